// Instruments in a session's own tick: scissors and the hook cut as they do, who cannot hold or cut
// presses, and a hand that takes another instrument lets go of what it had.

#include <gtest/gtest.h>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/cutting/validate.h"
#include "server/tissue/step/simulation.h"

namespace trocar::step {
namespace {

constexpr tool::ToolShape kScissors{.radius_m = 0.002f,
                                    .friction = 0.1f,
                                    .grip_n = 0,
                                    .edge_m = 0.04f,
                                    .form = tool::Form::Scissors};
constexpr tool::ToolShape kHook{
    .radius_m = 0.0015f, .friction = 0.1f, .grip_n = 0, .edge_m = 0.005f, .form = tool::Form::Hook};
constexpr tool::ToolShape kGrasper{.radius_m = 0.0025f, .reach_m = 0.010f, .edge_m = 0};

class Instruments : public ::testing::Test {
 protected:
  Instruments() : simulation_(*catalogue::make_liver(6000)) {
    top_ = {0, -1, 0};
    for (const auto& p : simulation_.organ().mesh.rest_positions)
      if (static_cast<float>(p.y) > top_.y) top_ = to_float(p);
  }
  void join(const tool::ToolShape& shape) {
    hands::HandJoin join{.slot = {0}};
    join.shapes[0] = shape;
    inputs_.joins.push_back(join);
  }
  // The shaft stands upright; depth_m is below the highest place.
  void hold(float depth_m, tool::Verb verb, float along_m = 0) {
    inputs_.samples.push_back(
        {kTool, {{top_ + Vec3f{along_m, -depth_m, 0}, rotation_from_z({0, 1, 0})}, verb}});
  }
  TickReport tick() {
    const auto report = simulation_.tick(inputs_, {});
    inputs_.clear();
    opened_m2_ += report.cut.opened_area_m2;
    return report;
  }
  void ticks(int count) {
    for (int i = 0; i < count; ++i) tick();
  }
  const hands::ClaimTable& claims() const { return simulation_.state().claims; }
  void expect_sound() const {
    const auto valid = cutting::validate(simulation_.state().cuts.topology());
    EXPECT_TRUE(valid.ok()) << valid.error().message;
  }

