// Averaged strain whose forces are taken once per step: they are the energies' own, their stiffness
// is a bound, and a solver with them is stable, comes to the same equilibrium, and depends on no
// number of workers.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/dynamics/block_descent.h"
#include "tests/dynamics/edited_organ.h"
#include "tests/mesh/block_mesh.h"
#include "tests/support/random.h"

namespace trocar::dynamics {
namespace {

using material::ElasticLaw;

struct Case {
  const char* name;
  organ::Organ (*make)();
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << c.name;
}

organ::Organ averaged(organ::Organ organ) {
  organ.material.has_averaged_strain = true;
  return organ;
}

organ::Organ block() {
  organ::Organ organ;
  organ.name = "block";
  organ.mesh = trocar::testing::block_mesh(4, 0.01);
  for (std::size_t i = 0; i < organ.mesh.node_count(); ++i)  // no regular directions left
    organ.mesh.rest_positions[i] +=
        Vec3d{double(i * 7 % 11) - 5, double(i * 5 % 13) - 6, double(i * 3 % 7) - 3} * 2e-4;
  organ.mesh.build_adjacency();
  organ.material.elastic_law = ElasticLaw::NeoHookean;
  organ.material.poisson_ratio = 0.48;
  organ.node_masses_kg = organ::lumped_masses(organ);
  return organ;
}

organ::Organ exponential_block() {
  auto organ = block();
  auto measured = *material::find_measured_material("human_liver_nava2008");
  measured.energy = material::StrainEnergy::Exponential;
  measured.exponent = 3;
  material::use_measured(measured, organ.material);
  return organ;
}

// Halves of two laws, both with averages.
organ::Organ block_of_two_laws() {
  auto organ = averaged(block());
  material::MaterialRegion half{"half", organ.material, {}};
  material::use_measured(*material::find_measured_material("human_liver_nava2008"), half.material);
  half.material.has_averaged_strain = true;
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n)
    if (organ.mesh.rest_positions[n].x > -0.002) half.nodes.emplace_back(n);
  organ.regions.push_back(half);
  return organ;
}

// A plate of one layer, and one of flat tets.
organ::Organ flat_block() {
  auto organ = block();
  for (auto& p : organ.mesh.rest_positions) p.y *= 0.2;
  organ.node_masses_kg = organ::lumped_masses(organ);
  return organ;
}

const Case kCases[] = {
    {"NeoHookean", [] { return averaged(block()); }},
    {"MeasuredLiver", [] { return averaged(*catalogue::make_measured_liver(1500)); }},
    {"Exponential", [] { return averaged(exponential_block()); }},
    {"TwoLaws", block_of_two_laws},
    {"FlatTets", [] { return averaged(flat_block()); }},
};

// All nodal forces of a tissue, at displacements per slot.
struct Forces {
  std::vector<Vec3d> gradients;
  std::vector<double> stiffness;
};
Forces forces_of(Tissue& tissue, const std::vector<Float4>& x) {
  const auto& groups = tissue.groups();
  for (Group g = 0; g < groups.group_count(); ++g) tissue.update_nodal_stress(g, x.data());
  Forces all{std::vector<Vec3d>(x.size()), std::vector<double>(x.size())};
  for (Group g = 0; g < groups.group_count(); ++g) {
    const auto forces = tissue.nodal_forces(g);
    Vec3Lanes gradients;
    Lanes stiffness;
    store(gradients, forces.gradient);
    store(stiffness, forces.stiffness);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      all.gradients[g * kLanes + lane] = to_double(gradients.at(lane));
      all.stiffness[g * kLanes + lane] = static_cast<double>(stiffness.v[lane]);
    }
  }
  return all;
}

std::vector<Float4> random_displacements(const Tissue& tissue, float amplitude,
                                         std::uint64_t seed) {
  const auto& groups = tissue.groups();
  const auto u = trocar::testing::random_vectors(groups.slot_count(), amplitude, seed);
  std::vector<Float4> x(u.size());
  for (Slot slot = 0; slot < x.size(); ++slot)
    if (groups.node_at(slot).is_valid()) x[slot] = to_float4(u[slot]);
  return x;
}

