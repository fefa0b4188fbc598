#pragma once

// An organ from another program's mesh, or from a surface or a label map that is filled with
// tetrahedra.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "server/organs/label_map/label_map.h"
#include "server/organs/mesh/raw_tets.h"
#include "server/organs/organ/fix_rule.h"
#include "server/organs/organ/organ.h"
#include "server/organs/surface/raw_surface.h"

namespace trocar::catalogue {

inline constexpr int kDefaultFillNodes = 2000;

struct ImportOptions {
  mesh::Unit unit = mesh::Unit::Metre;
  bool unit_is_said = false;           // by somebody, and not only the usual one
  organ::FixRule fix;                  // bottom:0.2
  std::optional<std::string> fix_set;  // the file's set of nodes that is held instead
  std::optional<std::string> name;     // instead of the file's stem
  // A surface or a label map is filled with so many, mesh::kMinFillNodes to mesh::kMaxFillNodes.
  std::optional<int> nodes;
  // These labels of a label map make the organ; none: all but 0. Number 0: the label of that name;
  // no name: that of the map.
  std::vector<std::pair<std::uint16_t, std::string>> labels;
};

struct ImportedOrgan {
  organ::Organ organ;
  double unit_m = 1;  // of the file's numbers
  // Those of the organ: a label map is turned to left, head and front, a surface stays as it says.
  surface::Axes axes = surface::Axes::Unsaid;
  std::vector<std::string> warnings;  // one line each: what was repaired or left out
  std::vector<std::string> notes;     // one line each: how a surface was filled, regions, sets
};

// "2", "1,2", "1:liver,2:tumour" or "liver,tumour". Error: names the part that is none.
Result<std::vector<std::pair<std::uint16_t, std::string>>> parse_labels(std::string_view text);

// Reads a mesh file (formats/mesh_file.h) or a label map (.nii, .nii.gz) and gives it the default
// material, in each of its regions, too. Error: of a surface where `nodes` is out of range, of tets
// where it is given.
Result<ImportedOrgan> import_organ(const std::filesystem::path& path, const ImportOptions& options);
// The same from a label map that was read elsewhere; `path` names it.
Result<ImportedOrgan> import_labels(label_map::LabelMap map, const std::filesystem::path& path,
                                    const ImportOptions& options);
// The name of an organ from that file: the file's without its ends.
std::string imported_name(const std::filesystem::path& path);
// Whether it would read a file of that name.
bool can_be_imported(const std::filesystem::path& path);

}  // namespace trocar::catalogue
