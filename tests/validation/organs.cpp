#include "tests/validation/organs.h"

#include <array>
#include <utility>

namespace trocar::validation {

organ::Organ lattice_with_diagonals(const catalogue::LatticeSize& size) {
  auto made = catalogue::make_lattice(size);
  TROCAR_ASSERT(made.ok());
  organ::Organ organ = std::move(*made);
  constexpr std::array<std::array<int, 3>, 6> kDiagonals{
      {{1, 1, 0}, {1, -1, 0}, {1, 0, 1}, {1, 0, -1}, {0, 1, 1}, {0, 1, -1}}};
  const auto is_inside = [](int i, int n) { return i >= 0 && i < n; };
  for (int k = 0; k < size.nz; ++k)
    for (int j = 0; j < size.ny; ++j)
      for (int i = 0; i < size.nx; ++i)
        for (const auto& [dx, dy, dz] : kDiagonals) {
          const int x = i + dx, y = j + dy, z = k + dz;
          if (!is_inside(x, size.nx) || !is_inside(y, size.ny) || !is_inside(z, size.nz)) continue;
          const auto a = catalogue::lattice_node(size, i, j, k),
                     b = catalogue::lattice_node(size, x, y, z);
          organ.mesh.links.push_back({std::min(a, b), std::max(a, b)});
        }
  organ.mesh.build_adjacency();
  organ.name = "lattice-with-diagonals";
  organ.source += ", face diagonals";
  return organ;
}

std::vector<double> even(double length, int cells) {
  std::vector<double> places;
  for (int i = 0; i <= cells; ++i) places.push_back(length * i / cells);
  return places;
}

organ::Organ tet_box(const std::vector<double>& x, const std::vector<double>& y,
                     const std::vector<double>& z) {
  organ::Organ organ;
  organ.name = "box";
  organ.source = "box of " + std::to_string(x.size() - 1) + " x " + std::to_string(y.size() - 1) +
                 " x " + std::to_string(z.size() - 1) + " cells, five tets each";
  auto& mesh = organ.mesh;
  for (const double c : z)
    for (const double b : y)
      for (const double a : x) mesh.rest_positions.push_back({a, b, c});
  // Corners of a cell by bits: 1 along x, 2 along y, 4 along z. The inner tet of an even cell has
  // the corners 0 3 5 6; an odd cell is its mirror image along x.
  constexpr std::array<std::array<int, 4>, 5> kTets{
      {{1, 3, 0, 5}, {2, 0, 3, 6}, {4, 5, 0, 6}, {7, 3, 5, 6}, {0, 3, 5, 6}}};
  for (std::size_t k = 0; k + 1 < z.size(); ++k)
    for (std::size_t j = 0; j + 1 < y.size(); ++j)
      for (std::size_t i = 0; i + 1 < x.size(); ++i)
        for (const auto& corners : kTets) {
          mesh::Tet tet;
          for (std::size_t c = 0; c < 4; ++c) {
            const auto bits =
                static_cast<std::size_t>((i + j + k) % 2 == 0 ? corners[c] : corners[c] ^ 1);
            tet[c] = NodeIndex((i + (bits & 1)) + x.size() * ((j + (bits >> 1 & 1)) +
                                                              y.size() * (k + (bits >> 2 & 1))));
          }
          const auto& p = mesh.rest_positions;
          const Vec3d& a = p[tet[0].value];
          if (dot(cross(p[tet[1].value] - a, p[tet[2].value] - a), p[tet[3].value] - a) < 0)
            std::swap(tet[2], tet[3]);
          mesh.tets.push_back(tet);
        }
  mesh.build_adjacency();
  const double base = y.front();
  for (std::uint32_t n = 0; n < mesh.node_count(); ++n)
    if (mesh.rest_positions[n].y <= base) organ.fixed_nodes.push_back(NodeIndex(n));
  mesh::centre_on_origin(mesh);
  organ.node_masses_kg = organ::lumped_masses(organ);
  TROCAR_ASSERT(organ::validate(organ).ok());
  return organ;
}

CubicConstants constants_of(const organ::Organ& organ) {
  const auto springs = organ::springs_of(organ);
  const auto& pairs = organ.mesh.spring_pairs();
  CubicConstants sum;
  for (std::size_t s = 0; s < springs.size(); ++s) {
    const auto [a, b] = pairs[s];
    const Vec3d r = organ.mesh.rest_positions[b.value] - organ.mesh.rest_positions[a.value];
    const double l2 = length_squared(r), x = r.x * r.x / l2, y = r.y * r.y / l2, z = r.z * r.z / l2;
    const double weight = springs[s].stiffness_n_m * l2 / 3;
    sum.c11 += weight * (x * x + y * y + z * z);
    sum.c12 += weight * (x * y + y * z + z * x);
  }
  const double volume = mesh::total_volume(organ.mesh);
  sum.c11 /= volume;
  sum.c12 /= volume;
  sum.c44 = sum.c12;  // central forces (Cauchy)
  return sum;
}

}  // namespace trocar::validation
