#include "tests/papers/synthetic_reduction.h"

#include "common/base/assert.h"
#include "server/lab/scenario/scenario_block.h"

namespace trocar::reduction::testing {

organ::Organ block(int nx, int ny, int nz) {
  auto organ = scenario::make_block({nx, ny, nz, 0.01});
  TROCAR_ASSERT(organ.ok());
  material::use_measured(*material::find_measured_material("human_liver_nava2008"),
                         organ->material);
  return std::move(*organ);
}

Reduction synthetic_reduction(const organ::Organ& organ, std::size_t modes) {
  Reduction r;
  r.source = "synthetic";
  r.mesh_hash = mesh_hash(organ);
  r.elasticity_hash = elasticity_hash(organ);
  r.node_count = static_cast<std::uint32_t>(organ.mesh.node_count());
  r.snapshot_count = 5;
  r.force_n = 0.4, r.radius_m = 0.015, r.influence_m = 0.02;
  const std::size_t length = 3 * organ.mesh.node_count();
  r.modes.assign(length * modes, 0.0);
  r.initial_tangent_n_m.assign(modes * modes, 0.25);
  for (std::size_t i = 0; i < modes; ++i) {
    r.modes[i * length + i] = 1;
    r.initial_tangent_n_m[i * modes + i] = 2 + static_cast<double>(i);
    r.eigenvalues_m2.push_back(1.0 / static_cast<double>(1 + i));
    r.eigenvalue_sum_m2 += r.eigenvalues_m2.back();
  }
  r.best_tangent_n_m = r.initial_tangent_n_m;
  r.best_tangent_n_m[0] *= 1.5;
  r.creep_times_s = {0, 1, 20};
  r.creep = {{NodeIndex(0), {1, 1.2, 2.5}, {{NodeIndex(0), {1, 1.5, 2.75}}}},
             {NodeIndex(7),
              {1, 1.25, 2.25},
              {{NodeIndex(5), {1, 1.125, 2}}, {NodeIndex(7), {1, 1.5, 3}}}}};
  return r;
}

}  // namespace trocar::reduction::testing
