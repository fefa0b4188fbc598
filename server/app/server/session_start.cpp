#include "server/app/server/session_start.h"

#include "common/base/log.h"
#include "common/base/timing.h"
#include "common/base/workers.h"
#include "server/organs/catalogue/hidden_structures.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/organs/organ/average_strain.h"
#include "server/organs/organ/organ_file.h"
#include "server/session/recording/resume.h"
#include "server/session/replication/lesson_messages.h"

namespace trocar::app {
namespace {

double seconds_since(std::uint64_t begin_ns) {
  return static_cast<double>(monotonic_ns() - begin_ns) * 1e-9;
}

unsigned most_workers(const ServerOptions& options) {
  return options.workers > 0 ? options.workers : usable_workers();
}

Result<organ::Organ> read_organ(const ServerOptions& options) {
  auto organ = catalogue::load_organ(options.organ);
  if (!organ) return organ;
  if (options.lesson)
    if (const auto hidden = catalogue::add_structures(*options.lesson, *organ); !hidden)
      return hidden.error();
  if (const auto chosen = choose_strain(options, *organ); !chosen) return chosen.error();
  return organ;
}

Result<SessionStart> begin(const ServerOptions& options) {
  auto organ = read_organ(options);
  if (!organ) return organ.error();
  const auto* lesson = options.lesson ? &*options.lesson : nullptr;
  return SessionStart{.simulation = step::Simulation(
                          std::move(*organ), most_workers(options),
                          {.bleeding = replication::bleeding_rules(lesson, options.bleeds),
                           .threads = options.threads})};
}

// Somebody who names an organ means that one.
Status check_organ(const ServerOptions& options, const organ::Organ& recorded) {
  if (!options.is_organ_chosen && !options.has_averaged_strain.has_value()) return {};
  const auto organ = read_organ(options);
  if (!organ) return organ.error();
  if (organ::organ_hash(*organ) == organ::organ_hash(recorded)) return {};
  return Error{ErrorCode::Usage, "--organ: " + options.organ + " is another organ than the " +
                                     recorded.name + " of " + options.resume_file +
                                     ", leave out --organ and --averaged-strain"};
}

Result<SessionStart> go_on(const ServerOptions& options) {
  const auto begin = monotonic_ns();
  auto session = recording::resume_session(options.resume_file, {.workers = most_workers(options)});
  if (!session) return session.error();
  if (const auto same = check_organ(options, session->simulation.organ()); !same)
    return same.error();
  const Tick tick = session->continuation.tick;
  log::info(
      "going on with {} after tick {} ({:.1f} s): restored the state of tick {}, simulated {} "
      "ticks "
      "again, state hash {:016x}, ready in {:.1f} s",
      options.resume_file, tick, static_cast<double>(tick) / static_cast<double>(kTicksPerSecond),
      session->snapshot_tick, tick - session->snapshot_tick, session->state_hash,
      seconds_since(begin));
  SessionStart start{.simulation = std::move(session->simulation),
                     .continues = std::move(session->continuation),
                     .participants = std::move(session->participants),
                     .unnamed_hands = std::move(session->unnamed_hands)};
  if (session->course) {
    const auto& course = *session->course;
    if (options.lesson && options.lesson->source != course.lesson().source)
      return Error{ErrorCode::Usage, "--lesson: the session of " + options.resume_file +
                                         " gives another lesson, leave out --lesson"};
    log::info("the lesson goes on: {}, stage {} of {} since {:.1f} s, {:.0f} points so far",
              course.lesson().title, course.stage_number() + 1, course.lesson().stages.size(),
              course.seconds(), course.points());
    if (!session->course_lacks.empty())
      log::warn("{}: {}, and stages are counted from there", options.resume_file,
                session->course_lacks);
    start.course = std::make_shared<lesson::Course>(*std::move(session->course));
  } else if (options.lesson) {
    return Error{ErrorCode::Usage, "--lesson: the session of " + options.resume_file +
                                       " gives no lesson, leave out --lesson"};
  }
  if (options.bleeds && !start.simulation.rules().bleeding)
    return Error{ErrorCode::Usage, "--bleeding: the session of " + options.resume_file +
                                       " does not bleed, leave out --bleeding"};
  if (options.threads && !start.simulation.rules().threads)
    return Error{ErrorCode::Usage, "--threads: the session of " + options.resume_file +
                                       " has no thread, leave out --threads"};
  return start;
}

}  // namespace

Status choose_strain(const ServerOptions& options, organ::Organ& organ) {
  if (options.has_averaged_strain.value_or(false)) return organ::average_strain(organ);
  if (options.has_averaged_strain) organ::use_plain_strain(organ);
  return {};
}

Result<std::optional<secure::SigningKey>> read_signing_key(const ServerOptions& options) {
  if (options.signing_key_file.empty()) return std::optional<secure::SigningKey>();
  if (options.journal == "none")
    return Error{ErrorCode::Usage, "--sign: --journal is none, there is nothing to sign"};
  auto key = secure::SigningKey::read(options.signing_key_file);
  if (!key) return Error{key.error().code, "--sign: " + key.error().message};
  return std::optional(std::move(*key));
}

Result<SessionStart> start_session(const ServerOptions& options) {
  auto key = read_signing_key(options);
  if (!key) return key.error();
  auto start = options.resume_file.empty() ? begin(options) : go_on(options);
  if (start) start->key = std::move(*key);
  return start;
}

}  // namespace trocar::app
