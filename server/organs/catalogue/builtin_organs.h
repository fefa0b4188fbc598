#pragma once

// Organs made by our own generators, so that nothing has to be downloaded. Every number in them
// comes from + - * / and sqrt, so an organ has the same hash on every machine.

#include <cstdint>

#include "common/base/result.h"
#include "server/organs/organ/organ.h"

namespace trocar::catalogue {

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
Result<organ::Organ> make_lattice(const LatticeSize& size);
organ::Organ make_lattice();

// An adult liver (liver_shape.h), meshed by isosurface stuffing to within 5 % of `target_tets`; the
// default gives about 4,000 nodes. 241 mm wide, 1.6 l, neo-Hookean with Young's modulus 4 kPa and
// Poisson's ratio 0.45 (springs stay crumpled once they were pressed flat), 1060 kg/m^3; held at
// the bare area, the vena cava and the falciform ligament, free everywhere else, so that the front
// edge can be lifted. 200,000 tets take 3 s of CPU time, the default 0.3 s.
inline constexpr int kMinLiverTets = 500, kMaxLiverTets = 200'000, kDefaultLiverTets = 18'500;
Result<organ::Organ> make_liver(int target_tets = kDefaultLiverTets);
// The same of "human_liver_nava2008", which is measured, and relaxes.
Result<organ::Organ> make_measured_liver(int target_tets = kDefaultLiverTets);

// The plate that Nakao 2003 cuts: 160 x 4 x 160 mm, y (up) through its thickness so that it lies
// flat; 24 x 24 cells in one layer, six tets each in mirrored pairs, 32 of the cells with a node in
// the middle and twelve tets. Nakao printed 1,274 nodes, 6,160 edges, 3,647 tets and 2,500
// polygons, which no one closed solid has (nodes - edges + tets + half the polygons is 11, must be
// 1); this one has 1,282, 6,177, 3,648 and 2,496 boundary triangles, all within 1 %. 900 kg/m^3;
// springs 100 N/m, dampers along them 0.05 N s/m, and the nodes' own damping as in other organs;
// Young's modulus 58 kPa, that of such springs on average over all directions. The rim (the four
// thin sides) is fixed: free, the plate would shrink under tension instead of opening where it is
// cut.
organ::Organ make_plate();

// An adult's stomach (stomach_shape.h), a hollow sac with two openings: 198 x 220 x 125 mm, 0.8 l
// inside, wall 7 mm, one surface of genus 1. Meshed by isosurface stuffing to within 5 % of
// `target_tets`; no tet, not even an edge, goes from the outer face of the wall to the inner one,
// so that the wall is two tets thick or more everywhere, which is why coarser ones are not made.
// Material as the liver's; held 8 mm deep around both openings, free between them. The
// default takes 1 s of CPU time, 200,000 tets 6 s.
inline constexpr int kMinStomachTets = 50'000, kMaxStomachTets = 200'000,
                     kDefaultStomachTets = 60'000;
Result<organ::Organ> make_stomach(int target_tets = kDefaultStomachTets);

// Two bodies of the size of those that Nakao 2003 cuts (17,582 nodes, 100,807 edges, 73,279 tets):
// a chest wall, 400 x 54 x 308 mm, y (up) through its thickness, 50 x 6 x 40 cells of five tets,
// held at its rim; under it, with a gap of 4 mm, a heart of 13,300 tets, 120 mm long, held at the
// lowest fifth. Springs and density as the plate's, 4 % tension in the wall: its rest pose is not
// quite in equilibrium, for it is free above and below. The heart is the region "heart". Takes 0.3
// s.
organ::Organ make_chest();

// A board, 150 x 5 x 90 mm, with six pegs of 6 x 20 x 6 mm, three on the left and three on the
// right; around each of those on the left lies a ring, 24 x 10 x 24 mm with a hole of 12 mm, which
// nothing holds. Neo-Hookean rubber of 50 kPa under gravity; the board is held at its lower face.
organ::Organ make_pegs();

}  // namespace trocar::catalogue
