// The rules on the real tree.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/architecture/folder_table.h"
#include "tests/architecture/rules.h"

namespace trocar::architecture {
namespace {

const SourceTree& tree() {
  static const SourceTree kTree = read_source_tree(TROCAR_SOURCE_DIR);
  return kTree;
}

void expect_none(const Breaches& breaches) {
  for (const auto& breach : breaches) ADD_FAILURE() << breach;
}

// A reader that finds nothing would let every rule pass.
TEST(Architecture, TheTreeIsRead) {
  EXPECT_GE(tree().layers.size(), 20u);
  EXPECT_GE(tree().layer_of("common/base"), 0);
  EXPECT_LT(tree().layer_of("common/base"), tree().layer_of("common/math"));
  EXPECT_EQ(tree().layer_of("server/tissue/cutting"),
            tree().layer_of("server/tissue/dynamics") + 1);
  EXPECT_TRUE(tree().closure_of("server/tissue/step").contains("common/math"));
  EXPECT_TRUE(tree().state_folders.contains("server/tissue/step"));
  for (const auto& folder : tree().state_folders) EXPECT_GE(tree().layer_of(folder), 0) << folder;
  EXPECT_FALSE(tree().folders.at("server/app/sim").programs.empty());
  EXPECT_TRUE(tree().has_file("server/tissue/step/tick.cpp"));
  EXPECT_TRUE(tree().has_file("README.md"));
  std::size_t includes = 0;
  for (const auto& file : tree().files) includes += file.includes.size();
  EXPECT_GE(includes, 300u);
}

TEST(Architecture, FoldersAreLayersAndListTheirFiles) {
  expect_none(check_folders(tree()));
}
TEST(Architecture, IncludesExist) {
  expect_none(check_includes(tree()));
}
TEST(Architecture, DependenciesAreWhatIsIncluded) {
  expect_none(check_dependencies(tree()));
}
TEST(Architecture, NetSeesNoWorld) {
  expect_none(check_net_sees_no_world(tree()));
}
TEST(Architecture, ProtobufStaysInItsFolders) {
  expect_none(check_protobuf(tree()));
}
TEST(Architecture, OnlyDrawingFoldersDraw) {
  expect_none(check_graphics(tree()));
}
TEST(Architecture, StateIsDeterministic) {
  expect_none(check_determinism(tree()));
}
TEST(Architecture, TheTableOfFoldersIsUpToDate) {
  std::ifstream file(std::filesystem::path(TROCAR_SOURCE_DIR) / "docs/folders.md");
  const std::string committed{std::istreambuf_iterator<char>(file), {}};
  EXPECT_EQ(committed, folder_table(tree()))
      << "write it again: ninja -C build/release folder_table && build/release/bin/folder_table > "
         "docs/folders.md";
}
TEST(Architecture, FilesAreShortAndBelongToNoMachine) {
  expect_none(check_files(tree()));
}

}  // namespace
}  // namespace trocar::architecture
