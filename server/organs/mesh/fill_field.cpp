#include "server/organs/mesh/fill_field.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>

namespace trocar::mesh {
namespace {

constexpr double kNodesPerCube = 2;
constexpr double kGoodCount = 0.02, kAcceptableCount = 0.15;  // shares of the asked number
constexpr double kGoodVolume = 0.001;
constexpr double kLostVolume = 0.3;  // share at which no growing outward helps
constexpr int kMaxSpacings = 12, kMaxGrowths = 6;
// Steps outward beyond this share of the spacing would close gaps.
constexpr double kMaxGrowth = 0.5;
constexpr double kMaxPlaces = 4e7;  // of the lattice: 2.5 GB

double surface_area(const TetMesh& mesh) {
  double area = 0;
  for (const auto& [a, b, c] : mesh.boundary_triangles) {
    const Vec3d& o = mesh.rest_positions[a.value];
    area += length(cross(mesh.rest_positions[b.value] - o, mesh.rest_positions[c.value] - o)) / 2;
  }
  return area;
}

double places_of(const Box& box, double spacing) {
  const Vec3d size = box.high - box.low;
  return (2 * size.x / spacing + 7) * (2 * size.y / spacing + 7) * (2 * size.z / spacing + 7);
}

// A wall needs a spacing a little below its thickness, which is about twice volume over surface.
double needed_nodes(double volume_m3, double surface_m2) {
  const double spacing = 0.8 * 2 * volume_m3 / surface_m2;
  return 1.3 * kNodesPerCube * volume_m3 / (spacing * spacing * spacing);
}

Error too_thin(int nodes, double needed) {
  std::string text = "parts are thinner than the spacing of " + std::to_string(nodes) +
                     " nodes, the volume is missed by more than 1 %: ";
  if (needed > kMaxFillNodes)
    text += "it is too thin to be filled, import a mesh of tetrahedra";
  else
    text += "ask for more nodes, such as --nodes " +
            std::to_string(static_cast<int>(std::ceil(needed / 1000)) * 1000);
  return {ErrorCode::BadFile, text};
}

}  // namespace

Result<FilledSolid> fill_field(const SignedField& distance, const Box& box, double volume_m3,
                               double surface_m2, int nodes) {
  TROCAR_ASSERT(nodes >= kMinFillNodes && nodes <= kMaxFillNodes);
  double spacing = std::cbrt(kNodesPerCube * volume_m3 / nodes), low = 0, high = 1e9;
  std::optional<TetMesh> best;
  double best_error = 1e9, best_spacing = 0;
  std::string failure = "nothing of the solid is inside";
  for (int i = 0; i < kMaxSpacings && best_error > kGoodCount; ++i) {
    if (places_of(box, spacing) > kMaxPlaces)
      return Error{ErrorCode::BadFile, "is too thin to be filled with " + std::to_string(nodes) +
                                           " nodes: ask for fewer (--nodes)"};
    auto mesh = stuff_isosurface(distance, box, spacing);
    if (!mesh) {
      failure = mesh.error().message;
      high = spacing;
      spacing = std::max(spacing * 0.9, (low + spacing) / 2);
      continue;
    }
    // The first guess is finer than needed: what it loses, a coarser one would lose, too.
    if (!best && std::abs(total_volume(*mesh) / volume_m3 - 1) > kLostVolume)
      return too_thin(nodes, needed_nodes(volume_m3, surface_m2));
    const double ratio = static_cast<double>(mesh->node_count()) / nodes;
    if (std::abs(ratio - 1) < best_error) {
      best_error = std::abs(ratio - 1);
      best_spacing = spacing;
      best = std::move(*mesh);
    }
    (ratio > 1 ? low : high) = spacing;
    const double next = spacing * std::cbrt(ratio);
    spacing = next > low && next < high ? next : (low + std::min(high, 2 * low + spacing)) / 2;
  }
  if (!best || best_error > kAcceptableCount)
    return Error{ErrorCode::BadFile,
                 "cannot be filled with about " + std::to_string(nodes) + " nodes" +
                     (best ? ", the nearest number is " + std::to_string(best->node_count())
                           : ": " + failure) +
                     ": ask for another number (--nodes)"};
  FilledSolid filled{std::move(*best), best_spacing, 0};
  double error = total_volume(filled.mesh) / volume_m3 - 1;
  double grown = 0, slope = surface_area(filled.mesh), previous_volume = total_volume(filled.mesh);
  for (int i = 0; i < kMaxGrowths && std::abs(error) > kGoodVolume; ++i) {
    const double step = (volume_m3 - previous_volume) / slope;
    const double next =
        std::clamp(grown + step, -kMaxGrowth * best_spacing, kMaxGrowth * best_spacing);
    if (next == grown) break;
    const Vec3d margin = Vec3d{1, 1, 1} * std::max(next, 0.0);
    auto mesh = stuff_isosurface([&](const Vec3d& p) { return distance(p) - next; },
                                 {box.low - margin, box.high + margin}, best_spacing);
    if (!mesh) break;
    const double volume = total_volume(*mesh);
    // A secant, where it is believable: a solid grows outward.
    const double measured = (volume - previous_volume) / (next - grown);
    if (measured > slope / 4 && measured < slope * 4) slope = measured;
    grown = next, previous_volume = volume;
    if (std::abs(volume / volume_m3 - 1) >= std::abs(error)) continue;
    error = volume / volume_m3 - 1;
    filled = {std::move(*mesh), best_spacing, next};
  }
  if (std::abs(error) > kFillVolumeTolerance)
    return too_thin(nodes, std::max(needed_nodes(volume_m3, surface_m2), nodes * 1.5));
  return filled;
}

}  // namespace trocar::mesh
