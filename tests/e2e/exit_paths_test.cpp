// However a client ends, or is cut off, in full contact with the liver: what the hand feels is zero
// within the time of what watches it. The programs are the real ones, the device is a fake behind
// its real interface.

#include <gtest/gtest.h>

#include <csignal>

#include "common/base/timing.h"
#include "tests/e2e/held_devices.h"
#include "tests/e2e/programs.h"

namespace trocar::e2e {
namespace {

constexpr double kContact_n = 0.25;
// A device that is not written to lets go after 100 ms, and so do we by ourselves.
constexpr double kWatchdog_ms = 100;
// Without answers: 250 ms, then another 250 ms, and the frame on its way.
constexpr double kNoAnswer_ms = 500 + 20;

class ExitPaths : public ::testing::Test {
 protected:
  Program start_client(const HeldDevice& device, const std::string& address = {},
                       const std::vector<std::string>& extra = {}) {
    // The name of somebody who did not say goodbye is kept for a while.
    std::vector<std::string> arguments{"--no-render",
                                       "--name",
                                       "Anna" + std::to_string(++clients_),
                                       "--device",
                                       device.name(),
                                       "--join",
                                       join_code(),
                                       "--server",
                                       address.empty() ? session_.address() : address,
                                       "--summary",
                                       (session_.folder / "Anna.json").string()};
    arguments.insert(arguments.end(), extra.begin(), extra.end());
    return Program("trocar-client", arguments, log());
  }
  std::string join_code() const {
    const auto server = session_.folder / "server.log";
    EXPECT_TRUE(
        wait_until([&] { return read_text(server).find("observer ") != std::string::npos; }, 20));
    return find_invitation(server, "surgeon").code;
  }
  std::filesystem::path log() const { return session_.folder / "Anna.log"; }
  void press(HeldDevice& device) {
    ASSERT_TRUE(
        wait_until([&] { return read_text(log()).find("1000 times") != std::string::npos; }, 60))
        << read_text(log());
    ASSERT_TRUE(device.press_until(kContact_n)) << device.force_n() << '\n' << read_text(log());
  }
  // Sends the client a signal in contact; its exit code.
  int end_by(int signal, HeldHaply& haply) {
    auto client = start_client(haply);
    press(haply);
    const auto since_ns = monotonic_ns();
    client.signal(signal);
    const int code = client.wait(20);
    // The service may still have to read what was sent.
    EXPECT_TRUE(wait_until([&] { return haply.released_after_ms(since_ns).has_value(); }, 2));
    EXPECT_LE(haply.released_after_ms(since_ns).value_or(1e9), kWatchdog_ms);
    return code;
  }

