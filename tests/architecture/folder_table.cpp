#include "tests/architecture/folder_table.h"

#include <algorithm>

namespace trocar::architecture {
namespace {

// The wing of "server/tissue/step" is "server/tissue", that of "common/base" is "common".
std::string wing_of(const std::string& folder) {
  const auto slash = folder.rfind('/');
  return slash == std::string::npos ? folder : folder.substr(0, slash);
}

}  // namespace

std::string folder_table(const SourceTree& tree) {
  std::string text =
      "# Folders\n\n"
      "<!-- Written by the program folder_table from TROCAR_LAYERS and the ABOUT lines. -->\n\n"
      "A folder includes only headers of folders above it in TROCAR_LAYERS. The mark in the "
      "column\n"
      "\"state\" says that its arithmetic reaches the state hash: clocks, random numbers, "
      "unordered\n"
      "containers and library functions that are not exactly rounded are forbidden there.\n";
  std::vector<std::string> wings;  // in the order of their first layers
  for (const auto& folder : tree.layers)
    if (std::ranges::find(wings, wing_of(folder)) == wings.end()) wings.push_back(wing_of(folder));
  for (const auto& wing : wings) {
    text += "\n## `" + wing + "`\n\n| folder | purpose | state |\n|---|---|---|\n";
    for (const auto& folder : tree.layers) {
      const auto at = tree.folders.find(folder);
      if (at == tree.folders.end() || wing_of(folder) != wing) continue;
      text += "| `" + folder + "` | " + at->second.about + " | " +
              (tree.state_folders.contains(folder) ? "x" : "") + " |\n";
    }
  }
  return text;
}

}  // namespace trocar::architecture
