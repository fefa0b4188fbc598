// Strain averaged over smoothing domains: what it leaves to tets, that even strain is exact, and
// that it does not lock where linear tets do.

#include "server/tissue/dynamics/nodal_strain.h"

#include <gtest/gtest.h>

#include <numeric>

#include "server/tissue/dynamics/tissue.h"
#include "server/tissue/topology/tet_shape.h"
#include "tests/mesh/block_mesh.h"
#include "tests/support/random.h"

namespace trocar::dynamics {
namespace {

constexpr double kCell_m = 0.01;

organ::Organ block(bool is_averaged) {
  organ::Organ organ;
  organ.name = "block";
  organ.mesh = trocar::testing::block_mesh(4, kCell_m);
  organ.material.elastic_law = material::ElasticLaw::NeoHookean;
  organ.material.poisson_ratio = 0.49;
  organ.material.edge_damping_time_s = 0;
  organ.material.has_averaged_strain = is_averaged;
  organ.node_masses_kg = organ::lumped_masses(organ);
  return organ;
}

// A stiff half with or without averages, and between them tets of the soft material.
organ::Organ block_of_two(bool is_stiff_averaged) {
  auto organ = block(true);
  material::MaterialRegion stiff{"stiff", organ.material, {}};
  stiff.material.young_modulus_pa *= 10;
  stiff.material.has_averaged_strain = is_stiff_averaged;
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n)
    if (organ.mesh.rest_positions[n].x > -0.1 * kCell_m) stiff.nodes.push_back(NodeIndex(n));
  organ.regions.push_back(stiff);
  EXPECT_TRUE(organ::validate(organ));
  return organ;
}

TEST(NodalStrain, VolumeThatTetsGiveUpIsThatOfStars) {
  for (const bool is_stiff_averaged : {false, true}) {
    const auto organ = block_of_two(is_stiff_averaged);
    const topology::Topology topology(organ);
    const Groups groups(topology, Coupling::NodalStrain);
    const NodalStrain strain(topology, groups);
    std::array<double, 2> given{}, taken{};
    int mixed = 0;
    for (std::uint32_t t = 0; t < topology.tet_count(); ++t) {
      const auto left = strain.left_to(topology, TetIndex(t));
      const double volume =
          topology::stress_free_shape(topology, TetIndex(t), topology.tet(TetIndex(t))).volume;
      given[topology.material_of(TetIndex(t))] += volume * (1 - left.volumetric);
      EXPECT_NEAR(1 - left.bracket, NodalStrain::kAveragedBracket * (1 - left.volumetric), 1e-12);
      if (left.volumetric > 0 && left.volumetric < 1) ++mixed;
    }
    for (std::uint32_t n = 0; n < topology.node_count(); ++n) {
      const auto material = strain.material_of(NodeIndex(n));
      if (material == NodalStrain::kNone) continue;
      taken[material] += 1 / static_cast<double>(strain.at_rest(groups.slot_of(NodeIndex(n)))[0].w);
    }
    for (std::size_t m = 0; m < 2; ++m) EXPECT_NEAR(taken[m], given[m], 1e-6 * given[0]);
    EXPECT_EQ(given[1] > 0, is_stiff_averaged);
    EXPECT_EQ(mixed > 0, is_stiff_averaged) << "tets where halves with strain meet";
  }
}

double energy_at(const organ::Organ& organ, const std::vector<Vec3f>& u) {
  const Tissue tissue(organ);
  const std::vector<Vec3f> rest(u.size());
  return tissue.energy_j(u) - tissue.energy_j(rest);
}

// The patch test: under the same strain everywhere averages change nothing.
TEST(NodalStrain, EvenStrainIsExact) {
  const auto plain = block(false), averaged = block(true);
  std::vector<Vec3f> u;
  for (const auto& p : plain.mesh.rest_positions)
    u.push_back(to_float(Vec3d{0.2 * p.x + 0.1 * p.y, -0.1 * p.y + 0.05 * p.z, 0.15 * p.x}));
  const double expected = energy_at(plain, u);
  EXPECT_GT(expected, 1e-4);
  EXPECT_NEAR(energy_at(averaged, u), expected, 2e-6 * expected);
}

// Averages take energy from strain that is not even, never add to it, and leave some of it: nothing
// moves without resistance (Jensen's inequality; the bracket's share left to tets).
TEST(NodalStrain, UnevenStrainCostsLessButNotNothing) {
  const auto plain = block(false), averaged = block(true);
  for (std::uint32_t seed = 1; seed < 20; ++seed) {
    const auto u = trocar::testing::random_vectors(plain.mesh.node_count(), 5e-4f, seed);
    const double tets = energy_at(plain, u), strain = energy_at(averaged, u);
    EXPECT_LT(strain, 0.9 * tets);
    EXPECT_GT(strain, 0.01 * tets);
  }
}

// Gradients that follow moves are those at the new places.
TEST(NodalStrain, FollowMoves) {
  const auto organ = block(true);
  const topology::Topology topology(organ);
  const Groups groups(topology, Coupling::NodalStrain);
  NodalStrain strain(topology, groups), anew(topology, groups);
  std::vector<Float4> x(groups.slot_count());
  for (Group g = 0; g < groups.group_count(); ++g) strain.restart_group(g, x.data());
  const auto moves = trocar::testing::random_vectors(groups.slot_count(), 1e-3f, 3);
  for (Group g = 0; g < groups.group_count(); ++g) {
    Vec3Lanes lanes;
    const std::uint8_t some = g % 2 == 0 ? 0xff : 0x2d;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const std::size_t slot = g * kLanes + lane;
      if ((some >> lane & 1) == 0) continue;
      lanes.set(lane, moves[slot]);
      x[slot] = to_float4(moves[slot]);
    }
    strain.after_move(g, load(lanes), some);
  }
  for (Group g = 0; g < groups.group_count(); ++g) anew.restart_group(g, x.data());
  for (Slot slot = 0; slot < groups.slot_count(); ++slot) {
    if (!groups.node_at(slot).is_valid()) continue;
    for (std::size_t r = 0; r < 3; ++r) {
      const auto a = to_vec3(strain.gradients()[3 * slot + r]),
                 b = to_vec3(anew.gradients()[3 * slot + r]);
      EXPECT_LT(length(a - b), 1e-6f * kCell_m * kCell_m * kCell_m) << slot;
      EXPECT_EQ(strain.gradients()[3 * slot + r].w, anew.gradients()[3 * slot + r].w);
    }
  }
}

}  // namespace
}  // namespace trocar::dynamics
