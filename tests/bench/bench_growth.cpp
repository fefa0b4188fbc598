// How a step's time grows: with the organ's nodes, when all of it moves and when one contact moves
// its surroundings, frozen or graded; and with the number of contacts on one organ.

#include "server/organs/catalogue/builtin_organs.h"
#include "tests/bench/pulled_work.h"
#include "tests/bench/session_work.h"

namespace trocar::bench {
namespace {

constexpr std::uint32_t kAllNodes = 1'000'000;
constexpr std::uint32_t kDepth = 6;
constexpr std::uint32_t kNearDepth = 2;  // graded: layers with all sweeps

// One surface node far from every edge, so that the nodes it moves are as many in every organ that
// is large enough.
BenchTool pull_top_centre(const organ::Organ& organ) {
  NodeIndex best;
  double nearest = 1e30, top = -1e30;
  const auto& p = organ.mesh.rest_positions;
  for (const auto& x : p) top = std::max(top, x.y);
  for (std::uint32_t n = 0; n < p.size(); ++n) {
    const double distance = p[n].x * p[n].x + p[n].z * p[n].z;
    if (p[n].y < top - 1e-9 || distance >= nearest) continue;
    nearest = distance;
    best = NodeIndex(n);
  }
  return {.place = to_float(p[best.value]),
          .outward = {0, 1, 0},
          .grasps = true,
          .reach_m = 0.002f,
          .amplitude_m = 0.008f};
}

void add_sizes(Suite& suite) {
  std::vector<int> sizes{1'000, 4'000, 16'000, 60'000, 200'000};
  if (suite.is_smoke()) sizes = {300, 1'000};
  for (const int tets : sizes) {
    const auto box = std::make_shared<const PulledBox>(make_pulled_box(growing_box(tets)));
    for (const Law law : kLaws)
      for (const std::uint32_t threads : {1u, 2u}) {
        if (!has(law) || threads > max_threads()) continue;
        if (threads > 1 && (suite.is_smoke() || law != Law::LinearTets)) continue;
        const SolverOptions options{.law = law, .threads = threads};
        Row row = row_of(*box, "nodes", "whole organ, " + title_of(law, options));
        row.threads = threads;
        add_work(suite, row, suite.steps(10, 60, 300),
                 [=](Row&) { return pull_by_us(box, options, false); });
      }
    Row row = row_of(*box, "nodes", "one contact, frozen, depth 6, springs");
    add_work(suite, row, suite.steps(20, 400, 1000), [=](Row&) {
      return run_session(box->organ, {pull_top_centre(box->organ)},
                         {{.depth = kDepth, .nodes = kAllNodes}, true});
    });
  }
}

// The queue is as large in each organ, so that what grows is the organ alone.
void add_graded_sizes(Suite& suite) {
  std::vector<int> sizes{80'000, 175'760, 466'560};
  if (suite.is_smoke()) sizes = {300, 1'000};
  const std::uint32_t queue_nodes = suite.is_smoke() ? 50 : 1200;
  for (const int tets : sizes) {
    const auto box = std::make_shared<const PulledBox>(make_pulled_box(growing_box(tets)));
    for (const Law law : {Law::Springs, Law::NeoHookean}) {
      Row row = row_of(*box, "graded", name_of(law));
      add_work(suite, row, suite.steps(10, 100, 300), [=](Row&) {
        return run_graded_session(
            box->organ, {pull_top_centre(box->organ)},
            {.law = law, .depth = step::kMaxDepthLimit, .nodes = queue_nodes});
      });
    }
  }
}

void add_contacts(Suite& suite) {
  const auto organ = catalogue::make_liver(suite.is_smoke() ? catalogue::kMinLiverTets : 88'000);
  TROCAR_ASSERT(organ.ok());
  std::vector<std::size_t> counts{1, 2, 4, 8, 16};
  if (suite.is_smoke()) counts = {1, 4};
  for (const Boundary boundary : {Boundary::Frozen, Boundary::Graded}) {
    for (const auto count : counts) {
      Row row = row_of(*organ, "contacts", std::to_string(count) + " contacts on a liver",
                       boundary == Boundary::Frozen ? "frozen, depth 6, springs"
                                                    : "graded, near depth 2, springs");
      const bool is_judged = count == 1 || count == 8;
      add_work(suite, row, suite.steps(20, 300, 1000),
               [organ = *organ, count, boundary, is_judged](Row&) {
                 return run_session(organ, spread_tools(organ, count, {0, 1, 0.3f}),
                                    {{.boundary = boundary,
                                      .depth = boundary == Boundary::Frozen ? kDepth : kNearDepth,
                                      .nodes = kAllNodes},
                                     true,
                                     is_judged});
               });
    }
  }
}

}  // namespace

void add_growth(Suite& suite) {
  add_sizes(suite);
  add_graded_sizes(suite);
  add_contacts(suite);
}

}  // namespace trocar::bench
