#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/builtin_search.h"
#include "server/organs/catalogue/five_tets.h"
#include "server/organs/mesh/pieces.h"
#include "server/organs/mesh/stuffing.h"

namespace trocar::catalogue {
namespace {

constexpr int kCellsX = 50, kCellsY = 6, kCellsZ = 40;  // of the wall
constexpr Vec3d kWall_m{0.40, 0.054, 0.308};
constexpr int kHeartTets = 13'300;
constexpr Vec3d kHeartHalf_m{0.060, 0.042, 0.050};
constexpr double kTaper = 0.3;  // of its radii, from the middle to the apex at the greatest x
constexpr double kGap_m = 0.004;
constexpr double kHeldShare = 0.2;  // of the heart's height

int wall_node(int i, int j, int k) {
  return i + (kCellsX + 1) * (j + (kCellsY + 1) * k);
}

mesh::TetMesh chest_mesh() {
  mesh::TetMesh mesh;
  for (int k = 0; k <= kCellsZ; ++k)
    for (int j = 0; j <= kCellsY; ++j)
      for (int i = 0; i <= kCellsX; ++i)
        mesh.rest_positions.push_back({(static_cast<double>(i) / kCellsX - 0.5) * kWall_m.x,
                                       (static_cast<double>(j) / kCellsY - 0.5) * kWall_m.y,
                                       (static_cast<double>(k) / kCellsZ - 0.5) * kWall_m.z});
  for (int k = 0; k < kCellsZ; ++k)
    for (int j = 0; j < kCellsY; ++j)
      for (int i = 0; i < kCellsX; ++i)
        add_five_tets(mesh, i, j, k,
                      [](int x, int y, int z) { return NodeIndex(wall_node(x, y, z)); });
  return mesh;
}

// An ellipsoid that tapers to an apex.
double heart_field(const Vec3d& p) {
  const double x = p.x / kHeartHalf_m.x, radius = 1 - kTaper * x;
  const double y = p.y / (kHeartHalf_m.y * radius), z = p.z / (kHeartHalf_m.z * radius);
  return x * x + y * y + z * z - 1;
}

mesh::TetMesh heart_mesh() {
  const Vec3d far = kHeartHalf_m * 1.2;
  const auto mesh_at = [&](double spacing_m) {
    return mesh::stuff_isosurface(heart_field, {-far, far}, spacing_m);
  };
  auto mesh = mesh_with_about(kHeartTets, 5.4e-4, mesh_at, "chest");
  TROCAR_ASSERT(mesh.ok());
  return std::move(*mesh);
}

void add_below(const mesh::TetMesh& heart, mesh::TetMesh& wall) {
  const auto first = static_cast<std::uint32_t>(wall.node_count());
  double top = heart.rest_positions.front().y;
  for (const auto& p : heart.rest_positions) top = std::max(top, p.y);
  const Vec3d to{0, -kWall_m.y / 2 - kGap_m - top, 0};
  for (const auto& p : heart.rest_positions) wall.rest_positions.push_back(p + to);
  for (auto tet : heart.tets) {
    for (auto& node : tet) node = NodeIndex(first + node.value);
    wall.tets.push_back(tet);
  }
}

// Such springs have this modulus on average over all directions, see springs_of().
double young_modulus_of_springs(const mesh::TetMesh& mesh, double stiffness_n_m) {
  double sum = 0;
  for (const auto& [a, b] : mesh.edges)
    sum +=
        stiffness_n_m * length_squared(mesh.rest_positions[b.value] - mesh.rest_positions[a.value]);
  return sum / (6 * mesh::total_volume(mesh));
}

// The wall's rim, and the heart's back. Lists its nodes, too; before centring.
void hold(organ::Organ& organ, std::vector<NodeIndex>& heart) {
  double low = 0;
  for (const auto& p : organ.mesh.rest_positions) low = std::min(low, p.y);
  const double top = -kWall_m.y / 2 - kGap_m / 2;
  for (std::size_t n = 0; n < organ.mesh.node_count(); ++n) {
    const Vec3d& p = organ.mesh.rest_positions[n];
    const bool is_heart = p.y < top;
    if (is_heart) heart.emplace_back(n);
    const bool is_rim =
        std::abs(p.x) > kWall_m.x / 2 - 1e-9 || std::abs(p.z) > kWall_m.z / 2 - 1e-9;
    if (is_heart ? p.y < low + kHeldShare * (top - low) : is_rim) organ.fixed_nodes.emplace_back(n);
  }
}

}  // namespace

organ::Organ make_chest() {
  organ::Organ organ;
  organ.name = "chest";
  organ.source = "chest wall and heart, of the size of those of Nakao 2003";
  organ.mesh = chest_mesh();
  add_below(heart_mesh(), organ.mesh);
  mesh::renumber_along_z(organ.mesh);
  organ.mesh.build_adjacency();
  auto& material = organ.material;
  material.density_kg_m3 = 900;
  material.spring_law = material::SpringLaw::Constant;
  material.spring_stiffness_n_m = 100;
  material.young_modulus_pa = young_modulus_of_springs(organ.mesh, material.spring_stiffness_n_m);
  material.edge_damping_time_s = 0.05 / 100;
  material.tension = 0.04;
  auto heart = material;
  heart.tension = 0;
  organ.regions = {{"heart", heart, {}}};
  hold(organ, organ.regions[0].nodes);
  organ.source_offset_m = mesh::centre_on_origin(organ.mesh);
  organ.node_masses_kg = organ::lumped_masses(organ);
  TROCAR_ASSERT(validate(organ));
  return organ;
}

}  // namespace trocar::catalogue
