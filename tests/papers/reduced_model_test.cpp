// The reduced model against the full one, where the two must agree, and against derivatives by
// differences.

#include "server/papers/dogan/reduced_model.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/papers/dogan/build.h"
#include "server/papers/dogan/quality.h"
#include "tests/papers/synthetic_reduction.h"

namespace trocar::dogan {
namespace {

using reduction::testing::block;

using finite_elements::Problem;

std::unique_ptr<FullModel> full(const organ::Organ& organ) {
  auto model = FullModel::create(organ);
  TROCAR_ASSERT(model.ok());
  return std::move(*model);
}

// Linear solutions of a unit force along each axis on each node that is not held.
Training linear_training(FullModel& model) {
  Training training;
  for (std::uint32_t n = 0; n < model.organ().mesh.node_count(); ++n) {
    if (std::ranges::binary_search(model.organ().fixed_nodes, NodeIndex(n))) continue;
    for (const Vec3d force : {Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}}) {
      const Press press{NodeIndex(n), force, 0};
      training.snapshots.push_back({press, model.linear_displacements(model.forces_of(press))});
    }
  }
  return training;
}

// Forces of the tissue at displacements, by the off-line solver's assembler on a problem made here.
Vector internal_forces(const organ::Organ& organ, const Vector& u) {
  auto material = organ.material.measured;
  material.relaxation.clear();
  const Problem problem = finite_elements::make_problem(
      finite_elements::make_elements(organ.mesh, organ.mesh.rest_positions,
                                     finite_elements::ElementOrder::Linear),
      material);
  finite_elements::Assembler assembler(problem, 1);
  Vector forces = Vector::Zero(u.size());
  TROCAR_ASSERT(assembler.add_forces(u, 0, forces));
  return forces;
}

TEST(ReducedModel, AllModesGiveTheLinearSolutionOfTheFullModel) {
  const auto organ = block(3, 3, 2);
  const auto model = full(organ);
  const auto built = reduce(*model, linear_training(*model), {.modes = 36, .tangents = 0});
  ASSERT_TRUE(built.ok()) << built.error().message;
  ASSERT_EQ(built->reduction.mode_count(), 36u);
  ASSERT_TRUE(validate(built->reduction).ok());
  const ReducedModel reduced(built->reduction, TangentChoice::Initial);
  const Press press{organ.mesh.surface_nodes.back(), {0.02, -0.05, 0.03}, 0.012};
  const Vector u = reduced.displacements(reduced.solve(node_forces(organ, press)));
  const Vector expected = model->linear_displacements(model->forces_of(press));
  EXPECT_LT((u - expected).norm(), 1e-8 * expected.norm());
}

// The law is without C20: with it the resistance to volume is another in growth than in loss,
// however small they are.
TEST(ReducedModel, IsTheFullModelAsForcesVanish) {
  auto organ = block(3, 3, 2);
  std::fill_n(organ.material.measured.coefficients_pa.begin() + 1, 4, 0.0);
  const auto model = full(organ);
  const auto built = reduce(*model, linear_training(*model), {.modes = 36, .tangents = 0});
  ASSERT_TRUE(built.ok());
  const ReducedModel reduced(built->reduction, TangentChoice::Initial);
  const Press press{organ.mesh.surface_nodes.back(), {0.02, -0.05, 0.03}, 0.012};
  const Vector u = reduced.displacements(reduced.solve(node_forces(organ, press)));
  constexpr double kShare = 1e-5;
  const auto nonlinear = model->displacements(model->forces_of(press), std::array{kShare});
  ASSERT_EQ(nonlinear.size(), 1u);
  EXPECT_LT((nonlinear[0] - kShare * u).norm(), 1e-3 * kShare * u.norm());
  const Vec3d there = reduced.displacement(reduced.solve(node_forces(organ, press)), press.node);
  EXPECT_EQ(there.x, u[3 * static_cast<Eigen::Index>(press.node.value)]);
}

TEST(ReducedModel, LoadsOfALinearTrainingAreExactInFewModes) {
  const auto organ = block(4, 4, 3);
  const auto model = full(organ);
  Training training;
  const auto nodes = accessible_nodes(organ, 0);
  for (const std::size_t i : {3u, 11u, 20u, 27u}) {
    const Press press{nodes[i], {0.01, -0.02, 0.01 * double(i)}, 0};
    training.snapshots.push_back({press, model->linear_displacements(model->forces_of(press))});
  }
  const auto built = reduce(*model, training, {.modes = 8, .tangents = 0});
  ASSERT_TRUE(built.ok());
  EXPECT_LE(built->reduction.mode_count(), 4u);  // no more are there
  EXPECT_LT(built->initial_error, 1e-8);
}

TEST(ReducedModel, TheTangentIsTheDerivativeOfTheForces) {
  const auto organ = block(3, 4, 3);
  const auto model = full(organ);
  const Press press{organ.mesh.surface_nodes.back(), {0.02, -0.06, 0}, 0.015};
  const auto states = model->displacements(model->forces_of(press), std::array{0.5, 1.0});
  ASSERT_EQ(states.size(), 2u);
  Matrix q(states[0].size(), 2);
  q << states[0], states[1];
  const Matrix modes = karhunen_loeve(q, 2).modes;
  const auto tangent = model->reduced_tangent(states[1], modes);
  ASSERT_TRUE(tangent.has_value());
  constexpr double kStep = 1e-6;
  for (Eigen::Index i = 0; i < 2; ++i) {
    const Vector difference = (internal_forces(organ, states[1] + kStep * modes.col(i)) -
                               internal_forces(organ, states[1] - kStep * modes.col(i))) /
                              (2 * kStep);
    EXPECT_LT((modes.transpose() * difference - tangent->col(i)).norm(), 1e-5 * tangent->norm());
  }
}

TEST(ReducedModel, FirstModesAreAReductionOfTheirOwn) {
  const auto organ = block(4, 4, 3);
  const auto model = full(organ);
  const Settings settings{
      .modes = 6, .places = 5, .directions = 1, .force_n = 0.05, .radius_m = 0.008};
  const auto training = train(*model, settings);
  auto fewer = settings;
  fewer.modes = 3;
  const auto six = reduce(*model, training, settings), three = reduce(*model, training, fewer);
  ASSERT_TRUE(six.ok() && three.ok());
  const auto forces = node_forces(organ, training.snapshots[4].press);
  const ReducedModel a(six->reduction, TangentChoice::Initial, 3),
      b(three->reduction, TangentChoice::Initial);
  EXPECT_LT((a.displacements(a.solve(forces)) - b.displacements(b.solve(forces))).norm(), 1e-12);
}

TEST(Build, TheBestTangentErrsNoMoreThanTheInitialOnTheTraining) {
  const auto organ = block(5, 5, 4);
  const auto model = full(organ);
  const Settings settings{.modes = 8, .places = 6, .force_n = 0.15, .radius_m = 0.012};
  const auto training = train(*model, settings);
  EXPECT_EQ(training.failed, 0u);
  ASSERT_EQ(training.snapshots.size(), 6u * 3 * 3);
  const auto built = reduce(*model, training, settings);
  ASSERT_TRUE(built.ok());
  ASSERT_TRUE(validate(built->reduction).ok()) << validate(built->reduction).error().message;
  EXPECT_EQ(built->tried.size() + built->indefinite, 54u);
  EXPECT_LE(built->best_error, built->initial_error);
  // The reduced model does what the report says.
  double sum = 0;
  const ReducedModel reduced(built->reduction, TangentChoice::Best);
  for (const auto& [press, u] : training.snapshots)
    sum += (reduced.displacements(reduced.solve(node_forces(organ, press))) - u).norm() / u.norm();
  EXPECT_NEAR(sum / 54, built->best_error, 1e-9);
  // And on other loads more than what the modes can show.
  const auto unseen = solve_unseen(*model, training, settings, 3);
  ASSERT_EQ(unseen.loads.size(), 6u);
  const auto quality = quality_of(built->reduction, organ, unseen.loads);
  EXPECT_GT(quality.projection.mean, 0.001);
  for (std::size_t i = 0; i < 6; ++i)
    EXPECT_GE(quality.best.field_errors[i], quality.projection.mean * 0.1);
  EXPECT_GE(quality.initial.field.mean, quality.projection.mean);
  EXPECT_GE(quality.initial.field.worst, quality.initial.field.high);
}

TEST(Build, LoadsWithoutAnEquilibriumAreCountedAndLeftOut) {
  const auto organ = block(3, 3, 3);
  const auto model = full(organ);
  const Settings settings{
      .places = 2, .directions = 1, .magnitudes = 1, .force_n = 100, .radius_m = 0};
  const auto training = train(*model, settings);
  EXPECT_EQ(training.failed + training.snapshots.size(), 2u);
  EXPECT_GE(training.failed, 1u);
  const auto none = reduce(*model, {}, settings);
  ASSERT_FALSE(none.ok());
  EXPECT_NE(none.error().message.find("try another --force or --radius"), std::string::npos);
}

TEST(Build, CreepGrowsToTheShareThatRemains) {
  const auto organ = block(3, 4, 3);
  const auto model = full(organ);
  const Settings settings{.creep_nodes = 2, .creep_s = 200, .influence_m = 0.011};
  auto small = settings;
  small.force_n = 1e-4, small.radius_m = 0.005;
  auto reduction = reduction::testing::synthetic_reduction(organ, 3);
  add_creep(*model, small, reduction);
  ASSERT_TRUE(validate(reduction).ok());
  ASSERT_EQ(reduction.creep.size(), 2u);
  for (const auto& curve : reduction.creep) {
    EXPECT_TRUE(std::ranges::is_sorted(curve.overall_growth));
    // Only shear relaxes, to 0.346 of it: less than an incompressible solid would grow by.
    EXPECT_LT(curve.overall_growth.back(), 1 / 0.346);
    EXPECT_GT(curve.overall_growth.back(), 2.0);
    EXPECT_GE(curve.neighbours.size(), 3u);
  }
  auto elastic = organ;
  elastic.material.measured.relaxation.clear();
  const auto lasting = full(elastic);
  add_creep(*lasting, small, reduction);
  for (const auto& curve : reduction.creep)
    for (const double growth : curve.overall_growth) EXPECT_NEAR(growth, 1, 1e-6);
}

TEST(Build, ScaledCreepIsExactWhereItWasStored) {
  const auto organ = block(3, 4, 3);
  const auto model = full(organ);
  const Settings settings{.modes = 4,
                          .places = 3,
                          .directions = 1,
                          .force_n = 0.02,
                          .radius_m = 0.005,
                          .creep_nodes = 3,
                          .influence_m = 0.1};
  const auto training = train(*model, settings);
  auto built = reduce(*model, training, settings);
  ASSERT_TRUE(built.ok());
  add_creep(*model, settings, built->reduction);
  ASSERT_EQ(built->reduction.creep.size(), 3u);
  const auto check = check_creep(*model, built->reduction, training.snapshots[2].press);
  ASSERT_TRUE(check.has_value());
  EXPECT_LT(check->scaling_errors.front(), 1e-12);
  // Along the displacement at once it is exact; its direction may turn.
  EXPECT_LT(check->scaling_errors.back(), 0.05);
  EXPECT_GT(check->full_m.back(), 1.5 * check->full_m.front());
}

TEST(CreepFactors, TakeTheNearestCurveAndInterpolateInTime) {
  const auto organ = block(3, 3, 2);
  const auto reduction = reduction::testing::synthetic_reduction(organ, 2);
  const CreepFactors factors(reduction, organ);
  EXPECT_EQ(factors.curve_near(NodeIndex(0)).node, NodeIndex(0));
  EXPECT_EQ(factors.curve_near(NodeIndex(8)).node, NodeIndex(7));
  EXPECT_EQ(factors.growth(NodeIndex(7), NodeIndex(7), 0), 1);
  EXPECT_EQ(factors.growth(NodeIndex(7), NodeIndex(7), 0.5), 1.25);
  EXPECT_EQ(factors.growth(NodeIndex(7), NodeIndex(5), 20), 2);
  EXPECT_EQ(factors.growth(NodeIndex(7), NodeIndex(2), 1e9), 2.25);  // beyond the influence
  Vector u = Vector::Ones(3 * 18);
  factors.scale(NodeIndex(7), 1, u);
  EXPECT_EQ(u[3 * 7], 1.5);
  EXPECT_EQ(u[3 * 5 + 2], 1.125);
  EXPECT_EQ(u[0], 1.25);
}

TEST(Quality, ErrorsAreMeanNinetyFiveAndWorst) {
  std::vector<double> values;
  for (int i = 100; i >= 1; --i) values.push_back(i);
  const auto errors = errors_of(values);
  EXPECT_EQ(errors.mean, 50.5);
  EXPECT_EQ(errors.high, 95);
  EXPECT_EQ(errors.worst, 100);
  EXPECT_EQ(errors_of({}).worst, 0);
}

TEST(FullModel, RefusesOrgansItIsNotOf) {
  const auto says = [](const organ::Organ& organ, const std::string& what) {
    const auto model = FullModel::create(organ);
    ASSERT_FALSE(model.ok());
    EXPECT_NE(model.error().message.find(what), std::string::npos) << model.error().message;
  };
  says(catalogue::make_lattice({4, 4, 4, 0.01}).value(), "has no tets");
  auto organ = block(3, 3, 3);
  organ.material.elastic_law = material::ElasticLaw::Springs;
  says(organ, "neo-Hookean or measured");
  organ = block(3, 3, 3);
  organ.gravity_m_s2 = {0, -9.81, 0};
  says(organ, "gravity");
  organ = block(3, 3, 3);
  organ.fixed_nodes.clear();
  says(organ, "held nowhere");
}

TEST(Settings, EachLimitIsNamed) {
  const auto says = [](const Settings& settings, const std::string& option) {
    const auto status = validate(settings);
    ASSERT_FALSE(status.ok()) << option;
    EXPECT_EQ(status.error().code, ErrorCode::Usage);
    EXPECT_TRUE(status.error().message.starts_with(option)) << status.error().message;
  };
  EXPECT_TRUE(validate(Settings{}).ok());
  says({.modes = 0}, "--modes");
  says({.modes = 65}, "--modes");
  says({.places = 1001}, "--places");
  says({.directions = 0}, "--directions");
  says({.magnitudes = 21}, "--magnitudes");
  says({.force_n = 0}, "--force");
  says({.radius_m = -1}, "--radius");
  says({.tangents = 10'001}, "--tangents");
  says({.creep_nodes = 1001}, "--creep-nodes");
  says({.creep_s = std::nan("")}, "--creep-seconds");
  says({.influence_m = 3}, "--influence");
  says({.threads = 0}, "--threads");
}

}  // namespace
}  // namespace trocar::dogan
