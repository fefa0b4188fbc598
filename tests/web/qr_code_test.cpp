#include "server/web/site/qr_code.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace trocar::site {
namespace {

TEST(QrCodeTest, HasTheMarksOfTheStandard) {
  const auto code = QrCode::of("https://192.168.1.20:7691/#join=7K3M-9QXZ-4T2B-WN8C&role=surgeon");
  ASSERT_TRUE(code);
  EXPECT_EQ((code->width() - 17) % 4, 0);
  EXPECT_EQ(code->digits().size(), static_cast<std::size_t>(code->width() * code->width()));
  // A square of seven with a light ring in three corners; every second module between two of them.
  const int last = code->width() - 7;
  for (const auto& [row, column] : {std::pair(0, 0), {0, last}, {last, 0}})
    for (int i = 0; i < 7; ++i) {
      EXPECT_TRUE(code->is_dark(row, column + i));
      EXPECT_EQ(code->is_dark(row + 1, column + i), i == 0 || i == 6);
    }
  for (int i = 7; i < last; ++i) EXPECT_EQ(code->is_dark(6, i), i % 2 == 0);
  EXPECT_FALSE(code->is_dark(-1, 0));
  EXPECT_FALSE(code->is_dark(0, code->width()));
  const auto lines = code->for_terminal();
  EXPECT_EQ(std::ranges::count(lines, '\n'), (code->width() + 8 + 1) / 2);
}

TEST(QrCodeTest, IsNotMadeOfWhatDoesNotFit) {
  EXPECT_FALSE(QrCode::of(""));
  EXPECT_FALSE(QrCode::of(std::string("a\0b", 3)));
  EXPECT_TRUE(QrCode::of(std::string(2331, 'x')));
  EXPECT_FALSE(QrCode::of(std::string(2332, 'x')));
}

}  // namespace
}  // namespace trocar::site
