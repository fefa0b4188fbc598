#include "server/organs/catalogue/builtin_search.h"

#include <cmath>
#include <optional>

namespace trocar::catalogue {
namespace {

// The count moves in steps as the lattice passes over the shape, so the search stops when this
// near.
constexpr double kGoodEnough = 0.01;
constexpr double kAcceptable = 0.05;
constexpr int kMaxAttempts = 16;
// Step to a finer lattice where meshing failed.
constexpr double kFiner = 0.97;

}  // namespace

// Tets are inversely proportional to the cube of the spacing, and one Newton step on that law is a
// good next guess.
Result<mesh::TetMesh> mesh_with_about(int target_tets, double volume_m3,
                                      const MeshAtSpacing& mesh_at, const std::string& name) {
  double spacing = 0.034, low = 0, high = 1;
  for (int i = 0; i < 60; ++i)  // spacing with spacing^3 = 12 volume / target, without libm
    spacing -= (spacing - 12 * volume_m3 / target_tets / (spacing * spacing)) / 3;
  std::optional<mesh::TetMesh> best;
  double best_error = 1e9;
  std::string failure;
  for (int attempt = 0; attempt < kMaxAttempts; ++attempt) {
    auto mesh = mesh_at(spacing);
    if (!mesh) {
      failure = mesh.error().message;
      high = spacing;
      spacing = spacing * kFiner > low ? spacing * kFiner : (low + high) / 2;
      continue;
    }
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
  if (best_error <= kAcceptable) return std::move(*best);
  std::string message =
      name + ": found no lattice with about " + std::to_string(target_tets) + " tets";
  if (best)
    message += ", nearest was " + std::to_string(best->tets.size());
  else
    message += ": " + failure;
  return Error{ErrorCode::Usage, message};
}

}  // namespace trocar::catalogue
