#pragma once

// A rule says which nodes of an imported mesh are held: those of its surface that lie in a slab at
// one side of the rest bounding box.

#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "server/organs/mesh/tet_mesh.h"

namespace trocar::organ {

struct FixRule {
  enum class Side : std::uint8_t { None, Bottom, Top, Back };  // lowest y, highest y, lowest z

  Side side = Side::Bottom;
  double fraction = 0.2;  // of the box's extent across that side, above 0, at most 1

  bool operator==(const FixRule&) const = default;
};

// A rule is written "none", "bottom:F", "top:F" or "back:F".
Result<FixRule> parse_fix_rule(std::string_view text);
std::string to_text(const FixRule& rule);

// Ascending.
std::vector<NodeIndex> nodes_held_by(const FixRule& rule, const mesh::TetMesh& mesh);

}  // namespace trocar::organ
