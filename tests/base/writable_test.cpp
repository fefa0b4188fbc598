// Long work looks first whether its end could be written, and says how far it is.

#include "common/base/writable.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "common/base/progress_line.h"
#include "common/base/text_file.h"
#include "tests/support/files.h"

namespace trocar {
namespace {

constexpr std::uint64_t kSecond = 1'000'000'000;

std::string said(const Status& status) {
  return status ? std::string() : status.error().message;
}

TEST(Writable, AFileNeedsItsFolderAndNothingIsMade) {
  const testing::TemporaryFolder folder;
  EXPECT_EQ(said(check_writable(folder.file("new"))), "");
  EXPECT_FALSE(std::filesystem::exists(folder.file("new")));
  EXPECT_EQ(said(check_writable("beside")), "");
  EXPECT_EQ(said(check_writable("/dev/null")), "");
  EXPECT_EQ(said(check_writable(folder.file("none/new"))),
            folder.file("none/new") +
                ": cannot be written, its folder is not there: make it, or name another file");
  std::filesystem::create_directories(folder.file("taken"));
  EXPECT_NE(said(check_writable(folder.file("taken"))).find("it is a folder"), std::string::npos);
  EXPECT_TRUE(write_text_file(folder.file("old"), "words"));
  EXPECT_EQ(said(check_writable(folder.file("old"))), "");
  EXPECT_NE(said(check_writable(folder.file("old/new"))), "");
}

TEST(Writable, AFolderCanBeMadeUnlessAFileIsInItsWay) {
  const testing::TemporaryFolder folder;
  EXPECT_EQ(said(check_writable_folder(folder.file("a/b/c"))), "");
  EXPECT_FALSE(std::filesystem::exists(folder.file("a")));
  EXPECT_EQ(said(check_writable_folder("out/beside")), "");
  EXPECT_TRUE(write_text_file(folder.file("file"), "words"));
  for (const char* name : {"file", "file/b", "file/b/c"}) {
    const auto message = said(check_writable_folder(folder.file(name)));
    EXPECT_TRUE(message.starts_with(folder.file(name) + ": cannot be made (")) << message;
  }
}

TEST(ProgressLine, SaysALineEveryTenSecondsWhereNobodySeesItChange) {
  ProgressLine line("program", false, 0);
  EXPECT_EQ(line.text("place", 1, 16, 3 * kSecond), "");
  EXPECT_EQ(line.text("place", 4, 16, 12 * kSecond), "program: place 4 of 16, 36 s to go\n");
  EXPECT_EQ(line.text("place", 5, 16, 15 * kSecond), "");
  EXPECT_EQ(line.text("place", 16, 16, 21 * kSecond), "");
  EXPECT_EQ(line.text("check", 1, 2, 23 * kSecond), "program: check 1 of 2, 2 s to go\n");
}

TEST(ProgressLine, IsRewrittenOnATerminal) {
  ProgressLine line("program", true, 0);
  EXPECT_EQ(line.text("place", 1, 2, kSecond), "\rprogram: place 1 of 2, 1 s to go  ");
  EXPECT_EQ(line.text("place", 2, 2, 2 * kSecond), "\rprogram: place 2 of 2, 0 s to go\n");
}

}  // namespace
}  // namespace trocar
