#include "client/device/simulated_device.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "client/device/device_checks.h"

namespace trocar::device {
namespace {

// A device on a clock that the test turns.
struct Bench {
  explicit Bench(const std::string& parameters, HandModel model = {})
      : device(
            HandScript::parse(parameters).value(), [this] { return now_us; }, model) {}

  DeviceReading after_ms(std::uint64_t ms) {
    now_us += ms * 1000;
    return device.read().value();
  }

  std::uint64_t now_us = 5'000'000;
  SimulatedDevice device;
};

// The tissue that a hand presses on from above, seen from the device.
struct Spring {
  double stiffness_n_m = 200, surface_m = -0.001;

  Vec3d force(const DeviceReading& reading) const {
    return {0, std::max(0.0, stiffness_n_m * (surface_m - reading.position_m.y)), 0};
  }
};

TEST(SimulatedDevice, AFreeHandFollowsItsIntention) {
  Bench bench("palpate,1Hz,3mm,6mm,-y");
  double lowest = 0, highest = -1;
  for (int ms = 0; ms < 4000; ++ms) {
    const auto reading = bench.after_ms(1);
    ASSERT_EQ(reading.time_us, bench.now_us);
    ASSERT_TRUE(checked(reading).has_value());
    if (ms < 2000) continue;
    lowest = std::min(lowest, reading.position_m.y);
    highest = std::max(highest, reading.position_m.y);
  }
  EXPECT_NEAR(lowest, -0.009, 4e-4);
  EXPECT_NEAR(highest, -0.003, 4e-4);
}

TEST(SimulatedDevice, TheForceActsOnTheHand) {
  Bench bench("still");
  for (int ms = 0; ms < 3000; ++ms) {
    bench.after_ms(1);
    ASSERT_TRUE(bench.device.write({0, 1, 0}, {}).ok());
  }
  // Arm and reflex hold against it: 1 N / (400 + 80) N/m.
  EXPECT_NEAR(bench.after_ms(1).position_m.y, 1.0 / 480, 3e-5);
}

TEST(SimulatedDevice, AClosedLoopOnTissueSettlesBetweenIntentionAndSurface) {
  Bench bench("press,5mm,10s,-y");
  const Spring tissue;
  DeviceReading reading;
  for (int ms = 0; ms < 6000; ++ms) {
    reading = bench.after_ms(1);
    ASSERT_TRUE(bench.device.write(tissue.force(reading), {}).ok());
  }
  // 480 (x + 5 mm) = 200 (-1 mm - x)
  EXPECT_NEAR(reading.position_m.y, -(480 * 0.005 + 200 * 0.001) / 680, 4e-5);
  EXPECT_NEAR(length(reading.velocity_m_s), 0, 1e-4);
}

TEST(SimulatedDevice, ItLooksForTheTissueAndCountsDepthFromThere) {
  Bench bench("press,5mm,10s,-y", HandModel{.search_m_s = 0.02});
  const Spring tissue{.surface_m = -0.03};
  DeviceReading reading;
  for (int ms = 0; ms < 6000; ++ms) {
    reading = bench.after_ms(1);
    ASSERT_TRUE(bench.device.write(tissue.force(reading), {}).ok());
  }
  // The arm was 0.05 N / 480 N/m ahead of the place where the spring gave 0.05 N.
  const double found_m = -0.03 - 0.05 / 200 - 0.05 / 480;
  EXPECT_NEAR(reading.position_m.y, (480 * (found_m - 0.005) - 200 * 0.03) / 680, 5e-4);
}

TEST(SimulatedDevice, WithoutTissueItBeginsWhereItsReachEnds) {
  Bench bench("press,5mm,10s,-y", HandModel{.search_m_s = 0.02});
  for (int ms = 0; ms < 7900; ms += 100) bench.after_ms(100);
  EXPECT_NEAR(bench.after_ms(100).position_m.y, -0.105, 1e-3);
}

TEST(SimulatedDevice, TheReflexComesLate) {
  Bench with("still"), without("still", HandModel{.reflex_n_m = 0});
  for (int ms = 0; ms < 200; ++ms) {
    ASSERT_TRUE(with.device.write({1, 0, 0}, {}).ok());
    ASSERT_TRUE(without.device.write({1, 0, 0}, {}).ok());
    const auto a = with.after_ms(1), b = without.after_ms(1);
    if (ms < 60) {
      ASSERT_EQ(a.position_m, b.position_m) << ms;
    } else if (ms == 199) {
      EXPECT_LT(a.position_m.x, b.position_m.x);
    }
  }
}

TEST(SimulatedDevice, EqualClocksAndForcesGiveEqualReadings) {
  Bench often("tap,2Hz,10mm"), seldom("tap,2Hz,10mm");
  const auto steps = {1u, 7u, 3u, 40u, 2u, 90u};
  for (int round = 0; round < 50; ++round)
    for (const auto ms : steps) {
      const Vec3d force{0.1 * round, 0.01 * ms, 0};
      ASSERT_TRUE(often.device.write(force, {}).ok());
      ASSERT_TRUE(seldom.device.write(force, {}).ok());
      for (unsigned i = 1; i < ms; ++i) often.after_ms(1);
      const auto a = often.after_ms(1), b = seldom.after_ms(ms);
      ASSERT_EQ(a.position_m, b.position_m);
      ASSERT_EQ(a.velocity_m_s, b.velocity_m_s);
      ASSERT_EQ(a.time_us, b.time_us);
    }
}

TEST(SimulatedDevice, AForceThatIsNotRenewedEnds) {
  Bench bench("still");
  ASSERT_TRUE(bench.device.write({0, 2, 0}, {}).ok());
  EXPECT_GT(bench.after_ms(100).position_m.y, 1e-3);
  EXPECT_NEAR(length(bench.after_ms(900).position_m), 0, 5e-5);
}

TEST(SimulatedDevice, NoForceThrowsTheHand) {
  Bench bench("still");
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Vec3d& force : {Vec3d{nan, 0, 0}, Vec3d{0, 1e308, 1e308}, Vec3d{0, 1e9, 0}}) {
    for (int ms = 0; ms < 100; ++ms) {
      ASSERT_TRUE(bench.device.write(force, {}).ok());
      ASSERT_LE(length(bench.after_ms(1).position_m), 0.05);
    }
  }
}

TEST(SimulatedDevice, AClockThatStopsJumpsOrGoesBackIsSurvived) {
  Bench bench("palpate,2Hz,5mm");
  const auto first = bench.after_ms(100);
  EXPECT_EQ(bench.after_ms(0).time_us, first.time_us) << "stuck: the safety chain sees it";
  bench.now_us -= 50'000;
  EXPECT_EQ(bench.device.read()->position_m, first.position_m);
  const auto later = bench.after_ms(3'600'000);
  EXPECT_EQ(later.time_us, bench.now_us);
  EXPECT_LE(length(later.position_m), 0.0101);
}

TEST(HandScript, MotionsGoWhereTheySay) {
  const auto deepest = [](const HandScript& script) {
    double most = 0;
    for (int ms = 0; ms < 8000; ++ms) most = std::max(most, length(script.position_m(ms * 1e-3)));
    return most;
  };
  EXPECT_EQ(deepest(*HandScript::parse("still")), 0);
  EXPECT_NEAR(deepest(*HandScript::parse("press,5mm,2s")), 0.005, 1e-9);
  EXPECT_NEAR(deepest(*HandScript::parse("tap,2Hz,10mm")), 0.010, 1e-9);
  EXPECT_NEAR(deepest(*HandScript::parse("palpate,1Hz,3mm")), 0.006, 1e-6);
  EXPECT_NEAR(HandScript::parse("press,5mm,2s,+z")->position_m(1).z, 0.005, 1e-12);
  EXPECT_EQ(HandScript::parse("press,5mm,2s,grip")->gripper(1), 1.0f);
  EXPECT_EQ(HandScript::parse("press,5mm,2s")->position_m(3.5), Vec3d{}) << "the pause";
}

TEST(HandScript, WrongParametersAreNamed) {
  for (const char* text :
       {"", "wave", "press,5", "press,-5mm", "press,nanmm", "press,1e9mm", "palpate,0Hz",
        "palpate,21Hz", "press,+w", "press,1mm,2mm", "palpate,1mm,2mm,3mm", "tap,,2Hz"}) {
    const auto script = HandScript::parse(text);
    ASSERT_FALSE(script.ok()) << text;
    EXPECT_FALSE(script.error().message.empty());
    EXPECT_EQ(script.error().message.find('\n'), std::string::npos);
  }
  const auto missing = HandScript::parse("path=no-such-file.txt");
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().code, ErrorCode::ResourceMissing);
}

