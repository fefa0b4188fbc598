#include "common/base/signals.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>

#include "common/base/program.h"

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

// The child does this with the second signal, and with the third after its time is over.
int exit_of_ended_thrice(unsigned seconds) {
  const pid_t child = ::fork();
  if (child == 0) {
    ignore_ending_signals(seconds);
    for (const int number : ending_signals()) ::raise(number);
    ::raise(SIGTERM);
    while (::pause() != -1 || errno != EINTR) {
    }
    ::raise(SIGTERM);
    ::_exit(0);
  }
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  return WIFSIGNALED(status) ? WTERMSIG(status) : -1;
}

TEST(Signals, AnEndInOrderIsNotCutShortUntilItsTimeIsOver) {
  EXPECT_EQ(exit_of_ended_thrice(1), SIGTERM);
}

TEST(Signals, AFileThatMayNotGrowIsAnErrorAlone) {
  const auto before = ::signal(SIGXFSZ, SIG_DFL);
  begin_program("base_test");
  std::FILE* file = std::tmpfile();
  rlimit room{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &room), 0);
  const rlimit none{0, room.rlim_max};
  ::setrlimit(RLIMIT_FSIZE, &none);
  EXPECT_EQ(::write(::fileno(file), "x", 1), -1);
  EXPECT_EQ(errno, EFBIG);
  ::setrlimit(RLIMIT_FSIZE, &room);
  std::fclose(file);
  ::signal(SIGXFSZ, before);
}

}  // namespace
}  // namespace trocar
