#pragma once

// One epoch changes the organ's surface by one SurfaceChange: new vertices, triangles that are
// gone, triangles that are new. Server, journal and clients apply the same changes to the same
// SurfaceLayout.
//
// Numbers are never used again: new vertices take the next slots, new triangles the next numbers, a
// removed triangle leaves a gap. So what is older than an epoch stays right after it.
//
// `sum` is that of triangle_hash over all triangles that live after the change, mod 2^64: it does
// not depend on their order, so both sides keep it up to date at the cost of the change, and a
// difference anywhere on the surface is noticed at the next change.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/base/index.h"
#include "common/base/result.h"
#include "common/wire/quantise.h"

namespace trocar::wire {

struct SurfaceLayout;

inline constexpr std::size_t kMaxSurfaceVertices = 4'000'000;
inline constexpr std::size_t kMaxSurfaceTriangles = 8'000'000;  // numbers, gaps included
inline constexpr std::int32_t kMaxRestQuanta = 62'500;          // 2 m from the origin
inline constexpr int kMaxChangeRegions = 1000;                  // names in a change

using Corners = std::array<VertexIndex, 3>;  // outward

struct NewVertex {
  QuantisedVertex rest_quanta;
  NodeIndex node;  // the server's; not on the wire
  // The surface vertices it was made from, each in a lower slot: it lies at a + (b - a) t / 65536.
  // A copy has a == b. Both invalid: it was not on the surface before.
  VertexIndex a, b;
  std::uint16_t t = 0;
  bool is_fixed = false;

  bool has_parents() const { return a.is_valid(); }
  bool operator==(const NewVertex&) const = default;
};

struct NewTriangle {
  Corners corners;
  bool is_wound = false;  // a face that a blade made

  // Three invalid corners: a number that is not used, of a triangle that came and went between two
  // frames. Not a wound.
  bool is_gap() const {
    return !corners[0].is_valid() && !corners[1].is_valid() && !corners[2].is_valid() && !is_wound;
  }
  bool operator==(const NewTriangle&) const = default;
};

struct SurfaceChange {
  std::uint32_t from_epoch = 0, epoch = 0;
  std::vector<NewVertex> new_vertices;
  std::vector<TriangleIndex> removed;  // ascending
  std::vector<NewTriangle> added;
  std::vector<std::string> regions;  // names of those whose tissue is laid open here, ascending
  std::uint64_t sum = 0;             // after the change

  bool operator==(const SurfaceChange&) const = default;
};

// Returns the hash of one triangle. It takes 64-bit integers only, so that any language can compute
// it:
//   mix(mix(number + 2^32 corner 0) xor (corner 1 + 2^32 corner 2)) xor (wound ? 2^64 - 1 : 0)
// with mix the finaliser of SplitMix64 (Steele, Lea and Flood 2014).
std::uint64_t triangle_hash(TriangleIndex number, const Corners& corners, bool is_wound);

// The sum that a layout has after a change, which `change.sum` must be. Indices must be valid.
std::uint64_t sum_after(const SurfaceChange& change, const SurfaceLayout& layout);

// Applies a change in place; on error `layout` is unchanged and the message says what is wrong.
// Everything is checked before anything is written: epochs, limits, parents, indices, that what is
// removed lives, the sum. Cost proportional to the change (amortised, vectors grow).
Status apply(const SurfaceChange& change, SurfaceLayout& layout);

// Returns where a vertex on the way from a to b lies, rounded: for a rest position or a
// displacement.
QuantisedVertex between(const QuantisedVertex& a, const QuantisedVertex& b, std::uint16_t t);

}  // namespace trocar::wire
