// Tests the friction that a hand feels on the sides of its blade.

#include <gtest/gtest.h>

#include <functional>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/step/simulation.h"
#include "tests/cutting/cut_organ.h"

namespace trocar::step {
namespace {

constexpr double kTau_pa = 2000;
constexpr float kRadius_m = 0.002f;

// 12 x 4 x 12 cm, held below; cutting costs nothing, so that all force is friction.
organ::Organ block(double friction_pa = kTau_pa) {
  auto organ = cutting::testing::box_organ(12, 4, 12, 0.01, 0);
  organ.material.cut_energy_j_m2 = 0;
  organ.material.blade_friction_pa = friction_pa;
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n)
    if (organ.mesh.rest_positions[n].y < -0.019) organ.fixed_nodes.emplace_back(n);
  return organ;
}

// The tip's place at a time, and the hand's work against the forces that it felt.
class Hand {
 public:
  Hand(Simulation& simulation, std::function<Vec3f(float)> place)
      : simulation_(simulation), place_(std::move(place)) {}

  Vec3f force() const { return simulation_.state().cuts.felt(ToolSlot{0}).force_n; }
  double work_j() const { return work_j_; }

  void run(int ticks) {
    for (int i = 0; i < ticks; ++i) tick();
  }

 private:
  void tick() {
    const Tick tick = simulation_.current_tick() + 1;
    hands::TickInputs inputs;
    if (tick == 1) {
      hands::HandJoin join{.slot = {0}};
      join.shapes[0] = {.radius_m = kRadius_m, .length_m = 0.3f, .edge_m = 0.1f};
      inputs.joins.push_back(join);
    }
    const Vec3f tip = place_(static_cast<float>(tick) * 1e-3f);
    inputs.samples.push_back(
        {tool_slot({0}, 0), {{tip, rotation_from_z({0, 1, 0})}, tool::Verb::Cut}});
    ASSERT_EQ(simulation_.tick(inputs, {}).solve.nodes_rejected, 0u) << "tick " << tick;
    if (tick > 1) work_j_ -= static_cast<double>(dot(force(), tip - last_));
    last_ = tip;
  }

  Simulation& simulation_;
  std::function<Vec3f(float)> place_;
  Vec3f last_;
  double work_j_ = 0;
};

float ramp(float t, float from, float to) {
  return std::clamp((t - from) / (to - from), 0.0f, 1.0f);
}

// Down beside the block, 3 cm deep; 8 cm into it; it stands; out to the left again and up.
Vec3f in_and_out(float t) {
  return {-0.07f + 0.08f * ramp(t, 0.2f, 1.0f) - 0.08f * ramp(t, 1.2f, 2.0f),
          0.03f - 0.04f * ramp(t, 0.0f, 0.2f) + 0.04f * ramp(t, 2.0f, 2.2f), 0.003f};
}

TEST(BladeFriction, HoldsABladeBackByWhatIsInTissue) {
  const double per_m = 2 * 2 * static_cast<double>(kRadius_m);
  Simulation simulation(block());
  Hand hand(simulation, in_and_out);
  hand.run(280);
  EXPECT_EQ(hand.force(), Vec3f{}) << "beside the tissue";
  hand.run(620);
  EXPECT_NEAR(static_cast<double>(hand.force().x), -kTau_pa * per_m * 0.03,
              0.25 * kTau_pa * per_m * 0.03);
  EXPECT_NEAR(hand.force().y, 0, 0.05);
  hand.run(250);
  EXPECT_LT(hand.force().x, -0.1f) << "it stands, and would be let back";
  const double into = hand.work_j();
  EXPECT_GT(into, 0.5 * kTau_pa * per_m * 0.03 * 0.06);
  hand.run(250);
  EXPECT_GT(hand.force().x, 0.1f) << "on the way back";
  hand.run(900);
  EXPECT_EQ(hand.force(), Vec3f{}) << "out of the tissue";
  EXPECT_GT(hand.work_j(), into);
}

TEST(BladeFriction, IsTheMaterials) {
  Vec3f forces[3];
  for (const int i : {0, 1, 2}) {
    Simulation simulation(block(i * kTau_pa));
    Hand hand(simulation, in_and_out);
    hand.run(900);
    forces[i] = hand.force();
  }
  EXPECT_EQ(forces[0], Vec3f{});
  EXPECT_NEAR(static_cast<double>(forces[2].x / forces[1].x), 2, 0.02);
}

TEST(BladeFriction, IsOverOnceTheBladeIsThrough) {
  Simulation simulation(block());
  Hand hand(simulation, [](float t) {
    return Vec3f{-0.07f + 0.14f * ramp(t, 0.0f, 1.0f), -0.05f, 0.003f};
  });
  hand.run(700);
  EXPECT_LT(hand.force().x, -0.2f);
  hand.run(700);
  EXPECT_EQ(hand.force(), Vec3f{});
}

// Around closed ways of all kinds the hand loses work, and its force makes no steps.
TEST(BladeFriction, NeverGivesBackMoreThanWasPutIn) {
  trocar::testing::Random random(17);
  for (int way = 0; way < 4; ++way) {
    Simulation simulation(block());
    std::array<float, 6> pace;
    for (auto& p : pace) p = static_cast<float>(1 + random.below(9));
    Hand hand(simulation, [&](float t) {
      const auto wave = [&](float n) {  // closed in a second, begins and ends at rest
        const float s = t * n - std::floor(t * n);
        return 16 * s * s * (1 - s) * (1 - s);
      };
      return Vec3f{-0.03f + 0.02f * wave(pace[0]) - 0.01f * wave(pace[1]),
                   0.01f - 0.02f * wave(pace[2]) + 0.02f * wave(pace[3]),
                   0.003f + 0.01f * wave(pace[4]) - 0.01f * wave(pace[5])};
    });
    Vec3f last{};
    for (int tick = 1; tick <= 1000; ++tick) {
      hand.run(1);
      ASSERT_LT(length(hand.force() - last), 0.6f) << "way " << way << " tick " << tick;
      last = hand.force();
      ASSERT_GE(hand.work_j(), -1e-9) << "way " << way << " tick " << tick;
    }
    EXPECT_GT(hand.work_j(), 1e-4);
  }
}

}  // namespace
}  // namespace trocar::step
