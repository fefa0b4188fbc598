// Quasi-linear viscoelasticity: analytic Prony series at small strains, the hereditary integral at
// large ones, creep, and rest.

#include <gtest/gtest.h>

#include <cmath>

#include "server/lab/finite_elements/material_point.h"
#include "tests/finite_elements/specimens.h"

namespace trocar::finite_elements::testing {
namespace {

constexpr double kCube_m = 0.01;

double relaxation(const HyperelasticMaterial& m, double t) {
  double g = m.equilibrium_share();
  for (const auto& [weight, time_s] : m.relaxation) g += weight * std::exp(-t / time_s);
  return g;
}

// Stress at t of a bracket whose elastic stress ramps evenly to `elastic` in `rise`.
double after_ramp(const HyperelasticMaterial& m, double elastic, double rise, double t) {
  double g = m.equilibrium_share() * std::min(t / rise, 1.0);
  for (const auto& [weight, tau] : m.relaxation) {
    const double since = std::max(t - rise, 0.0);
    g += weight * tau / rise * (std::exp(-since / tau) - std::exp(-t / tau));
  }
  return g * elastic;
}

Specimen sheared_block(double shear, ElementOrder order) {
  Specimen specimen({2, 2, 2}, kCube_m / 2, order, liver());
  const auto on_surface = [](const Vec3d& p) {
    const auto is_end = [](double x) { return x < 1e-9 || x > kCube_m - 1e-9; };
    return is_end(p.x) || is_end(p.y) || is_end(p.z);
  };
  specimen.hold_all_axes(on_surface);
  specimen.hold(on_surface, 0, [=](const Vec3d& p) { return shear * p.y; });
  return specimen;
}

double shear_stress(const Solver& solver) {
  const Vector forces = solver.reactions();
  const auto& p = solver.problem().mesh.rest_positions;
  double moment = 0;
  for (std::size_t i = 0; i < p.size(); ++i)
    moment += forces[static_cast<Eigen::Index>(3 * i)] * p[i].y;
  return moment / (kCube_m * kCube_m * kCube_m);
}

// A ramp of shear in 50 ms, then held: 0.1 % of the analytic series whatever the step.
TEST(Relaxation, SmallStrainsFollowThePronySeriesAtEachStep) {
  constexpr double kShear = 1e-3, kRise_s = 0.05;
  const double elastic = 2 * liver().coefficients_pa[0] * kShear;
  for (const double dt : {0.5e-3, 1e-3, 5e-3}) {
    const auto specimen = sheared_block(kShear, ElementOrder::Linear);
    Solver solver(specimen.problem(), {.threads = 1});
    const int steps = static_cast<int>(std::lround(0.4 / dt));
    for (int i = 1; i <= steps; ++i) {
      const double t = i * dt;
      ASSERT_TRUE(
          solver.step(specimen.loads(std::min(t / kRise_s, 1.0)), {.dt_s = dt}).is_converged);
      const double expected = after_ramp(liver(), elastic, kRise_s, t);
      ASSERT_NEAR(shear_stress(solver), expected, 1e-3 * expected) << dt << " " << t;
    }
    // From there on in one step: the recurrence is exact where strain rests.
    ASSERT_TRUE(solver.step(specimen.loads(), {.dt_s = 20 - 0.4}).is_converged);
    const double expected = after_ramp(liver(), elastic, kRise_s, 20);
    EXPECT_NEAR(shear_stress(solver), expected, 1e-3 * expected);
  }
}

TEST(Relaxation, AStepOfStrainRelaxesToTheEquilibriumShare) {
  const auto specimen = sheared_block(0.3, ElementOrder::Quadratic);
  Solver solver(specimen.problem(), {.threads = 1});
  ASSERT_TRUE(solver.step(specimen.loads(), {}).is_converged);
  const double at_once = shear_stress(solver);
  for (const double t : {0.1, 0.5, 2.0, 7.0}) {
    ASSERT_TRUE(solver.step(specimen.loads(), {.dt_s = t - solver.time_s()}).is_converged);
    EXPECT_NEAR(shear_stress(solver), relaxation(liver(), t) * at_once, 1e-9 * at_once);
  }
  ASSERT_TRUE(solver.step(specimen.loads(), {.dt_s = INFINITY}).is_converged);
  EXPECT_NEAR(shear_stress(solver) / at_once, 0.3461, 1e-4) << "of table 1, as printed";
}

// Volume does not relax: after a sudden confined compression only the bracket's share goes.
TEST(Relaxation, VolumeKeepsItsStress) {
  MaterialPoint point(liver());
  Matrix3 f = Matrix3::Identity();
  f(0, 0) = 0.9;
  const auto stress = stress_of(liver(), f);
  point.advance(f, 0);
  const auto relaxed = point.respond(f, INFINITY);
  const Vector6 expected =
      liver().equilibrium_share() * stress->relaxing.stress + stress->volumetric.stress;
  EXPECT_LT((relaxed->stress - expected).norm(), 1e-9 * expected.norm());
}

// Second Piola-Kirchhoff stress along x of diag(l, b, b): bracket and volumetric part.
double bracket_xx(double l, double b) {
  const auto psi = material::strain_energy(liver(), l * l + 2 * b * b - 3);
  return 2 * psi.first - 2 * liver().coefficients_pa[0] * b * b / l;
}
double bracket_yy(double l, double b) {
  const auto psi = material::strain_energy(liver(), l * l + 2 * b * b - 3);
  return 2 * psi.first - 2 * liver().coefficients_pa[0] * l;
}

// Sums the hereditary integral by the trapezoidal rule over the whole past at each instant. It does
// not use the recurrence that is tested.
class Volterra {
 public:
  explicit Volterra(double dt) : dt_(dt) {}
  void add(double value) {
    past_.push_back(value);
    const double t = static_cast<double>(past_.size()) * dt_;
    offset_ = past_.front() * relaxation(liver(), t);
    for (std::size_t i = 0; i + 1 < past_.size(); ++i)
      offset_ += mean(t - static_cast<double>(i) * dt_) * (past_[i + 1] - past_[i]);
  }
  // Returns the integral one step after the last value, if it is `value` there.
  double now(double value) const { return offset_ + mean(dt_) * (value - past_.back()); }

