#include "server/organs/mesh/fill_field.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>

namespace trocar::mesh {
namespace {

constexpr double kNodesPerCube = 2;
constexpr double kGoodCount = 0.05, kAcceptableCount = 0.15;  // shares of the asked number
constexpr double kGoodVolume = 0.001;
constexpr double kLostVolume = 0.3;  // share at which no growing outward helps
constexpr int kMaxAttempts = 16;
constexpr double kFiner = 0.93;  // step to a finer lattice where meshing failed
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
  const Vec3d size = box.most - box.least;
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
  // A wall that thin is lost for certain.
  if (needed_nodes(volume_m3, surface_m2) > 8.0 * nodes)
    return too_thin(nodes, needed_nodes(volume_m3, surface_m2));
  double spacing = std::cbrt(kNodesPerCube * volume_m3 / nodes), grown = 0;
  std::optional<FilledSolid> best;
  double best_score = 1e9;
  std::string failure = "nothing of the solid is inside";
  for (int i = 0; i < kMaxAttempts; ++i) {
    if (places_of(box, spacing) > kMaxPlaces)
      return Error{ErrorCode::BadFile, "is too thin to be filled with " + std::to_string(nodes) +
                                           " nodes: ask for fewer (--nodes)"};
    const Vec3d margin = Vec3d{1, 1, 1} * std::max(grown, 0.0);
    auto mesh = stuff_isosurface([&](const Vec3d& p) { return distance(p) - grown; },
                                 {box.least - margin, box.most + margin}, spacing);
    if (!mesh) {
      failure = mesh.error().message;
      spacing *= kFiner;
      continue;
    }
    const double volume = total_volume(*mesh);
    const double count_error = static_cast<double>(mesh->node_count()) / nodes - 1;
    const double volume_error = volume / volume_m3 - 1;
    // The first guess is finer than needed: what it loses, a coarser one would lose, too.
    if (!best && std::abs(volume_error) > kLostVolume)
      return too_thin(nodes, needed_nodes(volume_m3, surface_m2));
    const double step = (volume_m3 - volume) / surface_area(*mesh);
    const double score = std::max(std::abs(count_error) / kAcceptableCount,
                                  std::abs(volume_error) / kFillVolumeTolerance);
    if (score < best_score) {
      best_score = score;
      best = {std::move(*mesh), spacing, grown};
    }
    const bool is_count_good = std::abs(count_error) < kGoodCount;
    if (is_count_good && std::abs(volume_error) < kGoodVolume) break;
    // Nodes are inversely proportional to the cube of the spacing; half steps end a swing between
    // two lattices.
    const double power = i < kMaxAttempts / 2 ? 1 : 0.5;
    if (!is_count_good) spacing *= std::cbrt(1 + power * count_error);
    grown = std::clamp(grown + step, -kMaxGrowth * spacing, kMaxGrowth * spacing);
  }
  if (!best)
    return Error{ErrorCode::BadFile, "cannot be filled with about " + std::to_string(nodes) +
                                         " nodes: " + failure + ": ask for another number"};
  if (std::abs(total_volume(best->mesh) / volume_m3 - 1) > kFillVolumeTolerance)
    return too_thin(nodes, std::max(needed_nodes(volume_m3, surface_m2), nodes * 1.5));
  if (best_score > 1)
    return Error{ErrorCode::BadFile, "cannot be filled with about " + std::to_string(nodes) +
                                         " nodes, the nearest number is " +
                                         std::to_string(best->mesh.node_count()) +
                                         ": ask for another number (--nodes)"};
  return std::move(*best);
}

}  // namespace trocar::mesh
