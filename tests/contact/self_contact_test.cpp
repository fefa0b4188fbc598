// Tests contact between parts of the same organ.

#include "server/tissue/contact/self_contact.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>

#include "common/base/bytes.h"
#include "server/tissue/contact/contact_law.h"
#include "server/tissue/dynamics/block_descent.h"
#include "tests/contact/folded_organ.h"
#include "tests/contact/scene_fixture.h"

namespace trocar::contact::testing {
namespace {

// An organ and the solver alone, so that a test can start with any velocity.
struct Bodies {
  explicit Bodies(organ::Organ o)
      : organ(std::move(o)), world(organ), solver(organ, world), finder(organ) {
    for (std::uint32_t i = 0; i < world.node_count(); ++i)
      if (world.node_classes[i] != world::NodeClass::Fixed) near.push_back(NodeIndex(i));
  }
  void tick() {
    ++world.tick;
    contacts.clear();
    finder.find(world, pairs, contacts);
    solver.solve(contacts, near, {.sweeps = sweeps}, world);
  }
  template <typename Velocity>
  void set_velocities(Velocity&& velocity) {
    for (std::size_t i = 0; i < world.node_count(); ++i)
      world.velocities[i] = velocity(organ.mesh.rest_positions[i]);
    solver.read_state(world);
  }
  Vec3d momentum() const {
    Vec3d sum;
    for (std::size_t i = 0; i < world.node_count(); ++i)
      sum += to_double(world.velocities[i]) * static_cast<double>(world.masses[i]);
    return sum;
  }
  Vec3d spin() const {
    Vec3d sum;
    for (std::size_t i = 0; i < world.node_count(); ++i)
      sum += cross(to_double(world.position(NodeIndex(i))), to_double(world.velocities[i])) *
             static_cast<double>(world.masses[i]);
    return sum;
  }
  double kinetic() const {
    double sum = 0;
    for (std::size_t i = 0; i < world.node_count(); ++i)
      sum += 0.5 * static_cast<double>(world.masses[i]) *
             length_squared(to_double(world.velocities[i]));
    return sum;
  }
  // Mean height of the upper body less that of the lower one.
  double apart() const {
    double upper = 0, lower = 0;
    int uppers = 0, lowers = 0;
    for (std::size_t i = 0; i < world.node_count(); ++i) {
      const double y = static_cast<double>(world.position(NodeIndex(i)).y);
      if (organ.mesh.rest_positions[i].y > 0)
        upper += y, ++uppers;
      else
        lower += y, ++lowers;
    }
    return upper / uppers - lower / lowers;
  }

