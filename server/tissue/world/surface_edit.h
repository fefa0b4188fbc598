#pragma once

// How the organ's surface has changed: its triangles by number. Numbers are those of the mesh's
// boundary triangles, then the next ones; that of a triangle which is gone is never used again.

#include <array>
#include <cstdint>
#include <vector>

#include "common/base/index.h"

namespace trocar::world {

struct SurfaceEdit {
  struct Triangle {
    std::array<NodeIndex, 3> nodes;  // counter-clockwise seen from outside
    bool is_wound = false;           // where tissue was inside before a cut
    std::uint16_t material = 0;      // of the tet behind it, as organ::material_at() counts
  };

  std::vector<TriangleIndex> removed;  // ascending
  std::vector<Triangle> added;         // the next numbers, in order
  std::vector<NodeIndex> surfaced;     // nodes that were not on the surface, ascending
  std::vector<NodeIndex> touched;      // nodes of what was removed and added, ascending

  void clear() { removed.clear(), added.clear(), surfaced.clear(), touched.clear(); }
};

}  // namespace trocar::world
