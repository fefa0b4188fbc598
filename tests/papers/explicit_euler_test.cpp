// The papers' integrator: its stability limit, and agreement with the implicit solver.

#include "server/papers/nakao/explicit_euler.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/organs/catalogue/builtin_organs.h"

namespace trocar::nakao {
namespace {

using namespace dynamics;

organ::Organ column(double node_damping_per_s, double spring_time_s) {
  auto organ = *catalogue::make_lattice({.nx = 2, .ny = 12, .nz = 2});
  organ.material.node_damping_per_s = node_damping_per_s;
  organ.material.edge_damping_time_s = spring_time_s;
  return organ;
}

double largest_after(const organ::Organ& organ, double dt, double seconds) {
  world::World world(organ);
  ExplicitEuler integrator(organ, world);
  for (std::uint32_t n = 0; n < world.node_count(); ++n)
    if (world.node_classes[n] != world::NodeClass::Fixed)
      world.displacements[n] = {0, n % 2 == 0 ? 1e-5f : -1e-5f, 1e-5f};
  for (int i = 0; i < static_cast<int>(seconds / dt); ++i) integrator.step(dt, world);
  double largest = 0;
  for (const auto& u : world.displacements)
    largest = std::max(largest, static_cast<double>(length(u)));
  return largest;
}

// A chain of 11 masses, the last with half the mass and stiffness as the others: its highest mode
// is that of a chain fixed at one end, w^2 = 4 k/m sin^2(theta).
TEST(ExplicitEuler, HighestFrequencyIsThatOfTheLattice) {
  const auto organ = column(0, 0);
  const ExplicitEuler integrator(organ, world::World(organ));
  // Corner nodes carry a quarter cell, springs along y the whole k: 4 k / (m / 4) bounds w^2.
  const double cell = organ.material.density_kg_m3 * 1e-6;
  const double bound = std::sqrt(4 * organ.material.spring_stiffness_n_m / (cell / 4));
  EXPECT_LT(integrator.highest_frequency_rad_s(), bound * 1.01);
  EXPECT_GT(integrator.highest_frequency_rad_s(), bound * 0.97);
}

TEST(ExplicitEuler, StaysBoundedBelowItsLimit) {
  for (const auto& organ : {column(0, 0), column(10, 0), column(0, 0.001)}) {
    const ExplicitEuler integrator(organ, world::World(organ));
    EXPECT_LT(largest_after(organ, integrator.stable_dt_s(), 2.0), 1e-4);
  }
}

TEST(ExplicitEuler, DashpotsShortenTheStableStep) {
  const ExplicitEuler without(column(0, 0), world::World(column(0, 0)));
  const ExplicitEuler with(column(0, 0.002), world::World(column(0, 0.002)));
  EXPECT_LT(with.stable_dt_s(), 0.7 * without.stable_dt_s());
}

TEST(ExplicitEuler, AgreesWithImplicitStepsOfTheSameLength) {
  const auto organ = column(10, 0.001);
  world::World explicit_world(organ), implicit_world(organ);
  ExplicitEuler integrator(organ, explicit_world);
  BlockDescent solver(organ, implicit_world);
  std::vector<NodeIndex> free_nodes;
  std::vector<Vec3f> forces(organ.mesh.node_count());
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n) {
    if (implicit_world.node_classes[n] == world::NodeClass::Fixed) continue;
    free_nodes.push_back(NodeIndex(n));
    if (organ.mesh.rest_positions[n].y > 0.05) forces[n] = {0, 0.02f, 0};
  }
  const float dt = 1e-4f;
  ASSERT_LT(dt, integrator.stable_dt_s());
  double largest = 0, worst = 0;
  for (int i = 0; i < 3000; ++i) {
    integrator.step(static_cast<double>(dt), explicit_world, {.forces = forces});
    solver.solve({}, free_nodes, {.sweeps = 30, .dt = dt}, implicit_world, {.forces = forces});
    for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n) {
      const Vec3f difference = explicit_world.displacements[n] - implicit_world.displacements[n];
      largest = std::max(largest, static_cast<double>(length(implicit_world.displacements[n])));
      worst = std::max(worst, static_cast<double>(length(difference)));
    }
  }
  EXPECT_GT(largest, 1e-3);
  EXPECT_LT(worst, 0.02 * largest);
}

}  // namespace
}  // namespace trocar::nakao
