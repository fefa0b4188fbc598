#include "tests/architecture/folder_table.h"

namespace trocar::architecture {
namespace {

// Returns "server/tissue" of "server/tissue/step", "common" of "common/base".
std::string wing_of(const std::string& folder) {
  const auto slash = folder.rfind('/');
  return slash == std::string::npos ? folder : folder.substr(0, slash);
}

}  // namespace

std::string folder_table(const SourceTree& tree) {
  std::string text =
      "# Folders\n\n"
      "<!-- Written by the program folder_table from TROCAR_LAYERS and the ABOUT lines. -->\n\n"
      "A folder includes only headers of folders above it in this list. The mark in the column\n"
      "\"state\" says that its arithmetic reaches the state hash: clocks, random numbers, "
      "unordered\n"
      "containers and library functions that are not exactly rounded are forbidden there.\n";
  std::string wing;
  for (const auto& folder : tree.layers) {
    const auto at = tree.folders.find(folder);
    if (at == tree.folders.end()) continue;
    if (const std::string next = wing_of(folder); next != wing) {
      wing = next;
      text += "\n## `" + wing + "`\n\n| folder | purpose | state |\n|---|---|---|\n";
    }
    text += "| `" + folder + "` | " + at->second.about + " | " +
            (tree.state_folders.contains(folder) ? "x" : "") + " |\n";
  }
  return text;
}

}  // namespace trocar::architecture
