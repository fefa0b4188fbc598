// The rules on the real tree.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/architecture/folder_table.h"
#include "tests/architecture/rules.h"
#include "tests/architecture/size_rules.h"

namespace trocar::architecture {
namespace {

// These shrink, and nothing is added.
constexpr LargeClass kLargeClasses[] = {
    {"client/app", "ClientOptions", 53, "has a field for each option, and no rule between them"},
    {"client/embedding", "EmbeddedSurface", 68, "arrays per fine vertex that one pass writes"},
    {"client/haptics", "TouchModel", 59, "one state that each answer corrects"},
    {"client/replay", "ReplaySource", 63, "two interfaces, that of a source and that of a player"},
    {"client/replica", "Replica", 65, "frames, what they start from and what heals them"},
    {"client/web/wasm", "PageModel", 65, "each call of the page has a method"},
    {"server/app/server", "Server", 62, "what a process has one of"},
    {"server/session/recording", "Recorder", 57, "the file, its writer and what it keeps"},
    {"server/session/recording", "Verifier", 54, "a simulation beside the recording's"},
    {"server/session/replication", "Replicator", 68,
     "which message is for which of its parts, and who is connected as whom"},
    {"server/tissue/contact", "SelfSurface", 60, "skin, wounds and what is near to what"},
    {"server/tissue/dynamics", "BlockDescent", 108, "plan, schedule and sweeps share the arrays"},
    {"server/tissue/topology", "Topology", 59, "one array per property, one method to read each"},
};
constexpr std::size_t kLongFunctions = 37, kWideFunctions = 16;

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
  EXPECT_TRUE(tree().closure_of("server/tissue/step").contains("common/math"));
  EXPECT_TRUE(tree().state_folders.contains("server/tissue/step"));
  for (const auto* folders : {&tree().state_folders, &tree().offline})
    for (const auto& folder : *folders) EXPECT_GE(tree().layer_of(folder), 0) << folder;
  EXPECT_TRUE(tree().offline.contains("server/lab/fit"));
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
TEST(Architecture, SessionsSeeNoTool) {
  expect_none(check_sessions_see_no_tool(tree()));
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

TEST(Architecture, ClassesAreOneIdeaEach) {
  expect_none(check_classes(tree(), kLargeClasses));
}
TEST(Architecture, FunctionsAreShort) {
  expect_none(check_functions(tree(), kLongFunctions, kWideFunctions));
}

}  // namespace
}  // namespace trocar::architecture