  organ::Organ organ;
  world::World world;
  dynamics::BlockDescent solver;
  SelfContactFinder finder;
  SelfContactTable pairs;
  ContactList contacts;
  std::vector<NodeIndex> near;
  std::uint32_t sweeps = 8;
};

struct Crash {
  double deepest_m = 0, nearest_m = 1e9, greatest_n = 0;
  std::size_t most_pairs = 0;
};
// Two slabs, 7 mm thick, fly at each other.
Crash crash(Bodies& bodies, float speed, int ticks) {
  bodies.set_velocities([&](const Vec3d& p) {
    return Vec3f{0, p.y > 0 ? -speed : speed, 0} * 0.5f;
  });
  Crash result;
  for (int i = 0; i < ticks; ++i) {
    bodies.tick();
    result.most_pairs = std::max(result.most_pairs, bodies.contacts.points.size());
    result.nearest_m = std::min(result.nearest_m, bodies.apart());
    double pressed = 0;
    for (const auto& point : bodies.contacts.points)
      pressed +=
          static_cast<double>(load_at(point, displacement_of(point, bodies.world)).pressed_n);
    result.greatest_n = std::max(result.greatest_n, pressed);
    if (!bodies.contacts.points.empty())
      result.deepest_m = std::max(result.deepest_m, deepest_inside(bodies.organ, bodies.world));
  }
  return result;
}

TEST(Slabs, AtHandSpeedTheyStopWhereTheyTouch) {
  for (const double offset : {0.0, 0.0011, 0.0017}) {
    Bodies bodies(make_flaps({.hinge = 0, .offset_m = offset}));
    const auto result = crash(bodies, 0.1f, 120);
    std::printf("0.1 m/s: deepest %.3f mm, %zu points, up to %.2f N\n", result.deepest_m * 1e3,
                result.most_pairs, result.greatest_n);
    EXPECT_GT(result.most_pairs, 20u);
    EXPECT_GT(result.greatest_n, 0.02);
    EXPECT_LT(result.deepest_m, 0.0005);
  }
}

TEST(Slabs, NothingPassesAtAMetrePerSecond) {
  for (const double offset : {0.0, 0.0011, 0.0017})
    for (const float speed : {1.0f, 1.3f}) {
      Bodies bodies(make_flaps({.hinge = 0, .offset_m = offset}));
      const auto result = crash(bodies, speed, 60);
      std::printf("%.1f m/s: deepest %.3f mm, nearest %.2f mm, at the end %.2f mm\n",
                  static_cast<double>(speed), result.deepest_m * 1e3, result.nearest_m * 1e3,
                  bodies.apart() * 1e3);
      EXPECT_LT(result.deepest_m, 0.0025);
      EXPECT_GT(bodies.apart(), 0.0065);
    }
}

TEST(Slabs, WithoutContactTheyDoPass) {
  Bodies bodies(make_flaps({.hinge = 0}));
  bodies.set_velocities([](const Vec3d& p) { return Vec3f{0, p.y > 0 ? -0.5f : 0.5f, 0}; });
  for (int i = 0; i < 60; ++i) bodies.solver.solve({}, bodies.near, {}, bodies.world);
  EXPECT_LT(bodies.apart(), 0);
}

TEST(Slabs, ACollisionKeepsMomentumAndLosesEnergy) {
  Bodies bodies(make_flaps({.hinge = 0, .offset_m = 0.0013}));
  bodies.sweeps = 60;
  // The upper one is hit off its middle and sideways.
  bodies.set_velocities([](const Vec3d& p) {
    return p.y > 0 ? Vec3f{0.05f, -0.3f, 0.02f} : Vec3f{};
  });
  const Vec3d momentum = bodies.momentum(), spin = bodies.spin();
  const double energy = bodies.kinetic();
  std::size_t most = 0;
  for (int i = 0; i < 80; ++i) {
    bodies.tick();
    most = std::max(most, bodies.contacts.points.size());
    EXPECT_LT(bodies.kinetic(), 1.001 * energy);
  }
  ASSERT_GT(most, 20u);
  EXPECT_LT(length(bodies.momentum() - momentum), 0.002 * length(momentum));
  const double turning = 0.3 * length(momentum) / 0.3 * 0.01;  // 10 mm off the middle
  EXPECT_LT(length(bodies.spin() - spin), 0.02 * turning);
}

TEST(Points, AddNothingToTheWhole) {
  Bodies bodies(make_flaps({.hinge = 0, .offset_m = 0.0013}));
  crash(bodies, 0.2f, 38);
  ASSERT_GT(bodies.contacts.points.size(), 20u);
  double pressed = 0;
  for (const auto& point : bodies.contacts.self_points()) {
    const auto load = load_at(point, displacement_of(point, bodies.world));
    Vec3d force, torque;
    for (std::size_t k = 0; k < point.node_count; ++k) {
      const Vec3d f = to_double(load.gradient) * -static_cast<double>(point.weights[k]);
      force += f;
      torque += cross(to_double(bodies.world.position(point.nodes[k])), f);
    }
    const auto n = static_cast<double>(load.pressed_n);
    pressed += n;
    EXPECT_LE(length(force), 1e-6 * n);
    EXPECT_LE(length(torque), 2e-4 * n) << "0.2 mm beside it";
  }
  EXPECT_GT(pressed, 0.01);
}

// Tissue is crumpled at random, deep into itself: pairs slide from triangle to triangle. Where they
// are looked at anew, none presses harder than it already did there, but for what comes back.
TEST(Points, PressNoHarderForBeingLookedAtAnew) {
  Bodies bodies(make_flaps({.hinge = 0, .offset_m = 0.0013}));
  crash(bodies, 0.3f, 30);
  ASSERT_GT(bodies.contacts.points.size(), 20u);
  std::mt19937 random(7);
  std::uniform_real_distribution<float> step(-2e-4f, 2e-4f);
  const auto gap_at = [&](const ContactPoint& point) {
    return dot(point.normal, displacement_of(point, bodies.world) - point.plane);
  };
  int pressed = 0, moved_on = 0;
  for (int i = 0; i < 300; ++i) {
    const auto before = bodies.contacts.points;
    const auto pairs_before = bodies.pairs;
    for (std::size_t n = 0; n < bodies.world.node_count(); ++n) {
      const Vec3f way{step(random),
                      step(random) + (bodies.organ.mesh.rest_positions[n].y > 0 ? -1e-5f : 1e-5f),
                      step(random)};
      bodies.world.displacements[n] += way;
      bodies.world.velocities[n] = way * 1000.0f;
    }
    ++bodies.world.tick;
    bodies.contacts.clear();
    bodies.finder.find(bodies.world, bodies.pairs, bodies.contacts);
    for (const auto& point : bodies.contacts.self_points()) {
      const float gap = gap_at(point);
      if (gap >= 0) continue;
      ++pressed;
      const auto old = std::ranges::find(before, point.nodes[0],
                                         [](const ContactPoint& p) { return p.nodes[0]; });
      ASSERT_NE(old, before.end()) << "a pair begins before it presses";
      moved_on += old->nodes != point.nodes;
      // 1 % of the way of one node against another, at most 0.7 mm, comes back.
      EXPECT_GE(gap, std::min(0.0f, gap_at(*old)) - 8e-6f);
    }
  }
  std::printf("%d points pressed, %d of them on another triangle than before\n", pressed, moved_on);
  EXPECT_GT(pressed, 1000);
  EXPECT_GT(moved_on, 100);
}

// However long ago the last pass was.
TEST(Slabs, NothingPassesThatIsSuddenlyFast) {
  for (const int still : {1, 2, 3, 4, 5}) {
    Bodies bodies(make_flaps({.hinge = 0, .offset_m = 0.0011}));
    for (int i = 0; i < still; ++i) bodies.tick();
    const auto result = crash(bodies, 1.3f, 60);
    EXPECT_LT(result.deepest_m, 0.0025) << still;
    EXPECT_GT(bodies.apart(), 0.0065) << still;
  }
}

TEST(Slabs, WhatIsSlowIsLookedAtEveryFourthTick) {
  Bodies bodies(make_flaps({.hinge = 0}));
  bodies.set_velocities([](const Vec3d& p) { return Vec3f{0, p.y > 0 ? -0.1f : 0.1f, 0}; });
  int passes = 0;
  for (int i = 0; i < 40; ++i) {
    bodies.tick();
    passes += bodies.pairs.last_pass() == bodies.world.tick;
  }
  EXPECT_EQ(passes, 40 / kPassEvery);
  bodies.pairs.note_edit();
  bodies.tick();
  EXPECT_EQ(bodies.pairs.last_pass(), bodies.world.tick) << "what an edit changed is looked at now";
}

TEST(Rest, BuiltInOrgansDoNotTouchThemselves) {
  const organ::Organ organs[] = {*catalogue::make_liver(), *catalogue::make_stomach(),
                                 catalogue::make_lattice(), catalogue::make_plate()};
  for (const auto& organ : organs) {
    world::World world(organ);
    SelfContactFinder finder(organ);
    SelfContactTable pairs;
    ContactList contacts;
    finder.find(world, pairs, contacts);
    std::size_t pressing = contacts.self_seeds.size();
    std::printf("%s: %zu pairs listed, %zu points\n", organ.name.c_str(), finder.pairs_listed(),
                contacts.points.size());
    EXPECT_EQ(pressing, 0u) << organ.name;
    EXPECT_TRUE(contacts.points.empty()) << organ.name;
  }
}

TEST(Rest, FacesThatTouchAtRestStayWithoutForce) {
  // Two slabs without a gap: nodes of both on the same places.
  auto organ = make_flaps({.gap = 2, .hinge = 0});
  for (auto& p : organ.mesh.rest_positions) p.y -= p.y > 0 ? 0.0035 : -0.0035;
  Bodies bodies(std::move(organ));
  for (int i = 0; i < 20; ++i) bodies.tick();
  EXPECT_GT(bodies.pairs.nodes().size(), 20u) << "near each other";
  EXPECT_TRUE(bodies.contacts.points.empty()) << "and nothing presses";
  EXPECT_TRUE(bodies.contacts.self_seeds.empty());
  EXPECT_LT(bodies.kinetic(), 1e-14) << "J, what rounding moves";
  // But they do not pass either.
  const auto result = crash(bodies, 0.1f, 60);
  EXPECT_LT(result.deepest_m, 0.0005);
}

// How far each of two tools closes in: half a millimetre to the flap, 3.5 to the middle of the gap,
// the rest is tissue pressed.
constexpr double kPressed = 0.0052;
constexpr Flaps kSmall{.length = 6, .width = 4, .damping_per_s = 10};

// Two flat tools squeeze a hinged pair of flaps.
class Squeezed {
 public:
  explicit Squeezed(unsigned workers = 1, const step::TickDecisions& how = {},
                    const Flaps& flaps = {.length = 10, .damping_per_s = 10})
      : decisions(how), flaps_(flaps) {
    auto organ = make_flaps(flaps_);
    for (std::size_t i = 0; i < organ.mesh.node_count(); ++i)
      if (organ.mesh.rest_positions[i].x < -flaps_.length / 2.0 * flaps_.spacing_m + 1e-6)
        organ.fixed_nodes.push_back(NodeIndex(i));
    simulation.emplace(std::move(organ), workers);
  }
  // Both tools, `closed_m` in from where they touch.
  void step(double closed_m) {
    hands::TickInputs inputs;
    const Tick tick = simulation->current_tick() + 1;
    for (std::uint8_t hand = 0; hand < 2; ++hand) {
      if (tick == 1) {
        hands::HandJoin join{.slot = {hand}};
        join.shapes[0] = {
            .radius_m = kRadius, .length_m = 0.2f, .half_width_m = 0.03f, .friction = 0.6f};
        inputs.joins.push_back(join);
      }
      if (tick % 8 != 1) continue;
      const float side = hand == 0 ? 1.0f : -1.0f;
      const float y =
          side * static_cast<float>(flaps_.half_height_m() + 0.0005 + kRadius - closed_m);
      inputs.samples.push_back({tool_slot({hand}, 0),
                                {{{-0.002f, y, 0}, rotation_from_z({1, 0, 0})}, tool::Verb::Push}});
    }
    simulation->tick(inputs, decisions);
  }
  void close(double to_m, int ticks) {
    const double from = closed_;
    for (int i = 1; i <= ticks; ++i) step(from + (to_m - from) * i / ticks);
    closed_ = to_m;
  }
  void hold(int ticks) {
    for (int i = 0; i < ticks; ++i) step(closed_);
  }
  Reaction reaction(std::uint8_t hand) const {
    const auto& contacts = simulation->context().contact.found;
    for (const auto& tool : contacts.tools)
      if (tool.tool == tool_slot({hand}, 0))
        return reaction_on(contacts, tool, simulation->state().world);
    return {};
  }
  // Returns the vertical force of the lower flap on the upper one, N.
  double force_between() const {
    double sum = 0;
    for (const auto& point : simulation->context().contact.found.self_points()) {
      const auto load = load_at(point, displacement_of(point, simulation->state().world));
      const bool is_upper = simulation->organ().mesh.rest_positions[point.nodes[0].value].y > 0;
      sum += static_cast<double>(load.gradient.y) * (is_upper ? -1 : 1);
    }
    return sum;
  }
  double deepest() const { return deepest_inside(simulation->organ(), simulation->state().world); }

