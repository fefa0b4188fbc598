#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>

#include "client/device/mouse_tool.h"
#include "client/render/camera.h"
#include "client/shape/smooth_surface.h"
#include "common/tool/instrument.h"
#include "tests/client/synthetic_source.h"
#include "tests/support/surface_edits.h"

namespace trocar {
namespace {

struct Blob {
  std::vector<Vec3f> positions;
  std::vector<std::array<std::uint32_t, 3>> triangles;

  Blob() {
    const auto layout = testing::make_blob_layout(16, 24, 0.08);
    for (const auto& q : layout.rest_quanta) positions.push_back(wire::to_metres(q));
    for (const auto& t : layout.triangles)
      triangles.push_back({t[0].value, t[1].value, t[2].value});
  }
};

TEST(RayPick, FindsTheNearSideAndNotTheFar) {
  const Blob blob;
  const auto near = device::pick(blob.positions, blob.triangles, {0.013f, 0.011f, 1}, {0, 0, -1});
  ASSERT_TRUE(near.has_value());
  EXPECT_GT(*near, 0.88f);
  EXPECT_LT(*near, 0.96f);
  EXPECT_FALSE(device::pick(blob.positions, blob.triangles, {0.5f, 0, 1}, {0, 0, -1}));
  EXPECT_FALSE(device::pick(blob.positions, blob.triangles, {0.013f, 0.011f, 1}, {0, 0, 1}));
}

TEST(Camera, ProjectsWhatItsRaysPassThrough) {
  render::OrbitCamera camera;
  camera.frame({0.01f, 0.02f, 0}, 0.15f);
  const render::Size size{1280, 720};
  std::mt19937 random(3);
  std::uniform_real_distribution<float> any(0, 1);
  for (int i = 0; i < 200; ++i) {
    camera.orbit(any(random) - 0.5f, any(random) - 0.5f);
    const float x = 1280 * any(random), y = 720 * any(random);
    const auto view = camera.rays(size);
    const auto at = camera.project(view.eye + view.ray_through(x, y) * (0.1f + any(random)), size);
    ASSERT_TRUE(at.has_value());
    EXPECT_NEAR(at->x, x, 0.05f);
    EXPECT_NEAR(at->y, y, 0.05f);
    const auto pixel = view.pixel_of(view.eye + view.ray_through(x, y) * 0.3f);
    EXPECT_NEAR(pixel[0], x, 0.05f);
    EXPECT_NEAR(pixel[1], y, 0.05f);
  }
}

TEST(Camera, ItsOrientationIsThatOfTheScreen) {
  render::OrbitCamera camera;
  camera.frame({}, 0.12f);
  std::mt19937 random(5);
  std::uniform_real_distribution<float> any(-1, 1);
  for (int i = 0; i < 200; ++i) {
    camera.orbit(3 * any(random), any(random));
    const auto view = camera.rays({1280, 720});
    const Quatf turn = camera.orientation();
    EXPECT_LT(length(rotate(turn, {1, 0, 0}) - view.right), 1e-5f);
    EXPECT_LT(length(rotate(turn, {0, 1, 0}) - view.up), 1e-5f);
    EXPECT_LT(length(rotate(turn, {0, 0, -1}) - view.forward), 1e-5f);
  }
}

class MouseToolTest : public ::testing::Test {
 protected:
  MouseToolTest() {
    camera_.frame({}, 0.12f);
    input_.x = 640, input_.y = 360;
  }
  void update(int times = 1) {
    for (int i = 0; i < times; ++i)
      tool_.update(input_, camera_.rays(size_), blob_.positions, blob_.triangles, 0.016f);
  }
  float depth() const {
    const auto view = camera_.rays(size_);
    return dot(tool_.current().world_from_tool.position - view.eye, view.forward);
  }

