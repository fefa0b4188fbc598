#include "server/session/recording/verify.h"

#include <fmt/format.h>

#include <limits>

#include "common/base/json.h"
#include "common/base/printable.h"
#include "common/base/version.h"
#include "common/base/workers.h"
#include "server/session/recording/bleeding_messages.h"
#include "server/session/recording/recorded_session.h"
#include "server/session/recording/thread_messages.h"
#include "server/session/recording/verifier.h"

namespace trocar::recording {
namespace {

constexpr Tick kProgressPeriod = 1000;

}  // namespace

std::string Difference::text() const {
  return fmt::format("tick {}, {}: {} is {}, simulated {}", tick, channel, field, recorded,
                     simulated);
}

std::string VerifyReport::why() const {
  std::string out;
  for (const auto& reason : reasons) out += "not verified: " + printable(reason) + "\n";
  if (reasons_left_out > 0) out += fmt::format("not verified: {} more reasons\n", reasons_left_out);
  if (first_difference) out += "first difference: " + printable(first_difference->text()) + "\n";
  return out;
}

const char* name_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::Verified:
      return "verified";
    case Verdict::Different:
      return "different";
    case Verdict::NotVerified:
      return "not verified";
  }
  return "?";
}

Result<VerifyReport> verify_journal(const std::string& path,
                                    const std::function<void(Tick, Tick last)>& progress) {
  auto journal = journal::SessionJournal::open(path);
  if (!journal) return journal.error();
  const auto& info = (*journal)->info();
  auto organ = recorded_organ(**journal, path);
  if (!organ) return organ.error();
  auto loads = recorded_loads(**journal, *organ, path);
  if (!loads) return loads.error();

  auto bleeding = recorded_bleeding(**journal, path);
  if (!bleeding) return bleeding.error();
  auto threads = recorded_threads(**journal, path);
  if (!threads) return threads.error();

  VerifyReport report;
  const bool lacks_loads = info.has_external_loads && loads->empty();
  report.is_resimulated = info.sim_version == kSimVersion && !lacks_loads;
  report.begin_tick = info.begin_tick();
  report.last_tick = info.last_tick;
  report.container = info.summary;
  if (lacks_loads)
    report.reasons.push_back(
        "it is of a scenario with loads besides its tools, which it does not hold: run the "
        "scenario again");
  else if (!report.is_resimulated)
    report.reasons.push_back(
        fmt::format("it was recorded with sim_version {}, this program has {}: it cannot be "
                    "simulated again, only its surfaces were decoded",
                    info.sim_version, kSimVersion));
  // Damage is known before anything is compared: lists of participants may be among it.
  const auto end = (*journal)->check_end();
  const auto& whole = end.read;
  report.damaged_chunks = whole.damaged_chunks;
  const bool is_changed = end.status == journal::EndStatus::Wrong;
  if (whole.damaged_chunks > 0)
    report.reasons.push_back(fmt::format("{} damaged chunks, the first: {}", whole.damaged_chunks,
                                         whole.first_damage.message));
  else if (is_changed)
    report.reasons.push_back(end.text);
  else if (Status data = (*journal)->container().check_data_crc(); !data.ok())
    report.reasons.push_back(data.error().message);
  if (end.status == journal::EndStatus::Unpromised) report.reasons.push_back(end.text);
  if (!info.is_finished && (!is_changed || whole.damaged_chunks > 0))
    report.reasons.push_back("it has no end: " + report.container);

  step::SceneRules rules{
      .loads = std::move(*loads), .bleeding = std::move(*bleeding), .threads = std::move(*threads)};
  if (info.has_implicit_strain) rules.strain_scheme = dynamics::StrainScheme::Implicit;
  step::Simulation simulation(std::move(*organ), usable_workers(), std::move(rules));
  Verifier verifier(info, std::move(simulation), report);
  const auto lists = (*journal)->read_participants(0, std::numeric_limits<Tick>::max(),
                                                   [&](Tick tick, const proto::Participants& list) {
                                                     verifier.add_list(tick, list);
                                                     return true;
                                                   });
  verifier.set_all_lists(lists.ok() && info.is_finished && !is_changed);
  Tick next_progress = kProgressPeriod;
  (*journal)->read_all([&](std::string_view topic, Tick tick, BytesView bytes) {
    if (progress && tick >= next_progress) {
      progress(tick, info.last_tick);
      next_progress = tick + kProgressPeriod;
    }
    return verifier.check(topic, bytes);
  });
  verifier.finish((*journal)->container());
  return report;
}

}  // namespace trocar::recording
