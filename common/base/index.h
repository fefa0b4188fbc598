#pragma once

// Strongly typed 32-bit indices into arrays: a NodeIndex is not a TetIndex.

#include <compare>
#include <cstdint>

namespace trocar {

template <typename Tag>
struct Index {
  std::uint32_t value = 0xffffffffu;

  constexpr Index() = default;
  constexpr explicit Index(std::uint32_t v) : value(v) {}
  constexpr explicit Index(std::size_t v) : value(static_cast<std::uint32_t>(v)) {}
  constexpr explicit Index(int v) : value(static_cast<std::uint32_t>(v)) {}

  auto operator<=>(const Index&) const = default;
  constexpr bool is_valid() const { return value != 0xffffffffu; }
};

using NodeIndex = Index<struct NodeTag>;          // mesh node, the organ's own numbering everywhere
using TetIndex = Index<struct TetTag>;            // tetrahedron
using EdgeIndex = Index<struct EdgeTag>;          // undirected edge between two nodes of a tet
using LinkIndex = Index<struct LinkTag>;          // spring that is not (necessarily) a tet edge
using TriangleIndex = Index<struct TriangleTag>;  // boundary triangle
using VertexIndex = Index<struct SurfaceVertexTag>;  // surface vertex slot (Morton order)

}  // namespace trocar
