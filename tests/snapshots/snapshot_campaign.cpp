// Thousands of states of random sessions: written, read, continued. One row per organ.

#include <CLI/CLI.hpp>

#include <cinttypes>
#include <cstdio>
#include <optional>

#include "tests/snapshots/random_session.h"

namespace trocar::testing {
namespace {

constexpr std::uint64_t kPerSession = 40;

struct Row {
  std::optional<SnapshotOrgan> organ;  // nothing: a block with a reduction
  SnapshotFigures figures;
  std::uint64_t sessions = 0, failures = 0;
};

void print(const Row& row) {
  const auto& f = row.figures;
  std::printf("| %s | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " | %" PRIu64
              " | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " |\n",
              row.organ ? name_of(*row.organ) : "block with a reduction", row.sessions, f.snapshots,
              f.ticks_continued, f.in_a_cut, f.cut, f.after_a_tear, f.self_contact, f.grasp,
              f.reduced, row.failures);
  std::fflush(stdout);
}

int run(int argc, char** argv) {
  CLI::App app{"Writes states of random sessions, reads them and goes on from them.",
               "snapshot_campaign"};
  std::uint64_t count = 2000, seed = 1;
  bool has_large = true, has_reduction = true;
  app.add_option("--count", count, "states in all")->capture_default_str();
  app.add_option("--seed", seed, "of the first session")->capture_default_str();
  app.add_flag("!--no-large", has_large, "leave out the stomach and the chest");
  app.add_flag("!--no-reduction", has_reduction, "leave out the session with a reduction");
  CLI11_PARSE(app, argc, argv);

  std::vector<Row> rows;
  for (int i = 0; i < kSnapshotOrgans; ++i) {
    const auto organ = static_cast<SnapshotOrgan>(i);
    const bool is_large = organ == SnapshotOrgan::Stomach || organ == SnapshotOrgan::Chest;
    if (is_large && !has_large) continue;
    rows.push_back({.organ = organ, .figures = {}});
  }
  if (has_reduction) rows.push_back({});

  std::printf(
      "| organ | sessions | states | ticks continued | in a cut | cut | torn | "
      "self-contact | grasp | reduced | failures |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|\n");
  std::uint64_t failures = 0;
  for (auto& row : rows) {
    const std::uint64_t wanted = (count + rows.size() - 1) / rows.size();
    for (; row.figures.snapshots < wanted; ++row.sessions) {
      const auto of_session = seed + row.sessions;
      auto scene = row.organ ? random_scene(*row.organ, of_session) : reduced_scene(of_session % 2);
      RandomSession session(std::move(scene), of_session);
      const auto wrong = session.run(std::min(kPerSession, wanted - row.figures.snapshots));
      row.figures += session.figures();
      if (wrong.empty()) continue;
      ++row.failures, ++failures;
      std::fprintf(stderr, "%s, seed %" PRIu64 ": %s\n",
                   row.organ ? name_of(*row.organ) : "reduction", of_session, wrong.c_str());
    }
    print(row);
  }
  return failures == 0 ? 0 : 1;
}

}  // namespace
}  // namespace trocar::testing

int main(int argc, char** argv) {
  return trocar::testing::run(argc, argv);
}
