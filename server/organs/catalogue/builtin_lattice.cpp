#include <cstdio>
#include <string>

#include "server/organs/catalogue/builtin_organs.h"

namespace trocar::catalogue {
namespace {

constexpr double kYoungModulus_pa = 4000;

// Appends the quad a b c d (counter-clockwise seen from outside) as two triangles.
void add_quad(mesh::TetMesh& mesh, NodeIndex a, NodeIndex b, NodeIndex c, NodeIndex d) {
  mesh.boundary_triangles.push_back({a, b, c});
  mesh.boundary_triangles.push_back({a, c, d});
}

void add_nodes_and_links(const LatticeSize& s, mesh::TetMesh& mesh) {
  const Vec3d corner =
      Vec3d{double(s.nx - 1), double(s.ny - 1), double(s.nz - 1)} * (-s.spacing_m / 2);
  for (int k = 0; k < s.nz; ++k)
    for (int j = 0; j < s.ny; ++j)
      for (int i = 0; i < s.nx; ++i) {
        mesh.rest_positions.push_back(corner +
                                      Vec3d{double(i), double(j), double(k)} * s.spacing_m);
        const NodeIndex node = lattice_node(s, i, j, k);
        if (i + 1 < s.nx) mesh.links.push_back({node, lattice_node(s, i + 1, j, k)});
        if (j + 1 < s.ny) mesh.links.push_back({node, lattice_node(s, i, j + 1, k)});
        if (k + 1 < s.nz) mesh.links.push_back({node, lattice_node(s, i, j, k + 1)});
      }
}

void add_boundary(const LatticeSize& s, mesh::TetMesh& mesh) {
  const auto at = [&](int i, int j, int k) { return lattice_node(s, i, j, k); };
  const int x = s.nx - 1, y = s.ny - 1, z = s.nz - 1;
  for (int k = 0; k < z; ++k)
    for (int j = 0; j < y; ++j) {
      add_quad(mesh, at(0, j, k), at(0, j, k + 1), at(0, j + 1, k + 1), at(0, j + 1, k));
      add_quad(mesh, at(x, j, k), at(x, j + 1, k), at(x, j + 1, k + 1), at(x, j, k + 1));
    }
  for (int k = 0; k < z; ++k)
    for (int i = 0; i < x; ++i) {
      add_quad(mesh, at(i, 0, k), at(i + 1, 0, k), at(i + 1, 0, k + 1), at(i, 0, k + 1));
      add_quad(mesh, at(i, y, k), at(i, y, k + 1), at(i + 1, y, k + 1), at(i + 1, y, k));
    }
  for (int j = 0; j < y; ++j)
    for (int i = 0; i < x; ++i) {
      add_quad(mesh, at(i, j, 0), at(i, j + 1, 0), at(i + 1, j + 1, 0), at(i + 1, j, 0));
      add_quad(mesh, at(i, j, z), at(i + 1, j, z), at(i + 1, j + 1, z), at(i, j + 1, z));
    }
}

}  // namespace

Result<organ::Organ> make_lattice(const LatticeSize& size) {
  for (const int n : {size.nx, size.ny, size.nz})
    if (n < 2 || n > 400)
      return Error{ErrorCode::Usage,
                   "lattice: " + std::to_string(n) + " nodes along an axis, must be 2 to 400"};
  if (!(size.spacing_m >= 0.0005 && size.spacing_m <= 1))
    return Error{ErrorCode::Usage, "lattice: spacing must be 0.5 to 1000 mm"};
  organ::Organ organ;
  organ.name = "lattice";
  char source[80];
  std::snprintf(source, sizeof source, "lattice %d x %d x %d, spacing %g mm", size.nx, size.ny,
                size.nz, size.spacing_m * 1e3);
  organ.source = source;
  add_nodes_and_links(size, organ.mesh);
  add_boundary(size, organ.mesh);
  organ.mesh.build_adjacency();
  organ.material.spring_law = material::SpringLaw::Constant;
  organ.material.spring_stiffness_n_m = kYoungModulus_pa * size.spacing_m;
  organ.material.young_modulus_pa = kYoungModulus_pa;
  const double cell_mass =
      organ.material.density_kg_m3 * size.spacing_m * size.spacing_m * size.spacing_m;
  const auto share = [](int i, int n) { return i == 0 || i == n - 1 ? 0.5 : 1.0; };
  for (int k = 0; k < size.nz; ++k)
    for (int j = 0; j < size.ny; ++j)
      for (int i = 0; i < size.nx; ++i) {
        organ.node_masses_kg.push_back(cell_mass * share(i, size.nx) * share(j, size.ny) *
                                       share(k, size.nz));
        if (j == 0) organ.fixed_nodes.push_back(lattice_node(size, i, j, k));
      }
  if (auto status = validate(organ); !status) return status.error();
  return organ;
}

organ::Organ make_lattice() {
  auto organ = make_lattice(LatticeSize{});
  TROCAR_ASSERT(organ.ok());
  return std::move(*organ);
}

}  // namespace trocar::catalogue
