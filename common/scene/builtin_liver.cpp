#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "common/mesh/stuffing.h"
#include "common/scene/builtin_organs.h"
#include "common/scene/liver_shape.h"

namespace trocar::scene {
namespace {

// The count moves in steps as the lattice passes over the shape, so the search stops when this
// near.
constexpr double kGoodEnough = 0.01;
constexpr double kAcceptable = 0.05;
constexpr int kMaxAttempts = 16;

// The mesh whose number of tets comes nearest to the target. Tets are inversely proportional to the
// cube of the spacing, and one Newton step on that law is a good next guess.
Result<mesh::TetMesh> stuff_with_about(int target_tets) {
  const auto box = liver_box();
  const double volume = 1.63e-3;
  double spacing = 0.034, low = 0, high = 1;
  for (int i = 0; i < 60; ++i)  // spacing with spacing^3 = 12 volume / target, without libm
    spacing -= (spacing - 12 * volume / target_tets / (spacing * spacing)) / 3;
  std::optional<mesh::TetMesh> best;
  double best_error = 1e9;
  for (int attempt = 0; attempt < kMaxAttempts; ++attempt) {
    auto mesh = mesh::stuff_isosurface(liver_field, box, spacing);
    if (!mesh) return mesh.error();
    const double ratio = static_cast<double>(mesh->tets.size()) / target_tets;
    const double error = std::abs(ratio - 1);
    if (error < best_error) {
      best_error = error;
      best = std::move(*mesh);
    }
    if (best_error <= kGoodEnough) break;
    (ratio > 1 ? low : high) = spacing;
    const double next = spacing * (1 + (ratio - 1) / 3);
    spacing = next > low && next < high ? next : (low + high) / 2;
  }
  if (best_error > kAcceptable)
    return Error{ErrorCode::Usage, "liver: found no lattice with about " +
                                       std::to_string(target_tets) + " tets, nearest was " +
                                       std::to_string(best->tets.size())};
  return std::move(*best);
}

}  // namespace

Result<Organ> make_liver(int target_tets) {
  if (target_tets < kMinLiverTets || target_tets > kMaxLiverTets)
    return Error{ErrorCode::Usage, "liver: " + std::to_string(target_tets) + " tets, must be " +
                                       std::to_string(kMinLiverTets) + " to " +
                                       std::to_string(kMaxLiverTets)};
  auto mesh = stuff_with_about(target_tets);
  if (!mesh) return mesh.error();
  Organ organ;
  organ.name = "liver";
  organ.source = "liver, " + std::to_string(target_tets) + " tets asked for";
  organ.mesh = std::move(*mesh);
  for (const NodeIndex node : organ.mesh.surface_nodes)
    if (is_liver_held(organ.mesh.rest_positions[node.value])) organ.fixed_nodes.push_back(node);
  organ.source_offset_m = mesh::centre_on_origin(organ.mesh);
  organ.node_masses_kg = lumped_masses(organ.mesh, organ.material.density_kg_m3);
  if (auto status = validate(organ); !status) return status.error();
  return organ;
}

}  // namespace trocar::scene
