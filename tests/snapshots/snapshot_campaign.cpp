// Thousands of states of random sessions: written, read, continued. One row per kind of scene.

#include <CLI/CLI.hpp>

#include <cinttypes>
#include <cstdio>
#include <functional>
#include <string>

#include "tests/snapshots/random_session.h"

namespace trocar::testing {
namespace {

constexpr std::uint64_t kPerSession = 40;

struct Row {
  std::string name;
  std::function<SnapshotScene(std::uint64_t seed)> make_scene;
  SnapshotFigures figures = {};
  std::uint64_t sessions = 0, failures = 0;
};

void print(const Row& row) {
  const auto& f = row.figures;
  std::printf("| %s | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " | %" PRIu64
              " | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " |\n",
              row.name.c_str(), row.sessions, f.snapshots, f.ticks_continued, f.in_a_cut, f.cut,
              f.after_a_tear, f.self_contact, f.grasp, row.failures);
  std::fflush(stdout);
}

int run(int argc, char** argv) {
  CLI::App app{"Writes states of random sessions, reads them and goes on from them.",
               "snapshot_campaign"};
  std::uint64_t count = 2000, seed = 1;
  bool has_large = true;
  app.add_option("--count", count, "states in all")->capture_default_str();
  app.add_option("--seed", seed, "of the first session")->capture_default_str();
  app.add_flag("!--no-large", has_large, "leave out the stomach and the chest");
  CLI11_PARSE(app, argc, argv);

  std::vector<Row> rows;
  for (int i = 0; i < kSnapshotOrgans; ++i) {
    const auto organ = static_cast<SnapshotOrgan>(i);
    const bool is_large = organ == SnapshotOrgan::Stomach || organ == SnapshotOrgan::Chest;
    if (is_large && !has_large) continue;
    rows.push_back({name_of(organ),
                    [organ](std::uint64_t of_session) { return random_scene(organ, of_session); }});
  }
  rows.push_back({"liver with loads", loaded_scene});

  std::printf(
      "| scene | sessions | states | ticks continued | in a cut | cut | torn | "
      "self-contact | grasp | failures |\n"
      "|---|---|---|---|---|---|---|---|---|---|\n");
  std::uint64_t failures = 0;
  for (auto& row : rows) {
    const std::uint64_t wanted = (count + rows.size() - 1) / rows.size();
    for (; row.figures.snapshots < wanted; ++row.sessions) {
      const auto of_session = seed + row.sessions;
      RandomSession session(row.make_scene(of_session), of_session);
      const auto wrong = session.run(std::min(kPerSession, wanted - row.figures.snapshots));
      row.figures += session.figures();
      if (wrong.empty()) continue;
      ++row.failures, ++failures;
      std::fprintf(stderr, "%s, seed %" PRIu64 ": %s\n", row.name.c_str(), of_session,
                   wrong.c_str());
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
