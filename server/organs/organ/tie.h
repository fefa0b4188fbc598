#pragma once

// Ties hold one place of an organ's surface to another: tissue that lies between two bodies, and
// parts before they do, such as that between a gallbladder and its bed.
//
// Pulled apart by d, each mm^2 bears a stress that rises to `strength` at `rise`, then falls to
// zero at 2 toughness/strength, so that all of it takes `toughness` J/m^2 (a cohesive law with two
// lines). What has been pulled farther than `rise` is weaker for good: it goes straight to zero
// when it is let go. Pressed together a tie does nothing.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/base/index.h"
#include "common/base/result.h"
#include "common/math/vec3.h"
#include "server/organs/mesh/tet_mesh.h"

namespace trocar::organ {

// An end is a place on a boundary triangle of the mesh.
struct TieEnd {
  TriangleIndex triangle;
  std::array<double, 3> weights{};  // of its corners; none is negative, their sum is 1

  bool operator==(const TieEnd&) const = default;
};

struct Tie {
  std::array<TieEnd, 2> ends;  // of triangles without a common node
  double area_m2 = 0;          // that it stands for

  bool operator==(const Tie&) const = default;
};

struct TieLaw {
  double strength_pa = 8000;
  double toughness_j_m2 = 20;
  double rise_m = 1e-3;

  // Pulled apart so far it is broken.
  double full_m() const { return 2 * toughness_j_m2 / strength_pa; }
  bool operator==(const TieLaw&) const = default;
};

// Ties of one law, such as all of a bed. They are numbered through all bands.
struct TieBand {
  std::string name;
  TieLaw law;
  std::vector<Tie> ties;

  bool operator==(const TieBand&) const = default;
};

inline constexpr std::size_t kMaxTieBands = 100, kMaxTies = 100'000;

std::size_t tie_count(const std::vector<TieBand>& bands);
// Returns where an end is at these positions, such as those at rest.
Vec3d place_of(const TieEnd& end, const mesh::TetMesh& mesh, const std::vector<Vec3d>& positions);

// Error: names the number, its range and what to do.
Status validate(const TieLaw& law);
// Error: names the band, the tie and what is wrong.
Status validate(const std::vector<TieBand>& bands, const mesh::TetMesh& mesh);

}  // namespace trocar::organ
