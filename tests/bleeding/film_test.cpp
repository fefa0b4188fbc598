// A film on surfaces of which it is known where blood has to go.

#include "server/tissue/bleeding/film.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/tissue/bleeding/rules.h"
#include "tests/bleeding/height_field.h"

namespace trocar::bleeding {
namespace {

using testing::HeightField;

constexpr std::int64_t kMillilitrePl = 1'000'000'000;

struct Pour {
  explicit Pour(const HeightField& field) : places_(field.layout, field.displacements) {
    graph_.rebuild(field.layout);
    blood.resize(field.layout.vertex_count());
    is_wet_.resize(field.layout.vertex_count(), 0);
  }

  void pour(std::uint32_t vertex, std::int64_t pl) {
    blood.volume_pl[vertex] += pl;
    blood.shed_pl += pl;
    if (is_wet_[vertex]++ == 0) wet.push_back(vertex);
  }
  void run(int frames) {
    for (int frame = 0; frame < frames; ++frame) {
      film_.run(graph_, places_, blood, wet, is_wet_);
      ASSERT_EQ(blood.shed_pl, blood.on_surface_pl() + blood.dripped_pl) << "frame " << frame;
      ASSERT_GE(*std::ranges::min_element(blood.volume_pl), 0) << "frame " << frame;
    }
  }
  double head_m(std::uint32_t vertex) const {
    return places_[vertex].y + depth_m(blood, graph_, vertex);
  }
  // Returns where the blood is on the mean, m.
  Vec3d centre() const {
    Vec3d sum;
    double all = 0;
    for (const auto vertex : wet) {
      const auto volume = static_cast<double>(blood.volume_pl[vertex]);
      sum += places_[vertex] * volume;
      all += volume;
    }
    return sum / all;
  }

  Blood blood;
  std::vector<std::uint32_t> wet;
  SurfaceGraph graph_;

 private:
  SurfacePlaces places_;
  std::vector<std::uint8_t> is_wet_;
  Film film_;
};

TEST(Film, ItsSpeedIsThatOfNusselt) {
  // Mean speed of a laminar film: density g depth^2 sin / (3 viscosity).
  EXPECT_NEAR(film_speed_m_s(1e-4, 1), 1060 * 9.81 * 1e-8 / (3 * 3.5e-3), 1e-12);
  EXPECT_NEAR(film_speed_m_s(2e-4, 0.5), 2 * film_speed_m_s(1e-4, 1), 1e-12);
  EXPECT_EQ(film_speed_m_s(1e-4, 3), film_speed_m_s(1e-4, 1)) << "no steeper than upright";
}

TEST(Film, OnASlopeItRunsDownAndNeverUp) {
  const HeightField slope([](double x, double) { return 0.5 * x; });
  Pour pour(slope);
  pour.pour(HeightField::kMiddle, kMillilitrePl / 80);  // less deep than a step is high
  double before = pour.centre().y;
  for (int i = 0; i < 20; ++i) {
    pour.run(5);
    EXPECT_LE(pour.centre().y, before + 1e-9);
    before = pour.centre().y;
  }
  EXPECT_LT(before, -0.002);
  for (std::uint32_t row = 0; row < HeightField::kSide; ++row)
    for (std::uint32_t column = HeightField::kSide / 2 + 1; column < HeightField::kSide; ++column)
      EXPECT_EQ(pour.blood.volume_pl[HeightField::at(column, row)], 0) << "it has run up";
}

TEST(Film, AFilmAsThinAsWhatStaysDoesNotMove) {
  const HeightField slope([](double x, double) { return x; });
  Pour pour(slope);
  const double area = pour.graph_.area_m2(HeightField::kMiddle);
  pour.pour(HeightField::kMiddle,
            static_cast<std::int64_t>(0.99 * kStayingFilmM * area * kPicolitresPerCubicMetre));
  pour.run(100);
  EXPECT_EQ(pour.wet.size(), 1u);
}

TEST(Film, InABowlItPoolsAtTheBottomWithALevelSurface) {
  const HeightField bowl([](double x, double z) { return 4 * (x * x + z * z); });
  Pour pour(bowl);
  pour.pour(HeightField::at(4, 4), kMillilitrePl);
  pour.run(4000);
  // All but the film that stays on the way is in a pool around the middle.
  const double bottom = pour.head_m(HeightField::kMiddle);
  int in_pool = 0;
  for (const auto vertex : pour.wet) {
    const double depth = depth_m(pour.blood, pour.graph_, vertex);
    if (depth < 0.3e-3) continue;
    ++in_pool;
    EXPECT_NEAR(pour.head_m(vertex), bottom, 0.1e-3) << vertex;
  }
  EXPECT_GT(in_pool, 4);
  EXPECT_EQ(pour.blood.dripped_pl, 0) << "a bowl holds it";
}

TEST(Film, WhereItHangsItDripsOff) {
  const HeightField below([](double x, double z) { return 4 * (x * x + z * z); }, true);
  Pour pour(below);
  pour.pour(HeightField::kMiddle, kMillilitrePl / 5);
  pour.run(200);
  EXPECT_GT(pour.blood.dripped_pl, 0);
  EXPECT_LE(depth_m(pour.blood, pour.graph_, HeightField::kMiddle),
            kStayingFilmM + kHangingFilmM + 1e-9);
}

}  // namespace
}  // namespace trocar::bleeding