TEST(HandScript, KeyFramesAreJoinedByLines) {
  const auto script =
      HandScript::parse_keys("# a stroke\n0.5 0 0 0\n1.5 10 -20 0 1 # closed\n\n", "hand.txt");
  ASSERT_TRUE(script.ok()) << script.error().message;
  EXPECT_EQ(script->position_m(0), Vec3d{});
  EXPECT_NEAR(script->position_m(1).y, -0.010, 1e-12);
  EXPECT_NEAR(script->gripper(1), 0.5f, 1e-6f);
  EXPECT_EQ(script->position_m(99), (Vec3d{0.010, -0.020, 0}));
}

TEST(HandScript, WrongKeyFramesSayTheirLine) {
  for (const char* text :
       {"0 0 0 0\n1 0 0", "0 0 0 0\n1 0 0 0 0 0", "0 0 0 0\n0 1 1 1", "0 0 0 0\n1 x 0 0",
        "0 0 0 0\n1 nan 0 0", "0 0 0 0\n1 1e9 0 0", "0 0 0 0\n1 0 0 0 2", "0 0 0 0\n-1 0 0 0"}) {
    const auto script = HandScript::parse_keys(text, "hand.txt");
    ASSERT_FALSE(script.ok()) << text;
    EXPECT_TRUE(script.error().message.starts_with("hand.txt:2: ")) << script.error().message;
  }
  EXPECT_FALSE(HandScript::parse_keys("# nothing\n", "hand.txt").ok());
}

}  // namespace
}  // namespace trocar::device