double largest_eigenvalue(const SymMat3f& block) {
  const auto d = [](float v) { return static_cast<double>(v); };
  Vec3d v{1, 0.7, -0.4};
  double value = 0;
  for (int i = 0; i < 200; ++i) {
    const Vec3d w{d(block.xx) * v.x + d(block.xy) * v.y + d(block.xz) * v.z,
                  d(block.xy) * v.x + d(block.yy) * v.y + d(block.yz) * v.z,
                  d(block.xz) * v.x + d(block.yz) * v.y + d(block.zz) * v.z};
    value = length(w);
    v = w / std::max(value, 1e-30);
  }
  return value;
}

class ExplicitStrain : public ::testing::TestWithParam<Case> {};

TEST_P(ExplicitStrain, ForcesAreThoseOfTheEnergiesAndStiffnessIsABound) {
  const auto organ = GetParam().make();
  Tissue tissue(organ, StrainScheme::Explicit);
  const auto& groups = tissue.groups();
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const auto x = random_displacements(tissue, 0.0015f, seed);
    const auto forces = forces_of(tissue, x);
    double largest = 0, worst = 0;
    for (Group g = 0; g < groups.group_count(); ++g) {
      NodeStep8 step{zero_vec8(), zero_sym_mat8()};
      tissue.add_averaged(g, step);
      Vec3Lanes gradients;
      SymMat3Lanes blocks;
      store(gradients, step.gradient);
      store(blocks, step.block);
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const auto slot = g * kLanes + lane;
        const Vec3d expected = to_double(gradients.at(lane));
        largest = std::max(largest, length(expected));
        worst = std::max(worst, length(forces.gradients[slot] - expected));
        EXPECT_LE(largest_eigenvalue(blocks.at(lane)), 1.0001 * forces.stiffness[slot] + 1e-9);
      }
    }
    EXPECT_GT(largest, 1e-3) << "the test sees forces";
    EXPECT_LT(worst, 1e-4 * largest);
  }
}

// The largest eigenvalue of all nodes together, in parts of the nodes' stiffness, by power
// iteration: what the solver's stability counts on.
double largest_share(Tissue& tissue, const std::vector<Float4>& pose) {
  const auto at_pose = forces_of(tissue, pose);
  std::vector<Vec3d> v;
  for (const auto& u : trocar::testing::random_vectors(pose.size(), 1, 5))
    v.push_back(to_double(u));
  double share = 0;
  for (int i = 0; i < 40; ++i) {
    double square = 0, longest = 0;
    for (std::size_t s = 0; s < v.size(); ++s) {
      if (!(at_pose.stiffness[s] > 0)) v[s] = {};
      square += at_pose.stiffness[s] * length_squared(v[s]);
    }
    for (auto& a : v) a = a / std::sqrt(square), longest = std::max(longest, length(a));
    const double probe = 1e-4 / longest;
    auto moved = pose;
    for (std::size_t s = 0; s < v.size(); ++s)
      moved[s] = to_float4(to_vec3(pose[s]) + to_float(v[s] * probe));
    const auto forces = forces_of(tissue, moved);
    share = 0;
    for (std::size_t s = 0; s < v.size(); ++s) {
      if (!(at_pose.stiffness[s] > 0)) continue;
      const Vec3d change = (forces.gradients[s] - at_pose.gradients[s]) / probe;
      share += dot(change, v[s]);
      v[s] = change / at_pose.stiffness[s];
    }
  }
  return share;
}

TEST_P(ExplicitStrain, AllNodesTogetherAreNoStifferThanTheStabilityCountsOn) {
  const auto organ = GetParam().make();
  Tissue tissue(organ, StrainScheme::Explicit);
  for (const float amplitude : {0.0f, 0.001f})
    EXPECT_LT(largest_share(tissue, random_displacements(tissue, amplitude, 7)), kMostStiffness)
        << amplitude;
}

INSTANTIATE_TEST_SUITE_P(Organs, ExplicitStrain, ::testing::ValuesIn(kCases));

