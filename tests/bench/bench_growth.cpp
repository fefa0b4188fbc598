// How a step's time grows: with the organ's nodes, when all of it moves and when one contact moves
// its surroundings; and with the number of contacts on one organ.

#include "common/scene/builtin_organs.h"
#include "tests/bench/pulled_work.h"
#include "tests/bench/session_work.h"

namespace trocar::bench {
namespace {

constexpr std::uint32_t kAllNodes = 1'000'000;
constexpr std::uint32_t kDepth = 6;

void add_sizes(Suite& suite) {
  std::vector<int> sizes{1'000, 4'000, 16'000, 60'000, 200'000};
  if (suite.is_smoke()) sizes = {300, 1'000};
  for (const int tets : sizes) {
    const auto box = std::make_shared<const PulledBox>(make_pulled_box(growing_box(tets)));
    for (const Law law : {Law::Springs, Law::LinearTets, Law::NeoHookean})
      for (const std::uint32_t threads : {1u, 2u}) {
        if (!has(law) || threads > max_threads()) continue;
        const SolverOptions options{
            .law = law, .poisson_ratio = box->material.poisson_ratio, .threads = threads};
        Row row = row_of(*box, "nodes", "whole organ, " + title_of(law, options).substr(6));
        row.threads = threads;
        add_work(suite, row, suite.steps(10, 100, 300),
                 [=](Row&) { return pull_by_us(box, options, false); });
      }
    Row row = row_of(*box, "nodes", "one contact, frozen, depth 6, springs");
    add_work(suite, row, suite.steps(20, 400, 1000), [=](Row&) {
      return run_session(box->organ, spread_tools(box->organ, 1, {0.2f, 1, 0}),
                         {.depth = kDepth, .nodes = kAllNodes}, true);
    });
  }
}

void add_contacts(Suite& suite) {
  const auto organ = scene::make_liver(suite.is_smoke() ? scene::kMinLiverTets : 80'000);
  TROCAR_ASSERT(organ.ok());
  std::vector<std::size_t> counts{1, 2, 4, 8, 16};
  if (suite.is_smoke()) counts = {1, 4};
  for (const BoundaryMode mode : {BoundaryMode::Frozen, BoundaryMode::Graded}) {
    if (mode == BoundaryMode::Graded && !has_graded_mode()) continue;
    for (const auto count : counts) {
      Row row = row_of(*organ, "contacts", std::to_string(count) + " contacts on a liver",
                       std::string("ours, ") + name_of(mode) + ", depth 6, springs");
      add_work(suite, row, suite.steps(20, 400, 1000), [organ = *organ, count, mode](Row&) {
        return run_session(organ, spread_tools(organ, count, {0, 1, 0.3f}),
                           {.mode = mode, .depth = kDepth, .nodes = kAllNodes}, true);
      });
    }
  }
}

}  // namespace

void add_growth(Suite& suite) {
  add_sizes(suite);
  add_contacts(suite);
}

}  // namespace trocar::bench
