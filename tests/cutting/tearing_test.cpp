// Tissue that is stretched too far: where it tears, across what, and that it stays a sound solid.

#include "server/tissue/cutting/tearing.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "common/math/symmetric.h"
#include "tests/cutting/cut_organ.h"

namespace trocar::cutting::testing {
namespace {

organ::Organ bar(double tear_stretch) {
  auto organ = box_organ(12, 4, 4, 0.005);
  organ.material.tear_stretch = tear_stretch;
  return organ;
}

using Field = std::function<Vec3d(const Vec3d&)>;  // place at rest to displacement

class TornOrgan {
 public:
  explicit TornOrgan(organ::Organ source) : organ_(std::move(source)), tearing_(organ_.organ()) {}

  CutOrgan& organ() { return organ_; }
  void deform(const Field& field) {
    organ_.displacements.clear();
    for (const auto& p : organ_.topology().rest())
      organ_.displacements.push_back(to_float(field(p)));
  }
  // Returns the faces that tear now.
  std::span<const TetFace> find() {
    nodes_.clear();
    for (std::uint32_t n = 0; n < organ_.topology().node_count(); ++n)
      if (organ_.topology().has_node(NodeIndex(n))) nodes_.emplace_back(n);
    return tearing_.find(organ_.topology(), organ_.displacements, nodes_);
  }
  double tear() {
    organ_.cutter().tear(find());
    organ_.tick();
    return organ_.last().torn_area_m2;
  }

 private:
  CutOrgan organ_;
  Tearing tearing_;
  std::vector<NodeIndex> nodes_;
};

TEST(Symmetric, LargestPrincipalValueIsTheMostThatAnyDirectionHas) {
  trocar::testing::Random random(7);
  const auto vector = [&] {
    return Vec3d{random.between(-1, 1), random.between(-1, 1), random.between(-1, 1)};
  };
  for (int trial = 0; trial < 200; ++trial) {
    SymMat3<double> m;
    for (int i = 0; i < 1 + trial % 4; ++i) m.add_outer(vector(), random.between(-2, 3));
    const auto largest = largest_principal(m);
    EXPECT_NEAR(length(largest.direction), 1, 1e-12);
    EXPECT_LT(length(m * largest.direction - largest.direction * largest.value), 1e-11);
    for (int i = 0; i < 20; ++i) {
      const Vec3d v = normalized(vector(), {1, 0, 0});
      EXPECT_LE(dot(v, m * v), largest.value + 1e-11);
    }
  }
}

TEST(Tearing, BeginsAtTheStretchOfTheMaterial) {
  TornOrgan torn(bar(1.4));
  const auto stretch = [](double by) {
    return [by](const Vec3d& p) { return Vec3d{(by - 1) * p.x, 0, 0}; };
  };
  torn.deform(stretch(1.39));
  EXPECT_TRUE(torn.find().empty());
  torn.deform(stretch(1.41));
  EXPECT_FALSE(torn.find().empty());
  // However it is turned and moved.
  torn.deform([](const Vec3d& p) { return Vec3d{0.3 - p.y - p.x, 1.39 * p.x - p.y, 0}; });
  EXPECT_TRUE(torn.find().empty());
  torn.deform([](const Vec3d& p) { return Vec3d{0.3 - p.y - p.x, 1.41 * p.x - p.y, 0}; });
  EXPECT_FALSE(torn.find().empty());
}

TEST(Tearing, IsOffUnlessTheMaterialSaysOtherwise) {
  EXPECT_FALSE(Tearing(bar(0)).is_possible());
  auto organ = bar(0);
  organ.regions = {{"one", organ.material, {NodeIndex(3u)}}};
  organ.regions[0].material.tear_stretch = 2;
  EXPECT_TRUE(Tearing(organ).is_possible());
}

TEST(Tearing, PartsAcrossThePull) {
  TornOrgan torn(bar(1.3));
  // Stretched in the middle alone.
  torn.deform([](const Vec3d& p) { return Vec3d{0.8 * std::clamp(p.x, -0.004, 0.004), 0, 0}; });
  double across = 0, along = 0;
  for (const auto& face : torn.find()) {
    const auto& topology = torn.organ().topology();
    const auto nodes = face_nodes(topology.tet(face.tet), face.corner);
    const auto rest = topology.rest();
    const Vec3d area = cross(rest[nodes[1].value] - rest[nodes[0].value],
                             rest[nodes[2].value] - rest[nodes[0].value]);
    across += std::abs(area.x);
    along += std::abs(area.y) + std::abs(area.z);
    for (const auto n : nodes) EXPECT_LT(std::abs(rest[n.value].x), 0.016);
  }
  EXPECT_GT(across, 0);
  EXPECT_GT(across, along);
  EXPECT_GT(torn.tear(), 0);
  EXPECT_EQ(torn.organ().check(), "");
}

// Whatever field, torn on and on: valid, nothing lost, and the copy that repeats the edits equal.
TEST(Tearing, LeavesASoundSolidWhateverPulls) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    trocar::testing::Random random(seed);
    TornOrgan torn(bar(1.2));
    std::array<Vec3d, 3> waves, pulls;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto vector = [&](double size) {
        return Vec3d{random.between(-size, size), random.between(-size, size),
                     random.between(-size, size)};
      };
      waves[i] = vector(200);
      pulls[i] = vector(0.006);
    }
    double area = 0;
    for (int round = 0; round < 60; ++round) {
      torn.deform([&](const Vec3d& p) {
        Vec3d u;
        for (std::size_t i = 0; i < 3; ++i) u += pulls[i] * std::sin(dot(waves[i], p));
        return u;
      });
      area += torn.tear();
      if (round % 10 == 9) {
        ASSERT_EQ(torn.organ().check(), "") << "seed " << seed << " round " << round;
      }
    }
    EXPECT_GT(area, 1e-4) << "seed " << seed;
    const auto pieces = find_pieces(torn.organ().topology());
    EXPECT_GE(*std::ranges::min_element(pieces.tets), kLeastTorn) << "seed " << seed;
  }
}

}  // namespace
}  // namespace trocar::cutting::testing
