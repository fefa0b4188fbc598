// Tests what hands feel of blades that cut: the wound's work over the way of the whole edge,
// without steps, and nothing where nothing is cut. Friction is tested by itself.

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/step/simulation.h"
#include "tests/cutting/cut_organ.h"

namespace trocar::step {
namespace {

constexpr double kCutEnergy_j_m2 = 150;
// The bounds: of work, as a share of the wound's energy; of steps in a tick, at 20 mm/s.
constexpr double kWorkSlack = 0.05;
constexpr double kMostStep_n = 0.1;

using Way = std::function<Pose(float)>;  // of a tool, by the time in s

class Scene {
 public:
  Scene(const organ::Organ& organ, float edge_m, std::vector<Way> ways)
      : simulation_(organ), edge_m_(edge_m), ways_(std::move(ways)) {}

  void run(float seconds) {
    const auto end = simulation_.current_tick() + static_cast<Tick>(seconds * 1000 + 0.5f);
    while (simulation_.current_tick() < end) tick();
  }

  const blades::Wrench& felt(std::uint8_t hand = 0) const {
    return simulation_.state().cuts.felt(tool_slot({hand}, 0));
  }
  double due_j() const { return kCutEnergy_j_m2 * area_m2_; }
  // These are of the first hand: its work, the part of it by turning, the largest step of a force.
  double work_j() const { return work_j_; }
  double turning_j() const { return turning_j_; }
  double most_step_n() const { return most_step_n_; }
  double area_m2() const { return area_m2_; }
  // Returns the most since the beginning, m/s.
  float most_speed_m_s() const { return most_speed_m_s_; }
  // Bits of tools whose blades are to wait from now on.
  void wait(std::uint32_t waiting_tools) { decisions_.waiting_tools = waiting_tools; }
  Simulation& simulation() { return simulation_; }

  void expect_work() const {
    ASSERT_GT(due_j(), 0.1);
    EXPECT_NEAR(work_j_ / due_j(), 1, kWorkSlack) << "of " << due_j() << " J";
  }

 private:
  void tick() {
    const Tick tick = simulation_.current_tick() + 1;
    hands::TickInputs inputs;
    for (std::uint8_t hand = 0; hand < ways_.size(); ++hand) {
      if (tick == 1) {
        hands::HandJoin join{.slot = {hand}};
        join.shapes[0] = {.radius_m = 0.002f, .length_m = 0.3f, .edge_m = edge_m_};
        inputs.joins.push_back(join);
      }
      if (tick % 8 == 1)
        inputs.samples.push_back(
            {tool_slot({hand}, 0),
             {ways_[hand](static_cast<float>(tick) * 1e-3f), tool::Verb::Cut}});
    }
    area_m2_ += simulation_.tick(inputs, decisions_).cut.opened_area_m2;
    most_speed_m_s_ =
        std::max(most_speed_m_s_, simulation_.state().cuts.cutting_speed_m_s(tool_slot({0}, 0)));
    const auto pose = simulation_.state().tools[tool_slot({0}, 0)].pose;
    const auto& [force, torque] = felt();
    if (tick > 1) {
      const auto turned = pose.orientation * conjugate(last_pose_.orientation);
      const float twice = turned.w < 0 ? -2.0f : 2.0f;
      const double turning =
          -static_cast<double>(twice * dot(torque, Vec3f{turned.x, turned.y, turned.z}));
      turning_j_ += turning;
      work_j_ += turning - static_cast<double>(dot(force, pose.position - last_pose_.position));
    }
    most_step_n_ = std::max(most_step_n_, static_cast<double>(length(force - last_force_n_)));
    last_pose_ = pose;
    last_force_n_ = force;
  }

