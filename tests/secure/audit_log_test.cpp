#include "server/session/access/audit_log.h"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/secure/folder.h"

namespace trocar::access {
namespace {

std::vector<std::string> lines_of(const std::filesystem::path& file) {
  std::vector<std::string> lines;
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

TEST(AuditLog, a_file_at_its_limit_becomes_the_old_one_and_no_line_is_cut) {
  const testing::Folder folder;
  const auto path = folder.path() / "audit.jsonl", old = folder.path() / "audit.jsonl.1";
  auto log = AuditLog::open(path, 1000);
  ASSERT_TRUE(log.ok());
  for (int i = 0; i < 50; ++i)
    log->write({.event = "join", .name = "Ada " + std::to_string(i), .role = "surgeon"});
  const auto before = lines_of(old), now = lines_of(path);
  ASSERT_FALSE(before.empty());
  ASSERT_FALSE(now.empty());
  EXPECT_LE(std::filesystem::file_size(path), 1000u);
  EXPECT_LE(std::filesystem::file_size(old), 1000u);
  EXPECT_NE(now.back().find("Ada 49"), std::string::npos);
  EXPECT_NE(before.back().find("Ada " + std::to_string(50 - now.size() - 1)), std::string::npos);
  EXPECT_EQ(testing::mode_of(path), 0600u);
}

TEST(AuditLog, goes_on_with_the_file_that_is_there) {
  const testing::Folder folder;
  const auto path = folder.path() / "audit.jsonl";
  for (int start = 0; start < 3; ++start) {
    auto log = AuditLog::open(path);
    ASSERT_TRUE(log.ok());
    log->write({.event = "join", .name = "Ada", .role = "surgeon"});
  }
  EXPECT_EQ(lines_of(path).size(), 3u);
}

}  // namespace
}  // namespace trocar::access
