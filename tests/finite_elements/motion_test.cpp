// Implicit dynamics: frequency and order of convergence, energy, free fall, damping.

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/finite_elements/specimens.h"

namespace trocar::finite_elements::testing {
namespace {

constexpr double kLength_m = 0.05, kDensity = 1060;

// Column held along two axes everywhere: it moves as a rod of modulus lambda + 2 mu.
Specimen rod(ElementOrder order) {
  Specimen column({1, 10, 1}, kLength_m / 10, order, neo_hookean(4000, 0.3));
  const auto everywhere = [](const Vec3d&) { return true; };
  column.hold(everywhere, 0);
  column.hold(everywhere, 2);
  column.hold(plane(1, 0), 1);
  column.pull(plane(1, kLength_m), {0, 1, 0});
  return column;
}

double wave_modulus() {
  const auto m = neo_hookean(4000, 0.3);
  return m.bulk_modulus_pa + 2 * m.coefficients_pa[0];
}

// End of the rod after a quarter of its period, suddenly loaded.
double end_after_quarter(int steps, ElementOrder order, double radius) {
  const auto column = rod(order);
  Solver solver(column.problem(), {.threads = 1, .high_frequency_radius = radius});
  const double period = 4 * kLength_m / std::sqrt(wave_modulus() / kDensity);
  // The load is there from the start: a step of no length before motion begins.
  Loads loads = column.loads();
  State state = solver.state();
  state.loads = loads;
  solver.restore(state);
  for (int i = 0; i < steps; ++i)
    EXPECT_TRUE(solver.step(loads, {.dt_s = period / 4 / steps, .has_inertia = true}).is_converged);
  return mean_displacement(solver, plane(1, kLength_m)).y;
}

TEST(Motion, ASuddenlyLoadedRodReachesItsStaticLengthAfterAQuarterOfItsPeriod) {
  const double still = kLength_m / wave_modulus();
  EXPECT_NEAR(end_after_quarter(64, ElementOrder::Quadratic, 0.8), still, 0.02 * still);
  EXPECT_NEAR(end_after_quarter(64, ElementOrder::Linear, 0.8), still, 0.02 * still);
}

// A body in free fall: exact whatever the step, and no strain.
TEST(Motion, FreeFallIsExact) {
  for (const auto order : {ElementOrder::Linear, ElementOrder::Quadratic}) {
    Specimen block({1, 1, 1}, 0.01, order, liver());
    const Problem problem = block.problem();
    Assembler assembler(problem, 1);
    Vector down = Vector::Zero(static_cast<Eigen::Index>(problem.dof_count()));
    for (Eigen::Index i = 1; i < down.size(); i += 3) down[i] = -9.81;
    Solver solver(problem, {.threads = 1});
    Loads loads{assembler.mass_times(down), {}};
    State state = solver.state();
    state.loads = loads;
    solver.restore(state);
    for (int i = 0; i < 10; ++i)
      ASSERT_TRUE(solver.step(loads, {.dt_s = 0.01, .has_inertia = true}).is_converged);
    const double expected = -9.81 * 0.1 * 0.1 / 2;
    for (Eigen::Index i = 1; i < down.size(); i += 3)
      EXPECT_NEAR(solver.displacements()[i], expected, 1e-7);
  }
}

// First mode of the rod from a smooth start (no step of load): error falls with dt squared.
double mode_error(int steps) {
  const auto column = rod(ElementOrder::Quadratic);
  Problem problem = column.problem();
  Solver solver(problem, {.threads = 1, .tolerance = 1e-11, .high_frequency_radius = 1});
  const double period = 4 * kLength_m / std::sqrt(wave_modulus() / kDensity);
  State state = solver.state();
  const auto& p = problem.mesh.rest_positions;
  constexpr double kSpeed = 1e-4;
  for (std::size_t i = 0; i < p.size(); ++i)
    state.velocity[static_cast<Eigen::Index>(3 * i) + 1] =
        kSpeed * std::sin(std::numbers::pi * p[i].y / (2 * kLength_m));
  solver.restore(state);
  for (int i = 0; i < steps; ++i)
    EXPECT_TRUE(solver.step(no_loads(problem), {.dt_s = period / 4 / steps, .has_inertia = true})
                    .is_converged);
  const double amplitude = kSpeed * period / (2 * std::numbers::pi);
  return std::abs(mean_displacement(solver, plane(1, kLength_m)).y / amplitude - 1) +
         std::abs(solver.velocities().lpNorm<Eigen::Infinity>() / kSpeed);
}

TEST(Motion, TimeIntegrationIsOfSecondOrder) {
  const double coarse = mode_error(8), fine = mode_error(16);
  EXPECT_LT(fine, 0.01);
  EXPECT_GT(coarse / fine, 3.5);
}

TEST(Motion, DampingIsOfMassAndSpeed) {
  Specimen block({1, 1, 1}, 0.01, ElementOrder::Linear, liver());
  Problem problem = block.problem();
  problem.damping_per_s = 3;
  Solver solver(problem, {.threads = 1});
  State state = solver.state();
  for (Eigen::Index i = 0; i < state.velocity.size(); i += 3) state.velocity[i] = 0.1;
  solver.restore(state);
  for (int i = 0; i < 100; ++i)
    ASSERT_TRUE(solver.step(no_loads(problem), {.dt_s = 2e-3, .has_inertia = true}).is_converged);
  EXPECT_NEAR(solver.velocities()[0], 0.1 * std::exp(-3 * 0.2), 3e-5);
  EXPECT_NEAR(solver.velocities()[1], 0, 1e-9);
}

}  // namespace
}  // namespace trocar::finite_elements::testing
