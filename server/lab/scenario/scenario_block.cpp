#include "server/lab/scenario/scenario_block.h"

#include <cstdio>

namespace trocar::scenario {
namespace {

// The corners of the tets along each order of the three axes; odd orders are mirrored.
constexpr int kOrders[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};

void add_cube(const catalogue::LatticeSize& size, const std::array<int, 3>& corner,
              mesh::TetMesh& mesh) {
  const auto node = [&](const std::array<int, 3>& at) {
    return catalogue::lattice_node(size, at[0], at[1], at[2]);
  };
  for (int o = 0; o < 6; ++o) {
    std::array<int, 3> at = corner;
    mesh::Tet tet{node(at)};
    for (std::size_t step = 0; step < 3; ++step) {
      ++at[static_cast<std::size_t>(kOrders[o][step])];
      tet[step + 1] = node(at);
    }
    if (o >= 3) std::swap(tet[1], tet[2]);
    mesh.tets.push_back(tet);
  }
}

}  // namespace

Result<organ::Organ> make_block(const catalogue::LatticeSize& size) {
  organ::Organ organ;
  organ.name = "block";
  char source[80];
  std::snprintf(source, sizeof source, "block %d x %d x %d, spacing %g mm", size.nx, size.ny,
                size.nz, size.spacing_m * 1e3);
  organ.source = source;
  const Vec3d corner =
      Vec3d{double(size.nx - 1), double(size.ny - 1), double(size.nz - 1)} * (-size.spacing_m / 2);
  for (int k = 0; k < size.nz; ++k)
    for (int j = 0; j < size.ny; ++j)
      for (int i = 0; i < size.nx; ++i) {
        organ.mesh.rest_positions.push_back(corner + Vec3d{double(i), double(j), double(k)} *
                                                         size.spacing_m);
        if (j == 0) organ.fixed_nodes.push_back(catalogue::lattice_node(size, i, j, k));
        if (i + 1 < size.nx && j + 1 < size.ny && k + 1 < size.nz)
          add_cube(size, {i, j, k}, organ.mesh);
      }
  organ.mesh.build_adjacency();
  organ.node_masses_kg = organ::lumped_masses(organ);
  if (auto status = validate(organ); !status) return status.error();
  return organ;
}

}  // namespace trocar::scenario
