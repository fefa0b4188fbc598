// Fibres that run in another direction at each node: what a cut does to them.

#include <gtest/gtest.h>

#include "server/tissue/dynamics/tissue.h"
#include "tests/cutting/cut_organ.h"

namespace trocar::cutting::testing {
namespace {

using material::ElasticLaw;

// Directions that turn by more than a right angle through the box, of either sign.
organ::Organ turning_box(ElasticLaw law) {
  auto organ = box_organ(4, 4, 4, 0.01);
  organ.material.elastic_law = law;
  organ.material.tension = 0.02;
  organ.material.fibre_tension = 0.3;
  for (std::size_t n = 0; n < organ.mesh.node_count(); ++n) {
    const auto& p = organ.mesh.rest_positions[n];
    const Vec3d axis = normalized(Vec3d{1, 120 * p.x + 30 * p.z, 90 * p.y}, {});
    organ.fibre_directions.push_back(n % 3 == 0 ? -axis : axis);
  }
  return organ;
}

std::vector<Vec3f> deformed(const topology::Topology& topology) {
  std::vector<Vec3f> u;
  for (const auto& p : topology.rest())
    u.push_back(to_float(Vec3d{3 * p.y * p.x, -2 * p.z * p.z + 0.1 * p.x, 4 * p.x * p.y}));
  return u;
}

// Returns the energy that would result if parts had the fibre direction of their own nodes.
double energy_without_inheritance(const CutOrgan& box) {
  topology::Topology topology(box.organ());
  Places places(topology);
  EXPECT_TRUE(apply(box.history(), topology, places));
  for (std::uint32_t t = 0; t < topology.tet_count(); ++t) {
    std::array<Vec3d, 4> axes;
    for (std::size_t i = 0; i < 4; ++i) axes[i] = topology.fibre_axis(topology.tet(TetIndex(t))[i]);
    topology.set_fibre_axis(TetIndex(t), organ::sum_of_axes(axes));
  }
  return dynamics::Tissue(topology).energy_j(box.displacements);
}

// Energy after each tick of a blade, new nodes between those that they were made from.
void expect_no_change(const organ::Organ& organ) {
  constexpr double kTolerance_j = 2e-7;
  CutOrgan box(organ);
  box.displacements = deformed(box.topology());
  const auto before = dynamics::Tissue(box.topology()).energy_j(box.displacements);
  const auto path = straight_path({{0.0031, -0.06, -0.06}, {0.0031, -0.06, 0.06}},
                                  {{0.0031, 0.06, -0.06}, {0.0031, 0.06, 0.06}}, 0.002);
  std::uint32_t splits = 0;
  for (const auto& edge : path) {
    ASSERT_TRUE(box.cutter().move(0, edge));
    box.tick();
    const auto after = dynamics::Tissue(box.topology()).energy_j(box.displacements);
    ASSERT_NEAR(after, before, kTolerance_j) << splits;
    splits = box.total().splits;
  }
  box.cutter().lift(0);
  box.run_until_idle();
  EXPECT_EQ(box.check(), "");
  EXPECT_GT(splits, 20u);
  EXPECT_GT(std::abs(energy_without_inheritance(box) - before), 20 * kTolerance_j);
}

TEST(Fibres, ASplitOfTetsChangesNoEnergy) {
  for (const auto law : {ElasticLaw::TensorMass, ElasticLaw::NeoHookean}) {
    auto organ = turning_box(law);
    organ.material.edge_damping_time_s = 0;
    expect_no_change(organ);
  }
}

// Every part of a tet has its direction, to the bit, through thousands of edits.
TEST(Fibres, PartsKeepTheDirectionOfTheWhole) {
  const auto organ = turning_box(ElasticLaw::NeoHookean);
  topology::Topology topology(organ);
  Places places(topology);
  trocar::testing::Random random(11);
  std::vector<Vec3d> axes;
  for (std::uint32_t t = 0; t < topology.tet_count(); ++t)
    axes.push_back(topology.fibre_axis(TetIndex(t)));
  std::vector<TetChild> children;
  for (int i = 0; i < 500; ++i) {
    const auto& tet =
        topology.tet(TetIndex(random.below(static_cast<std::uint32_t>(topology.tet_count()))));
    const auto a = tet[random.below(4)], b = tet[random.below(4)];
    if (a == b) continue;
    split_edge(topology, places, a, b, 32768, children);
    axes.resize(topology.tet_count());
    for (const auto& [parent, child] : children) axes[child.value] = axes[parent.value];
    for (const auto& [parent, child] : children) {
      ASSERT_EQ(topology.fibre_axis(parent), axes[parent.value]);
      ASSERT_EQ(topology.fibre_axis(child), axes[child.value]);
    }
  }
  for (std::uint32_t t = 0; t < topology.tet_count(); ++t)
    ASSERT_EQ(topology.fibre_axis(TetIndex(t)), axes[t]);
  // A node that is made is between its ends, however these are signed.
  for (std::uint32_t n = 0; n < topology.node_count(); ++n)
    EXPECT_GT(length(topology.fibre_axis(NodeIndex(n))), 0.5);
}

// A field of one direction gives the same energy after a cut as a material of that direction.
TEST(Fibres, OfOneDirectionStayTheMaterialsThroughACut) {
  const Vec3d axis = normalized(Vec3d{0.2, 0.9, -0.4}, {});
  for (const auto law : {ElasticLaw::Springs, ElasticLaw::TensorMass, ElasticLaw::NeoHookean}) {
    auto organ = box_organ(3, 3, 3, 0.01);
    organ.material.elastic_law = law;
    organ.material.fibre_tension = 0.1;
    organ.material.fibre_stiffness_ratio = 4;
    auto field = organ;
    organ.material.fibre_direction = axis;
    for (std::size_t n = 0; n < field.mesh.node_count(); ++n)
      field.fibre_directions.push_back(n % 2 == 0 ? axis : -axis);
    CutOrgan own(organ), directed(field);
    for (auto* box : {&own, &directed})
      box->stroke(straight_path({{0.003, -0.06, -0.06}, {0.003, -0.06, 0.06}},
                                {{0.003, 0.06, -0.06}, {0.003, 0.06, 0.06}}, 0.002));
    const auto u = deformed(own.topology());
    EXPECT_GT(own.total().splits, 20u);
    EXPECT_EQ(dynamics::Tissue(own.topology()).energy_j(u),
              dynamics::Tissue(directed.topology()).energy_j(u))
        << static_cast<int>(law);
  }
}

}  // namespace
}  // namespace trocar::cutting::testing