  Session session_{"liver"};
  int clients_ = 0;
};

TEST_F(ExitPaths, ASignalToStopLetsGoAndSaysGoodbye) {
  for (const int signal : {SIGTERM, SIGINT, SIGHUP}) {
    HeldHaply haply;
    EXPECT_EQ(end_by(signal, haply), 0) << read_text(log());
    EXPECT_TRUE(haply.was_closed()) << "as the protocol of the service wants it";
  }
}

TEST_F(ExitPaths, ACrashLetsGo) {
  for (const int signal : {SIGSEGV, SIGABRT, SIGQUIT}) {
    HeldHaply haply;
    EXPECT_EQ(end_by(signal, haply), 128 + signal);
  }
}

TEST_F(ExitPaths, AKilledClientEndsItsConnection) {
  HeldHaply haply;
  EXPECT_EQ(end_by(SIGKILL, haply), 128 + SIGKILL);
}

TEST_F(ExitPaths, TheEndOfItsSecondsLetsGo) {
  HeldHaply haply;
  auto client = start_client(haply, {}, {"--seconds", "12"});
  press(haply);
  EXPECT_EQ(client.wait(30), 0);
  EXPECT_EQ(haply.force_n(), 0);
  EXPECT_TRUE(haply.was_closed());
}

TEST_F(ExitPaths, AKilledServerLetsGo) {
  HeldHaply haply;
  auto client = start_client(haply);
  press(haply);
  const auto since_ns = monotonic_ns();
  session_.server().signal(SIGKILL);
  ASSERT_TRUE(wait_until([&] { return haply.force_n() == 0; }, 10));
  EXPECT_LE(haply.released_after_ms(since_ns).value_or(1e9), kNoAnswer_ms);
  EXPECT_TRUE(client.is_running()) << "it waits for the server to come back";
  const auto messages = haply.message_count();
  EXPECT_TRUE(wait_until([&] { return haply.message_count() > messages + 100; }, 10));
  EXPECT_EQ(haply.force_n(), 0);
}

TEST_F(ExitPaths, ANetworkThatIsCutLetsGoAndTheTouchComesBack) {
  Program network("trocar-impair",
                  {"--to", session_.address(), "--listen", "127.0.0.1:0", "--ready-file",
                   (session_.folder / "network").string()},
                  session_.folder / "network.log");
  ASSERT_TRUE(wait_for_file(session_.folder / "network", 20));
  HeldHaply haply;
  auto client = start_client(haply, ready_address(session_.folder / "network"));
  press(haply);
  const auto since_ns = monotonic_ns();
  network.signal(SIGSTOP);
  ASSERT_TRUE(wait_until([&] { return haply.force_n() == 0; }, 10));
  EXPECT_LE(haply.released_after_ms(since_ns).value_or(1e9), kNoAnswer_ms);
  const auto messages = haply.message_count();
  EXPECT_TRUE(wait_until([&] { return haply.message_count() > messages + 2000; }, 20))
      << "the loop goes on";
  EXPECT_EQ(haply.force_n(), 0);
  network.signal(SIGCONT);
  // A tool that was silent for so long has to come out before it touches again.
  haply.go_out();
  EXPECT_TRUE(wait_until([&] { return haply.force_n() == 0; }, 10));
  EXPECT_TRUE(haply.press_until(kContact_n)) << haply.force_n();
  client.signal(SIGTERM);
  EXPECT_EQ(client.wait(20), 0);
}

TEST_F(ExitPaths, ADeviceThatIsUnpluggedFeelsNothingAndComesBack) {
  HeldHaply haply;
  auto client = start_client(haply);
  press(haply);
  const auto since_ns = monotonic_ns();
  haply.unplug();
  ASSERT_TRUE(wait_until([&] { return haply.force_n() == 0; }, 10));
  EXPECT_LE(haply.released_after_ms(since_ns).value_or(1e9), kWatchdog_ms);
  EXPECT_TRUE(wait_until(
      [&] { return read_text(log()).find("its tool rests until it is back") != std::string::npos; },
      10))
      << read_text(log());
  EXPECT_TRUE(client.is_running());
  haply.plug_in();
  const auto messages = haply.message_count();
  ASSERT_TRUE(wait_until([&] { return haply.message_count() > messages + 500; }, 20));
  haply.go_out();
  EXPECT_TRUE(haply.press_until(kContact_n)) << haply.force_n();
  client.signal(SIGTERM);
  EXPECT_EQ(client.wait(20), 0);
  EXPECT_EQ(haply.force_n(), 0);
}

// The library is in the client's own process, so no more is written after its death. Until a
// crashed program is dead, its device thread writes zero.
TEST_F(ExitPaths, AForceDimensionDeviceIsLetGoToo) {
  for (const int signal : {SIGTERM, SIGSEGV, SIGKILL}) {
    SCOPED_TRACE(signal);
    const auto folder = session_.folder / std::to_string(signal);
    std::filesystem::create_directories(folder);
    HeldForceDimension device(folder);
    device.fake().type = 33;  // omega.3: it has no wrist
    auto client = start_client(device);
    press(device);
    EXPECT_EQ(device.fake().watchdog_ms, 100);
    client.signal(signal);
    EXPECT_NE(client.wait(20), -1);
    if (signal == SIGKILL)
      EXPECT_TRUE(wait_until([&] { return device.force_n() == 0; }, 1)) << "its watchdog";
    else
      EXPECT_EQ(device.fake().last_force_size, 0);
    EXPECT_EQ(device.fake().closes, signal == SIGTERM ? 1 : 0);
  }
}

// Each hand of one participant has its own device, its own tool and its own force.
TEST_F(ExitPaths, TwoHandsFeelTheirOwn) {
  HeldHaply haply;
  HeldForceDimension omega(session_.folder);
  omega.fake().type = 33;
  auto client = start_client(haply, {}, {"--device", omega.name()});
  press(haply);
  EXPECT_EQ(omega.force_n(), 0) << "the other hand is free";
  haply.go_out();
  ASSERT_TRUE(wait_until([&] { return haply.force_n() == 0; }, 10));
  ASSERT_TRUE(omega.press_until(kContact_n)) << omega.force_n();
  EXPECT_EQ(haply.force_n(), 0);
  EXPECT_NEAR(omega.fake().force[0], omega.force_n(), 0.5 * omega.force_n())
      << "towards the person, its x";
  client.signal(SIGTERM);
  EXPECT_EQ(client.wait(20), 0);
  EXPECT_EQ(omega.force_n(), 0);
}

}  // namespace
}  // namespace trocar::e2e
