#pragma once

// Organs made by our own generators, so that nothing has to be downloaded. Every number in them
// comes from + - * / and sqrt, so an organ has the same hash on every machine.

#include <cstdint>

#include "common/base/result.h"
#include "common/scene/organ.h"

namespace trocar::scene {

// Cuboid of nodes with springs between the six nearest neighbours (Choi 2002: 30 x 15 x 30).
struct LatticeSize {
  int nx = 30, ny = 15, nz = 30;  // nodes along each axis, 2 to 400
  double spacing_m = 0.010;       // 0.0005 to 1; the whole at most 2 m

  bool operator==(const LatticeSize&) const = default;
};

// Node at grid place (i, j, k); x varies fastest, then y, then z.
inline NodeIndex lattice_node(const LatticeSize& size, int i, int j, int k) {
  return NodeIndex(i + size.nx * (j + size.ny * k));
}

// Links only, no tets; the outer quads, each split in two, are the boundary. The lowest layer in y
// is fixed. SpringLaw::Constant with k = 4 kPa x spacing (40 N/m at 10 mm): pulled along an axis,
// such a lattice has Young's modulus k / spacing = 4 kPa, that of liver; across, it has no shear
// stiffness. A node has the mass of its share of the cells around it, at 1060 kg/m^3.
Result<Organ> make_lattice(const LatticeSize& size);
Organ make_lattice();

// An adult liver (liver_shape.h), meshed by isosurface stuffing to within 5 % of `target_tets`; the
// default gives about 4,000 nodes. 241 mm wide, 1.6 l, Young's modulus 4 kPa, 1060 kg/m^3; held at
// the bare area, the vena cava and the falciform ligament, free everywhere else, so that the front
// edge can be lifted. 200,000 tets take 3 s of CPU time, the default 0.3 s.
inline constexpr int kMinLiverTets = 500, kMaxLiverTets = 200'000, kDefaultLiverTets = 18'500;
Result<Organ> make_liver(int target_tets = kDefaultLiverTets);

}  // namespace trocar::scene
