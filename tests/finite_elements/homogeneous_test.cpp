// Homogeneous deformations of meshes against closed forms, the patch test, and the tangent of the
// whole.

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <cmath>

#include "server/lab/finite_elements/material_point.h"
#include "tests/finite_elements/specimens.h"
#include "tests/support/random.h"

namespace trocar::finite_elements::testing {
namespace {

constexpr double kSide_m = 0.02;
constexpr double kArea_m2 = kSide_m * kSide_m;
constexpr double kTolerance = 1e-6;  // relative

// dPsi/dI1 of the reduced polynomial, continued linearly below 3.
double slope(const HyperelasticMaterial& m, double i1) {
  double sum = 0;
  for (int i = 5; i >= 1; --i)
    sum = sum * std::max(i1 - 3, 0.0) + i * m.coefficients_pa[static_cast<std::size_t>(i - 1)];
  return sum;
}

// Nominal stress along x of diag(a, b, c): dW/da.
double nominal(const HyperelasticMaterial& m, double a, double b, double c) {
  return 2 * slope(m, a * a + b * b + c * c) * a +
         (m.bulk_modulus_pa * (a * b * c - 1) - 2 * m.coefficients_pa[0]) * b * c;
}

double root(const std::function<double(double)>& f, double low, double high) {
  for (int i = 0; i < 200; ++i) {
    const double middle = (low + high) / 2;
    ((f(middle) < 0) == (f(low) < 0) ? low : high) = middle;
  }
  return low;
}

double uniaxial(const HyperelasticMaterial& m, double stretch) {
  const double side = root([&](double s) { return nominal(m, s, s, stretch); }, 0.3, 3);
  return nominal(m, stretch, side, side);
}
double equibiaxial(const HyperelasticMaterial& m, double stretch) {
  const double side = root([&](double s) { return nominal(m, s, stretch, stretch); }, 0.1, 3);
  return nominal(m, stretch, stretch, side);
}

class Homogeneous : public ::testing::TestWithParam<ElementOrder> {
 protected:
  Specimen block(const HyperelasticMaterial& material) const {
    return {{2, 2, 2}, kSide_m / 2, GetParam(), material};
  }
  // Along x to `stretch` in some steps; force on the far face.
  static double stretched(const Specimen& specimen, const Where& far, int axis = 0) {
    Solver solver(specimen.problem());
    for (const double share : {0.3, 0.7, 1.0}) {
      const auto report = solver.step(specimen.loads(share), {});
      EXPECT_TRUE(report.is_converged);
    }
    return reaction(solver, far, axis);
  }
  static void symmetry(Specimen& specimen) {
    for (int axis = 0; axis < 3; ++axis) specimen.hold(plane(axis, 0), axis);
  }
  static std::function<double(const Vec3d&)> by(double move) {
    return [=](const Vec3d&) { return move; };
  }
};

TEST_P(Homogeneous, UniaxialStressIsThatOfTheClosedForm) {
  for (const double stretch : {0.6, 0.8, 1.2, 1.6}) {
    auto specimen = block(liver());
    symmetry(specimen);
    specimen.hold(plane(0, kSide_m), 0, by((stretch - 1) * kSide_m));
    const double expected = uniaxial(liver(), stretch) * kArea_m2;
    EXPECT_NEAR(stretched(specimen, plane(0, kSide_m)), expected, kTolerance * std::abs(expected));
  }
}

TEST_P(Homogeneous, EquibiaxialStressIsThatOfTheClosedForm) {
  for (const double stretch : {0.75, 1.3}) {
    auto specimen = block(liver());
    symmetry(specimen);
    for (int axis = 0; axis < 2; ++axis)
      specimen.hold(plane(axis, kSide_m), axis, by((stretch - 1) * kSide_m));
    const double expected = equibiaxial(liver(), stretch) * kArea_m2;
    EXPECT_NEAR(stretched(specimen, plane(0, kSide_m)), expected, kTolerance * std::abs(expected));
  }
}

TEST_P(Homogeneous, SimpleShearStressIsThatOfTheClosedForm) {
  for (const double shear : {0.1, 0.5}) {
    auto specimen = block(liver());
    const auto anywhere = [](const Vec3d& p) {
      return p.x * (kSide_m - p.x) < 1e-9 * kSide_m || p.y * (kSide_m - p.y) < 1e-9 * kSide_m ||
             p.z * (kSide_m - p.z) < 1e-9 * kSide_m;
    };
    specimen.hold(anywhere, 0, [&](const Vec3d& p) { return shear * p.y; });
    specimen.hold(anywhere, 1);
    specimen.hold(anywhere, 2);
    // Work: half of the force couples lies in the corners; the mean over all nodes is exact.
    Solver solver(specimen.problem());
    ASSERT_TRUE(solver.step(specimen.loads(), {}).is_converged);
    const Vector forces = solver.reactions();
    double moment = 0;
    const auto& p = solver.problem().mesh.rest_positions;
    for (std::size_t i = 0; i < p.size(); ++i)
      moment += forces[static_cast<Eigen::Index>(3 * i)] * p[i].y;
    const double expected = 2 * slope(liver(), 3 + shear * shear) * shear;
    EXPECT_NEAR(moment / (kArea_m2 * kSide_m), expected, kTolerance * expected);
  }
}

TEST_P(Homogeneous, ConfinedCompressionIsThatOfTheClosedForm) {
  for (const double stretch : {0.95, 0.8}) {
    auto specimen = block(liver());
    symmetry(specimen);
    for (int axis = 1; axis < 3; ++axis) specimen.hold(plane(axis, kSide_m), axis);
    specimen.hold(plane(0, kSide_m), 0, by((stretch - 1) * kSide_m));
    const double expected = nominal(liver(), stretch, 1, 1) * kArea_m2;
    EXPECT_NEAR(stretched(specimen, plane(0, kSide_m)), expected, kTolerance * std::abs(expected));
  }
}

// Any linear displacement of the surface goes through an irregular mesh unchanged.
TEST_P(Homogeneous, PatchTest) {
  trocar::testing::Random random(5);
  auto jitter = [&](const Vec3d& p) {
    const auto is_inside = [](double x) { return x > 1e-6 && x < kSide_m - 1e-6; };
    if (!is_inside(p.x) || !is_inside(p.y) || !is_inside(p.z)) return p;
    const auto shift = [&] { return random.between(-1e-3, 1e-3); };
    return p + Vec3d{shift(), shift(), shift()};
  };
  Specimen specimen({3, 3, 3}, kSide_m / 3, GetParam(), liver_without_relaxation(), jitter);
  const double g[3][3] = {{0.15, 0.08, -0.05}, {0.02, -0.1, 0.07}, {-0.04, 0.06, 0.05}};
  const auto moved = [&](const Vec3d& p, int axis) {
    return g[axis][0] * p.x + g[axis][1] * p.y + g[axis][2] * p.z;
  };
  const auto on_surface = [](const Vec3d& p) {
    const auto is_end = [](double x) { return x < 1e-6 || x > kSide_m - 1e-6; };
    return is_end(p.x) || is_end(p.y) || is_end(p.z);
  };
  for (int axis = 0; axis < 3; ++axis)
    specimen.hold(on_surface, axis, [&, axis](const Vec3d& p) { return moved(p, axis); });
  Solver solver(specimen.problem());
  ASSERT_TRUE(solver.step(specimen.loads(), {}).is_converged);
  const auto& p = solver.problem().mesh.rest_positions;
  for (std::size_t i = 0; i < p.size(); ++i)
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(solver.displacements()[static_cast<Eigen::Index>(3 * i) + axis],
                  moved(p[i], axis), 1e-10);
}

TEST_P(Homogeneous, TangentOfTheWholeIsTheDerivativeOfTheForces) {
  auto specimen = block(liver());
  const Problem problem = specimen.problem();
  Assembler assembler(problem, 2);
  trocar::testing::Random random(7);
  const auto size = static_cast<Eigen::Index>(problem.dof_count());
  Vector u(size), d(size);
  for (Eigen::Index i = 0; i < size; ++i)
    u[i] = random.between(-5e-4, 5e-4), d[i] = random.between(-1, 1);
  constexpr double kStep = 1e-9, kDt_s = 0.1;
  Vector low = Vector::Zero(size), high = low, forces = low, product = low;
  ASSERT_TRUE(assembler.add_forces(u - kStep * d, kDt_s, low));
  ASSERT_TRUE(assembler.add_forces(u + kStep * d, kDt_s, high));
  SparseMatrix tangent = assembler.pattern().zeros();
  ASSERT_TRUE(assembler.add_forces_and_tangent(u, kDt_s, {}, d, forces, product, tangent));
  const Vector expected = (high - low) / (2 * kStep);
  EXPECT_LT((product - expected).norm(), 1e-6 * expected.norm());
  const Vector by_matrix = tangent.selfadjointView<Eigen::Lower>() * d;
  EXPECT_LT((product - by_matrix).norm(), 1e-12 * product.norm());
}

// Net force and torque of the tissue on itself are zero.
TEST_P(Homogeneous, ForcesWithinTheTissueBalance) {
  auto specimen = block(liver());
  const Problem problem = specimen.problem();
  Assembler assembler(problem, 1);
  trocar::testing::Random random(8);
  const auto size = static_cast<Eigen::Index>(problem.dof_count());
  Vector u(size), forces = Vector::Zero(size);
  for (Eigen::Index i = 0; i < size; ++i) u[i] = random.between(-5e-4, 5e-4);
  ASSERT_TRUE(assembler.add_forces(u, 0, forces));
  Eigen::Vector3d force = Eigen::Vector3d::Zero(), torque = force;
  for (Eigen::Index n = 0; n < size / 3; ++n) {
    const auto& p = problem.mesh.rest_positions[static_cast<std::size_t>(n)];
    const Eigen::Vector3d x = Eigen::Vector3d(p.x, p.y, p.z) + u.segment<3>(3 * n);
    const Eigen::Vector3d f = forces.segment<3>(3 * n);
    force += f;
    torque += x.cross(f);
  }
  EXPECT_LT(force.norm(), 1e-12 * forces.norm());
  EXPECT_LT(torque.norm(), 1e-12 * forces.norm() * kSide_m);
}

INSTANTIATE_TEST_SUITE_P(Orders, Homogeneous,
                         ::testing::Values(ElementOrder::Linear, ElementOrder::Quadratic));

// The specimen without a mesh is the same closed form.
TEST(MaterialPoint, SpecimensMeetTheClosedForms) {
  for (const double stretch : {0.6, 0.9, 1.3, 1.7}) {
    finite_elements::Specimen bar(liver(), material::TestMode::Uniaxial);
    EXPECT_NEAR(*bar.stretch_to(stretch, 0), uniaxial(liver(), stretch),
                1e-9 * liver().bulk_modulus_pa);
  }
  finite_elements::Specimen sheet(liver(), material::TestMode::Equibiaxial);
  EXPECT_NEAR(*sheet.stretch_to(1.3, 0), equibiaxial(liver(), 1.3), 1e-9 * liver().bulk_modulus_pa);
}

}  // namespace
}  // namespace trocar::finite_elements::testing
