#pragma once

// Pieces of the surface that nothing holds, and where they are.

#include <optional>
#include <span>
#include <vector>

#include "common/wire/surface_layout.h"

namespace trocar::lesson {

// The connected parts of a surface; each is known by one of its vertices.
class Components {
 public:
  explicit Components(const wire::SurfaceLayout& layout);
  std::uint32_t of(std::uint32_t vertex);
  // Something holds the part of this vertex, as of() has it.
  bool is_held(std::uint32_t part) const { return is_held_[part] != 0; }

 private:
  void join(std::uint32_t a, std::uint32_t b) { parent_[of(a)] = of(b); }
  std::vector<std::uint32_t> parent_;
  std::vector<std::uint8_t> is_held_;  // by vertex
};

// The triangles of the loose piece that lies nearest to a place at rest, ascending; empty where all
// of the surface is held.
std::vector<TriangleIndex> find_loose_piece(const wire::SurfaceLayout& layout,
                                            const Vec3d& place_m);

// A piece as one frame shows it, world frame.
struct PlacedPiece {
  Vec3d centre_m;              // of its surface, by area
  std::vector<Vec3d> corners;  // of its triangles, three each
};
PlacedPiece place_piece(const wire::SurfaceLayout& layout,
                        std::span<const wire::QuantisedVertex> displacements,
                        std::span<const TriangleIndex> piece);

}  // namespace trocar::lesson
