#include "server/session/recording/resume.h"

#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <limits>

#include "common/base/version.h"
#include "common/journal/session_journal.h"
#include "server/session/recording/bleeding_messages.h"
#include "server/session/recording/recorded_course.h"
#include "server/session/recording/recorded_session.h"
#include "server/session/recording/thread_messages.h"
#include "server/session/recording/verify.h"

namespace trocar::recording {
namespace {

constexpr Tick kEnd = std::numeric_limits<Tick>::max();

Error cannot(const std::string& path, const std::string& why) {
  return {ErrorCode::BadFile, path + ": cannot go on with it: " + why};
}

Status check_info(const std::string& path, const journal::SessionInfo& info) {
  if (info.sim_version != kSimVersion)
    return cannot(path, fmt::format("it was recorded with sim_version {}, this program has {}: use "
                                    "the release that recorded it",
                                    info.sim_version, kSimVersion));
  if (info.has_external_loads)
    return cannot(path, "it is of a scenario with loads besides tools, which no session has");
  if (info.gap_messages > 0)
    return cannot(path,
                  fmt::format("it has a gap, {} frames were never recorded", info.gap_messages));
  return {};
}

// The last tick up to which no record is missing, which must be the last one there is, or `until`.
Result<Tick> last_whole_tick(journal::SessionJournal& journal, const std::string& path,
                             Tick until) {
  Tick last = journal.info().begin_tick(), missing = 0;
  const Status read = read_ticks(journal, [&](const step::TickRecord& record, bool& stop) {
    if (record.tick != last + 1) missing = last + 1;
    last = record.tick;
    stop = missing != 0 || last >= until;
    return Status();
  });
  if (!read) return read.error();
  if (missing != 0) return cannot(path, fmt::format("it has a gap, tick {} is missing", missing));
  if (last == journal.info().begin_tick())
    return cannot(path, "it holds no tick: start a new session instead");
  return last;
}

// Restores the last snapshot up to that tick; returns its tick.
Result<Tick> restore_before(Tick tick, journal::SessionJournal& journal, const std::string& path,
                            ResumedSession& session) {
  auto& simulation = session.simulation;
  const auto snapshot = journal.snapshot_before(tick);
  if (!snapshot) return snapshot.error();
  if (!*snapshot) return cannot(path, "it has no snapshot");
  const auto restored =
      simulation.restore_snapshot(bytes_of(std::string_view((*snapshot)->state())));
  if (!restored) return cannot(path, restored.error().message);
  return simulation.current_tick();
}

// Simulates the recorded ticks after the one that it is at; returns the hash of the last.
Result<std::uint64_t> simulate_up_to(Tick last, journal::SessionJournal& journal,
                                     const std::string& path, ResumedSession& session) {
  auto& simulation = session.simulation;
  std::uint64_t hash = 0;
  const Status read =
      read_ticks(journal, [&](const step::TickRecord& record, bool& stop) -> Status {
        stop = record.tick >= last;
        hash = record.state_hash;
        if (record.tick <= simulation.current_tick()) return {};
        const auto& done = simulation.tick(record.inputs, record.decisions);
        if (done.state_hash == hash) return {};
        return cannot(path, fmt::format("tick {} has another state than was recorded, see "
                                        "trocar-journal verify",
                                        record.tick));
      });
  if (!read) return read.error();
  return hash;
}

// Whoever verifies the next journal begins with its snapshot, and so does this simulation: what it
// remembers beside its state is forgotten.
Status begin_as_restored(step::Simulation& simulation) {
  Bytes state;
  simulation.write_snapshot(state);
  return simulation.restore_snapshot(state);
}

bool has_hand(const step::Simulation& simulation, ParticipantSlot slot) {
  return simulation.state().tools[tool_slot(slot, 0)].is_present;
}

bool has_these_tools(const step::Simulation& simulation, const participants::Participant& who) {
  for (int i = 0; i < kToolsPerHand; ++i) {
    const auto number = static_cast<std::size_t>(i);
    const auto& tool = simulation.state().tools[tool_slot(who.slot, i)];
    const bool is_listed = number < who.tools.size();
    if (tool.is_present != is_listed || (is_listed && tool.shape != who.tools[number]))
      return false;
  }
  return true;
}

Status read_participants(journal::SessionJournal& journal, Tick until, ResumedSession& session) {
  const auto list = journal.participants_before(until);
  if (!list) return list.error();
  std::array<bool, kMaxHands> is_named{};
  if (*list) session.participants = participants_of(**list);
  std::erase_if(session.participants, [&](const auto& who) {
    const auto rights = wire::rights_of(who.role);
    if (who.slot.has_tools() ? !rights.may_have_tools : rights.has_tools) return true;
    if (!who.slot.has_tools()) return false;
    is_named[who.slot.value] = has_these_tools(session.simulation, who);
    return !is_named[who.slot.value];
  });
  for (std::uint8_t slot = 0; slot < kMaxHands; ++slot)
    if (!is_named[slot] && has_hand(session.simulation, {slot}))
      session.unnamed_hands.push_back({slot});
  return {};
}

}  // namespace

Result<ResumedSession> resume_session(const std::string& path, const ResumeOptions& options) {
  auto opened = journal::SessionJournal::open(path);
  if (!opened) return opened.error();
  auto& journal = **opened;
  if (const auto checked = check_info(path, journal.info()); !checked) return checked.error();
  auto organ = recorded_organ(journal, path);
  if (!organ) return organ.error();
  const auto last = last_whole_tick(journal, path, options.until.value_or(kEnd));
  if (!last) return last.error();
  auto bleeding = recorded_bleeding(journal, path);
  if (!bleeding) return bleeding.error();
  auto threads = recorded_threads(journal, path);
  if (!threads) return threads.error();
  step::SceneRules rules{.bleeding = std::move(*bleeding), .threads = std::move(*threads)};
  ResumedSession session{.simulation = step::Simulation(std::move(*organ), options.workers, rules),
                         .continuation = {std::filesystem::path(path).filename().string(), *last}};
  const auto from = restore_before(*last, journal, path, session);
  if (!from) return from.error();
  session.snapshot_tick = *from;
  const auto hash = simulate_up_to(*last, journal, path, session);
  if (!hash) return hash.error();
  session.state_hash = *hash;
  if (const auto begun = begin_as_restored(session.simulation); !begun) return begun.error();
  if (const auto read = read_participants(journal, options.until.value_or(kEnd), session); !read)
    return read.error();
  auto recorded = recorded_course(path, *last);
  if (!recorded) return recorded.error();
  session.course = std::move(recorded->course);
  session.course_lacks = std::move(recorded->missing);
  return session;
}

}  // namespace trocar::recording
