// Programs of the system stand in for others: sh, cat, sleep.

#include "common/process/process.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <thread>
#include <utility>

#include "common/process/memory_file.h"

namespace trocar::process {
namespace {

using std::chrono::milliseconds;
constexpr std::size_t kAll = 1 << 20;

Child started(const Command& command) {
  auto child = Child::start(command);
  EXPECT_TRUE(child) << child.error().message;
  return std::move(*child);
}

struct Said {
  Ending ending;
  std::string output, errors;
};

// Runs it to its end.
Said run(Command command) {
  const MemoryFile output, errors;
  command.out = output.descriptor();
  command.errors = errors.descriptor();
  const auto ending = started(command).wait();
  return {ending, output.text(kAll), errors.text(kAll)};
}

Said run_script(const std::string& script) {
  return run({.words = {"sh", "-c", script}});
}

// Starts a script that says a word when it is ready, and waits for that.
Child ready(const std::string& script) {
  const MemoryFile output;
  auto child = started({.words = {"/bin/sh", "-c", script}, .out = output.descriptor()});
  for (int i = 0; i < 3000 && output.text(kAll).empty(); ++i)
    std::this_thread::sleep_for(milliseconds(10));
  EXPECT_EQ(output.text(kAll), "ready\n");
  return child;
}

TEST(Child, arguments_are_not_read_by_a_shell) {
  EXPECT_EQ(run({.words = {"echo", "$HOME", "; touch x", "a  b"}}).output,
            "$HOME ; touch x a  b\n");
}

TEST(Child, streams_are_those_of_its_command_or_empty) {
  const MemoryFile in("what it reads");
  EXPECT_EQ(run({.words = {"cat"}, .in = in.descriptor()}).output, "what it reads");
  EXPECT_EQ(run({.words = {"cat"}}).output, "");
  const auto both = run_script("echo one; echo two >&2");
  EXPECT_EQ(both.output, "one\n");
  EXPECT_EQ(both.errors, "two\n");
}

TEST(Child, only_files_of_its_command_are_open_in_it) {
  const int ours = ::fcntl(STDOUT_FILENO, F_DUPFD, 9);  // it has no FD_CLOEXEC
  ASSERT_LT(ours, 100);
  const auto files = run_script("for i in $(seq 3 100); do [ -e /proc/$$/fd/$i ] && echo $i; done");
  EXPECT_EQ(files.output, "");
  ::close(ours);
  const MemoryFile more("a fourth one");
  EXPECT_EQ(run({.words = {"cat", "/proc/self/fd/3"}, .more = more.descriptor()}).output,
            "a fourth one");
}

TEST(Child, says_how_it_has_ended) {
  const auto exits = run_script("exit 3").ending;
  EXPECT_EQ(exits.exit_code, 3);
  EXPECT_EQ(exits.signal, 0);
  auto killed = started({.words = {"sleep", "1000"}});
  EXPECT_FALSE(killed.poll());
  killed.signal(SIGKILL);
  const auto ending = killed.wait();
  EXPECT_FALSE(ending.exit_code);
  EXPECT_EQ(ending.signal, SIGKILL);
  ASSERT_TRUE(killed.poll()) << "it still knows";
  EXPECT_EQ(killed.poll()->signal, SIGKILL);
  killed.signal(SIGKILL);  // nobody is hit
}

TEST(Child, what_cannot_be_started_is_an_error_with_its_reason) {
  for (const auto& [program, reason] : {std::pair{"/nowhere/program", "No such file or directory"},
                                        {"trocar-no-such-program", "No such file or directory"},
                                        {"/etc/passwd", "Permission denied"}}) {
    const auto child = Child::start({.words = {program}});
    ASSERT_FALSE(child) << program;
    EXPECT_EQ(child.error().code, ErrorCode::ResourceMissing);
    EXPECT_EQ(child.error().message, std::string(program) + ": cannot be started (" + reason + ")");
  }
}

TEST(Child, is_asked_to_end_and_killed_if_it_does_not) {
  auto polite = ready("trap 'exit 7' TERM; echo ready; while :; do sleep 0.01; done");
  polite.stop(std::chrono::minutes(1));
  EXPECT_EQ(polite.poll()->exit_code, 7);
  auto deaf = ready("trap '' TERM; echo ready; while :; do sleep 0.01; done");
  deaf.stop(milliseconds(50));
  EXPECT_EQ(deaf.poll()->signal, SIGKILL);
}

TEST(Child, ends_with_its_object_unless_it_is_left) {
  pid_t kept = 0, left = 0;
  {
    auto one = started({.words = {"sleep", "1000"}});
    auto other = std::move(one);
    kept = other.pid();
    auto third = started({.words = {"sleep", "1000"}});
    left = third.pid();
    third.leave();
  }
  EXPECT_NE(::kill(kept, 0), 0);
  EXPECT_EQ(::kill(left, 0), 0);
  ::kill(left, SIGKILL);
}

TEST(Child, has_no_blocked_signals_and_dies_of_a_broken_pipe) {
  sigset_t one, before;
  sigemptyset(&one);
  sigaddset(&one, SIGTERM);
  ::pthread_sigmask(SIG_BLOCK, &one, &before);
  const auto pipe_before = ::signal(SIGPIPE, SIG_IGN), hangup_before = ::signal(SIGHUP, SIG_IGN);
  const auto said = run({.words = {"grep", "-E", "^Sig(Blk|Ign)", "/proc/self/status"}});
  ::signal(SIGPIPE, pipe_before);
  ::signal(SIGHUP, hangup_before);
  sigset_t now;
  ::pthread_sigmask(SIG_SETMASK, &before, &now);
  ASSERT_EQ(said.output.substr(0, 32), "SigBlk:\t0000000000000000\nSigIgn:");
  // Those from 32 on are the C library's own.
  EXPECT_EQ(std::stoull(said.output.substr(33), nullptr, 16) & 0x7fffffff, 1u) << said.output;
  EXPECT_EQ(::sigismember(&now, SIGTERM), 1) << "ours are as they were";
}

TEST(Child, is_in_a_session_of_its_own_if_that_is_wanted) {
  EXPECT_EQ(::getsid(started({.words = {"sleep", "1000"}}).pid()), ::getsid(0));
  const auto apart = started({.words = {"sleep", "1000"}, .is_apart = true});
  EXPECT_EQ(::getsid(apart.pid()), apart.pid());
}

TEST(Child, says_all_at_the_end_of_a_log_that_is_its_owners) {
  const auto log =
      std::filesystem::temp_directory_path() / ("trocar-child-" + std::to_string(::getpid()));
  for (const char* script : {"echo one", "echo two >&2"})
    started({.words = {"sh", "-c", script}, .log = log}).wait();
  EXPECT_EQ(run({.words = {"cat", log}}).output, "one\ntwo\n");
  struct stat about {};
  ASSERT_EQ(::stat(log.c_str(), &about), 0);
  EXPECT_EQ(about.st_mode & 0777, 0600u) << "join codes stand in it";
  std::filesystem::remove(log);
  EXPECT_FALSE(Child::start({.words = {"echo"}, .log = "/nowhere/log"}));
}

TEST(MemoryFile, holds_its_text_and_gives_no_more_than_is_asked_for) {
  const std::string long_text(300'000, 'x');
  const MemoryFile file(long_text);
  EXPECT_EQ(file.text(kAll), long_text);
  EXPECT_EQ(file.text(100'000), long_text.substr(0, 100'000));
  EXPECT_EQ(MemoryFile().text(kAll), "");
}

TEST(MemoryFile, without_a_descriptor_no_child_starts) {
  rlimit before{};
  ::getrlimit(RLIMIT_NOFILE, &before);
  const rlimit none{0, before.rlim_max};
  ::setrlimit(RLIMIT_NOFILE, &none);
  const MemoryFile file;
  ::setrlimit(RLIMIT_NOFILE, &before);
  EXPECT_EQ(file.text(kAll), "");
  EXPECT_FALSE(Child::start({.words = {"echo"}, .out = file.descriptor()}));
}

TEST(Become, goes_on_as_another_program_or_says_why_not) {
  EXPECT_EXIT(become({"/bin/sh", "-c", "exit 3"}), ::testing::ExitedWithCode(3), "");
  EXPECT_EQ(become({"/nowhere/program"}).message,
            "/nowhere/program: cannot be started (No such file or directory)");
}

TEST(FindProgram, is_beside_this_one_or_on_the_path) {
  EXPECT_TRUE(find_program("process_test").ends_with("/process_test"));
  EXPECT_EQ(find_program("sh"), "sh");
}

}  // namespace
}  // namespace trocar::process
