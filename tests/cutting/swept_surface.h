#pragma once

// Finds what blades sweep, as triangles, and which tets of a mesh it touches: without regard for
// what the cutter makes of it.

#include "tests/cutting/cut_organ.h"

namespace trocar::cutting::testing {

class SweptSurface {
 public:
  explicit SweptSurface(std::span<const Path> paths);

  bool crosses(const Vec3d& a, const Vec3d& b) const;
  // Bits by edge 01, 02, 03, 12, 13, 23.
  std::uint8_t crossed_edges(const topology::Topology& topology, TetIndex tet) const;
  // Counts no further than `most`.
  std::uint32_t touched_tets(const topology::Topology& topology, std::uint32_t most) const;

 private:
  struct Triangle {
    PatchTriangle plane;
    Box box;
  };
  std::vector<Triangle> triangles_;
  Box box_;
};

// The crossed edges part a tet in one of these ways; Front: the cut ends inside the tet.
enum class Parting : std::uint8_t { None, Front, OneAndThree, TwoAndTwo };
Parting parting_of(std::uint8_t crossed_edges);

// Into how many tets each one of the organ has become by these events.
std::vector<std::uint32_t> count_parts(const organ::Organ& organ, const CutEvents& events);

}  // namespace trocar::cutting::testing
