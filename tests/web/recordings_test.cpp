#include "server/web/site/recordings.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

#include "common/base/json.h"

namespace trocar::site {
namespace {

namespace fs = std::filesystem;

class RecordingsTest : public ::testing::Test {
 protected:
  RecordingsTest() {
    fs::create_directories(folder_ / "below");
    write(root_ / "secret.mcap", "outside");
    write(folder_ / "a.mcap", "0123456789");
    write(folder_ / "notes.txt", "no recording");
    write(folder_ / "below/b.mcap", "below");
    fs::create_symlink(root_ / "secret.mcap", folder_ / "link.mcap");
    fs::create_directories(folder_ / "folder.mcap");
  }
  ~RecordingsTest() override { fs::remove_all(root_); }

  static void write(const fs::path& path, const std::string& text) { std::ofstream(path) << text; }

  const fs::path root_ =
      fs::temp_directory_path() / ("trocar-recordings-" + std::to_string(::getpid()));
  const fs::path folder_ = root_ / "served";
};

TEST_F(RecordingsTest, ListsRecordingsAlone) {
  const auto recordings = Recordings::open(folder_);
  ASSERT_TRUE(recordings.ok());
  const auto list = Json::parse(recordings->list());
  ASSERT_EQ(list.size(), 1u);
  EXPECT_EQ(list[0]["name"], "a.mcap");
  EXPECT_EQ(list[0]["bytes"], 10);
}

TEST_F(RecordingsTest, NamesWhatIsLeftOut) {
  const auto recordings = Recordings::open(folder_);
  ASSERT_TRUE(recordings.ok());
  EXPECT_TRUE(recordings->left_out().empty());
  write(folder_ / "b c.mcap", "");
  write(folder_ / "\u00dcbung.mcap", "");
  EXPECT_EQ(recordings->left_out(), (std::vector<std::string>{"b c.mcap", "\u00dcbung.mcap"}));
  EXPECT_EQ(Json::parse(recordings->list()).size(), 1u);
}

TEST_F(RecordingsTest, ReadsParts) {
  const auto recordings = Recordings::open(folder_);
  ASSERT_TRUE(recordings.ok());
  const auto recording = recordings->find("a.mcap");
  ASSERT_NE(recording, nullptr);
  EXPECT_EQ(recording->size(), 10u);
  EXPECT_EQ(recording->read(3, 4), "3456");
  EXPECT_EQ(recording->read(8, 10), "89");
  EXPECT_EQ(recording->read(20, 10), "");
}

TEST_F(RecordingsTest, NothingLeadsOutOfTheFolder) {
  const auto recordings = Recordings::open(folder_);
  ASSERT_TRUE(recordings.ok());
  for (const auto* name :
       {"../secret.mcap", "/etc/passwd", "link.mcap", "below/b.mcap", "folder.mcap", "notes.txt",
        "", ".mcap", "..mcap", "%2e%2e/secret.mcap", "a.mcap/", "a.mcap\n", "missing.mcap"})
    EXPECT_EQ(recordings->find(name), nullptr) << name;
  EXPECT_EQ(recordings->find(std::string("a.mcap\0.mcap", 12)), nullptr);
  EXPECT_EQ(recordings->find(std::string(5000, 'a') + ".mcap"), nullptr);
}

TEST_F(RecordingsTest, AFolderThatIsNoneIsAnError) {
  EXPECT_FALSE(Recordings::open(folder_ / "a.mcap").ok());
  EXPECT_FALSE(Recordings::open(folder_ / "none").ok());
}

}  // namespace
}  // namespace trocar::site
