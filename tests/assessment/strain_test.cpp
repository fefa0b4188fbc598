// Strain of tissue whose deformation is known.

#include "server/session/assessment/strain.h"

#include <gtest/gtest.h>

#include "proto/journal.pb.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/session/recording/lesson_frames.h"
#include "tests/recording/recorded_simulation.h"
#include "tests/support/files.h"

namespace trocar::assessment {
namespace {

double volume_of(const organ::Organ& organ) {
  double volume = 0;
  for (const auto& tet : organ.mesh.tets) {
    std::array<Vec3d, 4> p;
    for (std::size_t i = 0; i < 4; ++i) p[i] = organ.mesh.rest_positions[tet[i].value];
    volume += dot(p[1] - p[0], cross(p[2] - p[0], p[3] - p[0])) / 6;
  }
  return volume;
}

class StrainMapTest : public ::testing::Test {
 protected:
  StrainMapTest() : simulation_(*catalogue::make_liver(2000)) {}
  // Displaces every node.
  template <typename Field>
  void deform(Field field) {
    std::vector<Vec3f> displacements;
    for (const auto& place : simulation_.state().world.rest_positions)
      displacements.push_back(field(place));
    simulation_.start_relaxed(displacements);
  }
  step::Simulation simulation_;
};

TEST_F(StrainMapTest, AUniformStretchIsItsStrain) {
  deform([](const Vec3f& p) { return Vec3f{0.4f * p.x, -0.1f * p.y, 0}; });
  StrainMap below(simulation_.organ(), 0.41), above(simulation_.organ(), 0.39);
  below.look(simulation_);
  above.look(simulation_);
  EXPECT_EQ(below.volume_m3(), 0);
  EXPECT_NEAR(above.greatest(), 0.4, 1e-5);
  // All of it, as far as cells of 2 mm tell.
  const double volume = volume_of(simulation_.organ());
  EXPECT_NEAR(above.volume_m3(), volume, 0.01 * volume);
}

// A simple shear by g has the greatest stretch g/2 + sqrt(1 + g^2/4).
TEST_F(StrainMapTest, AShearHasItsPrincipalStretch) {
  constexpr float kShear = 0.8f;
  deform([](const Vec3f& p) { return Vec3f{kShear * p.y, 0, 0}; });
  StrainMap map(simulation_.organ(), 0.3);
  map.look(simulation_);
  EXPECT_NEAR(map.greatest(), kShear / 2 + std::sqrt(1 + kShear * kShear / 4) - 1, 1e-5);
}

TEST_F(StrainMapTest, ATurnStrainsNothing) {
  deform([](const Vec3f& p) { return Vec3f{-p.y - p.x, p.x - p.y, 0}; });
  StrainMap map(simulation_.organ(), 0.05);
  map.look(simulation_);
  EXPECT_EQ(map.volume_m3(), 0);
}

TEST_F(StrainMapTest, VolumesOfStructuresArePartsOfIt) {
  deform([](const Vec3f& p) { return Vec3f{0.5f * p.x, 0, 0}; });
  StrainMap map(simulation_.organ(), 0.3);
  map.look(simulation_);
  // A ball of 20 mm that lies within the liver.
  const lesson::Structure ball{
      .name = "lump", .from_m = {0, 0.02, 0.02}, .to_m = {0, 0.02, 0.02}, .radius_m = 0.02};
  const double volume = 4.0 / 3 * 3.14159265 * 8e-6;
  EXPECT_NEAR(map.volume_within_m3(ball), volume, 0.02 * volume);
}

// Returns the area of wound at rest that the recording ends with, both sides, m^2.
double wound_of(const std::string& file) {
  const auto session = recording::open_session_parts(file);
  EXPECT_TRUE(session.ok());
  double area = 0;
  const auto visit = [&](const recording::LessonFrame& frame) {
    const auto& layout = *frame.moment.layout;
    area = 0;
    for (std::size_t t = 0; t < layout.triangles.size(); ++t) {
      const auto& [a, b, c] = layout.triangles[t];
      if (layout.is_wound[t] == 0 || !a.is_valid()) continue;
      const auto from = layout.rest_m(a);
      area += length(cross(layout.rest_m(b) - from, layout.rest_m(c) - from)) / 2;
    }
  };
  EXPECT_TRUE(recording::read_lesson_frames(*session, visit, [](const std::string&) {}));
  return area;
}

// The session is simulated again, to the same bits or not at all.
TEST(MeasureStrain, OfASessionThatPressesGraspsAndCuts) {
  const trocar::testing::TemporaryFolder folder;
  const auto file = folder.file("session.mcap"), other = folder.file("other.mcap");
  recording::testing::record_simulation(file);
  Tick reached = 0;
  const auto damage = measure_strain(file, 0.05, nullptr, [&](Tick tick, Tick) { reached = tick; });
  ASSERT_TRUE(damage.ok()) << damage.error().message;
  EXPECT_EQ(reached, 2000u);
  EXPECT_GT(damage->greatest, 0.05);
  EXPECT_GT(damage->volume_m3, 1e-7);
  EXPECT_LT(damage->volume_m3, 1.6e-3);  // the whole liver
  EXPECT_GT(damage->cut_m2, 1e-5);
  EXPECT_NEAR(damage->cut_m2, wound_of(file) / 2, 0.02 * damage->cut_m2) << "one side of two";
  EXPECT_EQ(damage->torn_m2, 0) << "its tissue does not tear";
  // One hash is another.
  recording::testing::copy_journal(file, other, [](std::string_view topic, auto& message) {
    if (topic != "/tick_batch") return true;
    auto& record = *dynamic_cast<proto::TickBatch&>(message).mutable_record(0);
    if (record.tick() == 801) record.set_state_hash(record.state_hash() + 1);
    return true;
  });
  const auto refused = measure_strain(other, 0.05, nullptr);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().message,
            other + ": strain cannot be measured: tick 801 does not come out again");
}

}  // namespace
}  // namespace trocar::assessment
