// Quadratic elements converge where linear ones are stiff: a cantilever and Cook's membrane as a
// solid.

#include <gtest/gtest.h>

#include <cmath>

#include "tests/finite_elements/specimens.h"

namespace trocar::finite_elements::testing {
namespace {

constexpr double kYoung_pa = 4000, kPoisson = 0;

// Without lateral contraction, which the clamp would hinder: end deflection of a beam of 1 x 1 x 4
// under a small load across its end, over Timoshenko's.
double cantilever(int across, ElementOrder order) {
  constexpr double kWidth_m = 0.02, kLength_m = 0.08, kTraction_pa = 0.5;
  Specimen beam({across, 4 * across, across}, kWidth_m / across, order,
                neo_hookean(kYoung_pa, kPoisson));
  beam.hold_all_axes(plane(1, 0));
  beam.pull(plane(1, kLength_m), {kTraction_pa, 0, 0});
  Solver solver(beam.problem());
  EXPECT_TRUE(solver.step(beam.loads(), {}).is_converged);
  const double area = kWidth_m * kWidth_m, moment = area * area / 12;
  const double force = kTraction_pa * area, shear_pa = kYoung_pa / (2 * (1 + kPoisson));
  const double factor = 10 * (1 + kPoisson) / (12 + 11 * kPoisson);
  const double expected = force * kLength_m * kLength_m * kLength_m / (3 * kYoung_pa * moment) +
                          force * kLength_m / (factor * shear_pa * area);
  return mean_displacement(solver, plane(1, kLength_m)).x / expected;
}

TEST(Bending, QuadraticElementsMeetTimoshenko) {
  const double linear = cantilever(2, ElementOrder::Linear);
  const double quadratic = cantilever(1, ElementOrder::Quadratic);
  const double refined = cantilever(2, ElementOrder::Quadratic);
  EXPECT_LT(linear, 0.85) << "linear tets are too stiff";
  EXPECT_NEAR(quadratic, 1, 0.06);
  EXPECT_NEAR(refined, 1, 0.02);
}

// Cook's membrane: 48 wide, clamped from 0 to 44, the far side from 44 to 60 drawn up; here 10
// thick between walls without friction, of nearly incompressible material. Rise of the upper far
// corner.
double cook(int cells, ElementOrder order, double load_pa) {
  constexpr double kUnit_m = 1e-3;
  const double spacing = 48 * kUnit_m / cells;
  const int depth = 1;
  const auto shape = [&](const Vec3d& p) {
    const double x = p.x, share = p.y / (48 * kUnit_m);
    const double low = 44.0 / 48 * x, high = 44 * kUnit_m + 16.0 / 48 * x;
    return Vec3d{x, low + share * (high - low), p.z / spacing * 10 * kUnit_m / depth};
  };
  Specimen membrane({cells, cells, depth}, spacing, order, neo_hookean(4000, 0.49), shape);
  membrane.hold_all_axes(plane(0, 0));
  membrane.hold([](const Vec3d&) { return true; }, 2);
  membrane.pull(plane(0, 48 * kUnit_m), {0, load_pa, 0});
  Solver solver(membrane.problem());
  EXPECT_TRUE(solver.step(membrane.loads(), {}).is_converged);
  return mean_displacement(solver,
                           [&](const Vec3d& p) {
                             return std::abs(p.x - 48 * kUnit_m) < 1e-9 &&
                                    std::abs(p.y - 60 * kUnit_m) < 1e-9;
                           })
      .y;
}

TEST(Bending, QuadraticElementsConvergeOnCooksMembrane) {
  constexpr double kLoad_pa = 100;
  const double coarse = cook(2, ElementOrder::Quadratic, kLoad_pa);
  const double medium = cook(4, ElementOrder::Quadratic, kLoad_pa);
  const double fine = cook(8, ElementOrder::Quadratic, kLoad_pa);
  const double finest = cook(16, ElementOrder::Quadratic, kLoad_pa);
  const double linear = cook(16, ElementOrder::Linear, kLoad_pa);
  EXPECT_NEAR(fine / finest, 1, 0.03) << "the clamped corner is singular";
  EXPECT_LT(std::abs(fine - finest), 0.6 * std::abs(medium - fine));
  EXPECT_LT(std::abs(medium - fine), std::abs(coarse - medium));
  EXPECT_LT(linear / finest, 0.8) << "linear tets lock";
}

// Large rotations with small strains: a bar that is bent far.
TEST(Bending, LargeDeflectionsConverge) {
  Specimen beam({1, 8, 1}, 0.01, ElementOrder::Quadratic, liver_without_relaxation());
  beam.hold_all_axes(plane(1, 0));
  beam.pull(plane(1, 0.08), {60, 0, 0});
  Solver solver(beam.problem());
  const auto report = solver.step(beam.loads(), {});
  ASSERT_TRUE(report.is_converged);
  const Vec3d end = mean_displacement(solver, plane(1, 0.08));
  EXPECT_GT(end.x, 0.03);
  EXPECT_LT(end.y, -0.01) << "the end comes down as it goes aside";
  EXPECT_NEAR(reaction(solver, plane(1, 0), 0), -60 * 1e-4, 1e-9) << "what holds it balances";
}

}  // namespace
}  // namespace trocar::finite_elements::testing
