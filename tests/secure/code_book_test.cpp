// The book of codes on disk: what a thief of it has, and what survives a restart.

#include "server/session/access/code_book.h"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "common/secure/digest.h"
#include "common/secure/private_files.h"
#include "tests/secure/folder.h"

namespace trocar::access {
namespace {

constexpr std::uint16_t kPort = 7690;
constexpr std::int64_t kNow = 1000;

TEST(CodeBook, keeps_neither_code_nor_anything_that_gives_it_away) {
  const testing::Folder folder;
  auto book = *CodeBook::open(folder.path(), kPort, false, kNow);
  const auto secret = *book.issue(wire::Role::Surgeon, kNow + 10, -1);
  const auto file = folder.path() / "codes-7690.json";
  EXPECT_EQ(testing::mode_of(file), 0600u);
  EXPECT_EQ(testing::mode_of(folder.path() / "codes.key"), 0600u);
  const auto text = *secure::read_private_file(file);
  EXPECT_EQ(text.find(secure::to_hex(secret)), std::string::npos);
  EXPECT_EQ(text.find(secure::to_hex(secure::sha256(secret))), std::string::npos);
  // With another key the same file knows no code: the key does not lie in it.
  const testing::Folder thief;
  ASSERT_TRUE(secure::write_private_file(thief.path() / "codes-7690.json", text).ok());
  auto stolen = *CodeBook::open(thief.path(), kPort, true, kNow);
  EXPECT_EQ(stolen.entries().size(), 1u);
  EXPECT_EQ(stolen.check(secret, kNow).state, CodeState::Wrong);
}

TEST(CodeBook, codes_end_with_the_server_unless_they_are_kept) {
  const testing::Folder folder;
  secure::HalfCode kept{}, spent{}, old{};
  {
    auto book = *CodeBook::open(folder.path(), kPort, true, kNow);
    kept = *book.issue(wire::Role::Observer, kNow + 1000, 2);
    spent = *book.issue(wire::Role::Surgeon, kNow + 1000, 1);
    old = *book.issue(wire::Role::Surgeon, kNow + 5, -1);
    EXPECT_TRUE(book.use(book.check(kept, kNow).id));
    EXPECT_TRUE(book.use(book.check(spent, kNow).id));
    EXPECT_FALSE(book.use(book.check(spent, kNow).id));
    EXPECT_EQ(book.check(spent, kNow).state, CodeState::UsedUp);
  }
  {
    auto again = *CodeBook::open(folder.path(), kPort, true, kNow + 10);
    EXPECT_EQ(again.check(kept, kNow + 10).state, CodeState::Good);
    EXPECT_EQ(again.check(kept, kNow + 10).role, wire::Role::Observer);
    EXPECT_EQ(again.entries().front().uses_left, 1);
    EXPECT_EQ(again.check(spent, kNow + 10).state, CodeState::Wrong) << "no longer known";
    EXPECT_EQ(again.check(old, kNow + 10).state, CodeState::Wrong);
  }
  auto fresh = *CodeBook::open(folder.path(), kPort, false, kNow);
  EXPECT_EQ(fresh.check(kept, kNow).state, CodeState::Wrong);
}

TEST(CodeBook, revoking_a_code_or_a_role_reaches_the_server_that_runs) {
  const testing::Folder folder;
  auto book = *CodeBook::open(folder.path(), kPort, false, kNow);
  const auto first = *book.issue(wire::Role::Surgeon, kNow + 10, -1);
  const auto second = *book.issue(wire::Role::Surgeon, kNow + 10, -1);
  const auto watcher = *book.issue(wire::Role::Observer, kNow + 10, 5);
  auto host = *CodeBook::open_running(folder.path(), kPort);
  EXPECT_EQ(*host.revoke(secure::to_text({{}, first}), false), 1u);
  book.refresh();
  EXPECT_EQ(book.check(first, kNow).state, CodeState::Revoked);
  EXPECT_EQ(book.check(second, kNow).state, CodeState::Good);
  EXPECT_EQ(*host.revoke("surgeon", false), 1u);
  // A use is taken of what the file says now, so it does not undo what was revoked meanwhile.
  EXPECT_TRUE(book.use(book.check(watcher, kNow).id));
  EXPECT_EQ(book.check(second, kNow).state, CodeState::Revoked);
  EXPECT_FALSE(host.revoke("surgeon", false).ok()) << "nothing is left to revoke";
  EXPECT_FALSE(host.revoke("nurse", false).ok());
  EXPECT_FALSE(CodeBook::open_running(folder.path(), 1).ok());

  const auto spoilt = book.check(second, kNow).id;
  EXPECT_FALSE(book.puts_out(spoilt));
  EXPECT_EQ(*host.revoke(secure::to_text({{}, second}), true), 1u) << "revoked, but not put out";
  book.refresh();
  EXPECT_TRUE(book.puts_out(spoilt));
  EXPECT_FALSE(book.puts_out(book.check(first, kNow).id));
  EXPECT_FALSE(book.puts_out(0));

  const auto another = *host.issue(wire::Role::Surgeon, kNow + 10, -1);
  book.refresh();
  EXPECT_EQ(book.check(another, kNow).state, CodeState::Good);
  EXPECT_EQ(book.check(first, kNow).state, CodeState::Revoked);
}

TEST(CodeBook, numbers_that_no_code_has_are_refused_by_name) {
  const std::string code =
      R"({"role": "surgeon", "hmac": ")" + std::string(64, 'a') +
      R"(", "expires": 9, "uses_left": -1, "revoked": false, "puts_out": false, "id": )";
  const auto read = [&](const std::string& version, const std::string& id) {
    return parse_codes(R"({"version": )" + version + R"(, "codes": [)" + code + id + "}]}");
  };
  ASSERT_TRUE(read("1", "4294967295").ok()) << read("1", "4294967295").error().message;
  for (const char* id : {"4294967296", "-1", "1.5", "1e99", "true"}) {
    const auto entries = read("1", id);
    ASSERT_FALSE(entries.ok()) << id;
    EXPECT_EQ(entries.error().message, "id is no whole number in its range") << id;
  }
  EXPECT_FALSE(read("18888888444444444444", "1").ok());
}

TEST(CodeBook, a_damaged_file_revokes_and_a_damaged_start_says_so) {
  const testing::Folder folder;
  const auto file = folder.path() / "codes-7690.json";
  auto book = *CodeBook::open(folder.path(), kPort, false, kNow);
  const auto secret = *book.issue(wire::Role::Surgeon, kNow + 10, -1);
  for (const char* text : {"", "{}", "[1]", "{\"version\": 1, \"codes\": [{\"id\": \"x\"}]}",
                           "{\"version\": 2, \"codes\": []}"}) {
    ASSERT_TRUE(secure::write_private_file(file, text).ok());
    const auto opened = CodeBook::open(folder.path(), kPort, true, kNow);
    ASSERT_FALSE(opened.ok()) << text;
    EXPECT_NE(opened.error().message.find("codes-7690.json"), std::string::npos);
  }
  book.refresh();
  EXPECT_EQ(book.check(secret, kNow).state, CodeState::Wrong);
}

}  // namespace
}  // namespace trocar::access
