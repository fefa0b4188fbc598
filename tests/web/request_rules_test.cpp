#include "server/web/site/request_rules.h"

#include <gtest/gtest.h>

namespace trocar::site {
namespace {

void expect_part(std::string_view header, std::uint64_t first, std::uint64_t length) {
  const auto asked = read_range(header, 1000);
  EXPECT_EQ(asked.kind, RangeKind::Part) << header;
  EXPECT_EQ(asked.range.first, first) << header;
  EXPECT_EQ(asked.range.length, length) << header;
}

TEST(Range, IsReadAsRfc9110Says) {
  expect_part("bytes=0-0", 0, 1);
  expect_part("bytes=10-19", 10, 10);
  expect_part("bytes=900-5000", 900, 100);
  expect_part("bytes=999-", 999, 1);
  expect_part("bytes=-50", 950, 50);
  expect_part("bytes=-5000", 0, 1000);
}

TEST(Range, BeyondTheEndIsRefused) {
  for (const auto* header : {"bytes=1000-", "bytes=5000-6000", "bytes=-0"})
    EXPECT_EQ(read_range(header, 1000).kind, RangeKind::Unsatisfiable) << header;
  EXPECT_EQ(read_range("bytes=0-", 0).kind, RangeKind::Unsatisfiable);
}

TEST(Range, OfAnotherFormCountsAsNone) {
  for (const auto* header :
       {"", "bytes", "bytes=", "bytes=-", "bytes=5-1", "bytes=a-b", "bytes=1-2,4-5", "lines=1-2",
        "bytes=99999999999999999999-", "bytes= 1-2", "bytes=1--2"})
    EXPECT_EQ(read_range(header, 1000).kind, RangeKind::Whole) << header;
}

TEST(Host, IsThisServersOwn) {
  for (const auto* host : {"127.0.0.1:7691", "192.0.2.7", "[::1]:7691", "localhost:7691",
                           "Watch.Example", "watch.example:443", "box:7691", "box.local"})
    EXPECT_TRUE(is_own_host(host, "watch.example:7691", "box")) << host;
  for (const auto* host : {"", ":7691", "evil.example", "watch.example.evil.example",
                           "1.2.3.4.evil", "box.evil", "box.", "boxy"})
    EXPECT_FALSE(is_own_host(host, "watch.example:7691", "box")) << host;
  EXPECT_FALSE(is_own_host("watch.example", "", "")) << "nobody has said so";
}

TEST(Origin, IsExactlyThatOfTheHost) {
  EXPECT_TRUE(is_own_origin("https://watch.example:7691", "watch.example:7691", true));
  EXPECT_TRUE(is_own_origin("https://Watch.Example:7691", "watch.example:7691", true));
  EXPECT_TRUE(is_own_origin("http://127.0.0.1:7691", "127.0.0.1:7691", false));
  for (const auto* origin :
       {"", "null", "http://watch.example:7691", "https://watch.example",
        "https://evil-watch.example:7691", "https://watch.example:7691.evil.example",
        "https://watch.example:76910", "https://watch.example:7691/"})
    EXPECT_FALSE(is_own_origin(origin, "watch.example:7691", true)) << origin;
  EXPECT_FALSE(is_own_origin("https://", "", true));
}

TEST(SafetyHeaders, HaveStrictTransportWithTlsAlone) {
  EXPECT_EQ(safety_headers(true).size(), safety_headers(false).size() + 1);
  for (const auto& [name, value] : safety_headers(false))
    EXPECT_NE(name, "Strict-Transport-Security");
  bool has_policy = false;
  for (const auto& [name, value] : safety_headers(true)) {
    if (name != "Content-Security-Policy") continue;
    has_policy = true;
    EXPECT_EQ(value.find("unsafe-inline"), std::string_view::npos);
    EXPECT_NE(value.find("frame-ancestors 'none'"), std::string_view::npos);
  }
  EXPECT_TRUE(has_policy);
}

}  // namespace
}  // namespace trocar::site
