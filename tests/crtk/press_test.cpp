// A robot's program of another maker's DDS, the real trocar-crtk and a real server: it homes an
// arm, presses it on the liver, and feels that.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/crtk/messages.h"
#include "tests/e2e/programs.h"

namespace trocar::crtk {
namespace {

using e2e::Program;
using e2e::wait_until;
namespace fs = std::filesystem;

class CrtkPress : public ::testing::Test {
 protected:
  CrtkPress()
      : session_("liver"),
        robot_("trocar-crtk",
               {"--server", session_.address(), "--arm", "PSM1", "--tool", "probe", "--domain",
                std::to_string(domain_of_this_process())},
               session_.folder / "crtk.log") {
    peer_.hear(topic("operating_state"), kStateType, true);
    peer_.hear(topic("measured_cp"), kPoseType);
    peer_.hear(topic("measured_cf"), kWrenchType);
    peer_.hear(topic("measured_js"), kJointType);
    peer_.hear(topic("warning"), kTextType);
  }

  static std::string topic(const std::string& name) { return "rt/PSM1/" + name; }
  std::string log() const { return e2e::read_text(session_.folder / "crtk.log"); }
  StateSample state() const { return read_state(peer_.newest(topic("operating_state"))); }
  PoseSample tip() const { return read_pose(peer_.newest(topic("measured_cp"))); }
  WrenchSample felt() const { return read_wrench(peer_.newest(topic("measured_cf"))); }
  static double length(const std::array<double, 3>& v) { return std::hypot(v[0], v[1], v[2]); }

  // Says it until it has the effect: trocar-crtk may not know this program yet.
  template <typename Effect>
  bool command(const std::string& text, Effect effect) {
    return wait_until(
        [&] {
          peer_.say(topic("state_command"), kCommandType, write_command(text));
          return wait_until(effect, 2);
        },
        20);
  }
  void become_ready() {
    ASSERT_TRUE(wait_until([&] { return tip().frame == "PSM1_base"; }, 60)) << log();
    ASSERT_TRUE(wait_until([&] { return state().state == "DISABLED"; }, 20)) << log();
    ASSERT_TRUE(command("home", [&] { return state().is_homed && !state().is_busy; })) << log();
    EXPECT_EQ(state().state, "ENABLED");
  }
  void go(const PoseSample& to) { peer_.say(topic("servo_cp"), kPoseType, write(to)); }
  // Goes on along -z, into the body, until something presses back: so far with each frame of the
  // session, however fast that goes.
  PoseSample press(double force_n) {
    auto aim = tip();
    const double deepest = aim.position[2] - 0.05;
    while (length(felt().force) < force_n && aim.position[2] > deepest) {
      aim.position[2] -= 0.0005;
      const auto before = peer_.newest(topic("measured_cp"));
      peer_.say(topic("servo_cp"), kPoseType, write(aim));
      if (!wait_until([&] { return peer_.newest(topic("measured_cp")) != before; }, 10)) break;
    }
    return aim;
  }
  // The newest warning that says so.
  bool is_warned(const std::string& of) {
    return wait_until(
        [&] { return read_text(peer_.newest(topic("warning"))).find(of) != std::string::npos; },
        10);
  }

  e2e::Session session_;
  Program robot_;
  FastPeer peer_;
};

TEST_F(CrtkPress, AnotherMakersProgramPressesOnTheLiverAndFeelsIt) {
  become_ready();
  const auto start = tip();
  EXPECT_EQ(length(felt().force), 0);

  const auto pressed = press(0.3);
  EXPECT_GE(length(felt().force), 0.3) << log();
  EXPECT_GT(felt().force[2], 0.15) << "tissue presses back, out of the body";
  EXPECT_LT(tip().position[2], start.position[2] - 0.02);

  // Wrong commands are not followed, and that is said.
  auto wrong = pressed;
  wrong.position[2] = std::nan("");
  go(wrong);
  EXPECT_TRUE(is_warned("no number"));
  wrong = pressed;
  wrong.position[0] += 0.1;
  go(wrong);
  EXPECT_TRUE(is_warned("jumps"));
  wrong = pressed;
  wrong.frame = "world";
  go(wrong);
  EXPECT_TRUE(is_warned("frame_id"));
  EXPECT_LT(std::abs(tip().position[0] - pressed.position[0]), 0.005);

  // A flood is not followed either, and fills no log.
  for (int i = 0; i < 3'000; ++i) {
    wrong.position[0] = i;
    go(wrong);
  }
  const auto lines = log();
  EXPECT_LT(std::ranges::count(lines, '\n'), 60) << lines;
  EXPECT_LT(std::abs(tip().position[0] - pressed.position[0]), 0.005);

  // By force: it finds the place where the liver presses back as much.
  WrenchSample push;
  push.force = {0, 0, -0.5};
  EXPECT_TRUE(wait_until(
      [&] {
        peer_.say(topic("servo_cf"), kWrenchType, write(push));
        return std::abs(felt().force[2] - 0.5) < 0.08;
      },
      20))
      << felt().force[2] << log();
  EXPECT_TRUE(is_warned("stream has ended"));

  EXPECT_TRUE(command("disable", [&] { return state().state == "DISABLED"; }));
  go(tip());
  EXPECT_TRUE(is_warned("enable it"));
  EXPECT_EQ(read_joints(peer_.newest(topic("measured_js"))).name.size(), 6);

  robot_.signal(SIGTERM);
  EXPECT_EQ(robot_.wait(10), 0) << log();
  EXPECT_TRUE(session_.server().is_running());
}

}  // namespace
}  // namespace trocar::crtk
