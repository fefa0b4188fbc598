// folder_table [DIR]: prints docs/folders.md for the source tree at DIR (default: here).

#include <cstdio>

#include "tests/architecture/folder_table.h"

int main(int argc, char** argv) {
  const auto tree = trocar::architecture::read_source_tree(argc > 1 ? argv[1] : ".");
  if (tree.layers.empty()) {
    std::fputs("folder_table: no TROCAR_LAYERS here, start it in the root of the sources\n",
               stderr);
    return 3;
  }
  std::fputs(trocar::architecture::folder_table(tree).c_str(), stdout);
}
