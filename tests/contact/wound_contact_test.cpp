// The sides of a wound, and pieces that have come free, against each other.

#include <gtest/gtest.h>

#include <cmath>

#include "common/base/bytes.h"
#include "server/tissue/contact/contact_law.h"
#include "tests/contact/folded_organ.h"
#include "tests/contact/scene_fixture.h"

namespace trocar::contact::testing {
namespace {

// Returns a block of 40 x 24 x 24 mm, held at the bottom, whose tissue is soft beside the contact.
organ::Organ cube() {
  return block(11, 7, 7, 0.004, [](organ::Organ& o) {
    o.material.young_modulus_pa = 6000;
    o.material.node_damping_per_s = 20;
    o.gravity_m_s2 = {};
  });
}

// How deep a node of the surface is inside a tet that is not its own, over everything that there is
// now.
double deepest_overlap(const step::Simulation& simulation) {
  const auto& topology = simulation.state().cuts.topology();
  const auto& world = simulation.state().world;
  const auto& layout = simulation.layout();
  double deepest = 0;
  const auto at = [&](NodeIndex n) {
    return topology.rest()[n.value] + to_double(world.displacements[n.value]);
  };
  for (const auto node : world.surface_nodes) {
    const Vec3d p = at(node);
    bool is_inside = false;
    for (std::uint32_t t = 0; t < topology.tet_count() && !is_inside; ++t) {
      if (!topology.has_tet(TetIndex(t))) continue;
      const auto& tet = topology.tet(TetIndex(t));
      if (std::ranges::find(tet, node) != tet.end()) continue;
      const Vec3d a = at(tet[0]), ab = at(tet[1]) - a, ac = at(tet[2]) - a, ad = at(tet[3]) - a,
                  ap = p - a;
      if (length_squared(ap) > 1e-3) continue;
      const double volume = dot(cross(ab, ac), ad);
      const double v = dot(cross(ap, ac), ad) / volume, w = dot(cross(ab, ap), ad) / volume,
                   x = dot(cross(ab, ac), ap) / volume;
      is_inside = v > 0 && w > 0 && x > 0 && v + w + x < 1;
    }
    if (!is_inside) continue;
    double nearest = 1e9;
    for (const auto& t : layout.triangles) {
      if (!t[0].is_valid()) continue;
      const NodeIndex n[3] = {layout.node_of_vertex[t[0].value], layout.node_of_vertex[t[1].value],
                              layout.node_of_vertex[t[2].value]};
      if (n[0] == node || n[1] == node || n[2] == node) continue;
      nearest = std::min(nearest, distance_to_triangle(p, at(n[0]), at(n[1]), at(n[2])));
    }
    deepest = std::max(deepest, nearest);
  }
  return deepest;
}

double pressed_n(const HandScene& scene) {
  double sum = 0;
  for (const auto& point : scene.simulation.context().contact.found.self_points())
    sum += static_cast<double>(load_at(point, displacement_of(point, scene.world())).pressed_n);
  return sum;
}

// A state that is read anew goes on like the one that has come there: what is listed depends on the
// way, what is found must not. Ticks without hands.
void expect_restorable(HandScene& scene) {
  Bytes snapshot;
  scene.simulation.write_snapshot(snapshot);
  HandScene fresh(scene.simulation.organ());
  ASSERT_TRUE(fresh.simulation.restore_snapshot(snapshot).ok());
  for (int i = 0; i < 4; ++i)
    ASSERT_EQ(scene.tick().state_hash, fresh.tick().state_hash)
        << "tick " << scene.simulation.current_tick();
}

// A blade through the block's middle, from below `tip_y` to above it.
void cut_across(HandScene& scene, float tip_y, float x = 0.0007f) {
  scene.join(0, {.radius_m = 0.001f, .length_m = 0.2f, .edge_m = 0.06f});
  for (int i = 0; i <= 360; ++i) {
    const Vec3f tip{x, tip_y, -0.018f + 1e-4f * static_cast<float>(i)};
    if (i % 4 == 0) scene.put(0, upright(tip), tool::Verb::Cut);
    scene.tick();
    EXPECT_LT(pressed_n(scene), 1e-4) << "the cut itself presses nothing, tick " << i;
  }
  scene.put(0, upright({0, 0.3f, 0}), tool::Verb::None);
  scene.tick();
}

constexpr tool::ToolShape kPlate{
    .radius_m = 0.003f, .length_m = 0.04f, .half_width_m = 0.02f, .friction = 0.3f};

// Shaft up, its width along z.
constexpr Quatf kUprightAcross{-0.5f, -0.5f, -0.5f, 0.5f};

// Two plates close in along x, each by `by_m` past where they touch.
void squeeze(HandScene& scene, float from_m, float by_m, int ticks) {
  for (int i = 0; i <= ticks; ++i) {
    const float x = 0.020f + kPlate.radius_m + 0.0005f - from_m -
                    (by_m - from_m) * static_cast<float>(i) / static_cast<float>(ticks);
    for (const float side : {1.0f, -1.0f})
      scene.put(side > 0 ? 1 : 2, {{side * x, -0.006f, 0}, kUprightAcross});
    scene.tick();
  }
}

TEST(Lips, PressedTogetherTheyCarryTheLoadOfTheUncutBlock) {
  double load[2] = {}, between = 0, deepest = 0;
  for (const bool is_cut : {false, true}) {
    HandScene scene(cube());
    if (is_cut) cut_across(scene, -0.009f);
    scene.join(1, kPlate);
    scene.join(2, kPlate);
    squeeze(scene, 0, 0.0035f, 200);
    for (int i = 0; i < 30; ++i) squeeze(scene, 0.0035f, 0.0035f, 9);
    const double right = static_cast<double>(scene.reaction(1).force_n.x),
                 left = static_cast<double>(scene.reaction(2).force_n.x);
    between = pressed_n(scene);
    deepest = deepest_overlap(scene.simulation);
    std::printf("%s: plates %.4f and %.4f N, between %.4f N, %zu pairs, deepest %.4f mm\n",
                is_cut ? "cut" : "uncut", right, left, between,
                scene.simulation.context().contact.found.self_points().size(), 1e3 * deepest);
    load[is_cut ? 1 : 0] = right;
  }
  EXPECT_NEAR(load[1], load[0], 0.03 * load[0]);
  EXPECT_GT(between, 0.5 * load[0]) << "the tissue below the cut has the rest";
  EXPECT_LT(deepest, 0.0001);
}

// A block that two plates hold squeezed while a blade goes through it; then they squeeze harder.
void drive_cut_under_pressure(HandScene& scene, int tick) {
  if (tick == 0) {
    scene.join(0, {.radius_m = 0.001f, .length_m = 0.2f, .edge_m = 0.06f});
    scene.join(1, kPlate);
    scene.join(2, kPlate);
  }
  const auto t = static_cast<float>(tick);
  const float in = tick < 200 ? t / 200 * 0.0025f : 0.0025f + 1e-5f * std::max(0.0f, t - 700);
  const float x = 0.020f + kPlate.radius_m + 0.0005f - in;
  for (const float side : {1.0f, -1.0f})
    scene.put(side > 0 ? 1 : 2, {{side * x, -0.006f, 0}, kUprightAcross});
  if (tick >= 300 && tick <= 700) {
    const float z = -0.018f + 1e-4f * (t - 300);
    const bool is_out = tick > 660;
    scene.put(0, upright({0.0007f, is_out ? 0.3f : -0.009f, z}),
              is_out ? tool::Verb::None : tool::Verb::Cut);
  }
  scene.tick();
}

TEST(Lips, ACutUnderPressureAddsNoEnergyAndTheLoadStays) {
  HandScene scene(cube());
  double before = 0, most_kinetic = 0, least = 1e9, most = 0;
  for (int tick = 0; tick < 700; ++tick) {
    drive_cut_under_pressure(scene, tick);
    if (tick < 299) continue;
    const auto force = static_cast<double>(scene.reaction(1).force_n.x);
    if (tick == 299) before = force;
    least = std::min(least, force), most = std::max(most, force);
    double kinetic = 0;
    for (std::size_t n = 0; n < scene.world().node_count(); ++n)
      kinetic += 0.5 * static_cast<double>(scene.world().masses[n] *
                                           length_squared(scene.world().velocities[n]));
    most_kinetic = std::max(most_kinetic, kinetic);
  }
  std::printf("plate %.4f N before, then %.4f to %.4f N, kinetic at most %.3g J, deepest %.4f mm\n",
              before, least, most, most_kinetic, 1e3 * deepest_overlap(scene.simulation));
  EXPECT_NEAR(least, before, 0.03 * before);
  EXPECT_NEAR(most, before, 0.03 * before);
  EXPECT_LT(deepest_overlap(scene.simulation), 0.0001);
}

TEST(Lips, ARestoredStateGoesOnBitForBit) {
  HandScene one(cube()), two(cube());
  Bytes snapshot;
  int restored = -1;
  for (int tick = 0; tick < 900; ++tick) {
    drive_cut_under_pressure(one, tick);
    if (restored >= 0) {
      drive_cut_under_pressure(two, tick);
      ASSERT_EQ(one.simulation.state_hash(), two.simulation.state_hash())
          << "tick " << tick << ", restored after " << restored;
    }
    if (tick != 390 && tick != 450 && tick != 780) continue;
    snapshot.clear();
    one.simulation.write_snapshot(snapshot);
    ASSERT_TRUE(two.simulation.restore_snapshot(snapshot).ok());
    restored = tick;
  }
  EXPECT_GT(one.simulation.context().contact.found.self_points().size(), 20u);
}

// One lip is drawn away, up and sideways, and let go.
TEST(Lips, DrawnApartTheyMeetAgain) {
  HandScene scene(cube());
  cut_across(scene, -0.009f);
  scene.join(1, {.radius_m = 0.003f, .length_m = 0.1f, .reach_m = 0.007f});
  const Vec3f at{0.008f, 0.0125f, 0};
  scene.put(1, upright(at), tool::Verb::None);
  scene.ticks(10);
  double open = 0;
  for (int i = 0; i <= 300; ++i) {
    const float t = static_cast<float>(i) / 300;
    scene.put(1, upright(at + Vec3f{0.012f, 0.004f, 0.005f} * t), tool::Verb::Grasp);
    scene.tick();
    if (i % 60 == 59) expect_restorable(scene);
  }
  for (const auto node : scene.world().surface_nodes)
    open = std::max(open, static_cast<double>(length(scene.world().displacements[node.value])));
  EXPECT_GT(open, 0.008) << "drawn open";
  EXPECT_EQ(pressed_n(scene), 0);
  scene.put(1, upright({0, 0.3f, 0}), tool::Verb::None);
  double most = 0, deepest = 0;
  for (int i = 0; i < 400; ++i) {
    scene.tick();
    most = std::max(most, pressed_n(scene));
    if (i % 50 == 20) deepest = std::max(deepest, deepest_overlap(scene.simulation));
    if (i % 100 == 99) expect_restorable(scene);
  }
  std::printf("open %.2f mm, meets with %.3f N, deepest %.4f mm\n", 1e3 * open, most,
              1e3 * deepest);
  EXPECT_GT(most, 0.01);
  EXPECT_LT(deepest, 0.001) << "a rim may cut into a rim when they snap to";
  EXPECT_LT(deepest_overlap(scene.simulation), 0.0001);
}

// The part above a cut through the whole block is pressed against the part below.
class Piece : public ::testing::Test {
 protected:
  // The blade lies along x.
  static void cut_off(HandScene& scene) {
    scene.join(0, {.radius_m = 0.001f, .length_m = 0.2f, .edge_m = 0.06f});
    for (int i = 0; i <= 360; ++i) {
      const Vec3f tip{-0.03f, 0.0017f, -0.018f + 1e-4f * static_cast<float>(i)};
      if (i % 4 == 0) scene.put(0, {tip, rotation_from_z({1, 0, 0})}, tool::Verb::Cut);
      scene.tick();
    }
    scene.put(0, upright({0, 0.3f, 0}), tool::Verb::None);
    scene.tick();
  }
  // Returns the mean displacement of the nodes above the cut, m.
  static Vec3d moved(const HandScene& scene) {
    Vec3d sum;
    double count = 0;
    for (std::size_t n = 0; n < scene.world().node_count(); ++n) {
      if (scene.world().rest_positions[n].y < 0.003f) continue;
      sum += to_double(scene.world().displacements[n]), ++count;
    }
    return sum / count;
  }
};

TEST_F(Piece, RestsOnTheBlockByItsWeight) {
  auto organ = cube();
  organ.gravity_m_s2 = {0, -9.81, 0};
  HandScene whole(organ), cut(organ);
  // The blade is not to meet tissue that sags.
  constexpr int kSettle = 400;
  whole.ticks(kSettle + 361);
  cut.ticks(kSettle);
  cut_off(cut);
  whole.ticks(700), cut.ticks(700);
  std::printf("whole %.4f mm, cut %.4f mm, %zu pairs, pressed %.4f N, deepest %.4f mm\n",
              1e3 * moved(whole).y, 1e3 * moved(cut).y,
              cut.simulation.context().contact.found.self_points().size(), pressed_n(cut),
              1e3 * deepest_overlap(cut.simulation));
  EXPECT_NEAR(moved(cut).y, moved(whole).y, 0.00005);
  EXPECT_LT(deepest_overlap(cut.simulation), 0.00005);
}

TEST_F(Piece, CarriesAPlateWhereverItHasBeenPushed) {
  HandScene scene(cube());
  cut_off(scene);
  scene.join(1, kPlate);
  scene.join(2, kPlate);
  // 8 mm along x, by a plate that touches only the piece.
  for (int i = 0; i <= 400; ++i) {
    const float x = -0.020f - kPlate.radius_m - 0.0005f + 2.1e-5f * static_cast<float>(i);
    scene.put(1, {{x, 0.007f, 0}, kUprightAcross});
    scene.tick();
    if (i % 100 == 99) expect_restorable(scene);
  }
  std::printf("moved %.3f %.3f mm, deepest %.4f mm\n", 1e3 * moved(scene).x, 1e3 * moved(scene).y,
              1e3 * deepest_overlap(scene.simulation));
  // Then a plate presses from above, its shaft along x and its width along z.
  for (int i = 0; i <= 400; ++i) {
    const float y =
        0.012f + kPlate.radius_m + 0.0005f - 1e-5f * static_cast<float>(std::min(i, 300));
    scene.put(2, {{-0.014f, y, 0}, rotation_from_z({1, 0, 0})});
    scene.tick();
    if (i % 100 == 99) expect_restorable(scene);
  }
  std::printf("moved %.3f %.3f mm, plate %.4f N, pressed %.4f N, deepest %.4f mm\n",
              1e3 * moved(scene).x, 1e3 * moved(scene).y,
              static_cast<double>(scene.reaction(2).force_n.y), pressed_n(scene),
              1e3 * deepest_overlap(scene.simulation));
  EXPECT_GT(moved(scene).x, 0.007);
  EXPECT_GT(scene.reaction(2).force_n.y, 0.3f);
  EXPECT_LT(deepest_overlap(scene.simulation), 0.0003);
}

}  // namespace
}  // namespace trocar::contact::testing
