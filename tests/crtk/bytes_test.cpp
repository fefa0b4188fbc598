// Each type of our bus on the wire, byte by byte as its published description has it (XCDR1,
// little-endian), seen and said by another maker's DDS.

#include <gtest/gtest.h>

#include <bit>

#include "client/crtk/bus.h"
#include "tests/crtk/messages.h"
#include "tests/e2e/programs.h"

namespace trocar::crtk {
namespace {

// Bytes by hand: numbers are aligned to their size, counted from behind the encapsulation.
class Bytes {
 public:
  Bytes& number(std::uint64_t value, std::size_t size) {
    while ((bytes_.size() - 4) % size != 0) bytes_.push_back(0);
    for (std::size_t i = 0; i < size; ++i)
      bytes_.push_back(static_cast<std::uint8_t>(value >> 8 * i));
    return *this;
  }
  Bytes& u32(std::uint32_t value) { return number(value, 4); }
  Bytes& real(double value) { return number(std::bit_cast<std::uint64_t>(value), 8); }
  Bytes& text(const std::string& text) {
    u32(static_cast<std::uint32_t>(text.size() + 1));
    bytes_.insert(bytes_.end(), text.begin(), text.end());
    bytes_.push_back(0);
    return *this;
  }
  Bytes& flag(bool value) { return number(value ? 1 : 0, 1); }
  Bytes& header(const std::string& frame) { return u32(0).u32(0).text(frame); }
  operator Sample() const { return bytes_; }  // NOLINT: implicit

 private:
  Sample bytes_{0, 1, 0, 0};
};

// The last two bits of the encapsulation say how many bytes fill the last word of four.
Sample without_filling(Sample bytes) {
  if (bytes.size() < 4) return bytes;
  for (; (bytes[3] & 3) != 0 && bytes.back() == 0; --bytes[3]) bytes.pop_back();
  return bytes;
}

// A sample's stamp says when it was written: here it says nothing.
Sample without_stamp(Sample bytes) {
  for (std::size_t i = 4; i < std::min<std::size_t>(12, bytes.size()); ++i) bytes[i] = 0;
  return bytes;
}

class CrtkBytes : public ::testing::Test {
 protected:
  CrtkBytes() {
    auto bus = Bus::open({domain_of_this_process(), ""},
                         {{"PSM1", "PSM1_base", true, {"outer_yaw", "outer_pitch"}}});
    EXPECT_TRUE(bus) << bus.error().message;
    bus_ = std::move(*bus);
  }

  // Gives until the peer has heard it: it may not know the bus yet.
  Sample heard(const std::string& topic, const std::function<void()>& give) {
    e2e::wait_until(
        [&] {
          give();
          return !peer_.newest("rt/PSM1/" + topic).empty();
        },
        20);
    return without_filling(peer_.newest("rt/PSM1/" + topic));
  }
  // Says it until something was taken: the bus may not know the peer yet.
  template <typename Take>
  auto said(const std::string& topic, const char* type, const Sample& sample, Take take) {
    decltype(take()) taken{};
    e2e::wait_until(
        [&] {
          peer_.say("rt/PSM1/" + topic, type, sample);
          taken = take();
          return taken != decltype(take()){};
        },
        20);
    return taken;
  }

