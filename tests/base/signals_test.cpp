#include "common/base/signals.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <array>
#include <cerrno>

namespace trocar {
namespace {

TEST(Signals, AHangupThatIsIgnoredStaysIgnored) {
  const auto before = ::signal(SIGHUP, SIG_DFL);
  EXPECT_EQ(ending_signals(), (std::vector<int>{SIGINT, SIGTERM, SIGHUP}));
  ::signal(SIGHUP, SIG_IGN);
  EXPECT_EQ(ending_signals(), (std::vector<int>{SIGINT, SIGTERM})) << "as under nohup";
  ::signal(SIGHUP, before);
}

TEST(Signals, WritingWhereNobodyReadsIsAnErrorAlone) {
  const auto before = ::signal(SIGPIPE, SIG_DFL);
  ignore_broken_pipes();
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe(ends.data()), 0);
  ::close(ends[0]);
  EXPECT_EQ(::write(ends[1], "x", 1), -1);
  EXPECT_EQ(errno, EPIPE);
  ::close(ends[1]);
  ::signal(SIGPIPE, before);
}

}  // namespace
}  // namespace trocar
