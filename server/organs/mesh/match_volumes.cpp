#include "server/organs/mesh/match_volumes.h"

#include <algorithm>
#include <map>
#include <tuple>

namespace trocar::mesh {
namespace {

constexpr int kMatchPasses = 6;
constexpr double kMatchedVolume = 0.001;  // share of a label's

double volume_at(const TetStars& stars, const Tet& tet) {
  const Vec3d& o = stars.position(tet[0]);
  return dot(cross(stars.position(tet[1]) - o, stars.position(tet[2]) - o),
             stars.position(tet[3]) - o) /
         6;
}

}  // namespace

std::vector<Triangle> interface_of(const TetMesh& mesh,
                                   const std::vector<std::uint16_t>& tet_labels,
                                   std::uint16_t label) {
  struct Face {
    std::array<NodeIndex, 3> sorted;
    bool is_inside = false;
    Triangle face;
  };
  std::vector<Face> faces;
  std::vector<std::uint8_t> is_at(mesh.node_count(), 0);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    if (tet_labels[t] == label)
      for (const NodeIndex node : mesh.tets[t]) is_at[node.value] = 1;
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (const auto& [i, j, k] : kTetFaces) {
      const Tet& tet = mesh.tets[t];
      if (!is_at[tet[i].value] || !is_at[tet[j].value] || !is_at[tet[k].value]) continue;
      Face face{{tet[i], tet[j], tet[k]}, tet_labels[t] == label, {tet[i], tet[j], tet[k]}};
      std::sort(face.sorted.begin(), face.sorted.end());
      faces.push_back(face);
    }
  std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) {
    return std::tie(a.sorted, a.is_inside, a.face) < std::tie(b.sorted, b.is_inside, b.face);
  });
  std::vector<Triangle> out;
  for (std::size_t f = 1; f < faces.size(); ++f)
    if (faces[f].sorted == faces[f - 1].sorted && faces[f].is_inside && !faces[f - 1].is_inside)
      out.push_back(faces[f].face);
  return out;
}

void match_volumes(TetMesh& mesh, const std::vector<std::uint16_t>& tet_labels,
                   const std::vector<std::pair<std::uint16_t, double>>& volumes, double limit_m,
                   const ShapeBound& bound) {
  const auto places = mesh.rest_positions;
  const auto outward = surface_normals(mesh);
  TetStars stars(mesh.rest_positions, mesh.tets);
  std::vector<std::vector<Triangle>> interfaces;
  for (const auto& asked : volumes)
    interfaces.push_back(interface_of(mesh, tet_labels, asked.first));
  for (int pass = 0; pass < kMatchPasses; ++pass)
    for (std::size_t l = 0; l < volumes.size(); ++l) {
      const auto& [label, asked] = volumes[l];
      double volume = 0, area = 0;
      for (std::size_t t = 0; t < mesh.tets.size(); ++t)
        if (tet_labels[t] == label) volume += volume_at(stars, mesh.tets[t]);
      std::map<NodeIndex, Vec3d> normals;
      for (const auto& [a, b, c] : interfaces[l]) {
        const Vec3d& o = stars.position(a);
        const Vec3d normal = cross(stars.position(b) - o, stars.position(c) - o) * 0.5;
        area += length(normal);
        for (const NodeIndex node : {a, b, c}) normals[node] += normal;
      }
      if (!(area > 0) || std::abs(volume - asked) < kMatchedVolume * asked) continue;
      const double step = std::clamp((asked - volume) / area, -limit_m, limit_m);
      for (const auto& [node, normal] : normals) {
        Vec3d way = normalized(normal, Vec3d{}) * step;
        if (stars.is_on_surface(node)) way -= outward[node.value] * dot(way, outward[node.value]);
        for (int half = 0; half < 3; ++half, way *= 0.5) {
          const Vec3d to = stars.position(node) + way;
          if (length_squared(to - places[node.value]) > limit_m * limit_m ||
              !stars.can_move(node, to, bound))
            continue;
          stars.move(node, to);
          break;
        }
      }
    }
  mesh.rest_positions = stars.take_positions();
}

}  // namespace trocar::mesh
