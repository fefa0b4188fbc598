// The form of join codes: what is read, what is folded, what is refused.

#include "common/secure/join_code.h"

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace trocar::secure {
namespace {

JoinCode random_code(testing::Random& random) {
  JoinCode code;
  for (auto& byte : code.certificate) byte = static_cast<std::uint8_t>(random.below(256));
  for (auto& byte : code.secret) byte = static_cast<std::uint8_t>(random.below(256));
  return code;
}

TEST(JoinCode, what_is_written_is_read_again) {
  testing::Random random(1);
  for (int i = 0; i < 2000; ++i) {
    const auto code = random_code(random);
    const auto text = to_text(code);
    ASSERT_EQ(text.size(), 19u);
    const auto read = parse_join_code(text);
    ASSERT_TRUE(read.ok()) << text;
    EXPECT_EQ(*read, code) << text;
  }
}

TEST(JoinCode, case_hyphens_spaces_and_letters_like_digits_do_not_matter) {
  testing::Random random(2);
  for (int i = 0; i < 2000; ++i) {
    const auto code = random_code(random);
    std::string spoken;
    for (char c : to_text(code)) {
      if (c == '-' && random.below(2)) continue;
      if (c == '0' && random.below(2)) c = random.below(2) ? 'O' : 'o';
      if (c == '1' && random.below(2)) c = "IiLl"[random.below(4)];
      if (random.below(2) && c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
      spoken += c;
      if (random.below(5) == 0) spoken += ' ';
    }
    const auto read = parse_join_code(spoken);
    ASSERT_TRUE(read.ok()) << spoken;
    EXPECT_EQ(*read, code) << spoken;
  }
}

TEST(JoinCode, a_code_with_one_wrong_character_is_another_code_or_none) {
  testing::Random random(3);
  for (int i = 0; i < 500; ++i) {
    const auto code = random_code(random);
    auto text = to_text(code);
    const auto at = random.below(19);
    if (text[at] == '-') continue;
    const char before = text[at];
    text[at] = static_cast<char>(' ' + 1 + random.below(94));
    const auto read = parse_join_code(text);
    if (read.ok() && *read == code) {
      EXPECT_TRUE((before == '0' && (text[at] == 'o' || text[at] == 'O' || text[at] == '0')) ||
                  (before == '1' && std::string("1iIlL").find(text[at]) != std::string::npos) ||
                  std::toupper(text[at]) == before)
          << text;
    }
  }
}

TEST(JoinCode, other_lengths_and_letters_are_refused_in_a_printable_line) {
  for (const char* text : {"", "7K3M", "7K3M-9QXZ-4T2B-WN8", "7K3M-9QXZ-4T2B-WN8CC",
                           "UUUU-9QXZ-4T2B-WN8C", "7K3M-9QXZ-4T2B-WN8!", "7K3M_9QXZ_4T2B_WN8C",
                           "7K3M-9QXZ-4T2B-WN\x1b"
                           "C"}) {
    const auto read = parse_join_code(text);
    ASSERT_FALSE(read.ok()) << text;
    EXPECT_NE(read.error().message.find("join code"), std::string::npos);
    for (const char c : read.error().message) EXPECT_TRUE(c >= ' ' && c <= '~');
  }
}

TEST(JoinCode, links_say_where_the_server_is) {
  testing::Random random(4);
  const auto code = random_code(random);
  const auto read = parse_invitation(to_link("[fe80::1]:7690", code));
  ASSERT_TRUE(read.ok());
  EXPECT_EQ(read->server, "[fe80::1]:7690");
  EXPECT_EQ(read->code, code);
  const auto alone = parse_invitation(to_text(code));
  ASSERT_TRUE(alone.ok());
  EXPECT_TRUE(alone->server.empty());
  for (const char* text : {"trocar://", "trocar:///7K3M-9QXZ-4T2B-WN8C", "trocar://host:1",
                           "trocar://a b/7K3M-9QXZ-4T2B-WN8C", "http://a/7K3M-9QXZ-4T2B-WN8C",
                           "trocar://host:1/7K3M-9QXZ-4T2B-WN8C/more"})
    EXPECT_FALSE(parse_invitation(text).ok()) << text;
}

}  // namespace
}  // namespace trocar::secure
