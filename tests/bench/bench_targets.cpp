// The work for which a time is aimed at: the papers' figure, the best other library's as measured
// before on another machine, and ours. A row that the engine cannot do is not there.

#include "server/organs/catalogue/builtin_organs.h"
#include "tests/bench/pulled_work.h"
#include "tests/bench/session_work.h"

namespace trocar::bench {
namespace {

constexpr std::uint32_t kAllLayers = 1000;

void add_lattice(Suite& suite) {
  const auto organ = catalogue::make_lattice();
  const catalogue::LatticeSize size;
  const auto node = catalogue::lattice_node(size, size.nx / 2, size.ny - 1, size.nz / 2);
  const BenchTool tool{.place = to_float(organ.mesh.rest_positions[node.value]),
                       .grasps = true,
                       .reach_m = 0.002f,
                       .amplitude_m = 0.008f};
  Row row =
      row_of(organ, "targets", "891 nodes, one contact, depth 10", title_of(Law::Springs, {}));
  row.paper_ms = "5 (Choi 2002)";
  row.target_ms = 0.08;
  add_work(suite, row, suite.steps(20, 2000, 6000),
           [=](Row&) { return run_session(organ, {tool}, {{.depth = 10, .nodes = kAllNodes}}); });
}

void add_plate(Suite& suite) {
  const auto organ = catalogue::make_plate();
  const BenchTool tool{.place = {0, 0.002f, 0}, .amplitude_m = 0.004f};
  Row row = row_of(organ, "targets", "480 nodes of the plate, pressed", title_of(Law::Springs, {}));
  row.paper_ms = "4.1-13.7 (Nakao 2003)";
  row.target_ms = 0.10;
  row.note = "no topology changes in this run";
  add_work(suite, row, suite.steps(20, 2000, 6000),
           [=](Row&) { return run_session(organ, {tool}, {{.depth = kAllLayers, .nodes = 480}}); });
}

struct WholeOrgan {
  const char* object;
  Law law;
  std::uint32_t threads;
  const char* peer_ms;
  const char* peer_row;  // of this run
  double target_ms;
};

void add_whole_organs(Suite& suite) {
  const auto chest = std::make_shared<const PulledBox>(make_pulled_box(
      suite.is_smoke() ? BoxShape{"smaller box", {8, 4, 4}, {0.08, 0.04, 0.04}} : chest_box()));
  const WholeOrgan works[] = {
      {"whole 17.4k-node spring organ", Law::Springs, 1, "45.5 implicit, 1.64 explicit",
       "peers/W3 chest size/Bullet mass-spring, implicit", 1.5},
      {"whole 17.4k-node organ of linear tets", Law::LinearTets, 1, "71 (98 corotated)",
       "peers/W3 chest size/Bullet linear, implicit", 6},
      {"whole 17.4k-node organ of linear tets", Law::LinearTets, 2, "71 (98 corotated)",
       "peers/W3 chest size/Bullet linear, implicit", 3.5},
  };
  for (const auto& work : works) {
    if (!has(work.law) || work.threads > max_threads()) continue;
    const SolverOptions options{.law = work.law, .threads = work.threads};
    Row row = row_of(*chest, "targets", title_of(work.law, options));
    row.object = suite.is_smoke() ? "tiny box" : work.object;
    row.threads = work.threads;
    row.peer_ms = work.peer_ms;
    row.peer_row = work.peer_row;
    row.target_ms = work.target_ms;
    row.error_limit_percent = 1;
    add_work(suite, row, suite.steps(100, 200, 600),
             [=](Row&) { return pull_by_us(chest, options, true); });
  }
}

void add_whole_liver(Suite& suite) {
  const auto liver = std::make_shared<const PulledBox>(make_pulled_liver(
      suite.is_smoke() ? catalogue::kMinLiverTets : catalogue::kDefaultLiverTets));
  for (const Law law : {Law::NeoHookean, Law::NeoHookeanAveraged}) {
    if (!has(law)) continue;
    const SolverOptions options{.law = law};
    Row row = row_of(*liver, "targets", title_of(law, options));
    row.object = suite.is_smoke() ? "tiny liver" : "whole 4k-node liver, pulled";
    row.peer_ms = "25 (neo-Hookean)";
    row.peer_row = "peers/W2 liver size/Bullet neo-Hookean, implicit";
    row.target_ms = 1.0;
    row.error_limit_percent = 1;
    add_work(suite, row, suite.steps(100, 400, 1000),
             [=](Row&) { return pull_by_us(liver, options, true); });
  }
}

struct GradedWork {
  const char* object;
  int tets;
  std::size_t contacts;
  Law law;
  std::uint32_t threads;
  double target_ms;
};

void add_graded(Suite& suite) {
  const GradedWork works[] = {
      {"1 contact, graded, 4k-node liver", 18'500, 1, Law::NeoHookean, 1, 0.4},
      {"2 contacts, graded, 4k-node liver", 18'500, 2, Law::NeoHookean, 1, 0.4},
      {"8 contacts, graded, 17k-node liver", 88'000, 8, Law::Springs, 1, 1.0},
      {"8 contacts, graded, 17k-node liver", 88'000, 8, Law::NeoHookean, 2, 1.0},
  };
  for (const auto& work : works) {
    if (!has(work.law) || work.threads > max_threads()) continue;
    auto organ = catalogue::make_liver(suite.is_smoke() ? catalogue::kMinLiverTets : work.tets);
    TROCAR_ASSERT(organ.ok());
    Row row = row_of(
        *organ, "targets",
        suite.is_smoke() ? "tiny graded liver, " + std::to_string(work.contacts) : work.object,
        title_of(work.law, {.threads = work.threads}));
    row.threads = work.threads;
    row.target_ms = work.target_ms;
    row.error_limit_percent = 3;
    const SessionCase graded{.options = {.law = work.law,
                                         .boundary = Boundary::Graded,
                                         .depth = kNearDepth,
                                         .nodes = kAllNodes,
                                         .threads = work.threads},
                             .includes_rest = true,
                             .is_judged = true};
    add_work(suite, row, suite.steps(20, 300, 1000), [organ = *organ, work, graded](Row&) {
      return run_session(organ, spread_tools(organ, work.contacts, {0, 1, 0.3f}), graded);
    });
  }
}

}  // namespace

void add_targets(Suite& suite) {
  add_lattice(suite);
  add_plate(suite);
  add_whole_organs(suite);
  add_whole_liver(suite);
  add_graded(suite);
}

}  // namespace trocar::bench
