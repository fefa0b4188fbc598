#include "client/device/spacemouse_device.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <array>
#include <climits>
#include <cmath>
#include <cstring>

#include "client/device/device_checks.h"
#include "tests/device/device_bench.h"
#include "tests/support/random.h"

namespace trocar::device {
namespace {

using Event = std::array<std::int32_t, 8>;

// The daemon's side of the socket.
class FakeDaemon {
 public:
  explicit FakeDaemon(const std::string& path)
      : listener_(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path, path.data(), path.size());
    const int bound =
        bind(listener_.value(), reinterpret_cast<const sockaddr*>(&address), sizeof address);
    EXPECT_EQ(bound, 0);
    EXPECT_EQ(listen(listener_.value(), 1), 0);
  }

  // Returns the word that the client sent first.
  std::uint32_t accept_client() {
    client_ = FileDescriptor(accept(listener_.value(), nullptr, nullptr));
    std::uint32_t word = 0;
    EXPECT_EQ(recv(client_.value(), &word, sizeof word, MSG_WAITALL), 4);
    return word;
  }
  void send_bytes(const void* bytes, std::size_t count) {
    ASSERT_EQ(send(client_.value(), bytes, count, MSG_NOSIGNAL), static_cast<ssize_t>(count));
  }
  void send_event(const Event& event) { send_bytes(event.data(), sizeof event); }
  void hang_up() { client_ = FileDescriptor(); }

 private:
  FileDescriptor listener_, client_;
};

class SpaceMouseTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto opened = SpaceMouseDevice::open(path_, [this] { return now_us_; });
    ASSERT_TRUE(opened.ok()) << opened.error().message;
    device_ = std::move(*opened);
    EXPECT_EQ(daemon_.accept_client(), 0x7faa5501u);
    ASSERT_TRUE(device_->read().ok());
  }
  DeviceReading after_ms(std::uint64_t ms) {
    now_us_ += ms * 1000;
    auto reading = device_->read();
    EXPECT_TRUE(reading.ok());
    EXPECT_TRUE(checked(*reading).has_value());
    return *reading;
  }

  std::uint64_t now_us_ = 1'000'000;
  testing::ShortFolder folder_;
  std::string path_ = folder_.file("spnav.sock");
  FakeDaemon daemon_{path_};
  std::unique_ptr<HapticDevice> device_;
};

TEST_F(SpaceMouseTest, ADeflectedCapMovesTheHandAndALooseOneLeavesIt) {
  for (int i = 0; i < 100; ++i) {
    daemon_.send_event({0, 350, 0, 350, 0, 0, 0, 10});
    after_ms(10);
  }
  // One second at full speed, 80 mm/s; z of the daemon points away from the person.
  auto reading = after_ms(0);
  EXPECT_NEAR(reading.position_m.x, 0.08, 1e-6);
  EXPECT_NEAR(reading.position_m.z, -0.08, 1e-6);
  EXPECT_EQ(reading.position_m.y, 0);
  EXPECT_NEAR(reading.velocity_m_s.x, 0.08, 1e-6);
  daemon_.send_event({0, 5, -8, 13, 3, 0, -2, 10});
  after_ms(0);
  const auto later = after_ms(40);
  EXPECT_EQ(later.position_m, reading.position_m) << "inside the dead zone";
}

TEST_F(SpaceMouseTest, ItsTurnsTurnTheTool) {
  for (int i = 0; i < 100; ++i) {
    daemon_.send_event({0, 0, 0, 0, 0, 350, 0, 10});
    after_ms(10);
  }
  const Vec3f ahead = rotate(after_ms(0).orientation, {0, 0, 1});
  EXPECT_NEAR(std::atan2(ahead.x, ahead.z), 1.2, 2e-3);
}

TEST_F(SpaceMouseTest, ButtonsAreBits) {
  daemon_.send_event({1, 0, 0, 0, 0, 0, 0, 0});
  daemon_.send_event({1, 4, 0, 0, 0, 0, 0, 0});
  EXPECT_EQ(after_ms(1).buttons, 0b10001u);
  daemon_.send_event({2, 0, 0, 0, 0, 0, 0, 0});
  EXPECT_EQ(after_ms(1).buttons, 0b10000u);
}

TEST_F(SpaceMouseTest, TheDaemonsAnswerIsNoEventWhereverItComes) {
  const std::uint32_t answer = 0x7faa5501;
  daemon_.send_event({1, 2, 0, 0, 0, 0, 0, 0});
  daemon_.send_bytes(&answer, sizeof answer);
  daemon_.send_event({1, 3, 0, 0, 0, 0, 0, 0});
  EXPECT_EQ(after_ms(1).buttons, 0b1100u);
}

