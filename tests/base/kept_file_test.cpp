// Files that programs write: what is there is not lost, and what failed leaves nothing.

#include "common/base/kept_file.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "common/base/text_file.h"
#include "tests/support/files.h"

namespace trocar {
namespace {

TEST(KeptFile, RecordingsAndOrgansAreNotReplaced) {
  const testing::TemporaryFolder folder;
  const auto error_of = [&](std::string_view text) {
    const auto path = folder.file("kept");
    EXPECT_TRUE(write_text_file(path, text));
    const Status status = refuse_to_replace_kept("--csv", path);
    return status ? std::string() : status.error().message;
  };
  EXPECT_EQ(error_of(std::string_view("\x89MCAP0\r\nand more", 16)),
            "--csv: " + folder.file("kept") +
                " is a recording, which would be lost: choose another name");
  EXPECT_NE(error_of("TROCARO1 and more").find("is an organ"), std::string::npos);
  EXPECT_EQ(error_of("a,b,c\n"), "");
  EXPECT_EQ(error_of(""), "");
  EXPECT_TRUE(refuse_to_replace_kept("--csv", folder.file("none")));
  EXPECT_TRUE(refuse_to_replace_kept("--csv", "/dev/full"));
}

TEST(TextFile, WhatFailedLeavesNoPart) {
  const testing::TemporaryFolder folder;
  std::filesystem::create_directories(folder.file("taken/by"));
  const Status written = write_text_file(folder.file("taken"), "words");
  ASSERT_FALSE(written);
  EXPECT_NE(written.error().message.find("directory"), std::string::npos)
      << written.error().message;
  EXPECT_FALSE(std::filesystem::exists(folder.file("taken.part")));
}

}  // namespace
}  // namespace trocar
