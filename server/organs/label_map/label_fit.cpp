#include "server/organs/label_map/label_fit.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "server/organs/mesh/pieces.h"

namespace trocar::label_map {
namespace {

constexpr double kPieceShare = 0.01;

// Visits the voxels whose centre lies in the tet.
template <typename Visit>
void for_each_voxel_in(const LabelMap& map, const std::array<Vec3d, 4>& corners, Visit visit) {
  std::array<Vec3d, 4> p;
  for (std::size_t i = 0; i < 4; ++i) p[i] = map.voxel_of(corners[i]);
  std::array<int, 3> low{}, high{};
  const auto range = [&p](auto member, int size, int& first, int& last) {
    const auto [least, most] =
        std::minmax({p[0].*member, p[1].*member, p[2].*member, p[3].*member});
    first = std::clamp(static_cast<int>(std::ceil(least)), 0, size - 1);
    last = std::clamp(static_cast<int>(std::floor(most)), 0, size - 1);
  };
  range(&Vec3d::x, map.size[0], low[0], high[0]);
  range(&Vec3d::y, map.size[1], low[1], high[1]);
  range(&Vec3d::z, map.size[2], low[2], high[2]);
  // Planes of the faces, positive inside; a mirrored frame turns all four.
  constexpr int kFaces[4][4] = {{0, 1, 2, 3}, {0, 3, 1, 2}, {0, 2, 3, 1}, {1, 3, 2, 0}};
  std::array<Vec3d, 4> normals;
  std::array<double, 4> offsets{};
  for (std::size_t f = 0; f < 4; ++f) {
    const auto& [i, j, k, opposite] = kFaces[f];
    normals[f] = cross(p[j] - p[i], p[k] - p[i]);
    offsets[f] = -dot(normals[f], p[i]);
    if (dot(normals[f], p[opposite]) + offsets[f] < 0) normals[f] *= -1, offsets[f] *= -1;
  }
  for (int k = low[2]; k <= high[2]; ++k)
    for (int j = low[1]; j <= high[1]; ++j)
      for (int i = low[0]; i <= high[0]; ++i) {
        const Vec3d at{double(i), double(j), double(k)};
        bool is_inside = true;
        for (std::size_t f = 0; f < 4; ++f)
          is_inside = is_inside && dot(normals[f], at) + offsets[f] >= 0;
        if (is_inside) visit(map.index(i, j, k));
      }
}

// Numbers of pieces and surfaces of labels in the map.
class MapPieces {
 public:
  explicit MapPieces(const LabelSolid& solid) : map_(solid.map()), is_done_(map_.labels.size()) {
    const auto& labels = solid.labels();
    pieces.assign(labels.size(), 0);
    surfaces_m2.assign(labels.size(), 0);
    for (std::size_t i = 0; i < is_done_.size(); ++i) {
      if (map_.labels[i] == 0 || is_done_[i]) continue;
      const auto l = static_cast<std::size_t>(std::ranges::lower_bound(labels, map_.labels[i]) -
                                              labels.begin());
      const auto voxels = static_cast<double>(walk(i, surfaces_m2[l]));
      if (voxels * map_.voxel_volume_m3() >= kPieceShare * solid.volume_of(labels[l])) ++pieces[l];
    }
  }

  std::vector<std::size_t> pieces;
  std::vector<double> surfaces_m2;

 private:
  std::size_t walk(std::size_t from, double& surface_m2) {
    const std::size_t nx = std::size_t(map_.size[0]);
    const std::array<std::size_t, 3> strides{1, nx, nx * std::size_t(map_.size[1])};
    const std::array<double, 3> h{length(map_.steps_m[0]), length(map_.steps_m[1]),
                                  length(map_.steps_m[2])};
    std::size_t count = 0;
    queue_.assign(1, static_cast<std::uint32_t>(from));
    is_done_[from] = true;
    while (!queue_.empty()) {
      const std::size_t at = queue_.back();
      queue_.pop_back();
      ++count;
      // The margin keeps neighbours inside the map.
      for (std::size_t d = 0; d < 3; ++d)
        for (const auto next : {at - strides[d], at + strides[d]}) {
          if (map_.labels[next] != map_.labels[from]) {
            surface_m2 += h[(d + 1) % 3] * h[(d + 2) % 3] / kVoxelsOverSurface;
          } else if (!is_done_[next]) {
            is_done_[next] = true;
            queue_.push_back(static_cast<std::uint32_t>(next));
          }
        }
    }
    return count;
  }

  const LabelMap& map_;
  std::vector<bool> is_done_;
  std::vector<std::uint32_t> queue_;
};

std::size_t pieces_of(const mesh::TetMesh& mesh, const std::vector<std::uint16_t>& tet_labels,
                      std::uint16_t label, double& volume_m3) {
  mesh::TetMesh part;
  part.rest_positions = mesh.rest_positions;
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    if (tet_labels[t] == label) part.tets.push_back(mesh.tets[t]);
  const auto found = mesh::find_pieces(part);
  std::vector<double> volumes(found.count, 0);
  for (std::size_t t = 0; t < part.tets.size(); ++t)
    volumes[found.piece_of_tet[t]] += tet_volume(part, TetIndex(t));
  volume_m3 = 0;
  for (const double volume : volumes) volume_m3 += volume;
  return static_cast<std::size_t>(std::ranges::count_if(
      volumes, [&](double volume) { return volume >= kPieceShare * volume_m3; }));
}

}  // namespace

std::vector<LabelFit> fit_of_labels(const LabelSolid& solid, const mesh::TetMesh& mesh,
                                    const std::vector<std::uint16_t>& tet_labels) {
  const auto& labels = solid.labels();
  const auto& map = solid.map();
  std::vector<std::size_t> kept(65536, 0);
  // A voxel centre on a face lies in two tets, and counts once.
  std::vector<bool> is_counted(map.labels.size());
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    std::array<Vec3d, 4> corners;
    for (std::size_t i = 0; i < 4; ++i) corners[i] = mesh.rest_positions[mesh.tets[t][i].value];
    for_each_voxel_in(map, corners, [&](std::size_t voxel) {
      if (map.labels[voxel] != tet_labels[t] || is_counted[voxel]) return;
      is_counted[voxel] = true;
      ++kept[tet_labels[t]];
    });
  }
  const MapPieces in_map(solid);
  std::vector<LabelFit> out;
  for (std::size_t l = 0; l < labels.size(); ++l) {
    LabelFit fit{.label = labels[l], .map_m3 = solid.volume_of(labels[l])};
    fit.kept = static_cast<double>(kept[labels[l]]) * map.voxel_volume_m3() / fit.map_m3;
    fit.mesh_pieces = pieces_of(mesh, tet_labels, labels[l], fit.mesh_m3);
    fit.map_pieces = in_map.pieces[l];
    fit.thickness_m = 4 * fit.map_m3 / in_map.surfaces_m2[l];
    out.push_back(fit);
  }
  return out;
}

}  // namespace trocar::label_map