  Simulation simulation_;
  float edge_m_;
  std::vector<Way> ways_;
  TickDecisions decisions_;
  float most_speed_m_s_ = 0;
  double area_m2_ = 0, work_j_ = 0, turning_j_ = 0, most_step_n_ = 0;
  Pose last_pose_;
  Vec3f last_force_n_;
};

organ::Organ liver(int tets) {
  auto organ = *catalogue::make_liver(tets);
  organ.material.blade_friction_pa = 0;
  return organ;
}

// Returns a block of 12 x 4 x 8 cm, held below.
organ::Organ block(double cell_m, double jitter = 0.2) {
  const auto cells = [&](double side_m) { return static_cast<int>(side_m / cell_m + 0.5); };
  auto organ = cutting::testing::box_organ(cells(0.12), cells(0.04), cells(0.08), cell_m, jitter);
  organ.material.blade_friction_pa = 0;
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n)
    if (organ.mesh.rest_positions[n].y < -0.0199) organ.fixed_nodes.emplace_back(n);
  return organ;
}

Vec3f top_of(const organ::Organ& organ) {
  Vec3f top{0, -1, 0};
  for (const auto& p : organ.mesh.rest_positions)
    if (static_cast<float>(p.y) > top.y) top = to_float(p);
  return top;
}

// Upright, from one place towards another at this speed.
Way straight(const Vec3f& from, const Vec3f& to, float speed_m_s) {
  const float seconds = length(to - from) / speed_m_s;
  return [=](float t) {
    return Pose{from + (to - from) * std::min(1.0f, t / seconds), rotation_from_z({0, 1, 0})};
  };
}

// About the tip, by as much to the right as it leans to the left at first.
Way turned(const Vec3f& tip, float lean, float seconds) {
  return [=](float t) {
    const float angle = lean * (1 - 2 * std::min(1.0f, t / seconds));
    return Pose{tip, rotation_from_z({std::sin(angle), std::cos(angle), 0})};
  };
}

constexpr Vec3f kLeftOfBlock{-0.07f, -0.01f, 0.0013f}, kRightOfBlock{0.07f, -0.01f, 0.0013f};

TEST(BladeForce, DoesTheWorkOfAStroke) {
  for (const double cell_m : {0.01, 0.005})
    for (const double jitter : {0.0, 0.2})
      for (const float speed : {0.02f, 0.1f, 0.4f}) {
        if (jitter == 0 && speed != 0.02f) continue;
        SCOPED_TRACE("block of " + std::to_string(cell_m) + " m, " + std::to_string(speed) +
                     " m/s");
        Scene scene(block(cell_m, jitter), 0.1f, {straight(kLeftOfBlock, kRightOfBlock, speed)});
        scene.run(0.14f / speed + 0.1f);
        scene.expect_work();
        if (speed == 0.02f) {
          EXPECT_LT(scene.most_step_n(), kMostStep_n);
        }
        EXPECT_EQ(scene.felt().force_n, Vec3f{}) << "it is through";
        EXPECT_EQ(scene.felt().torque_nm, Vec3f{});
      }
}

// No step is felt, what was planned is cut, and nothing more until it goes on.
TEST(BladeForce, OfABladeThatIsToWaitIsAStopThatLetsItBack) {
  Scene scene(block(0.005), 0.1f, {straight(kLeftOfBlock, kRightOfBlock, 0.1f)});
  scene.run(0.4f);
  scene.wait(1);
  scene.run(0.1f);
  const double planned_m2 = scene.area_m2();
  scene.run(0.1f);
  EXPECT_EQ(scene.area_m2(), planned_m2);
  // 500 N/m over 20 mm, which is the most.
  EXPECT_NEAR(static_cast<double>(scene.felt().force_n.x), -10, 0.5);
  EXPECT_EQ(scene.simulation().state().cuts.cutting_speed_m_s(tool_slot({0}, 0)), 0);
  Bytes snapshot;
  scene.simulation().write_snapshot(snapshot);
  Simulation restored(block(0.005));
  ASSERT_TRUE(restored.restore_snapshot(snapshot).ok());
  EXPECT_EQ(restored.state_hash(), scene.simulation().state_hash());
  scene.wait(0);
  scene.run(0.3f);
  EXPECT_GT(scene.area_m2(), planned_m2 + 1e-4) << "it goes on";
  EXPECT_LE(scene.most_step_n(), static_cast<double>(blades::kMostStep_n) + 1e-4);
}

// control::ToolWaits has a bound of 0.1 m/s for a surgeon's blade.
TEST(BladeForce, TellsHowFastABladeGoesThroughWholeTissueHoweverTough) {
  for (const double energy_j_m2 : {30.0, 750.0}) {
    SCOPED_TRACE(energy_j_m2);
    auto organ = block(0.005);
    organ.material.cut_energy_j_m2 = energy_j_m2;
    for (const float speed : {0.05f, 0.4f}) {
      Scene scene(organ, 0.1f, {straight(kLeftOfBlock, kRightOfBlock, speed)});
      scene.run(0.12f / speed);
      EXPECT_LT(scene.most_speed_m_s(), 1.2f * speed);
      EXPECT_GT(scene.most_speed_m_s(), 0.7f * speed);
    }
  }
}

TEST(BladeForce, TellsHowFastABladeTurnsInWholeTissue) {
  constexpr float kLength_m = 0.12f, kAngle = 1.4f, kSeconds = 1;
  Scene scene(block(0.005), kLength_m, {turned({0, -0.03f, 0.0013f}, kAngle, kSeconds)});
  scene.run(kSeconds);
  const float end_m_s = kLength_m * kAngle / kSeconds;
  EXPECT_GT(scene.most_speed_m_s(), 0.2f * end_m_s);
  EXPECT_LT(scene.most_speed_m_s(), end_m_s);
}

TEST(BladeForce, DoesTheWorkOfAStrokeThroughTheLiver) {
  for (const int tets : {6000, 18'500})
    for (const float speed : {0.02f, 0.1f}) {
      if (tets > 6000 && speed != 0.02f) continue;
      SCOPED_TRACE(std::to_string(tets) + " tets, " + std::to_string(speed) + " m/s");
      const auto organ = liver(tets);
      const Vec3f begin = top_of(organ) + Vec3f{0, -0.06f, 0};
      Scene scene(organ, 0.06f,
                  {straight({-0.13f, begin.y, begin.z}, {0.13f, begin.y, begin.z}, speed)});
      scene.run(0.26f / speed + 0.1f);
      scene.expect_work();
      if (speed == 0.02f) {
        EXPECT_LT(scene.most_step_n(), kMostStep_n);
      }
    }
}

TEST(BladeForce, DoesTheWorkOfABladeThatTurnsAboutItsTip) {
  for (const double cell_m : {0.01, 0.005})
    for (const float seconds : {6.0f, 1.0f}) {
      SCOPED_TRACE("block of " + std::to_string(cell_m) + " m, " + std::to_string(seconds) + " s");
      Scene scene(block(cell_m), 0.12f, {turned({0, -0.03f, 0.0013f}, 1.4f, seconds)});
      scene.run(seconds + 0.2f);
      scene.expect_work();
      EXPECT_NEAR(scene.turning_j() / scene.work_j(), 1, 1e-6) << "the tip stands";
      if (seconds == 6) {
        EXPECT_LT(scene.most_step_n(), kMostStep_n);
      }
    }
}

// The wound grows by elements, so that a blade that stops in tissue has worked for its own way.
TEST(BladeForce, IsOfTheWayToAPartOfAnElement) {
  const auto organ = liver(18'500);
  const Vec3f tip = top_of(organ) + Vec3f{0, -0.03f, 0};
  Scene scene(organ, 0.12f, {turned(tip, 1.2f, 6)});
  scene.run(6.2f);
  const double element_m = cutting::testing::CutOrgan(organ).cutter().mean_h();
  EXPECT_GT(scene.turning_j(), 0.9 * scene.due_j());
  EXPECT_NEAR(scene.work_j(), scene.due_j(), kCutEnergy_j_m2 * 0.05 * element_m);
  EXPECT_LT(scene.most_step_n(), kMostStep_n);
}

// The edge is in tissue from the tip to 3 cm above it.
TEST(BladeForce, ActsWhereTheEdgeIsInTissue) {
  Scene scene(block(0.005), 0.1f, {straight(kLeftOfBlock, kRightOfBlock, 0.05f)});
  scene.run(1.4f);
  const auto& [force, torque] = scene.felt();
  EXPECT_NEAR(force.x, -kCutEnergy_j_m2 * 0.03, 0.15 * kCutEnergy_j_m2 * 0.03);
  EXPECT_NEAR(torque.z / -force.x, 0.015, 0.001);
  EXPECT_NEAR(length(torque), torque.z, 1e-6f);
  std::shared_ptr<PublishedFrame> frame;
  while (!frame) {
    scene.run(0.001f);
    frame = scene.simulation().pop_frame();
  }
  EXPECT_EQ(frame->tools[0].force_n, scene.felt().force_n);
  EXPECT_EQ(frame->tools[0].torque_nm, scene.felt().torque_nm);
}

TEST(BladeForce, IsNothingInAirBesideABladeThatCuts) {
  Scene scene(block(0.01), 0.1f,
              {straight(kLeftOfBlock, kRightOfBlock, 0.1f),
               straight({-0.07f, 0.03f, 0.02f}, {0.07f, 0.03f, 0.02f}, 0.1f)});
  double most_n = 0;
  for (int i = 0; i < 1400; ++i) {
    scene.run(0.001f);
    most_n = std::max(most_n, static_cast<double>(length(scene.felt().force_n)));
    ASSERT_EQ(scene.felt(1).force_n, Vec3f{}) << "tick " << i;
    ASSERT_EQ(scene.felt(1).torque_nm, Vec3f{}) << "tick " << i;
  }
  EXPECT_GT(most_n, 3);
}

// Two blades at once, one three times as deep as the other.
TEST(BladeForce, IsOverSoonAfterTissue) {
  Scene scene(block(0.01), 0.1f, {straight(kLeftOfBlock, kRightOfBlock, 0.4f)});
  const auto tip_x = [&] {
    return scene.simulation().state().tools[tool_slot({0}, 0)].pose.position.x;
  };
  while (tip_x() < 0.0615f) {
    scene.run(0.001f);
    ASSERT_LT(scene.simulation().current_tick(), 400u);
  }
  const float left_n = length(scene.felt().force_n);
  EXPECT_GT(left_n, 0);
  scene.run(0.008f + left_n / (1000 * blades::kMostStep_n));
  EXPECT_EQ(scene.felt().force_n, Vec3f{});
}

TEST(BladeForce, IsOfEachBladesOwnWound) {
  const Way deep = straight(kLeftOfBlock, kRightOfBlock, 0.1f);
  const Way shallow = straight({-0.07f, 0.01f, 0.0237f}, {0.07f, 0.01f, 0.0237f}, 0.1f);
  Scene both(block(0.005), 0.1f, {deep, shallow});
  both.run(0.9f);
  EXPECT_NEAR(both.felt(0).force_n.x, -kCutEnergy_j_m2 * 0.03, 0.15 * kCutEnergy_j_m2 * 0.03);
  EXPECT_NEAR(both.felt(1).force_n.x, -kCutEnergy_j_m2 * 0.01, 0.15 * kCutEnergy_j_m2 * 0.01);
}

TEST(BladeForce, FadesWhereABladeStands) {
  Scene scene(block(0.01), 0.1f, {straight(kLeftOfBlock, {0, -0.01f, 0.0013f}, 0.02f)});
  scene.run(3.4f);
  EXPECT_LT(scene.felt().force_n.x, -3);
  scene.run(0.2f);
  const double work_j = scene.work_j();
  scene.run(1.0f);
  EXPECT_EQ(scene.felt().force_n, Vec3f{});
  EXPECT_EQ(scene.felt().torque_nm, Vec3f{});
  EXPECT_NEAR(scene.work_j(), work_j, 1e-9);
  EXPECT_LT(scene.most_step_n(), kMostStep_n);
}

// The blade goes back and forth through the same wound.
TEST(BladeForce, IsLittleInAWoundThatIsThere) {
  constexpr float kSpeed = 0.05f;
  const Vec3f end{0.03f, -0.01f, 0.0013f};
  const float there_s = length(end - kLeftOfBlock) / kSpeed;
  const Way in = straight(kLeftOfBlock, end, kSpeed), out = straight(end, kLeftOfBlock, kSpeed);
  Scene scene(block(0.01), 0.1f, {[=](float t) {
                const float turns = std::floor(t / there_s);
                const float rest = t - turns * there_s;
                return static_cast<int>(turns) % 2 == 0 ? in(rest) : out(rest);
              }});
  scene.run(there_s);
  const double into_j = scene.work_j();
  scene.run(there_s);
  const double back_j = scene.work_j() - into_j;
  scene.run(there_s);
  const double again_j = scene.work_j() - into_j - back_j;
  EXPECT_GT(into_j, 0.35);
  EXPECT_LT(back_j, 0.1 * into_j);
  EXPECT_LT(again_j, 0.1 * into_j);
}

// A blade goes towards what a grasp holds, is stopped there, and goes on for 12 mm. Then the jaws
// open, or the blade is lifted: no hand feels a step.
TEST(BladeForce, ChangesGraduallyWhereABladeIsStopped) {
  constexpr float kMost_n = 0.3f, kRounding_n = 1e-4f;
  const auto organ = block(0.01);
  for (const bool is_lifted : {false, true}) {
    SCOPED_TRACE(is_lifted ? "the blade is lifted" : "the jaws open");
    Simulation simulation(organ);
    const ToolSlot blade = tool_slot({0}, 0), jaws = tool_slot({1}, 0);
    Vec3f last;
    float most_step_n = 0, most_n = 0;
    for (Tick tick = 1; tick <= 1500; ++tick) {
      hands::TickInputs inputs;
      if (tick == 1)
        for (std::uint8_t hand = 0; hand < 2; ++hand) {
          hands::HandJoin join{.slot = {hand}};
          join.shapes[0] = {
              .radius_m = 0.002f, .length_m = 0.3f, .reach_m = 0.012f, .edge_m = 0.05f};
          inputs.joins.push_back(join);
        }
      const bool is_over = tick > 1000;
      const float x = -0.07f + 0.1f * std::min(0.7f, static_cast<float>(tick) * 1e-3f);
      if (tick % 8 == 1) {
        inputs.samples.push_back({blade,
                                  {{{x, -0.01f, 0.0013f}, rotation_from_z({0, 1, 0})},
                                   is_over && is_lifted ? tool::Verb::None : tool::Verb::Cut}});
        inputs.samples.push_back({jaws,
                                  {{{-0.01f, 0.02f, 0}, rotation_from_z({0, 1, 0})},
                                   is_over && !is_lifted ? tool::Verb::None : tool::Verb::Grasp}});
      }
      simulation.tick(inputs, {});
      const Vec3f now = simulation.state().cuts.felt(blade).force_n;
      most_step_n = std::max(most_step_n, length(now - last));
      most_n = std::max(most_n, length(now));
      last = now;
    }
    std::printf("up to %.2f N, by %.3f N in a tick\n", most_n, most_step_n);
    EXPECT_GT(most_n, 4);
    EXPECT_LE(most_step_n, kMost_n + kRounding_n);
    // Tissue that goes back where it was may still pull at a blade that stands in it.
    EXPECT_LT(length(last), is_lifted ? 1e-9f : 0.05f);
  }
}

TEST(BladeForce, GoesOnFromASnapshot) {
  const std::vector<Way> ways{straight(kLeftOfBlock, kRightOfBlock, 0.1f)};
  Scene a(block(0.01), 0.1f, ways), b(block(0.01), 0.1f, ways);
  a.run(0.5f);
  Bytes snapshot;
  a.simulation().write_snapshot(snapshot);
  const auto restored = b.simulation().restore_snapshot(snapshot);
  ASSERT_TRUE(restored.ok()) << restored.error().message;
  EXPECT_EQ(b.felt().force_n, a.felt().force_n);
  EXPECT_EQ(b.felt().torque_nm, a.felt().torque_nm);
  for (int i = 0; i < 300; ++i) {
    a.run(0.001f), b.run(0.001f);
    ASSERT_EQ(b.felt().force_n, a.felt().force_n) << "tick " << i;
    ASSERT_EQ(b.felt().torque_nm, a.felt().torque_nm) << "tick " << i;
    ASSERT_EQ(b.simulation().state_hash(), a.simulation().state_hash()) << "tick " << i;
  }
  EXPECT_LT(a.felt().force_n.x, -3);
}

TEST(BladeForce, DoesTheWorkOfWildStrokes) {
  const auto organ = liver(6000);
  const Vec3f middle = top_of(organ) + Vec3f{0, -0.03f, 0};
  Scene scene(organ, 0.06f, {[=](float t) {
                const float s = 10 * t;  // 0.5 m/s and more
                const Vec3f lean{0.4f * std::sin(1.3f * s), 1, 0.4f * std::sin(0.9f * s)};
                const Vec3f away{0.05f * std::sin(s), 0.02f * std::sin(0.37f * s),
                                 0.03f * std::sin(0.61f * s)};
                return Pose{middle + away, rotation_from_z(normalized(lean, {}))};
              }});
  scene.run(2);
  scene.expect_work();
  EXPECT_LT(scene.most_step_n(), 1);
}

}  // namespace
}  // namespace trocar::step