  Blob blob_;
  render::OrbitCamera camera_;
  render::Size size_{1280, 720};
  device::PointerInput input_;
  device::MouseTool tool_{tool::ToolShape{}};
};

TEST_F(MouseToolTest, HoversJustAboveTheSurfaceUnderThePointer) {
  EXPECT_FALSE(tool_.pop_due(1).has_value());
  update();
  const auto view = camera_.rays(size_);
  const auto surface = device::pick(blob_.positions, blob_.triangles, view.eye,
                                    view.ray_through(input_.x, input_.y));
  ASSERT_TRUE(surface.has_value());
  EXPECT_NEAR(depth(), *surface - 0.008f, 1e-4f);
  EXPECT_EQ(tool_.current().verb, tool::Verb::None);
  // The shaft leaves towards the person.
  const Vec3f shaft = rotate(tool_.current().world_from_tool.orientation, {0, 0, 1});
  EXPECT_LT(dot(shaft, view.forward), -0.5f);
  EXPECT_GT(dot(shaft, view.up), 0.1f);
}

TEST_F(MouseToolTest, TheLeftButtonAlonePressesAndKeepsItsDepthUntilTheWheelTurns) {
  update(10);
  const float surface = depth() + 0.008f;
  input_.left = true;
  update();
  EXPECT_EQ(tool_.current().verb, tool::Verb::Push);
  EXPECT_LT(depth(), surface) << "it goes down at a bounded speed";
  update(30);
  EXPECT_NEAR(depth(), surface + 0.006f, 1e-4f);
  for (int i = 0; i < 30; ++i) {
    input_.x += 5;
    update();
  }
  EXPECT_NEAR(depth(), surface + 0.006f, 1e-4f);
  input_.wheel = 2;
  update();
  EXPECT_NEAR(depth(), surface + 0.012f, 1e-4f);
  input_.wheel = 0;
  input_.left = false;
  update(30);
  EXPECT_EQ(tool_.current().verb, tool::Verb::None);
}

TEST_F(MouseToolTest, TheWheelAloneDoesNotPutItIntoTissue) {
  update(10);
  const float surface = depth() + 0.008f;
  input_.wheel = 20;
  update(10);
  input_.wheel = 0;
  update(30);
  EXPECT_LT(depth(), surface);
  input_.left = true;
  update(30);
  EXPECT_NEAR(depth(), surface + 0.006f, 1e-4f);
}

TEST_F(MouseToolTest, JawsCloseWhereTheSurfaceIs) {
  update(10);
  const float surface = depth() + 0.008f;
  input_.grasp = true;
  update();
  EXPECT_EQ(tool_.current().verb, tool::Verb::None) << "the tip is still above";
  update(10);
  EXPECT_EQ(tool_.current().verb, tool::Verb::Grasp);
  EXPECT_NEAR(depth(), surface + 0.001f, 1e-4f);
  input_.grasp = false;
  input_.left = true;
  update();
  EXPECT_EQ(tool_.current().verb, tool::Verb::Push);
  EXPECT_NEAR(depth(), surface + 0.001f, 1e-4f) << "from one verb to another it stays";
}

TEST_F(MouseToolTest, TheLeftButtonDoesWhatTheInstrumentIsFor) {
  update(30);
  const auto verb_of = [&](std::string_view name) {
    input_.left = false;
    update();
    tool_.take(tool::find_instrument(name)->shape);
    EXPECT_EQ(tool_.current().verb, tool::Verb::None);
    input_.left = true;
    update(60);
    return tool_.current().verb;
  };
  using enum tool::Verb;
  EXPECT_EQ(verb_of("all"), Push);
  EXPECT_EQ(verb_of("probe"), Push);
  EXPECT_EQ(verb_of("grasper"), Grasp);
  EXPECT_EQ(verb_of("scissors"), Cut);
  EXPECT_EQ(verb_of("hook"), Cut);
  // A key asks for what an instrument cannot do: it presses.
  input_.left = false;
  update();
  tool_.take(tool::find_instrument("probe")->shape);
  input_.cut = true;
  update();
  EXPECT_EQ(tool_.current().verb, Push);
}

TEST_F(MouseToolTest, ScissorsStayOpenUntilTheyAreInTheTissue) {
  update(30);
  tool_.take(tool::find_instrument("scissors")->shape);
  const float before = depth();
  input_.left = true;
  update(3);
  EXPECT_EQ(tool_.current().verb, tool::Verb::None);
  update(60);
  EXPECT_EQ(tool_.current().verb, tool::Verb::Cut);
  EXPECT_NEAR(depth() - before, 0.020f, 0.001f) << "8 mm above the surface to 12 mm below";
}

TEST_F(MouseToolTest, TurnsAboutItsShaft) {
  update(30);
  const auto pose = tool_.current().world_from_tool;
  const Vec3f shaft = rotate(pose.orientation, {0, 0, 1}),
              side = rotate(pose.orientation, {1, 0, 0});
  input_.roll_left = true;
  update(30);
  const auto turned = tool_.current().world_from_tool;
  EXPECT_LT(length(rotate(turned.orientation, {0, 0, 1}) - shaft), 1e-4f);
  EXPECT_NEAR(dot(rotate(turned.orientation, {1, 0, 0}), side), std::cos(30 * 0.016f * 1.6f), 1e-3);
}

// The other hand has the pointer meanwhile, which is elsewhere when it comes back.
TEST_F(MouseToolTest, AHandThatThePointerLeavesGoesOnHolding) {
  update(30);
  tool_.take(tool::find_instrument("grasper")->shape);
  input_.left = true;
  update(60);
  ASSERT_EQ(tool_.current().verb, tool::Verb::Grasp);
  const Vec3f held_at = tool_.current().world_from_tool.position;
  tool_.leave();
  EXPECT_EQ(tool_.current().verb, tool::Verb::Grasp);
  input_.left = false;
  input_.x += 150, input_.y -= 80;
  tool_.come_back(input_, camera_.rays(size_));
  update();
  EXPECT_EQ(tool_.current().verb, tool::Verb::Grasp) << "nobody has let go";
  EXPECT_LT(length(tool_.current().world_from_tool.position - held_at), 1e-4f)
      << "it leaps nowhere";
  input_.x += 40;
  update();
  EXPECT_GT(length(tool_.current().world_from_tool.position - held_at), 1e-3f) << "it moves";
  // It lets go as a hand does: press, and release.
  input_.left = true;
  update();
  EXPECT_EQ(tool_.current().verb, tool::Verb::Grasp);
  input_.left = false;
  update();
  EXPECT_EQ(tool_.current().verb, tool::Verb::None);
  update(60);
  const auto view = camera_.rays(size_);
  const auto pixel = view.pixel_of(tool_.current().world_from_tool.position);
  EXPECT_NEAR(pixel[0], input_.x, 2) << "free, it comes to the pointer";
}

TEST_F(MouseToolTest, AButtonThatWasPressedForOneHandDoesNothingInTheOther) {
  update(30);
  input_.left = true;
  tool_.come_back(input_, camera_.rays(size_));
  update(10);
  EXPECT_EQ(tool_.current().verb, tool::Verb::None);
  input_.left = false;
  update();
  input_.left = true;
  update();
  EXPECT_EQ(tool_.current().verb, tool::Verb::Push);
}

TEST_F(MouseToolTest, AHandThatHoldsNothingStopsWhenThePointerLeavesIt) {
  update(30);
  input_.push = true;
  update(30);
  ASSERT_EQ(tool_.current().verb, tool::Verb::Push);
  tool_.leave();
  EXPECT_EQ(tool_.current().verb, tool::Verb::None);
}

TEST_F(MouseToolTest, TipStaysWhileTheCameraTurns) {
  update(10);
  const Vec3f tip = tool_.current().world_from_tool.position;
  input_.right = true;
  for (int i = 0; i < 20; ++i) {
    input_.x += 10;
    camera_.orbit(0.05f, 0);
    update();
  }
  EXPECT_EQ(tool_.current().world_from_tool.position, tip);
}

TEST_F(MouseToolTest, SamplesAtMostEveryEightMillisecondsAndAtLeastEveryForty) {
  std::uint64_t last = 0;
  int moving = 0, still = 0;
  for (std::uint64_t ms = 100; ms < 1100; ++ms) {
    input_.x = 600 + static_cast<float>(ms % 100);
    update();
    if (tool_.pop_due(ms * 1'000'000)) {
      EXPECT_TRUE(last == 0 || ms - last >= 8);
      last = ms;
      ++moving;
    }
  }
  EXPECT_NEAR(moving, 125, 2);
  update(100);
  for (std::uint64_t ms = 1100; ms < 2100; ++ms)
    if (tool_.pop_due(ms * 1'000'000)) {
      EXPECT_LE(ms - last, 40u);
      last = ms;
      ++still;
    }
  EXPECT_NEAR(still, 25, 2);
}

TEST_F(MouseToolTest, NeverLeavesTheSpaceThatTheServerAccepts) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> any(-1, 1);
  for (int i = 0; i < 3000; ++i) {
    input_.x = 3000 * any(random), input_.y = 2000 * any(random);
    input_.wheel = 20 * any(random);
    input_.left = any(random) > 0, input_.grasp = any(random) > 0;
    update();
    const auto& sample = tool_.current();
    ASSERT_LE(length(sample.world_from_tool.position), 2.0f);
    ASSERT_NEAR(norm(sample.world_from_tool.orientation), 1.0f, 1e-3f);
  }
}

// The handle goes where the mouse goes, the tip the other way, and the shaft passes the port.
TEST_F(MouseToolTest, AnEndoscopeThatIsSteeredPivotsAtItsPort) {
  tool_.take({.radius_m = 0.005f, .form = tool::Form::Endoscope});
  update();
  const auto view = camera_.rays(size_);
  const auto tip = [&] { return tool_.current().world_from_tool.position; };
  const auto back = [&] { return rotate(tool_.current().world_from_tool.orientation, {0, 0, 1}); };
  const Vec3f before = tip(), port = before + back() * 0.14f;
  input_.dx = 40;
  tool_.steer(input_, view, 0.016f);
  EXPECT_LT(dot(tip() - before, view.right), -0.002f);
  EXPECT_LT(length(tip() + back() * length(port - tip()) - port), 1e-4f);
  EXPECT_NEAR(length(port - tip()), 0.14f, 1e-4f);
  input_.dx = 0, input_.wheel = 2;
  tool_.steer(input_, view, 0.016f);
  EXPECT_GT(length(port - tip()), 0.141f);
  input_.wheel = 1000;
  tool_.steer(input_, view, 0.016f);
  EXPECT_LT(length(port - tip()), tool_.shape().length_m);
}

TEST(SmoothSurface, KeepsTheServersVerticesAndRoundsWhatLiesBetween) {
  const Blob blob;
  shape::SmoothSurface surface;
  surface.build(blob.positions.size(), blob.triangles, {}, 16 * blob.triangles.size());
  surface.update(blob.positions);
  EXPECT_EQ(surface.triangles().size(), 16 * blob.triangles.size());
  // A closed surface of genus 0: V = F / 2 + 2.
  EXPECT_EQ(surface.vertex_count(), surface.triangles().size() / 2 + 2);
  for (std::size_t i = 0; i < blob.positions.size(); ++i)
    ASSERT_EQ(surface.positions()[i], blob.positions[i]);
  for (const Vec3f& n : surface.normals()) ASSERT_NEAR(length(n), 1.0f, 1e-4f);
  for (const auto& triangle : surface.triangles())
    for (const auto v : triangle) ASSERT_LT(v, surface.vertex_count());
}

// Drawn finely, a surface with slits is as closed as it came: along the rim both sides have the
// same points, and one normal, so that the lip looks round.
TEST(SmoothSurface, TheRimOfAWoundIsARoundLipAndHasNoCrack) {
  auto layout = testing::make_blob_layout(16, 24, 0.08);
  testing::Random random(2);
  for (int i = 0; i < 25; ++i)
    ASSERT_TRUE(wire::apply(testing::random_change(layout, random), layout).ok());
  std::vector<Vec3f> positions;
  for (const auto& q : layout.rest_quanta)
    positions.push_back(wire::to_metres(q) +
                        Vec3f{0, 0, static_cast<float>(random.between(-1e-3, 1e-3))});
  std::vector<shape::TriangleCorners> triangles;
  for (std::size_t i = 0; i < layout.triangles.size(); ++i) {
    const auto& t = layout.triangles[i];
    triangles.push_back({});
    if (layout.has_triangle(TriangleIndex(i)))
      triangles.back() = {t[0].value, t[1].value, t[2].value};
  }
  shape::SmoothSurface surface;
  for (const std::size_t budget : {std::size_t{0}, 4 * triangles.size(), 16 * triangles.size()}) {
    surface.build(positions.size(), triangles, layout.is_wound, budget);
    surface.update(positions);
    ASSERT_EQ(surface.positions().size(), surface.vertex_count());
    ASSERT_EQ(surface.normals().size(), surface.vertex_count());
    ASSERT_EQ(surface.is_wound().size(), surface.vertex_count());
    const auto point = [&](std::uint32_t v) {
      const Vec3f& p = surface.positions()[v];
      return std::array{p.x, p.y, p.z};
    };
    std::map<std::pair<std::array<float, 3>, std::array<float, 3>>, int> edges;
    for (const auto& t : surface.triangles()) {
      ASSERT_EQ(surface.is_wound()[t[0]], surface.is_wound()[t[1]]);
      ASSERT_EQ(surface.is_wound()[t[0]], surface.is_wound()[t[2]]);
      for (std::size_t k = 0; k < 3; ++k) {
        const auto a = point(t[k]), b = point(t[(k + 1) % 3]);
        ++edges[{a, b}];
        --edges[{b, a}];
      }
    }
    for (const auto& [ends, sum] : edges) ASSERT_EQ(sum, 0) << "a crack, budget " << budget;
    std::map<std::array<float, 3>, std::uint32_t> outer;
    int round = 0;
    for (std::uint32_t v = 0; v < surface.vertex_count(); ++v)
      if (surface.is_wound()[v] == 0) outer.emplace(point(v), v);
    for (std::uint32_t v = 0; v < surface.vertex_count(); ++v)
      if (const auto rim = outer.find(point(v)); surface.is_wound()[v] != 0 && rim != outer.end())
        round += dot(surface.lips()[v], surface.lips()[rim->second]) > 0.999f;
    EXPECT_GT(round, 40);
  }
}

TEST(SmoothSurface, DistancesFromARimGrowAwayFromItOnBothSides) {
  auto layout = testing::make_blob_layout(16, 24, 0.08);
  testing::Random random(3);
  ASSERT_TRUE(wire::apply(testing::random_change(layout, random), layout).ok());
  std::vector<Vec3f> positions;
  for (const auto& q : layout.rest_quanta) positions.push_back(wire::to_metres(q));
  std::vector<shape::TriangleCorners> triangles(layout.triangles.size());
  for (std::size_t i = 0; i < triangles.size(); ++i)
    for (std::size_t k = 0; k < 3 && layout.has_triangle(TriangleIndex(i)); ++k)
      triangles[i][k] = layout.triangles[i][k].value;
  shape::SmoothSurface surface;
  surface.build(positions.size(), triangles, layout.is_wound, 4 * triangles.size());
  surface.update(positions);
  constexpr float kMost = 0.03f;
  std::vector<float> distances;
  surface.measure_rim(kMost, distances);
  ASSERT_EQ(distances.size(), surface.vertex_count());
  std::vector<Vec3f> rim;
  for (std::size_t v = 0; v < distances.size(); ++v) {
    if (surface.is_rim()[v] == 0) continue;
    EXPECT_EQ(distances[v], 0);
    rim.push_back(surface.positions()[v]);
  }
  ASSERT_FALSE(rim.empty());
  std::size_t near = 0;
  for (std::size_t v = 0; v < distances.size(); ++v) {
    float least = kMost;
    for (const Vec3f& p : rim) least = std::min(least, length(surface.positions()[v] - p));
    EXPECT_GE(distances[v], least - 1e-6f);
    EXPECT_LE(distances[v], std::min(kMost, 1.5f * least + 1e-6f));
    near += distances[v] < kMost;
  }
  EXPECT_GT(near, rim.size());
}

TEST(SmoothSurface, MidpointsOfASphereLieNearerToItThanChords) {
  std::vector<Vec3f> octahedron = {{1, 0, 0},  {-1, 0, 0}, {0, 1, 0},
                                   {0, -1, 0}, {0, 0, 1},  {0, 0, -1}};
  const std::vector<shape::TriangleCorners> faces = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                                     {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  shape::SmoothSurface surface;
  surface.build(6, faces, {}, 32);
  surface.update(octahedron);
  ASSERT_EQ(surface.vertex_count(), 18u);
  for (std::size_t i = 6; i < 18; ++i) {
    // The cubic through two unit normals a right angle apart; a chord's midpoint is at 0.707.
    EXPECT_NEAR(length(surface.positions()[i]), 0.625f * std::sqrt(2.0f), 1e-5f);
  }
}

}  // namespace
}  // namespace trocar
