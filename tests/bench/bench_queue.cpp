// Choi 2002 fig. 6: what a time step spends on setting up, filling the queue and solving, against
// the nodes that move, on a lattice of 30 x 15 x 30. One surface node is pulled.

#include "server/organs/catalogue/builtin_organs.h"
#include "tests/bench/session_work.h"

namespace trocar::bench {
namespace {

BenchTool pull_top_centre(const catalogue::LatticeSize& size, const organ::Organ& organ) {
  const auto node = catalogue::lattice_node(size, size.nx / 2, size.ny - 1, size.nz / 2);
  return {.place = to_float(organ.mesh.rest_positions[node.value]),
          .outward = {0, 1, 0},
          .grasps = true,
          .reach_m = 0.002f,
          .amplitude_m = 0.008f};
}

}  // namespace

void add_queue(Suite& suite) {
  const catalogue::LatticeSize size =
      suite.is_smoke() ? catalogue::LatticeSize{8, 5, 8} : catalogue::LatticeSize{};
  const auto organ = catalogue::make_lattice(size);
  TROCAR_ASSERT(organ.ok());
  const auto tool = pull_top_centre(size, *organ);
  const std::uint32_t deepest = suite.is_smoke() ? 2 : 14;
  for (std::uint32_t depth = 1; depth <= deepest; ++depth) {
    Row row = row_of(*organ, "queue", "lattice, depth " + std::to_string(depth),
                     "ours, springs, 4 sweeps");
    row.more["depth"] = depth;
    add_work(suite, row, suite.steps(20, 600, 2000), [organ = *organ, tool, depth](Row&) {
      return run_session(organ, {tool}, {{.depth = depth, .nodes = kAllNodes}});
    });
  }
}

}  // namespace trocar::bench