 private:
  double mean(double since) const {
    return (relaxation(liver(), since) + relaxation(liver(), since - dt_)) / 2;
  }
  double dt_, offset_ = 0;
  std::vector<double> past_;
};

double free_side(const Volterra& yy, double l, double guess) {
  const double bulk = liver().bulk_modulus_pa;
  double low = guess * 0.8, high = guess * 1.2;
  for (int i = 0; i < 60; ++i) {
    const double b = (low + high) / 2;
    const double total = yy.now(bracket_yy(l, b)) + bulk * (l * b * b - 1) * l;
    (total < 0 ? low : high) = b;
  }
  return (low + high) / 2;
}

// Stretched to 1.4 in 0.2 s and held.
TEST(Relaxation, LargeStrainsMeetTheHereditaryIntegral) {
  constexpr double kDt_s = 2e-3;
  Specimen block({1, 1, 1}, kCube_m, ElementOrder::Linear, liver());
  for (int axis = 0; axis < 3; ++axis) block.hold(plane(axis, 0), axis);
  block.hold(plane(0, kCube_m), 0, [](const Vec3d&) { return 0.4 * kCube_m; });
  Solver solver(block.problem(), {.threads = 1});
  Volterra xx(kDt_s), yy(kDt_s);
  xx.add(0), yy.add(0);
  double b = 1;
  for (int i = 1; i <= 300; ++i) {
    const double share = std::min(i * kDt_s / 0.2, 1.0), l = 1 + 0.4 * share;
    ASSERT_TRUE(solver.step(block.loads(share), {.dt_s = kDt_s}).is_converged);
    b = free_side(yy, l, b);
    const double j = l * b * b;
    const double nominal = l * xx.now(bracket_xx(l, b)) + liver().bulk_modulus_pa * (j - 1) * b * b;
    ASSERT_NEAR(reaction(solver, plane(0, kCube_m), 0) / (kCube_m * kCube_m), nominal,
                2e-4 * std::abs(nominal))
        << i;
    xx.add(bracket_xx(l, b)), yy.add(bracket_yy(l, b));
  }
}

// A dead load that is put on in 20 ms and stays: the stretch for which the hereditary integral
// carries it, by bisection.
TEST(Relaxation, CreepMeetsTheHereditaryIntegral) {
  constexpr double kDt_s = 2e-3, kLoad_pa = 1500, kRise_s = 0.02;
  Specimen block({1, 1, 1}, kCube_m, ElementOrder::Linear, liver());
  for (int axis = 0; axis < 3; ++axis) block.hold(plane(axis, 0), axis);
  block.pull(plane(0, kCube_m), {kLoad_pa, 0, 0});
  // The far face stays even under the even load, as the closed form has it.
  Solver solver(block.problem(), {.threads = 1});
  Volterra xx(kDt_s), yy(kDt_s);
  xx.add(0), yy.add(0);
  double l = 1, b = 1, first = 0;
  for (int i = 1; i <= 200; ++i) {
    const double share = std::min(i * kDt_s / kRise_s, 1.0);
    ASSERT_TRUE(solver.step(block.loads(share), {.dt_s = kDt_s}).is_converged);
    double low = l * 0.95, high = l * 1.2;
    for (int k = 0; k < 45; ++k) {
      l = (low + high) / 2;
      b = free_side(yy, l, b);
      const double nominal =
          l * xx.now(bracket_xx(l, b)) + liver().bulk_modulus_pa * (l * b * b - 1) * b * b;
      (nominal < share * kLoad_pa ? low : high) = l;
    }
    const double ours = mean_displacement(solver, plane(0, kCube_m)).x / kCube_m;
    ASSERT_NEAR(ours, l - 1, 3e-4 * (l - 1)) << i;
    if (i == 10) first = ours;
    xx.add(bracket_xx(l, b)), yy.add(bracket_yy(l, b));
  }
  EXPECT_GT(l - 1, 1.1 * first) << "it creeps";
}

TEST(Relaxation, WhatIsNotLoadedDoesNotMove) {
  Specimen block({2, 2, 2}, kCube_m / 2, ElementOrder::Quadratic, liver());
  block.hold_all_axes(plane(1, 0));
  Solver solver(block.problem());
  for (const auto& settings : std::initializer_list<StepSettings>{
           {}, {.dt_s = INFINITY}, {.dt_s = 1}, {.dt_s = 1e-3, .has_inertia = true}}) {
    const auto report = solver.step(block.loads(), settings);
    EXPECT_TRUE(report.is_converged);
    EXPECT_EQ(report.iterations, 0);
    EXPECT_EQ(solver.displacements().norm(), 0);
  }
}

}  // namespace
}  // namespace trocar::finite_elements::testing
