// Contact as a whole, against closed forms.

#include <gtest/gtest.h>

#include <cmath>

#include "tests/contact/scene_fixture.h"

namespace trocar::contact::testing {
namespace {

constexpr double kGravity = 9.81;

// A free block on a flat, horizontal tool; gravity is inclined instead. Returns how fast it slides
// after a second, m/s, along the incline.
double speed_on_incline(float friction, double slope) {
  auto organ = block(5, 3, 5, 0.010, [&](organ::Organ& o) {
    o.fixed_nodes.clear();
    o.material.young_modulus_pa = 60'000;
    o.material.node_damping_per_s = 0;
    o.gravity_m_s2 = {kGravity * std::sin(slope), -kGravity * std::cos(slope), 0};
  });
  HandScene scene(std::move(organ));
  scene.decisions.sweeps = 40;
  scene.decisions.depth_limit = 20;
  const float bottom = -0.010f, radius = 0.010f;
  scene.join(0,
             {.radius_m = radius, .length_m = 0.5f, .half_width_m = 0.05f, .friction = friction});
  // The plate lies along x by its shaft, so that the block has 400 mm to slide.
  const Pose pose{{-0.1f, bottom - radius, 0}, rotation_from_z({1, 0, 0})};
  scene.hold(0, pose, 400);
  Vec3d sum;
  for (const auto& v : scene.world().velocities) sum += to_double(v);
  return (sum / static_cast<double>(scene.world().velocities.size())).x;
}

TEST(Friction, ABlockStaysBelowTheSlipAngleAndSlidesAboveIt) {
  const float friction = 0.4f;
  const double slip_angle = std::atan(0.4);
  EXPECT_NEAR(speed_on_incline(friction, 0.9 * slip_angle), 0, 2e-3);
  const double steep = 1.5 * slip_angle;
  const double acceleration = kGravity * (std::sin(steep) - 0.4 * std::cos(steep));
  const double reached = speed_on_incline(friction, steep);
  EXPECT_NEAR(reached, acceleration * 0.4, 0.08 * acceleration * 0.4);
}

// Pressed by a frictionless ball into a block, at a point `offset_m` beside a node.
double press_force(double spacing_m, int half_cells, const Vec3f& offset_m, float depth = 0.005f) {
  const int n = 2 * half_cells + 1;
  auto organ = block(n, half_cells + 1, n, spacing_m);
  const float top = top_of(organ);
  HandScene scene(std::move(organ));
  scene.decisions.depth_limit = 40;
  scene.decisions.node_limit = 100'000;
  scene.decisions.sweeps = 8;
  scene.join(0, {.radius_m = 0.024f, .length_m = 0.1f, .friction = 0});
  for (int i = 0; i <= 24; ++i)
    scene.hold(0, upright(offset_m + Vec3f{0, top - depth * static_cast<float>(i) / 24.0f, 0}), 8);
  scene.hold(0, upright(offset_m + Vec3f{0, top - depth, 0}), 160);
  return scene.reaction(0).force_n.y;
}

// Against nodes alone, a ball between nodes and one on a node were seen 15 % apart. How near both
// come to Hertz under refinement is measured by deploy/validate.
TEST(Indentation, WhereTheBallMeetsTheMeshMattersLittle) {
  const float cell = 0.008f;
  const double on_node = press_force(0.008, 6, {});
  EXPECT_GT(on_node, 0.1);
  const Vec3f places[] = {{0.5f, 0, 0}, {0.5f, 0, 0.5f}, {0.25f, 0, 0.4f}, {0.33f, 0, -0.33f}};
  for (const auto& place : places)
    EXPECT_NEAR(press_force(0.008, 6, place * cell), on_node, 0.05 * on_node);
}

TEST(Indentation, FinerMeshesOfOneBlockAreSofterByLessAndLess) {
  const double coarse = press_force(0.012, 4, {}), middle = press_force(0.008, 6, {}),
               fine = press_force(0.006, 8, {});
  EXPECT_GT(coarse, middle);
  EXPECT_GT(middle, fine);
  EXPECT_LT(middle / fine - 1, 0.6 * (coarse / fine - 1));
}

// F = 4/3 E / (1 - nu^2) sqrt(R) d^(3/2) on a half-space. This block, four contact radii wide and
// deep and held below, is stiffer, and the mesh adds to that; the power of the depth is Hertz's.
TEST(Indentation, GrowsWithTheDepthAsHertzSays) {
  const float depth = 0.003f;
  const double once = press_force(0.006, 8, {}, depth),
               twice = press_force(0.006, 8, {}, 2 * depth);
  const double hertz = 4.0 / 3 * 4000 / (1 - 0.3 * 0.3) * std::sqrt(0.024) * std::pow(0.003, 1.5);
  EXPECT_GT(once, hertz);
  EXPECT_LT(once, 1.5 * hertz);
  EXPECT_NEAR(std::log2(twice / once), 1.5, 0.15);
}

TEST(Reaction, AnOffAxisPushTurnsTheToolByForceTimesArm) {
  auto organ = block(4, 5, 4, 0.008);
  const float top = top_of(organ), radius = 0.006f, arm = 0.09f;
  HandScene scene(std::move(organ));
  scene.join(0, {.radius_m = radius, .length_m = 0.2f, .friction = 0});
  // Shaft along +x, its tip 90 mm from the block's middle.
  scene.hold(0, {{-arm, top + radius + 0.001f, 0}, rotation_from_z({1, 0, 0})}, 80);
  scene.hold(0, {{-arm, top + radius - 0.003f, 0}, rotation_from_z({1, 0, 0})}, 400);
  const auto reaction = scene.reaction(0);
  ASSERT_GT(reaction.force_n.y, 0.05f);
  EXPECT_NEAR(reaction.torque_nm.z, arm * reaction.force_n.y, 0.02f * arm * reaction.force_n.y);
  EXPECT_NEAR(reaction.torque_nm.x, 0, 0.02f * arm * reaction.force_n.y);
}

// Momenta of a free block about the origin, kg m/s and kg m^2/s.
struct Momenta {
  Vec3d linear, angular;
};
Momenta momenta_of(const world::World& world) {
  Momenta sum;
  for (std::uint32_t n = 0; n < world.node_count(); ++n) {
    const Vec3d p = to_double(world.velocities[n]) * static_cast<double>(world.masses[n]);
    sum.linear += p;
    sum.angular += cross(to_double(world.position(NodeIndex(n))), p);
  }
  return sum;
}

// The block gets what the tool gives: the sums of the forces and torques felt over time are its
// momenta, with a push beside its centre that sets it spinning.
TEST(Reaction, OfAnOffAxisPushIsAllTheMomentumThatAFreeBlockGets) {
  auto organ = block(5, 3, 5, 0.010, [](organ::Organ& o) {
    o.fixed_nodes.clear();
    o.material.young_modulus_pa = 20'000;
    o.material.node_damping_per_s = 0;
  });
  const float top = top_of(organ);
  HandScene scene(std::move(organ));
  scene.decisions.sweeps = 40;
  scene.decisions.depth_limit = 20;
  scene.join(0, {.radius_m = 0.008f, .length_m = 0.2f, .friction = 0.3f});
  Momenta given;
  for (int tick = 0; tick < 120; ++tick) {
    const float depth = 0.004f * static_cast<float>(tick) / 40 - 0.001f;
    const Pose pose = upright({0.012f, top - depth, 0.005f});
    scene.put(0, pose);
    scene.tick();
    const auto reaction = scene.reaction(0);
    const Vec3d force = -to_double(reaction.force_n);
    given.linear += force * static_cast<double>(kTickSeconds);
    given.angular += (cross(to_double(pose.position), force) - to_double(reaction.torque_nm)) *
                     static_cast<double>(kTickSeconds);
  }
  const auto got = momenta_of(scene.world());
  ASSERT_GT(length(given.linear), 1e-4);
  ASSERT_GT(length(given.angular), 1e-6);
  EXPECT_LT(length(got.linear - given.linear), 0.02 * length(given.linear));
  EXPECT_LT(length(got.angular - given.angular), 0.02 * length(given.angular));
}

TEST(Rest, AHeldContactGainsNoEnergyAndItsForceStaysForAMinute) {
  auto organ = block(5, 4, 5, 0.010);
  const float top = top_of(organ);
  HandScene scene(std::move(organ));
  scene.join(0, {.radius_m = 0.012f, .length_m = 0.1f});
  const Pose pose = upright({0.003f, top - 0.004f, -0.002f});
  scene.hold(0, upright({0.003f, top + 0.002f, -0.002f}), 40);
  scene.hold(0, pose, 2000);
  const auto kinetic = [&] {
    double sum = 0;
    for (std::size_t i = 0; i < scene.world().node_count(); ++i)
      sum += 0.5 * static_cast<double>(scene.world().masses[i]) *
             length_squared(to_double(scene.world().velocities[i]));
    return sum;
  };
  const Vec3f before = scene.reaction(0).force_n;
  double most = 0;
  for (int second = 0; second < 60; ++second) {
    scene.hold(0, pose, 1000);
    most = std::max(most, kinetic());
  }
  EXPECT_LT(most, 1e-12) << "J";
  EXPECT_LT(length(scene.reaction(0).force_n - before), 0.005f * length(before));
}

TEST(ThinWall, PressingFromEitherSideIsTheSame) {
  auto organ = catalogue::make_plate();
  const auto press = [&](float side) {
    HandScene scene(organ);
    scene.join(0, {.radius_m = 0.010f, .length_m = 0.1f, .friction = 0});
    const float face = 0.002f;
    const auto at = [&](float height) {
      return Pose{{0.0021f, side * (face + height), 0.0013f}, rotation_from_z({0, side, 0})};
    };
    scene.hold(0, at(0.001f), 40);
    for (int i = 0; i <= 40; ++i)
      scene.hold(0, at(0.001f - 0.007f * static_cast<float>(i) / 40.0f), 8);
    scene.hold(0, at(-0.006f), 800);
    return scene.reaction(0).force_n.y;
  };
  const float above = press(1), below = press(-1);
  EXPECT_GT(above, 0.05f);
  EXPECT_NEAR(-below, above, 0.05f * above);
}

TEST(TwoTools, BothFeelTheirOwnContactOnSharedNodes) {
  auto organ = block(7, 4, 7, 0.010);
  const float top = top_of(organ);
  HandScene scene(std::move(organ));
  for (const auto hand : kHands) scene.join(hand, {.radius_m = 0.008f, .friction = 0});
  for (int i = 0; i < 1200; ++i) {
    const float y = top + 0.001f - 0.006f * std::min(1.0f, static_cast<float>(i) / 600.0f);
    if (i % 8 == 0)
      for (const auto hand : kHands) scene.put(hand, upright({hand == 0 ? -0.009f : 0.009f, y, 0}));
    scene.tick();
  }
  // The mesh is not mirrored in x, hence the tolerance.
  const float left = scene.reaction(0).force_n.y, right = scene.reaction(1).force_n.y;
  EXPECT_GT(left, 0.05f);
  EXPECT_NEAR(left, right, 0.15f * left);
}

}  // namespace
}  // namespace trocar::contact::testing