TEST(ExplicitStrain, CutTissueIsNoStifferEither) {
  testing::EditedOrgan edited(averaged(block()), 3);
  Tissue tissue(edited.topology(), {}, StrainScheme::Explicit);
  for (int edit = 0; edit < 60; ++edit) {
    edited.edit();
    tissue.update_topology(edited.topology());
    edited.topology().clear_changes();
    if (edit % 10 == 9) {
      EXPECT_LT(largest_share(tissue, random_displacements(tissue, 0, 7)), kMostStiffness) << edit;
    }
  }
}

// --- The solver ---

struct Session {
  Session(organ::Organ o, StrainScheme scheme, unsigned workers = 1)
      : organ(std::move(o)), world(organ), solver(organ, world, workers, scheme) {
    solver.use_linear_far_field(world);
    plan = solver.far_plan(1e-3f);
  }
  SolveReport step(const ExternalLoads& loads = {}, std::uint32_t interval = 1) {
    const auto far = plan.with_interval(interval);
    const SolveSettings settings{.far_sweeps = far.sweeps,
                                 .far_over_relaxation = far.over_relaxation,
                                 .far_interval = interval,
                                 .has_linear_far_field = true};
    ++world.tick;
    return solver.solve({}, near, settings, world, loads);
  }
  double energy_j() const {
    double kinetic = 0;
    for (std::size_t i = 0; i < world.node_count(); ++i)
      kinetic += 0.5 * static_cast<double>(world.masses[i]) *
                 length_squared(to_double(world.velocities[i]));
    return kinetic + solver.tissue().energy_j(world.displacements);
  }

  organ::Organ organ;
  world::World world;
  BlockDescent solver;
  FarPlan plan;
  std::vector<NodeIndex> near;
};

organ::Organ liver(double size, double stiffness) {
  auto organ = averaged(*catalogue::make_liver(3000));
  for (auto& p : organ.mesh.rest_positions) p = p * size;
  organ.node_masses_kg = organ::lumped_masses(organ);
  organ.material.young_modulus_pa *= stiffness;
  organ.material.poisson_ratio = 0.48;
  return organ;
}

// Large, small, soft and stiff: 0.1 to 90 times the stiffness per mass of the liver itself. Added
// inertia takes part in the swing, so that it may become energy that was none at first: as much as
// there is of it, which is little where sessions have this scheme. Nothing swings up.
TEST(ExplicitStrain, ABlowSwingsOut) {
  int explicit_organs = 0;
  for (const auto& [size, stiffness] :
       {std::pair{1.0, 1.0}, {1.0, 0.1}, {1.0, 10.0}, {0.33, 1.0}, {0.33, 10.0}})
    for (const std::uint32_t interval : {1u, 2u, 3u}) {
      auto organ = liver(size, stiffness);
      // Stiff organs, which sessions solve the other way, swing up in turns of three without this.
      if (stiffness > 1 && interval > 2) organ.material.edge_damping_time_s = 0.001;
      Session session(std::move(organ), StrainScheme::Explicit);
      const float speed = static_cast<float>(0.15 * size * std::sqrt(stiffness));
      for (std::size_t i = 0; i < session.world.node_count(); ++i)
        if (session.world.node_classes[i] != world::NodeClass::Fixed)
          session.world.velocities[i] = {speed, 0, -speed};
      session.solver.read_state(session.world);
      const double at_start = session.energy_j();
      const double kinetic = at_start - session.solver.tissue().energy_j(
                                            std::vector<Vec3f>(session.world.node_count()));
      std::array<double, 2> most{};
      for (int i = 0; i < 600; ++i) {
        session.step({}, interval);
        most[i < 300 ? 0 : 1] = std::max(most[i < 300 ? 0 : 1], session.energy_j());
      }
      SCOPED_TRACE(std::to_string(size) + ' ' + std::to_string(stiffness) + ' ' +
                   std::to_string(interval));
      EXPECT_LT(most[1], most[0]);
      if (interval > 1 || scheme_for(session.organ, session.world, 1e-3f) == StrainScheme::Implicit)
        continue;
      ++explicit_organs;
      EXPECT_LT(most[0] - at_start, 0.02 * kinetic);
    }
  EXPECT_GE(explicit_organs, 2);
}

