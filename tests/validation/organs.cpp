#include "tests/validation/organs.h"

#include <array>

namespace trocar::validation {

scene::Organ lattice_with_diagonals(const scene::LatticeSize& size) {
  auto made = scene::make_lattice(size);
  TROCAR_ASSERT(made.ok());
  scene::Organ organ = std::move(*made);
  constexpr std::array<std::array<int, 3>, 6> kDiagonals{
      {{1, 1, 0}, {1, -1, 0}, {1, 0, 1}, {1, 0, -1}, {0, 1, 1}, {0, 1, -1}}};
  const auto is_inside = [](int i, int n) { return i >= 0 && i < n; };
  for (int k = 0; k < size.nz; ++k)
    for (int j = 0; j < size.ny; ++j)
      for (int i = 0; i < size.nx; ++i)
        for (const auto& [dx, dy, dz] : kDiagonals) {
          const int x = i + dx, y = j + dy, z = k + dz;
          if (!is_inside(x, size.nx) || !is_inside(y, size.ny) || !is_inside(z, size.nz)) continue;
          const auto a = scene::lattice_node(size, i, j, k), b = scene::lattice_node(size, x, y, z);
          organ.mesh.links.push_back({std::min(a, b), std::max(a, b)});
        }
  organ.mesh.build_adjacency();
  organ.name = "lattice-with-diagonals";
  organ.source += ", face diagonals";
  return organ;
}

}  // namespace trocar::validation
