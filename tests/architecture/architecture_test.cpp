// The rules on the real tree.

#include <gtest/gtest.h>

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
  EXPECT_TRUE(tree().has_file("server/tissue/step/tick.cpp"));
  EXPECT_TRUE(tree().has_file("README.md"));
  std::size_t includes = 0;
  for (const auto& file : tree().files) includes += file.includes.size();
  EXPECT_GE(includes, 300u);
}

TEST(Architecture, FoldersAreLayersAndListTheirFiles) {
  expect_none(check_folders(tree()));
}
TEST(Architecture, IncludesFollowDepends) {
  expect_none(check_includes(tree()));
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
TEST(Architecture, FilesAreShortAndBelongToNoMachine) {
  expect_none(check_files(tree()));
}

}  // namespace
}  // namespace trocar::architecture