  std::unique_ptr<Bus> bus_;
  FastPeer peer_;
};

Measured some_measured() {
  Measured m;
  m.tip = {{0.25f, -0.5f, 2}, {0.5f, -0.5f, 0.5f, 0.5f}};
  m.velocity_m_s = {1, 2, 3};
  m.turning_rad_s = {-1, -2, -3};
  m.force_n = {0.5f, 0, -8};
  m.torque_nm = {0.125f, 0, 4};
  m.joints = {0.75, -0.25};
  m.joint_speeds = {1.5, -2.5};
  m.jaw_rad = 0.5;
  m.jaw_speed_rad_s = -1;
  return m;
}

TEST_F(CrtkBytes, MeasuredAreAsTheirDescriptionsSay) {
  peer_.hear("rt/PSM1/measured_cp", kPoseType);
  peer_.hear("rt/PSM1/measured_cv", kTwistType);
  peer_.hear("rt/PSM1/measured_cf", kWrenchType);
  peer_.hear("rt/PSM1/measured_js", kJointType);
  peer_.hear("rt/PSM1/jaw/measured_js", kJointType);
  const auto give = [&] { bus_->give(0, some_measured()); };
  const Sample pose = Bytes()
                          .header("PSM1_base")
                          .real(0.25)
                          .real(-0.5)
                          .real(2)
                          .real(0.5)
                          .real(-0.5)
                          .real(0.5)
                          .real(0.5);
  EXPECT_EQ(without_stamp(heard("measured_cp", give)), pose);
  const Sample twist =
      Bytes().header("PSM1_base").real(1).real(2).real(3).real(-1).real(-2).real(-3);
  EXPECT_EQ(without_stamp(heard("measured_cv", give)), twist);
  const Sample wrench =
      Bytes().header("PSM1_base").real(0.5).real(0).real(-8).real(0.125).real(0).real(4);
  EXPECT_EQ(without_stamp(heard("measured_cf", give)), wrench);
  const Sample joints = Bytes()
                            .header("PSM1_base")
                            .u32(2)
                            .text("outer_yaw")
                            .text("outer_pitch")
                            .u32(2)
                            .real(0.75)
                            .real(-0.25)
                            .u32(2)
                            .real(1.5)
                            .real(-2.5)
                            .u32(0);
  EXPECT_EQ(without_stamp(heard("measured_js", give)), joints);
  const Sample jaw =
      Bytes().header("PSM1_base").u32(1).text("jaw").u32(1).real(0.5).u32(1).real(-1).u32(0);
  EXPECT_EQ(without_stamp(heard("jaw/measured_js", give)), jaw);
}

// The first of these with nothing but bytes that somebody can count.
TEST_F(CrtkBytes, StateAndTextAreAsTheirDescriptionsSay) {
  bus_->give(0, OperatingState{State::Enabled, true, false});
  peer_.hear("rt/PSM1/operating_state", kStateType, true);
  peer_.hear("rt/PSM1/warning", kTextType);
  peer_.hear("rt/PSM1/error", kTextType);
  const Sample state{0,  1, 0, 0,                    // CDR, little-endian
                     0,  0, 0, 0, 0,   0,   0,   0,  // stamp
                     10, 0, 0, 0, 'P', 'S', 'M', '1', '_', 'b', 'a', 's', 'e', 0,  // frame_id
                     0,  0, 8, 0, 0,   0,   'E', 'N', 'A', 'B', 'L', 'E', 'D', 0,  // state
                     1,  0};  // is_homed, is_busy
  // Said before anybody listened.
  EXPECT_EQ(without_stamp(heard("operating_state", [] {})), state);
  const Sample text{0, 1, 0, 0, 3, 0, 0, 0, 'n', 'o', 0};
  EXPECT_EQ(heard("warning", [&] { bus_->warn(0, "no"); }), text);
  EXPECT_EQ(heard("error", [&] { bus_->tell_error(0, "no"); }), text);
}

TEST_F(CrtkBytes, CommandsAreReadFromBytes) {
  const auto pose =
      said("servo_cp", kPoseType,
           Bytes().header("b").real(1).real(2).real(3).real(0).real(0.5).real(0).real(-1),
           [&] { return bus_->take_pose(0); });
  EXPECT_EQ(pose, (ServoPose{"b", {1, 2, 3}, {0, 0.5, 0, -1}}));
  const auto wrench = said("servo_cf", kWrenchType,
                           Bytes().header("").real(1).real(2).real(3).real(4).real(5).real(6),
                           [&] { return bus_->take_wrench(0); });
  EXPECT_EQ(wrench, (ServoWrench{"", {1, 2, 3}, {4, 5, 6}}));
  const auto jaw =
      said("jaw/servo_jp", kJointType, Bytes().header("").u32(0).u32(1).real(0.25).u32(0).u32(0),
           [&] { return bus_->take_jaw(0); });
  EXPECT_EQ(jaw, ServoJaw{{0.25}});
  const Sample home{0, 1, 0, 0, 0, 0, 0, 0, 0, 0,   0,   0,   1,   0, 0,
                    0, 0, 0, 0, 0, 5, 0, 0, 0, 'h', 'o', 'm', 'e', 0};
  const auto commands =
      said("state_command", kCommandType, home, [&] { return bus_->take_commands(0); });
  ASSERT_FALSE(commands.empty());
  EXPECT_EQ(commands.front(), "home");
}

// Lengths that lie, ends that are missing: nothing of it reaches an arm.
TEST_F(CrtkBytes, BytesThatAreNoSampleAreLeftOut) {
  const std::string command = "rt/PSM1/state_command";
  const auto take_commands = [&] { return bus_->take_commands(0); };
  EXPECT_FALSE(said("state_command", kCommandType, write_command("pause"), take_commands).empty());
  const Sample whole = Bytes().header("b").text("home");
  for (const std::size_t length : {4, 8, 15, 17, 20, 24, 27})
    peer_.say(command, kCommandType,
              {whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length)});
  peer_.say(command, kCommandType, Bytes().header("b").u32(0xffffffff));
  peer_.say(command, kCommandType, whole);
  std::vector<std::string> commands;
  const auto has_come = [&] {
    for (auto& one : bus_->take_commands(0))
      if (one != "pause") commands.push_back(std::move(one));
    return !commands.empty() && commands.back() == "home";
  };
  ASSERT_TRUE(e2e::wait_until(has_come, 20));
  EXPECT_EQ(commands.size(), 1);

  peer_.say("rt/PSM1/jaw/servo_jp", kJointType, Bytes().header("").u32(0xffffffff).u32(1).real(1));
  peer_.say("rt/PSM1/jaw/servo_jp", kJointType, Bytes().header("").u32(0).u32(0x20000000).real(1));
  const auto jaw =
      said("jaw/servo_jp", kJointType, Bytes().header("").u32(0).u32(1).real(0.75).u32(0).u32(0),
           [&] { return bus_->take_jaw(0); });
  EXPECT_EQ(jaw, ServoJaw{{0.75}});
}

}  // namespace
}  // namespace trocar::crtk
