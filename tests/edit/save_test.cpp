// A saved organ is what was edited, to the bit, and no file is lost.

#include "server/organs/edit/save.h"

#include <gtest/gtest.h>

#include <fstream>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/edit/editor.h"
#include "server/organs/organ/organ_file.h"

namespace trocar::edit {
namespace {

namespace fs = std::filesystem;

class Save : public ::testing::Test {
 protected:
  Save() {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  static std::string bytes_of_file(const fs::path& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  const fs::path folder_ =
      fs::path(::testing::TempDir()) /
      ("save_" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
};

TEST_F(Save, AnUntouchedOrganIsTheSameFile) {
  const auto organ = catalogue::make_plate();
  ASSERT_TRUE(organ::write_organ(folder_ / "plate.organ", organ).ok());
  auto read = organ::read_organ(folder_ / "plate.organ");
  ASSERT_TRUE(read.ok());
  const Editor editor(std::move(*read));
  ASSERT_TRUE(save(editor.organ(), folder_ / "again.organ", Replace::Refuse).ok());
  EXPECT_EQ(bytes_of_file(folder_ / "again.organ"), bytes_of_file(folder_ / "plate.organ"));
}

TEST_F(Save, AnEditedOrganComesBackAsItWasEdited) {
  Editor editor(*catalogue::make_liver(1000));
  const auto first = editor.organ();
  editor.hold(std::vector{NodeIndex(1), NodeIndex(5)});
  const auto surface = first.mesh.surface_nodes;
  ASSERT_TRUE(editor
                  .add_region("all",
                              [&] {
                                std::vector<NodeIndex> all;
                                for (std::size_t i = 0; i < first.mesh.node_count(); ++i)
                                  all.push_back(NodeIndex(i));
                                return all;
                              }())
                  .ok());
  ASSERT_TRUE(editor.use_measured(0, material::measured_materials().front()).ok());
  ASSERT_TRUE(save(editor.organ(), folder_ / "edited.organ", Replace::Refuse).ok());
  const auto read = organ::read_organ(folder_ / "edited.organ");
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(*read, editor.organ());
  EXPECT_EQ(organ::organ_hash(*read), organ::organ_hash(editor.organ()));
  EXPECT_EQ(read->mesh, first.mesh);
  EXPECT_EQ(read->node_masses_kg, first.node_masses_kg);
  EXPECT_TRUE(editor.has_unsaved_changes());
  editor.set_saved();
  EXPECT_FALSE(editor.has_unsaved_changes());
  editor.undo();
  EXPECT_TRUE(editor.has_unsaved_changes());
}

TEST_F(Save, AsksBeforeAnotherFileIsReplaced) {
  const auto organ = catalogue::make_plate();
  const auto file = folder_ / "mine.organ";
  std::ofstream(file) << "precious";
  const auto refused = save(organ, file, Replace::Refuse);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::Refused);
  EXPECT_EQ(bytes_of_file(file), "precious");
  EXPECT_TRUE(save(organ, file, Replace::Allow).ok());
  EXPECT_TRUE(organ::read_organ(file).ok());
}

TEST_F(Save, RefusesOtherNamesAndPlaces) {
  const auto organ = catalogue::make_plate();
  EXPECT_FALSE(save(organ, folder_ / "plate.msh", Replace::Refuse).ok());
  EXPECT_FALSE(save(organ, folder_ / "none" / "plate.organ", Replace::Refuse).ok());
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(Save, FindsAFreeName) {
  const auto before = fs::current_path();
  fs::current_path(folder_);
  EXPECT_EQ(free_name("scans/spleen.stl"), "spleen.organ");
  std::ofstream("spleen.organ") << "";
  EXPECT_EQ(free_name("spleen.organ"), "spleen-edited.organ");
  std::ofstream("spleen-edited.organ") << "";
  EXPECT_EQ(free_name("spleen.organ"), "spleen-edited-2.organ");
  fs::current_path(before);
}

}  // namespace
}  // namespace trocar::edit