// A corner that was drawn out far, and flies on: its inertia would be hundreds of times its mass.
TEST(ExplicitStrain, WhatIsDrawnOutFarIsPulledBack) {
  Session session(averaged(block()), StrainScheme::Explicit);
  for (std::uint32_t n = 0; n < session.world.node_count(); ++n) {
    session.near.emplace_back(n);
    session.world.node_classes[n] = world::NodeClass::Active;
  }
  session.world.displacements[0] = {-0.05f, -0.05f, -0.05f};
  session.world.velocities[0] = {-1, -1, -1};
  session.solver.read_state(session.world);
  const double at_start = session.energy_j();
  double most = 0;
  for (int i = 0; i < 500; ++i) {
    session.step();
    most = std::max(most, session.energy_j());
  }
  double longest = 0;
  for (const auto neighbour : session.organ.mesh.node_neighbours[NodeIndex(0)]) {
    const auto between =
        session.world.displacements[neighbour.value] - session.world.displacements[0];
    longest = std::max(longest, length(to_double(between)));
  }
  EXPECT_LT(most, 1.01 * at_start);
  EXPECT_LT(longest, 0.002);
}

// A pull that stays: where the tissue comes to rest has nothing to do with the scheme.
TEST(ExplicitStrain, EquilibriumIsThatOfTheEnergies) {
  std::array<std::vector<Vec3f>, 2> ends;
  for (const auto scheme : {StrainScheme::Implicit, StrainScheme::Explicit}) {
    auto organ = liver(1, 1);
    organ.material.node_damping_per_s = 30;
    Session session(organ, scheme);
    std::vector<Vec3f> forces(session.world.node_count());
    for (std::size_t n = 0; n < forces.size(); ++n)
      forces[n] = Vec3f{1, -1, 0.5f} * session.world.masses[n];
    for (int i = 0; i < 3000; ++i) session.step({.forces = forces});
    ends[static_cast<std::size_t>(scheme)] = session.world.displacements;
  }
  float farthest = 0, apart = 0;
  for (std::size_t n = 0; n < ends[0].size(); ++n) {
    farthest = std::max(farthest, length(ends[0][n]));
    apart = std::max(apart, length(ends[0][n] - ends[1][n]));
  }
  EXPECT_GT(farthest, 0.003f);
  EXPECT_LT(apart, 0.01f * farthest);
}

TEST(ExplicitStrain, ResultsDoNotDependOnTheNumberOfWorkers) {
  std::array<std::vector<Vec3f>, 2> ends;
  for (const unsigned workers : {1u, 3u}) {
    Session session(block_of_two_laws(), StrainScheme::Explicit, workers);
    session.near = {NodeIndex(3), NodeIndex(30), NodeIndex(31)};
    session.world.velocities[31] = {0.5f, 0.2f, 0};
    session.solver.read_state(session.world);
    for (int i = 0; i < 50; ++i) session.step();
    ends[workers / 2] = session.world.displacements;
  }
  EXPECT_GT(length(ends[0][31]), 1e-4f);
  EXPECT_EQ(ends[0], ends[1]);
}

// The force that holds a node is what the energies leave: inertia that stabilises is no force.
TEST(ExplicitStrain, HoldingForcesAreThoseOfTheEnergies) {
  std::array<Vec3f, 2> forces;
  for (const auto scheme : {StrainScheme::Implicit, StrainScheme::Explicit}) {
    auto organ = liver(1, 1);
    organ.material.node_damping_per_s = 100;
    NodeIndex node(0);
    for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n)
      if (organ.mesh.rest_positions[n].y > organ.mesh.rest_positions[node.value].y)
        node = NodeIndex(n);
    Session session(organ, scheme);
    session.world.node_classes[node.value] = world::NodeClass::Fixed;
    session.solver.read_state(session.world);
    const std::array held{node};
    for (int i = 1; i <= 2500; ++i) {
      const std::array places{Vec3f{0, -0.004f * std::min(1.0f, static_cast<float>(i) / 500), 0}};
      session.step({.held = held, .held_displacements = places});
    }
    forces[static_cast<std::size_t>(scheme)] = session.solver.holding_force({}, node);
  }
  EXPECT_GT(length(forces[0]), 0.02f);
  EXPECT_LT(length(forces[0] - forces[1]), 0.02f * length(forces[0]));
}

}  // namespace
}  // namespace trocar::dynamics
