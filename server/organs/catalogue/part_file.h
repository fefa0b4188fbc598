#pragma once

// A part file (TOML): an organ of several bodies, each with its own source, material, holding and
// look, and the ties between them. join_parts.h makes the organ of it.

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "server/organs/catalogue/import_organ.h"
#include "server/organs/material/material_keys.h"
#include "server/organs/organ/tie.h"

namespace trocar::catalogue {

inline constexpr std::size_t kMostParts = 100;

// Keys of a material that are given replace those that the source has.
struct PartMaterial {
  std::optional<std::string> measured;  // a name, or a .toml file beside the part file
  std::optional<material::ElasticLaw> elastic_law;
  std::optional<bool> has_averaged_strain;
  std::array<std::optional<double>, material::kNumberKeys.size()> numbers;
};

struct PartRule {
  std::string name;
  std::string source;  // "box", "ellipsoid", or what load_organ() takes
  Vec3d at_m;          // is added to the source's own coordinates
  // A box or an ellipsoid has this size, about the origin.
  std::optional<Vec3d> size_m;
  std::optional<std::array<int, 3>> cells;  // of a box, along each axis
  // A file is imported so; an ellipsoid takes its number of nodes from here, too.
  ImportOptions import;
  bool is_held_whole = false;
  bool has_hold = false;  // else a built-in organ or an .organ file keeps its own
  PartMaterial material;
  std::string look;
};

struct TieRule {
  std::string name;
  std::array<std::string, 2> between;  // names of parts; ties begin on the first
  double within_m = 0, area_m2 = 0;    // of a tie: at most so long, for at most so much area
  organ::TieLaw law;
};

struct PartFile {
  std::filesystem::path source;
  std::vector<PartRule> parts;
  std::vector<TieRule> ties;
};

// Whether a .toml file is one, and no scenario: it has a [[part]].
bool is_part_file(const std::filesystem::path& path);
Result<PartFile> read_part_file(const std::filesystem::path& path);
// `source` stands for the file's path: in messages, and for files relative to it.
Result<PartFile> parse_parts_text(std::string_view text, std::string_view source);

}  // namespace trocar::catalogue
