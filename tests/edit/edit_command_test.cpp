// The options of trocar-organ edit: what they open, what they change, what they refuse.

#include "server/app/edit_command/edit_command.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "server/organs/catalogue/load_organ.h"
#include "server/organs/organ/organ_file.h"

namespace trocar::edit_command {
namespace {

namespace fs = std::filesystem;

// The command of such words; a message where they are refused.
Result<EditCommand> parse(std::vector<std::string> words) {
  CLI::App app("test");
  EditCommand command;
  add_options(app, command);
  std::ranges::reverse(words);  // as CLI11 wants it
  try {
    app.parse(words);
  } catch (const CLI::ParseError& error) {
    return Error{ErrorCode::Usage, error.what()};
  }
  return command;
}

std::string refusal(const std::vector<std::string>& words) {
  const auto command = parse(words);
  if (!command) return command.error().message;
  const auto editor = open(*command);
  return editor ? "" : editor.error().message;
}

TEST(EditCommand, OpensAnOrganAsItIs) {
  const auto editor = open(*parse({"plate"}));
  ASSERT_TRUE(editor.ok());
  EXPECT_EQ(editor->organ(), *catalogue::load_organ("plate"));
  EXPECT_FALSE(editor->has_unsaved_changes());
}

TEST(EditCommand, ABuiltInOrganGoesBeforeAFolderOfItsName) {
  const auto before = fs::current_path();
  const auto folder = fs::path(::testing::TempDir()) / "edit_command_folder";
  fs::create_directories(folder / "plate");
  fs::current_path(folder);
  const auto editor = open(*parse({"plate"}));
  fs::current_path(before);
  ASSERT_TRUE(editor.ok()) << editor.error().message;
  EXPECT_EQ(editor->organ(), *catalogue::load_organ("plate"));
}

TEST(EditCommand, ReleasesBeforeItHolds) {
  const auto editor = open(*parse({"--hold", "y=0..,surface", "--release", "all", "lattice"}));
  ASSERT_TRUE(editor.ok()) << editor.error().message;
  const auto& organ = editor->organ();
  EXPECT_FALSE(organ.fixed_nodes.empty());
  for (const NodeIndex node : organ.fixed_nodes) {
    EXPECT_GE(organ.mesh.rest_positions[node.value].y, -1e-6);
    EXPECT_EQ(organ.mesh.is_surface_node[node.value], 1);
  }
}

TEST(EditCommand, MakesRegionsAndGivesThemMaterials) {
  const auto editor =
      open(*parse({"elastic-liver", "--region", "a:x=0..", "--region", "b: c:x=..-40", "--give",
                   "a:human_liver_nava2008", "--give", "b: c:20000", "--material", "3000"}));
  ASSERT_TRUE(editor.ok()) << editor.error().message;
  const auto& organ = editor->organ();
  ASSERT_EQ(organ.regions.size(), 2u);
  EXPECT_EQ(organ.regions[0].material.measured.name, "human_liver_nava2008");
  EXPECT_EQ(organ.regions[1].name, "b: c");
  EXPECT_EQ(organ.regions[1].material.young_modulus_pa, 20000);
  EXPECT_EQ(organ.material.young_modulus_pa, 3000);
  EXPECT_TRUE(organ.material.has_averaged_strain);
}

TEST(EditCommand, RefusesInOneLineThatNamesTheOption) {
  const auto names = [](const std::string& message, const char* option) {
    return message.find(option) != std::string::npos && message.find('\n') == std::string::npos;
  };
  EXPECT_TRUE(names(refusal({"plate", "--hold", "y=5"}), "--hold"));
  EXPECT_TRUE(names(refusal({"plate", "--hold", "y=1900.."}), "--hold"));
  EXPECT_TRUE(names(refusal({"plate", "--release", "some"}), "--release"));
  EXPECT_TRUE(names(refusal({"plate", "--region", "lump"}), "--region"));
  EXPECT_TRUE(names(refusal({"plate", "--region", ":all"}), "--region"));
  EXPECT_TRUE(names(refusal({"plate", "--region", "a:all", "--region", "a:all"}), "--region"));
  EXPECT_TRUE(names(refusal({"plate", "--give", "a:1000"}), "--give"));
  EXPECT_TRUE(names(refusal({"plate", "--material", "0"}), "--material"));
  EXPECT_TRUE(names(refusal({"plate", "--material", "cheese"}), "--material"));
  EXPECT_TRUE(names(refusal({"lattice", "--material", "human_liver_nava2008"}), "--material"));
  EXPECT_TRUE(names(refusal({"plate", "--unit", "mm"}), "--unit"));
  EXPECT_TRUE(names(refusal({"none.organ"}), "none.organ"));
  EXPECT_FALSE(parse({}).ok());
}

TEST(EditCommand, AMeshIsReadInItsUnit) {
  const auto file = fs::path(::testing::TempDir()) / "edit_command_tet.mesh";
  std::ofstream(file) << "MeshVersionFormatted 1\nDimension 3\nVertices\n4\n0 0 0 0\n10 0 0 0\n"
                         "0 10 0 0\n0 0 10 0\nTetrahedra\n1\n1 2 3 4 0\nEnd\n";
  const auto editor = open(*parse({file.string(), "--unit", "mm"}));
  ASSERT_TRUE(editor.ok()) << editor.error().message;
  EXPECT_NEAR(mesh::total_volume(editor->organ().mesh), 1e-6 / 6, 1e-12);
}

TEST(EditCommand, TheSizeOfTheWindowIsChecked) {
  EXPECT_EQ(*window_size(*parse({"plate", "--size", "800x600"})), (std::pair{800, 600}));
  for (const char* size : {"800", "800x", "x600", "80x60", "800x600x", "9000x600"})
    EXPECT_FALSE(window_size(*parse({"plate", "--size", size})).ok()) << size;
}

TEST(EditCommand, SavesWithoutLosingAFile) {
  const auto file = fs::path(::testing::TempDir()) / "edit_command.organ";
  fs::remove(file);
  auto command = *parse({"plate", "--out", file.string(), "--release", "all"});
  const auto editor = open(command);
  ASSERT_TRUE(editor.ok());
  ASSERT_TRUE(save(command, *editor).ok());
  EXPECT_EQ(*organ::read_organ(file), editor->organ());
  const auto again = save(command, *editor);
  ASSERT_FALSE(again.ok());
  EXPECT_NE(again.error().message.find("--replace"), std::string::npos);
  command.replaces = true;
  EXPECT_TRUE(save(command, *editor).ok());
}

}  // namespace
}  // namespace trocar::edit_command
