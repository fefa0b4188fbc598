#include "common/base/unfinished_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "tests/support/files.h"

namespace trocar {
namespace {

namespace fs = std::filesystem;

unsigned mode_of(const std::string& path) {
  struct stat about {};
  EXPECT_EQ(::stat(path.c_str(), &about), 0) << path;
  return about.st_mode & 0777;
}

auto files_in(const fs::path& folder) {
  return std::distance(fs::directory_iterator(folder), fs::directory_iterator());
}

TEST(WriteWholeFile, takes_the_place_of_what_is_there_with_its_own_mode) {
  const testing::TemporaryFolder folder;
  const auto path = folder.file("secret");
  std::ofstream(path) << "something that was longer than what follows";
  fs::permissions(path, fs::perms::all);
  std::ofstream(UnfinishedFile::name_for(path)) << "left by one that was killed";
  ASSERT_TRUE(write_whole_file(path, std::string("a\0b", 3), 0600));
  EXPECT_EQ(testing::load_text(path), std::string("a\0b", 3));
  EXPECT_EQ(mode_of(path), 0600u);
  EXPECT_EQ(files_in(fs::path(path).parent_path()), 1);
}

TEST(WriteWholeFile, a_link_goes_and_what_it_leads_to_stays) {
  const testing::TemporaryFolder folder;
  const auto path = folder.file("link"), other = folder.file("other");
  std::ofstream(other) << "mine";
  fs::create_symlink(other, path);
  ASSERT_TRUE(write_whole_file(path, "yours"));
  EXPECT_EQ(testing::load_text(other), "mine");
  EXPECT_FALSE(fs::is_symlink(path));
  EXPECT_EQ(testing::load_text(path), "yours");
}

TEST(WriteWholeFile, what_cannot_be_written_leaves_nothing_and_says_why) {
  const testing::TemporaryFolder folder;
  const auto nowhere = write_whole_file(folder.file("none/new"), "text");
  ASSERT_FALSE(nowhere);
  EXPECT_NE(nowhere.error().message.find("none/new: cannot be written (No such file or directory)"),
            std::string::npos)
      << nowhere.error().message;
  const auto taken = folder.file("taken");
  fs::create_directories(taken + "/child");
  ASSERT_FALSE(write_whole_file(taken, "text"));
  EXPECT_EQ(files_in(fs::path(taken).parent_path()), 1);
}

}  // namespace
}  // namespace trocar