  static constexpr ToolSlot kTool{0};
  Simulation simulation_;
  hands::TickInputs inputs_;
  Vec3f top_;
  double opened_m2_ = 0;
};

TEST_F(Instruments, ScissorsCutWhatIsBetweenTheirBladesAndNoMore) {
  join(kScissors);
  hold(0.02f, tool::Verb::None);
  ticks(20);
  EXPECT_EQ(opened_m2_, 0);
  hold(0.02f, tool::Verb::Cut);
  for (int i = 0; i < 400; ++i) {
    if (i % 20 == 0) hold(0.02f, tool::Verb::Cut);
    tick();
    EXPECT_EQ(length(simulation_.state().cuts.felt(kTool).force_n), 0) << "a hand closes them";
  }
  // A triangle as long as they are in the tissue, half as wide as it is from the hinge.
  const double hinge_m = 0.04, in_air_m = 0.04 - 0.02;
  const double between_m2 = 0.25 * (hinge_m * hinge_m - in_air_m * in_air_m);
  EXPECT_GT(opened_m2_, 0.6 * between_m2);
  EXPECT_LT(opened_m2_, 1.5 * between_m2);
  // Closed, they cut nothing, wherever they go.
  const double before = opened_m2_;
  for (int i = 0; i < 200; ++i) {
    if (i % 10 == 0) hold(0.02f, tool::Verb::Cut, 0.0001f * static_cast<float>(i));
    tick();
  }
  EXPECT_EQ(opened_m2_, before);
  // Opened again, they do.
  hold(0.02f, tool::Verb::None, 0.02f);
  ticks(200);
  for (int i = 0; i < 400; ++i) {
    if (i % 20 == 0) hold(0.02f, tool::Verb::Cut, 0.02f);
    tick();
  }
  EXPECT_GT(opened_m2_, before + 0.2 * between_m2);
  expect_sound();
}

// The hook hangs by its side, and is drawn along the surface.
TEST_F(Instruments, AnEnergisedHookCutsAcrossItsShaftAndIsHardlyFelt) {
  const auto draw = [&](tool::ToolShape shape) {
    simulation_ = Simulation(*catalogue::make_liver(6000));
    opened_m2_ = 0;
    join(shape);
    // Turned so that its y, and a scalpel's z, points up and back.
    const Quatf turned =
        shape.form == tool::Form::Hook ? rotation_from_z({0, 0, 1}) : rotation_from_z({0, 1, 0});
    float greatest_n = 0;
    for (int i = 0; i < 400; ++i) {
      const float t = static_cast<float>(i) * 1e-3f;
      const Vec3f tip = top_ + Vec3f{-0.02f + 0.1f * t, -0.004f, 0};
      if (i % 8 == 0) inputs_.samples.push_back({kTool, {{tip, turned}, tool::Verb::Cut}});
      tick();
      greatest_n = std::max(greatest_n, length(simulation_.state().cuts.felt(kTool).force_n));
    }
    expect_sound();
    return greatest_n;
  };
  auto scalpel = kHook;
  scalpel.form = tool::Form::Scalpel;
  const float of_scalpel_n = draw(scalpel);
  const double by_scalpel_m2 = opened_m2_;
  const float of_hook_n = draw(kHook);
  EXPECT_GT(opened_m2_, 0.7 * by_scalpel_m2);
  EXPECT_LT(opened_m2_, 1.3 * by_scalpel_m2);
  EXPECT_LT(of_hook_n, 0.7f * of_scalpel_n);
}

TEST_F(Instruments, WhoCannotHoldOrCutPresses) {
  join(kGrasper);
  hold(0.004f, tool::Verb::Cut);
  ticks(50);
  EXPECT_EQ(claims().claim(kTool).verb, tool::Verb::Push);
  EXPECT_EQ(opened_m2_, 0);
  inputs_.changes.push_back({kTool, kScissors});
  hold(0.004f, tool::Verb::Grasp);
  ticks(50);
  EXPECT_EQ(claims().claim(kTool).verb, tool::Verb::Push);
}

TEST_F(Instruments, AnotherInstrumentLetsGoOfWhatTheOneBeforeHeld) {
  join(kGrasper);
  hold(0.002f, tool::Verb::Grasp);
  ticks(200);
  ASSERT_EQ(claims().claim(kTool).verb, tool::Verb::Grasp);
  ASSERT_FALSE(simulation_.state().grasps[kTool].nodes.empty());
  inputs_.changes.push_back({kTool, kScissors});
  EXPECT_EQ(tick().inputs_dropped, 0u);
  EXPECT_FALSE(simulation_.state().tools[kTool].has_sample) << "it is nowhere until it says so";
  ticks(400);
  EXPECT_TRUE(simulation_.state().grasps[kTool].nodes.empty());
  hold(-0.02f, tool::Verb::None);
  ticks(5);
  EXPECT_EQ(simulation_.state().tools[kTool].shape, kScissors);
  // A shape that no tool has is dropped and counted, and so is one for nobody's tool.
  inputs_.changes.push_back({ToolSlot{2}, kScissors});
  inputs_.changes.push_back({kTool, {.radius_m = -1}});
  EXPECT_EQ(tick().inputs_dropped, 2u);
}

// Half closed, they are as closed when they come back.
TEST_F(Instruments, ScissorsAreInASnapshot) {
  join(kScissors);
  for (int i = 0; i < 150; ++i) {
    if (i % 10 == 0) hold(0.008f, tool::Verb::Cut);
    tick();
  }
  const float closed = simulation_.state().tools[kTool].closed;
  ASSERT_GT(closed, 0.1f);
  ASSERT_LT(closed, 0.9f);
  Bytes snapshot;
  simulation_.write_snapshot(snapshot);
  Simulation other(*catalogue::make_liver(6000));
  ASSERT_TRUE(other.restore_snapshot(snapshot).ok());
  EXPECT_EQ(other.state().tools[kTool].closed, closed);
  for (int i = 0; i < 200; ++i) {
    if (i % 10 == 0) hold(0.008f, tool::Verb::Cut);
    ASSERT_EQ(simulation_.tick(inputs_, {}).state_hash, other.tick(inputs_, {}).state_hash);
    inputs_.clear();
  }
}

}  // namespace
}  // namespace trocar::step
