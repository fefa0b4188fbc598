// A notice keeps what a session says of itself, and bounds what others say.

#include "common/discovery/notice.h"

#include <gtest/gtest.h>

#include "common/base/printable.h"
#include "common/discovery/finder.h"
#include "tests/support/random.h"

namespace trocar::discovery {
namespace {

const SessionNotice kLesson{
    .name = "Übung 1", .organ = "liver", .people = 12, .needs_code = true, .protocol = "1.9"};

TEST(Notice, ComesBackAsItWas) {
  for (const bool needs_code : {true, false}) {
    auto notice = kLesson;
    notice.needs_code = needs_code;
    EXPECT_EQ(from_txt(notice.name, to_txt(notice)), notice);
  }
}

TEST(Notice, IsBoundedAndPrintableWhateverIsSaid) {
  const std::vector<std::string> said{"organ=\x1b[2J" + std::string(300, 'x'),
                                      "organ=second",
                                      "people=-4",
                                      "people=7",
                                      "code=maybe",
                                      "=",
                                      "nothing",
                                      "",
                                      "protocol=\xff\xfe"};
  const auto notice = from_txt("a\nb\x07" + std::string(300, 'n'), said);
  EXPECT_LE(notice.name.size(), kMostNameBytes);
  EXPECT_LE(notice.organ.size(), kMostValueBytes);
  EXPECT_TRUE(notice.organ.starts_with("?[2J")) << "the first of equal keys counts";
  EXPECT_EQ(notice.people, 0);
  EXPECT_TRUE(notice.needs_code) << "only a plain no is a no";
  for (const auto& text : {notice.name, notice.organ, notice.protocol})
    EXPECT_TRUE(is_printable(text)) << text;
  EXPECT_EQ(from_txt("x", std::vector<std::string>{"people=99999999999999999999"}).people, 0);
  EXPECT_EQ(from_txt("x", std::vector<std::string>{"people=5000"}).people, kMostPeople);
}

TEST(Notice, RandomBytesGiveAPrintableTable) {
  trocar::testing::Random random(7);
  const auto bytes = [&random](std::size_t most) {
    std::string text(random.below(static_cast<std::uint32_t>(most)), ' ');
    for (char& c : text) c = static_cast<char>(random.below(256));
    return text;
  };
  for (int i = 0; i < 2000; ++i) {
    const std::vector<std::string> records{"organ=" + bytes(200), "people=" + bytes(5), bytes(300),
                                           "protocol=" + bytes(100)};
    const auto notice = from_txt(bytes(200), records);
    for (const auto& text : {notice.name, notice.organ, notice.protocol})
      ASSERT_TRUE(is_printable(text));
    for (const auto& record : to_txt(notice)) ASSERT_LE(record.size(), 255u);
  }
}

TEST(Notice, ATableHasARowForEach) {
  const auto table = to_table({{kLesson, "192.168.1.20", 7690}});
  EXPECT_NE(table.find("Übung 1"), std::string::npos);
  EXPECT_NE(table.find("192.168.1.20:7690\n"), std::string::npos);
  EXPECT_EQ(to_table({}), "no session announces itself on this network\n");
}

}  // namespace
}  // namespace trocar::discovery