  static constexpr float kRadius = 0.004f;
  std::optional<step::Simulation> simulation;
  step::TickDecisions decisions;

 private:
  Flaps flaps_;
  double closed_ = 0;
};

TEST(Squeeze, TheFlapsStopAtEachOtherAndPassTheForceOn) {
  Squeezed squeezed;
  squeezed.close(kPressed, 104);
  squeezed.hold(500);
  const double upper = static_cast<double>(squeezed.reaction(0).force_n.y),
               lower = static_cast<double>(squeezed.reaction(1).force_n.y),
               between = squeezed.force_between();
  std::printf("tools %.3f and %.3f N, between %.3f N, %zu points, deepest %.3f mm\n", upper, lower,
              between, squeezed.simulation->context().contact.found.self_points().size(),
              squeezed.deepest() * 1e3);
  EXPECT_GT(upper, 0.1);
  EXPECT_NEAR(-lower, upper, 0.1 * upper);
  EXPECT_NEAR(between, upper, 0.2 * upper) << "the hinge has the rest";
  EXPECT_LT(squeezed.deepest(), 0.0005);
}

TEST(Squeeze, FastToolsDoNotPushAFlapThroughTheOther) {
  Squeezed squeezed;
  squeezed.close(kPressed, 10);  // each at 0.5 m/s
  double deepest = 0;
  for (int i = 0; i < 20; ++i) {
    squeezed.hold(10);
    deepest = std::max(deepest, squeezed.deepest());
  }
  std::printf("deepest %.3f mm\n", deepest * 1e3);
  EXPECT_LT(deepest, 0.001);
  EXPECT_GT(squeezed.force_between(), 0.1);
}

TEST(Squeeze, HashesDoNotDependOnWorkers) {
  for (const auto boundary : {world::Boundary::Frozen, world::Boundary::Graded}) {
    const step::TickDecisions how{.depth_limit = 6, .boundary = boundary};
    Squeezed one(1, how, kSmall), two(2, how, kSmall);
    for (int i = 0; i < 100; ++i) {
      const double closed = kPressed * std::min(1.0, i / 60.0);
      one.step(closed), two.step(closed);
    }
    EXPECT_GT(one.simulation->state().self_contacts.nodes().size(), 20u);
    EXPECT_EQ(one.simulation->state_hash(), two.simulation->state_hash());
  }
}

TEST(Squeeze, ARestoredStateGoesOnBitForBit) {
  Squeezed one, two;
  const auto closed = [](int i) { return kPressed * std::min(1.0, i / 80.0); };
  Bytes snapshot;
  for (int i = 0; i < 300; ++i) {
    one.step(closed(i));
    if (i < 71) two.step(closed(i));
    if (i != 70 && i != 100 && i != 173) continue;
    snapshot.clear();
    one.simulation->write_snapshot(snapshot);
    EXPECT_FALSE(one.simulation->state().self_contacts.nodes().empty());
    ASSERT_TRUE(two.simulation->restore_snapshot(snapshot).ok());
    ASSERT_EQ(one.simulation->state_hash(), two.simulation->state_hash());
    const int next = i == 70 ? 100 : i == 100 ? 173 : 299;
    Squeezed* const second = &two;
    for (int k = i + 1; k <= next; ++k) second->step(closed(k));
  }
  EXPECT_EQ(one.simulation->state_hash(), two.simulation->state_hash());
}

TEST(Squeeze, DamagedPairsAreRefused) {
  Squeezed squeezed;
  squeezed.close(kPressed, 100);
  const auto& pairs = squeezed.simulation->state().self_contacts;
  const std::size_t count = pairs.nodes().size();
  ASSERT_GT(count, 4u);
  Bytes good;
  squeezed.simulation->write_snapshot(good);
  const std::size_t places = good.size() - sizeof(SelfContactPlace) * count,
                    triangles = places - 4 - 4 * count, nodes = triangles - 4 - 4 * count;
  const auto refuses = [&](std::size_t at, std::uint32_t value) {
    Bytes bad = good;
    for (std::size_t i = 0; i < 4; ++i) bad[at + i] = static_cast<std::uint8_t>(value >> 8 * i);
    return !squeezed.simulation->restore_snapshot(bad).ok();
  };
  EXPECT_TRUE(refuses(triangles, 1'000'000)) << "no such triangle";
  EXPECT_TRUE(refuses(nodes, 1'000'000)) << "no such node";
  EXPECT_TRUE(refuses(nodes + 4, pairs.nodes()[0].value)) << "a node twice";
  const std::uint32_t not_a_number = 0x7fc00000;
  for (std::size_t i = 0; i < sizeof(SelfContactPlace) / 4; ++i)
    EXPECT_TRUE(refuses(places + 4 * i, not_a_number)) << i;
  EXPECT_TRUE(refuses(places, std::bit_cast<std::uint32_t>(2.0f))) << "beside its triangle";
  EXPECT_TRUE(refuses(places - 4, 3)) << "places for some";
  EXPECT_TRUE(refuses(nodes - 4, 0)) << "no pairs";
  EXPECT_TRUE(refuses(nodes - 4, 0xffffffff)) << "too many";
  EXPECT_TRUE(squeezed.simulation->restore_snapshot(good).ok());
}

// Tissue that lies still is looked at every kLookEvery ticks, and found where it was.
TEST(Squeeze, PairsThatLieStillAreSeldomLookedAt) {
  Squeezed squeezed;
  squeezed.close(kPressed, 100);
  squeezed.hold(3000);
  world::World world = squeezed.simulation->state().world;
  SelfContactTable pairs = squeezed.simulation->state().self_contacts;
  const auto count = pairs.nodes().size();
  ASSERT_GT(count, 20u);
  for (auto& velocity : world.velocities)
    ASSERT_LT(length(velocity), 1e-4f) << "the fold has come to rest";
  SelfContactFinder finder(squeezed.simulation->organ());
  ContactList list;
  std::size_t looked_at = 0;
  for (Tick i = 0; i < kLookEvery; ++i, ++world.tick) {
    const auto before = pairs;
    list.points.clear();
    finder.find(world, pairs, list);
    looked_at += finder.pairs_looked_at();
    ASSERT_EQ(pairs.nodes().size(), count);
    for (std::size_t k = 0; k < count; ++k) {
      EXPECT_EQ(pairs.triangles()[k], before.triangles()[k]);
      EXPECT_LT(length(pairs.places()[k].weights - before.places()[k].weights), 1e-3f);
      EXPECT_LT(length(pairs.places()[k].normal - before.places()[k].normal), 1e-3f);
    }
  }
  EXPECT_EQ(looked_at, count);
}

TEST(Squeeze, AHeldFoldGainsNoEnergyInTenSeconds) {
  Squeezed squeezed(1, {}, kSmall);
  squeezed.close(kPressed, 104);
  squeezed.hold(1500);
  const auto kinetic = [&] {
    const auto& world = squeezed.simulation->state().world;
    double sum = 0;
    for (std::size_t i = 0; i < world.node_count(); ++i)
      sum += 0.5 * static_cast<double>(world.masses[i]) *
             length_squared(to_double(world.velocities[i]));
    return sum;
  };
  const double before = squeezed.force_between();
  double most = 0;
  for (int i = 0; i < 100; ++i) {
    squeezed.hold(100);
    most = std::max(most, kinetic());
  }
  std::printf("kinetic at most %.3g J, force %.4f then %.4f N\n", most, before,
              squeezed.force_between());
  EXPECT_LT(most, 1e-10) << "J";
  EXPECT_NEAR(squeezed.force_between(), before, 0.01 * before);
}

}  // namespace
}  // namespace trocar::contact::testing
