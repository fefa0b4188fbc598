#include "tests/reduce/reduced_block.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "server/lab/reduce/local_build.h"
#include "tests/reduce/small_organ.h"

namespace trocar::reduce::testing {

ReducedBlock::ReducedBlock(std::uint32_t patches) : organ(block(12, 6, 12)) {
  auto built = build_local(organ, {.modes = 16,
                                   .vibrations = 16,
                                   .patch_radius_m = 0.018,
                                   .force_n = 0.5,
                                   .directions = 1,
                                   .field_nodes = 3,
                                   .patches = patches,
                                   .threads = 2});
  TROCAR_ASSERT(built.ok());
  local = std::make_shared<organ::LocalReduction>(std::move(built->reduction));
}

std::size_t ReducedBlock::near_top(std::size_t n) const {
  std::vector<std::size_t> order(local->patches.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  Vec3d top;
  for (const auto& x : organ.mesh.rest_positions) top.y = std::max(top.y, x.y);
  std::ranges::stable_sort(order, {},
                           [&](std::size_t patch) { return length(centre(patch) - top); });
  return order[n];
}

}  // namespace trocar::reduce::testing
