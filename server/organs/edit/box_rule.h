#pragma once

// A rule in numbers says which nodes of an organ are meant: a box, a slab or a half-space along the
// organ's axes. Positions are in the organ's frame: y up, the origin at the centre of its rest
// bounding box.

#include <limits>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/math/vec3.h"
#include "server/organs/mesh/tet_mesh.h"

namespace trocar::edit {

struct BoxRule {
  static constexpr double kOpen = std::numeric_limits<double>::infinity();
  Vec3d low_m{-kOpen, -kOpen, -kOpen};  // m; infinite where it is open
  Vec3d high_m{kOpen, kOpen, kOpen};
  bool is_on_surface = false;  // only nodes of the surface

  bool operator==(const BoxRule&) const = default;
};

// Reads terms with commas between them, in mm: "x=-10..20", "y=..-40" and "z=5.." bound an axis,
// "surface" leaves inner nodes out, "all" is every node. Each axis at most once. Error: names the
// term, and `option`, which said it.
Result<BoxRule> parse_box_rule(std::string_view text, std::string_view option);

// Ascending. A node on the edge is inside, to 1e-6 m.
std::vector<NodeIndex> nodes_in(const BoxRule& rule, const mesh::TetMesh& mesh);

}  // namespace trocar::edit
