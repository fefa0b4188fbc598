#pragma once

// An organ from three sides: from the front (along -z, x to the right, y up), from its left (along
// -x) and from above (along -y), all at the same scale, with the edges of its triangles. A fine
// surface is drawn instead, without edges, painted with its picture.
//
// Regions have colours of their own, held nodes are dark; of a fine surface, as the mesh's nearest
// triangle has them, and what is painted shows through a region's colour. The bar below the first
// view has a length of 1, 2 or 5 times a power of ten, which scale_bar_m() tells. Drawn by depth
// buffer, orthographic; the same organ gives the same picture.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/image/image.h"
#include "common/wire/fine_surface.h"
#include "server/organs/mesh/tet_mesh.h"

namespace trocar::picture {

using Colour = std::array<std::uint8_t, 3>;  // red, green, blue

struct Picture {
  int width = 0, height = 0;
  std::vector<Colour> pixels;  // row by row from the top

  Colour& at(int x, int y) {
    return pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
  }
  std::span<const std::uint8_t> rgb() const {
    return {pixels.data()->data(), pixels.size() * sizeof(Colour)};
  }
};

// region_of_node: one a node, 0 for the organ's own; is_held: one a node. fine: valid, or empty;
// painted: its picture, used if it has texture coordinates.
Picture draw_organ(const mesh::TetMesh& mesh, const std::vector<std::uint16_t>& region_of_node,
                   const std::vector<std::uint8_t>& is_held, const wire::FineSurface& fine = {},
                   const image::Image& painted = {});
double scale_bar_m(const mesh::TetMesh& mesh);

}  // namespace trocar::picture
