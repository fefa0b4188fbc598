#pragma once

// A rule says where the fibres of an organ run: along an axis; around one, as Langer's lines run
// around a trunk or neck; or as a table says node by node.

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "server/organs/mesh/tet_mesh.h"

namespace trocar::organ {

struct FibreRule {
  enum class Kind : std::uint8_t { Along, Around, Table };

  Kind kind = Kind::Along;
  Vec3d axis{};  // Along, Around: one of the world's, through the centre of the bounding box
  std::filesystem::path table;  // Table

  bool operator==(const FibreRule&) const = default;
};

// A rule is written "x", "y", "z", "around:x", "around:y", "around:z", or the name of a .csv file.
Result<FibreRule> parse_fibre_rule(std::string_view text);

// Per node, as Organ::fibre_directions; zero on the axis that they run around. A table has the
// columns id, x, y, z and a row for each node, in any order; its directions are of any length but
// zero. Wrong ones are refused with file and line.
Result<std::vector<Vec3d>> fibre_directions_by(const FibreRule& rule, const mesh::TetMesh& mesh);

}  // namespace trocar::organ