TEST_F(SpaceMouseTest, EventsThatComeInPiecesAreJoined) {
  const Event event{1, 1, 0, 0, 0, 0, 0, 0};
  const auto* bytes = reinterpret_cast<const char*>(event.data());
  for (std::size_t i = 0; i < sizeof event; ++i) {
    EXPECT_EQ(after_ms(1).buttons, 0u) << "short by " << sizeof event - i;
    daemon_.send_bytes(bytes + i, 1);
  }
  EXPECT_EQ(after_ms(1).buttons, 0b10u);
}

TEST_F(SpaceMouseTest, ADeflectedCapThatFallsSilentStopsHandAndTime) {
  daemon_.send_event({0, 350, 0, 0, 0, 0, 0, 10});
  after_ms(0);
  for (int i = 0; i < 10; ++i) after_ms(10);
  const auto last = after_ms(10);
  const auto stuck = after_ms(500);
  EXPECT_EQ(stuck.position_m, last.position_m);
  EXPECT_EQ(stuck.time_us, last.time_us);
  EXPECT_EQ(stuck.velocity_m_s, Vec3d{});
  daemon_.send_event({0, 0, 0, 0, 0, 0, 0, 10});
  EXPECT_EQ(after_ms(1).time_us, now_us_) << "it spoke again";
  EXPECT_EQ(after_ms(5000).time_us, now_us_) << "at rest, silence is fresh";
}

TEST_F(SpaceMouseTest, UnpluggedItIsGoneAndComesBack) {
  daemon_.send_event({0, 350, 0, 0, 0, 0, 0, 10});
  daemon_.send_event({3, 1, 0, 0, 0, 0, 0, 0});
  auto gone = device_->read();
  ASSERT_FALSE(gone.ok());
  EXPECT_TRUE(testing::is_advice(gone.error())) << gone.error().message;
  daemon_.send_event({3, 0, 0, 0, 0, 0, 0, 0});
  const auto before = after_ms(0);
  EXPECT_EQ(after_ms(50).position_m, before.position_m) << "it does not go on where it was";
}

TEST_F(SpaceMouseTest, ADaemonThatEndsIsAnError) {
  daemon_.hang_up();
  auto gone = device_->read();
  ASSERT_FALSE(gone.ok());
  EXPECT_TRUE(testing::is_advice(gone.error())) << gone.error().message;
  EXPECT_FALSE(device_->read().ok());
}

TEST_F(SpaceMouseTest, GarbageMovesNothingBeyondTheReach) {
  testing::Random random(11);
  for (int i = 0; i < 3000; ++i) {
    Event event;
    for (auto& word : event) word = static_cast<std::int32_t>(random.below(UINT_MAX));
    event[0] = static_cast<std::int32_t>(random.below(10)) - 1;
    if (event[0] == 3) event[1] = 0;
    daemon_.send_event(event);
    const auto reading = after_ms(1);
    ASSERT_LE(length(reading.position_m), 0.15 * std::sqrt(3.0));
    ASSERT_LE(length(reading.velocity_m_s), 0.2);
  }
  for (const auto extreme : {INT_MAX, INT_MIN}) {
    daemon_.send_event({0, extreme, extreme, extreme, extreme, extreme, extreme, extreme});
    daemon_.send_event({1, extreme, 0, 0, 0, 0, 0, 0});
    after_ms(10);
  }
}

TEST_F(SpaceMouseTest, AFloodIsTakenPieceByPiece) {
  std::vector<Event> events(500, Event{0, 350, 0, 0, 0, 0, 0, 10});
  events.push_back({1, 7, 0, 0, 0, 0, 0, 0});
  daemon_.send_bytes(events.data(), events.size() * sizeof events[0]);
  EXPECT_EQ(after_ms(1).buttons, 0u);
  EXPECT_TRUE(testing::eventually([&] { return after_ms(1).buttons == 0b10000000u; }));
}

TEST_F(SpaceMouseTest, APauseOfTheProgramDoesNotThrowTheHand) {
  daemon_.send_event({0, 350, 0, 0, 0, 0, 0, 10});
  now_us_ += 60'000'000;
  EXPECT_LE(after_ms(0).position_m.x, 0.08 * 0.0501);
}

TEST_F(SpaceMouseTest, ItRendersNoForce) {
  EXPECT_EQ(device_->limits().force_n, 0);
  EXPECT_TRUE(device_->write({1, 2, 3}, {}).ok());
}

TEST(SpaceMouse, WithoutADaemonTheErrorSaysWhatToInstall) {
  const testing::ShortFolder folder;
  for (const std::string& path : {folder.file("none.sock"), std::string(300, 'x'), std::string()}) {
    const auto opened = SpaceMouseDevice::open(path, monotonic_us);
    ASSERT_FALSE(opened.ok());
    EXPECT_TRUE(testing::is_advice(opened.error())) << opened.error().message;
  }
}

}  // namespace
}  // namespace trocar::device
