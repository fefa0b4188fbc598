#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/builtin_search.h"
#include "server/organs/catalogue/stomach_shape.h"
#include "server/organs/mesh/pieces.h"
#include "server/organs/mesh/stuffing.h"

namespace trocar::catalogue {
namespace {

using mesh::NodePair;
using mesh::Tet;
using mesh::TetMesh;

// Edges from the outer face of the wall straight to the inner one, in lexicographic order.
std::vector<NodePair> edges_through_the_wall(const TetMesh& mesh) {
  enum class Face : std::uint8_t { None, Outer, Inner };
  constexpr double kOnFace_m = 1e-7;  // the stuffing finds faces to within 1e-9 m
  std::vector<Face> faces(mesh.node_count(), Face::None);
  for (const NodeIndex node : mesh.surface_nodes) {
    const double depth = stomach_sac_field(mesh.rest_positions[node.value]);
    if (std::abs(depth) < kOnFace_m) faces[node.value] = Face::Outer;
    if (std::abs(depth + kStomachWall_m) < kOnFace_m) faces[node.value] = Face::Inner;
  }
  std::vector<NodePair> through;
  for (const NodePair& edge : mesh.edges) {
    const Face a = faces[edge[0].value], b = faces[edge[1].value];
    if (a != Face::None && b != Face::None && a != b) through.push_back(edge);
  }
  return through;
}

// Puts a node in the middle of each of these edges, and halves the tets around it. No new edge
// joins two old nodes, so that none of them is left afterwards.
void split(TetMesh& mesh, const std::vector<NodePair>& edges) {
  std::vector<std::vector<std::size_t>> tets_of(mesh.node_count());
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (const NodeIndex node : mesh.tets[t]) tets_of[node.value].push_back(t);
  for (const auto& [a, b] : edges) {
    const NodeIndex middle(mesh.node_count());
    mesh.rest_positions.push_back((mesh.rest_positions[a.value] + mesh.rest_positions[b.value]) *
                                  0.5);
    tets_of.emplace_back();
    auto& around_b = tets_of[b.value];
    for (const std::size_t t : std::vector(tets_of[a.value])) {
      const auto at_b = std::find(around_b.begin(), around_b.end(), t);
      if (at_b == around_b.end()) continue;
      Tet half = mesh.tets[t];
      std::replace(half.begin(), half.end(), a, middle);
      std::replace(mesh.tets[t].begin(), mesh.tets[t].end(), b, middle);
      const std::size_t added = mesh.tets.size();
      *at_b = added;
      tets_of[middle.value].push_back(t);
      for (const NodeIndex node : half)
        if (node != b) tets_of[node.value].push_back(added);
      mesh.tets.push_back(half);
    }
  }
}

Result<TetMesh> stomach_mesh(double spacing_m) {
  auto mesh = mesh::stuff_isosurface(stomach_field, stomach_box(), spacing_m);
  if (!mesh) return mesh.error();
  if (const auto through = edges_through_the_wall(*mesh); !through.empty()) {
    split(*mesh, through);
    mesh::renumber_along_z(*mesh);
    mesh->build_adjacency();
  }
  // Vertices - edges + triangles of the surface: 0 for a tube. A lattice too coarse for the wall
  // leaves holes in it, and each hole takes 2 away.
  if (2 * mesh->surface_nodes.size() != mesh->boundary_triangles.size())
    return Error{ErrorCode::Usage, "the lattice is too coarse for the wall"};
  return mesh;
}

}  // namespace

Result<organ::Organ> make_stomach(int target_tets) {
  if (target_tets < kMinStomachTets || target_tets > kMaxStomachTets)
    return Error{ErrorCode::Usage, "stomach: " + std::to_string(target_tets) + " tets, must be " +
                                       std::to_string(kMinStomachTets) + " to " +
                                       std::to_string(kMaxStomachTets)};
  auto mesh = mesh_with_about(target_tets, 6.2e-4, stomach_mesh, "stomach");
  if (!mesh) return mesh.error();
  organ::Organ organ;
  organ.name = "stomach";
  organ.source = "stomach, " + std::to_string(target_tets) + " tets asked for";
  organ.mesh = std::move(*mesh);
  organ.material.elastic_law = material::ElasticLaw::NeoHookean;
  for (std::size_t n = 0; n < organ.mesh.node_count(); ++n)
    if (is_stomach_held(organ.mesh.rest_positions[n])) organ.fixed_nodes.push_back(NodeIndex(n));
  organ.source_offset_m = mesh::centre_on_origin(organ.mesh);
  organ.node_masses_kg = organ::lumped_masses(organ);
  if (auto status = validate(organ); !status) return status.error();
  return organ;
}

}  // namespace trocar::catalogue
