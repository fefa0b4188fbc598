#include "server/lab/scenario/settle.h"

#include <algorithm>
#include <cstdio>

#include "server/lab/scenario/relaxed_organ.h"
#include "server/lab/scenario/scenario_run.h"
#include "server/organs/embed/embed.h"

namespace trocar::scenario {

Result<Settled> settle(organ::Organ organ, const Vec3d& gravity_m_s2,
                       const SettleOptions& options) {
  const std::string name = "organ '" + organ.name + "'";
  if (organ.fixed_nodes.empty())
    return Error{ErrorCode::BadFile, name +
                                         ": nothing holds it, so it has no equilibrium: import "
                                         "the mesh with a --fix rule"};
  organ.gravity_m_s2 = gravity_m_s2;
  scenario::ResolvedScenario resolved;
  resolved.scenario.source = name;
  resolved.scenario.run.starts_in_equilibrium = true;
  resolved.scenario.run.tolerance_n = options.tolerance_n;
  resolved.scenario.run.max_sweeps = options.max_sweeps;
  resolved.organ = relaxed_organ(organ);
  if (auto s = check_supported(resolved); !s) return s.error();
  const ScenarioRun run(std::move(resolved), Solver::Full);
  Settled result;
  result.residual_n = run.settling().solve.residual_n;
  result.sweeps = run.settling().solve.sweeps;
  if (!run.settling().is_converged) {
    char text[160];
    std::snprintf(text, sizeof text,
                  ": no equilibrium to %g N within %u sweeps (%g N reached): is the material far "
                  "too soft for this gravity?",
                  options.tolerance_n, options.max_sweeps, static_cast<double>(result.residual_n));
    return Error{ErrorCode::BadFile, name + text};
  }
  auto free = organ.stress_free();
  const mesh::TetMesh before = organ.mesh;
  auto& rest = organ.mesh.rest_positions;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const Vec3d move = to_double(run.world().displacements[i]);
    rest[i] += move;
    result.largest_move_m = std::max(result.largest_move_m, length(move));
    result.mean_move_m += length(move) / static_cast<double>(rest.size());
  }
  const Vec3d centre = mesh::centre_on_origin(organ.mesh);
  for (auto& position : free) position -= centre;
  embed::carry(before, rest, organ.fine_surface);
  organ.source_offset_m += centre;
  organ.stress_free_positions_m = std::move(free);
  if (auto s = organ::validate(organ); !s)
    return Error{ErrorCode::BadFile,
                 name + ": is too soft for this gravity, or held at too few nodes" +
                     (organ.material.elastic_law == material::ElasticLaw::Springs
                          ? ", and springs fold first (neo-hookean tissue bears more)"
                          : "") +
                     ": it hangs so far that " + s.error().message};
  result.organ = std::move(organ);
  return result;
}

}  // namespace trocar::scenario
