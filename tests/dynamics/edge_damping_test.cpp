// Damping along edges adds to the stress of tissue that moves fast.

#include <gtest/gtest.h>

#include <cmath>

#include "server/organs/organ/organ.h"
#include "server/tissue/dynamics/tissue.h"
#include "tests/mesh/block_mesh.h"

namespace trocar::dynamics {
namespace {

using material::ElasticLaw;

class EdgeDamping : public ::testing::TestWithParam<ElasticLaw> {};

// The pull of a block's face along x where the block was stretched by `before` a tick ago and is
// stretched by `now`, its volume kept.
double pull_n(const organ::Organ& organ, double before, double now) {
  Tissue tissue(organ);
  const auto& groups = tissue.groups();
  std::vector<Float4> start(groups.slot_count()), end(groups.slot_count());
  double most = 0;
  for (const auto& rest : organ.mesh.rest_positions) most = std::max(most, rest.x);
  for (Slot slot = 0; slot < groups.slot_count(); ++slot) {
    const auto node = groups.node_at(slot);
    if (!node.is_valid()) continue;
    const Vec3d rest = organ.mesh.rest_positions[node.value];
    const auto moved = [&](double stretch) {
      const double across = 1 / std::sqrt(stretch) - 1;
      return to_float4(to_float(Vec3d{(stretch - 1) * rest.x, across * rest.y, across * rest.z}));
    };
    start[slot] = moved(before);
    end[slot] = moved(now);
  }
  double pull = 0;
  for (Group g = 0; g < groups.group_count(); ++g) {
    NodeStep8 step{zero_vec8(), zero_sym_mat8()};
    tissue.begin_group(g, start.data(), 1000);
    tissue.add(g, end.data(), load_group(&end[g * kLanes]), step);
    Vec3Lanes gradients;
    store(gradients, step.gradient);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const auto node = groups.nodes_of(g)[lane];
      if (node.is_valid() && organ.mesh.rest_positions[node.value].x > most - 1e-6)
        pull += static_cast<double>(gradients.at(lane).x);
    }
  }
  return pull;
}

// Tissue that is stretched to 1.2 within 10 ms has the stress of its law within 3 %, unless
// somebody asks for more damping.
TEST_P(EdgeDamping, OfTheDefaultHardlyAddsToTheStressOfAJump) {
  organ::Organ organ;
  organ.name = "block";
  organ.mesh = trocar::testing::block_mesh(3, 0.01);
  organ.mesh.build_adjacency();
  mesh::centre_on_origin(organ.mesh);
  organ.material.elastic_law = GetParam();
  if (GetParam() == ElasticLaw::Measured)
    material::use_measured(*material::find_measured_material("human_liver_nava2008"),
                           organ.material);
  organ.node_masses_kg = organ::lumped_masses(organ);
  ASSERT_TRUE(organ::validate(organ).ok());
  const double held = pull_n(organ, 1.2, 1.2), jumping = pull_n(organ, 1.18, 1.2);
  EXPECT_GT(held, 0.01);
  EXPECT_GT(jumping, held) << "there is some";
  EXPECT_LT(jumping / held, 1.03);
}

INSTANTIATE_TEST_SUITE_P(Laws, EdgeDamping,
                         ::testing::Values(ElasticLaw::Springs, ElasticLaw::NeoHookean,
                                           ElasticLaw::Measured));

}  // namespace
}  // namespace trocar::dynamics
