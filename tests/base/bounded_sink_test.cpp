#include "common/base/bounded_sink.h"

#include <gtest/gtest.h>
#include <spdlog/logger.h>
#include <spdlog/sinks/ostream_sink.h>

#include <algorithm>
#include <sstream>

namespace trocar::log {
namespace {

TEST(BoundedSink, LeavesOutWhatIsTooMuchAndSaysSo) {
  std::ostringstream out;
  std::uint64_t clock_ns = 0;
  auto inner = std::make_shared<spdlog::sinks::ostream_sink_mt>(out);
  spdlog::logger logger("test", std::make_shared<BoundedSink>(inner, [&] { return clock_ns; }));
  logger.set_level(spdlog::level::debug);
  logger.set_pattern("%l %v");
  const auto lines = [&] {
    const auto text = out.str();
    return std::ranges::count(text, '\n');
  };
  for (int i = 0; i < 5000; ++i) logger.info("joined");
  EXPECT_EQ(lines(), 300);
  logger.error("lost");
  logger.debug("detail");
  EXPECT_EQ(lines(), 303) << "with the line that says how many were left out";
  EXPECT_NE(
      out.str().find("warning 4700 lines were left out before this one: too many\nerror lost"),
      std::string::npos);
  clock_ns += 1'000'000'000;
  for (int i = 0; i < 5000; ++i) logger.warn("refused");
  EXPECT_EQ(lines(), 313) << "ten per second";
}

}  // namespace
}  // namespace trocar::log
