// Scenarios on the off-line solver: where both can, it and the live solver find the same
// equilibrium; what it cannot do is refused; a stopped run goes on.

#include "server/lab/finite_elements/scenario_solve.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "server/lab/scenario/scenario_run.h"
#include "tests/scenario/scenario_texts.h"
#include "tests/support/files.h"

namespace trocar::finite_elements {
namespace {

using scenario::expect_resolved;
using trocar::testing::TemporaryFolder;

// A column of 20 x 60 x 20 mm that stands on its lowest layer.
const std::string kColumn = R"([organ]
source = "block"
nodes = [3, 7, 3]
spacing_mm = 10
[material]
young_modulus_pa = 4000
elastic_law = "neo-hookean"
poisson_ratio = 0.3
[[nodes]]
name = "top"
box_min_mm = [-10, 30, -10]
box_max_mm = [10, 30, 10]
[[nodes]]
name = "side"
box_min_mm = [10, -10, -10]
box_max_mm = [10, 20, 10]
[[nodes]]
name = "corner"
nearest_mm = [10, 30, 10]
)";
const std::string kStatic = R"([run]
mode = "static"
seconds = 1
load_steps = 2
tolerance_n = 1e-7
max_sweeps = 20000
[[probe]]
set = "top"
quantity = "displacement"
[[probe]]
set = "fixed"
quantity = "reaction"
)";

std::unique_ptr<ScenarioSolve> solve_of(const std::string& text,
                                        const ScenarioSettings& settings = {}) {
  auto solve = ScenarioSolve::create(expect_resolved(text), settings);
  EXPECT_TRUE(solve.ok()) << (solve.ok() ? "" : solve.error().message);
  return std::move(*solve);
}

void expect_same(const std::string& text) {
  const auto ours = solve_of(text, {.order = ElementOrder::Linear});
  scenario::ScenarioRun live(expect_resolved(text), scenario::Solver::Full);
  while (!ours->is_finished()) {
    EXPECT_TRUE(ours->step().is_converged);
    EXPECT_TRUE(live.step().is_converged);
    for (std::size_t i = 0; i < 2; ++i) {
      const Vec3d a = ours->probe(i), b = live.probe(i);
      EXPECT_LT(length(a - b), 2e-3 * length(b) + 2e-6) << i << " at " << live.time_s();
    }
  }
  EXPECT_GT(length(ours->probe(0)), 1e-3) << "it moved";
}

TEST(ScenarioSolve, MeetsTheLiveSolverUnderDisplacement) {
  expect_same(kColumn + kStatic +
              "[[displace]]\nset = \"top\"\n[[displace.key]]\ntime_s = 0\ndisplacement_mm = [0, 0, "
              "0]\n[[displace.key]]\ntime_s = 1\ndisplacement_mm = [8, -6, 3]\n");
}
TEST(ScenarioSolve, MeetsTheLiveSolverUnderGravityAndTraction) {
  expect_same(kColumn + kStatic +
              "[gravity]\nm_s2 = [0, -9.81, 0]\n[[traction]]\nset = \"top\"\n[[traction.key]]\n"
              "time_s = 0\ntraction_pa = [60, 200, 0]\n");
}
TEST(ScenarioSolve, MeetsTheLiveSolverUnderPressureAndForce) {
  expect_same(
      kColumn + kStatic +
      "[[traction]]\nset = \"side\"\n[[traction.key]]\ntime_s = 0\npressure_pa = 40\n"
      "[[force]]\nset = \"corner\"\n[[force.key]]\ntime_s = 0\nforce_n = [0, 0.02, 0.02]\n");
}

// The column of measured liver.
std::string liver_column() {
  const std::string own =
      "young_modulus_pa = 4000\nelastic_law = \"neo-hookean\"\npoisson_ratio = 0.3\n";
  std::string text = kColumn;
  return text.replace(text.find(own), own.size(),
                      "elastic_law = \"measured\"\nmeasured = \"human_liver_nava2008\"\n"
                      "node_damping_per_s = 100\n");
}

TEST(ScenarioSolve, MeetsTheLiveSolverInMeasuredTissueThatHasNoTimeToRelax) {
  // Ten times as coarse: single precision under this bulk modulus.
  std::string run = kStatic;
  run.replace(run.find("1e-7"), 4, "1e-6");
  expect_same(liver_column() + run +
              "[[displace]]\nset = \"top\"\n[[displace.key]]\ntime_s = 0\ndisplacement_mm = [0, 0, "
              "0]\n[[displace.key]]\ntime_s = 1\ndisplacement_mm = [6, -3, 2]\n");
}

TEST(ScenarioSolve, MeetsTheLiveSolverUnderAnExponentialLaw) {
  const TemporaryFolder folder;
  const auto file = folder.file("exponential.toml");
  std::ofstream(file) << "[hyperelastic]\nname = \"x\"\nc_i0_pa = [800]\nexponent = 3\n"
                         "bulk_modulus_pa = 8000\n";
  std::string text = liver_column();
  const std::string name = "human_liver_nava2008";
  text.replace(text.find(name), name.size(), file);
  expect_same(text + kStatic +
              "[[displace]]\nset = \"top\"\n[[displace.key]]\ntime_s = 0\ndisplacement_mm = [0, 0, "
              "0]\n[[displace.key]]\ntime_s = 1\ndisplacement_mm = [8, -6, 3]\n");
}

// The live solver lets relaxed tissue start from the equilibrium that the off-line solver finds.
TEST(ScenarioSolve, TissueThatRelaxesHangsWhereTheLiveSolverLetsItStart) {
  const std::string load =
      "[gravity]\nm_s2 = [0, -0.5, 0]\n[[probe]]\nset = \"top\"\nquantity = "
      "\"displacement\"\n";
  const auto ours = solve_of(liver_column() + load + "[run]\nmode = \"static\"\nseconds = 1\n",
                             {.order = ElementOrder::Linear, .is_equilibrium = true});
  ASSERT_TRUE(ours->step().is_converged);
  const std::string start =
      "[run]\nseconds = 0.01\nstart = \"equilibrium\"\n"
      "tolerance_n = 3e-7\nmax_sweeps = 50000\n";
  scenario::ScenarioRun live(expect_resolved(liver_column() + load + start),
                             scenario::Solver::Full);
  live.step();
  const Vec3d a = ours->probe(0), b = live.probe(0);
  EXPECT_LT(a.y, -1e-5);
  EXPECT_LT(length(a - b), 0.002 * length(a));
}

// The force that holds a column which was bent in 50 ms, damped so that it does not ring.
TEST(ScenarioSolve, MeasuredLiverRelaxesAsInTheLiveSolver) {
  const std::string text =
      liver_column() +
      "[run]\nseconds = 0.6\ntolerance_n = 1e-6\nmax_sweeps = 2000\nboundary = \"whole\"\n"
      "[[probe]]\nset = \"top\"\nquantity = \"displacement\"\nrate_hz = 100\n"
      "[[probe]]\nset = \"fixed\"\nquantity = \"reaction\"\nrate_hz = 100\n"
      "[[displace]]\nset = \"top\"\n[[displace.key]]\ntime_s = 0\ndisplacement_mm = [0, 0, 0]\n"
      "[[displace.key]]\ntime_s = 0.05\ndisplacement_mm = [6, 0, 0]\n";
  const auto ours = solve_of(text, {.order = ElementOrder::Linear});
  scenario::ScenarioRun live(expect_resolved(text), scenario::Solver::Full);
  double early = 0;
  for (int i = 0; !ours->is_finished(); ++i) {
    ASSERT_TRUE(ours->step().is_converged);
    live.step();
    if (i == 250) early = length(ours->probe(1));
  }
  const Vec3d a = ours->probe(1), b = live.probe(1);
  std::printf("%.4f N at 0.25 s, %.4f at the end, live %.4f\n", early, length(a), length(b));
  EXPECT_LT(length(a), 0.85 * early);
  EXPECT_LT(length(a - b), 0.01 * length(a));
}

// The reaction of the fixed nodes balances the load, whatever the elements. (Under all of the
// earth's gravity a column as soft as this falls over.)
TEST(ScenarioSolve, ReactionsBalanceLoads) {
  const std::string text = kColumn + kStatic +
                           "[gravity]\nm_s2 = [0, -2, 0]\n[[force]]\nset = \"top\"\n"
                           "[[force.key]]\ntime_s = 0\nforce_n = [0.02, 0, 0]\n";
  for (const auto order : {ElementOrder::Linear, ElementOrder::Quadratic}) {
    const auto solve = solve_of(text, {.order = order});
    while (!solve->is_finished()) ASSERT_TRUE(solve->step().is_converged);
    const double weight = 1060 * 0.02 * 0.06 * 0.02 * 2;
    EXPECT_NEAR(solve->probe(1).x, -0.02, 1e-7);
    EXPECT_NEAR(solve->probe(1).y, weight, 1e-7 * weight);
  }
}

TEST(ScenarioSolve, AMeasuredMaterialRelaxesToItsEquilibrium) {
  const std::string text =
      kColumn + kStatic +
      "[[displace]]\nset = \"top\"\n[[displace.key]]\ntime_s = 0\ndisplacement_mm = [2, 0, 0]\n";
  ScenarioSettings settings{.material = *material::find_measured_material("human_liver_nava2008")};
  const auto at_once = solve_of(text, settings);
  settings.is_equilibrium = true;
  const auto at_last = solve_of(text, settings);
  while (!at_once->is_finished()) ASSERT_TRUE(at_once->step().is_converged);
  while (!at_last->is_finished()) ASSERT_TRUE(at_last->step().is_converged);
  const double share = at_last->probe(1).x / at_once->probe(1).x;
  EXPECT_GT(share, 0.3461) << "volume does not relax";
  EXPECT_LT(share, 0.40);
}

TEST(ScenarioSolve, DynamicRunsGoOnFromTheirState) {
  const std::string text = kColumn +
                           "[run]\nseconds = 0.02\n[[probe]]\nset = \"top\"\nquantity = "
                           "\"velocity\"\nrate_hz = 500\n[[force]]\nset = \"top\"\n[[force.key]]\n"
                           "time_s = 0\nforce_n = [0.1, 0, 0]\n";
  const ScenarioSettings settings{.order = ElementOrder::Linear, .dt_s = 2e-3};
  const TemporaryFolder folder;
  const auto path = folder.file("a.state");
  const auto whole = solve_of(text, settings), first = solve_of(text, settings),
             second = solve_of(text, settings);
  EXPECT_EQ(whole->step_count(), 10u);
  while (!whole->is_finished()) ASSERT_TRUE(whole->step().is_converged);
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(first->step().is_converged);
  ASSERT_TRUE(first->save(path).ok());
  ASSERT_TRUE(second->resume(path).ok());
  EXPECT_EQ(second->steps_done(), 4u);
  while (!second->is_finished()) ASSERT_TRUE(second->step().is_converged);
  EXPECT_EQ(whole->probe(0), second->probe(0));
  const auto other = solve_of(text, {.order = ElementOrder::Quadratic, .dt_s = 2e-3});
  EXPECT_FALSE(other->resume(path).ok());
}

// A sudden load on a column at rest sets it in motion, as it does in the live solver with steps so
// short that they damp little; one that it stands in equilibrium with leaves it where it is.
TEST(ScenarioSolve, MotionStartsAtRestOrInEquilibrium) {
  const auto text = [](const std::string& start) {
    return kColumn + "[run]\nseconds = 0.02\ndt_s = 0.0001\ntolerance_n = 1e-6\n" + start +
           "[[probe]]\nset = \"top\"\nquantity = \"displacement\"\nrate_hz = 1000\n" +
           "[[force]]\nset = \"top\"\n[[force.key]]\ntime_s = 0\nforce_n = [0.02, 0, 0]\n";
  };
  const ScenarioSettings settings{.order = ElementOrder::Linear, .dt_s = 1e-4};
  const auto ours = solve_of(text(""), settings);
  EXPECT_EQ(length(ours->probe(0)), 0) << "before the first step";
  scenario::ScenarioRun live(expect_resolved(text("")), scenario::Solver::Full);
  while (!live.is_finished()) {
    for (int i = 0; i < 10; ++i) ASSERT_TRUE(ours->step().is_converged);
    live.step();
    const Vec3d a = ours->probe(0), b = live.probe(0);
    EXPECT_NEAR(a.x, b.x, 0.05 * b.x + 1e-6) << live.time_s();
  }
  const auto still = solve_of(text("start = \"equilibrium\"\n"), settings);
  ASSERT_TRUE(still->start().is_converged);
  const Vec3d at_first = still->probe(0);
  EXPECT_GT(at_first.x, 2 * ours->probe(0).x) << "it is still on its way";
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(still->step().is_converged);
  EXPECT_LT(length(still->probe(0) - at_first), 1e-6 * length(at_first));
}

// A column that a force of 0.1 N sways, which is there from the start or comes in 20 ms.
std::string swayed(const std::string& force, const std::string& more_run = "") {
  return kColumn + "[run]\nseconds = 0.02\n" + more_run +
         "[[force]]\nset = \"top\"\n[[force.key]]\ntime_s = 0\nforce_n = " + force +
         "\n[[force.key]]\ntime_s = 0.02\nforce_n = [0.1, 0, 0]\n";
}

TEST(ScenarioSolve, AStateOfAnotherRunIsRefused) {
  const std::string text = swayed("[0.1, 0, 0]");
  const ScenarioSettings settings{.order = ElementOrder::Linear};
  const TemporaryFolder folder;
  const auto path = folder.file("a.state");
  const auto first = solve_of(text, settings);
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(first->step().is_converged);
  ASSERT_TRUE(first->save(path).ok());
  EXPECT_TRUE(solve_of(text, settings)->resume(path).ok());
  const auto refused = [&](const std::string& other, const ScenarioSettings& with,
                           const std::string& says) {
    const auto solve = solve_of(other, with);
    const auto status = solve->resume(path);
    ASSERT_FALSE(status.ok()) << says;
    EXPECT_NE(status.error().message.find(says), std::string::npos) << status.error().message;
    EXPECT_EQ(solve->steps_done(), 0u);
  };
  refused(text, {.order = ElementOrder::Linear, .dt_s = 2e-3}, "resume with the same --step-ms");
  refused(swayed("[0, 0, 0]"), settings, "other loads");
  refused(text + "[gravity]\nm_s2 = [0, -1, 0]\n", settings, "other loads");
  refused(swayed("[0.1, 0, 0]", "start = \"equilibrium\"\n"), settings, "another start");
  refused(swayed("[0.1, 0, 0]", "mode = \"static\"\nload_steps = 20\n"), settings, "other loads");
}

TEST(ScenarioSolve, AStaticStateIsOfOneResponse) {
  const std::string text =
      kColumn + kStatic +
      "[[displace]]\nset = \"top\"\n[[displace.key]]\ntime_s = 0\ndisplacement_mm = [0, 0, 0]\n"
      "[[displace.key]]\ntime_s = 1\ndisplacement_mm = [2, 0, 0]\n";
  ScenarioSettings settings{.order = ElementOrder::Linear};
  const TemporaryFolder folder;
  const auto path = folder.file("a.state");
  const auto first = solve_of(text, settings), second = solve_of(text, settings);
  ASSERT_TRUE(first->step().is_converged);
  ASSERT_TRUE(first->save(path).ok());
  ASSERT_TRUE(second->resume(path).ok());
  EXPECT_EQ(second->steps_done(), 1u);
  settings.is_equilibrium = true;
  const auto status = solve_of(text, settings)->resume(path);
  ASSERT_FALSE(status.ok());
  EXPECT_NE(status.error().message.find("--response"), std::string::npos);
}

TEST(ScenarioSolve, StepsThatDoNotFillTheRunAreRefused) {
  const auto steps = [](double dt_s) {
    const auto solve = ScenarioSolve::create(expect_resolved(swayed("[0, 0, 0]")),
                                             {.order = ElementOrder::Linear, .dt_s = dt_s});
    if (solve.ok()) return static_cast<int>((*solve)->step_count());
    EXPECT_EQ(solve.error().code, ErrorCode::Usage);
    EXPECT_NE(solve.error().message.find("--step-ms: 0.02 s are"), std::string::npos)
        << solve.error().message;
    return 0;
  };
  EXPECT_EQ(steps(1e-6), 20'000);
  EXPECT_EQ(steps(2e-3), 10);
  EXPECT_EQ(steps(0.02), 1);
  EXPECT_EQ(steps(0.02 / 3), 3);
  EXPECT_EQ(steps(0.04), 0) << "longer than the run";
  EXPECT_EQ(steps(1), 0);
  EXPECT_EQ(steps(0.015), 0);
  EXPECT_EQ(steps(3e-3), 0);
}

TEST(ScenarioSolve, RefusesWhatItCannotDo) {
  const auto refused = [](const std::string& text, const std::string& says,
                          const ScenarioSettings& settings = {}) {
    const auto solve = ScenarioSolve::create(expect_resolved(text), settings);
    ASSERT_FALSE(solve.ok()) << says;
    EXPECT_NE(solve.error().message.find(says), std::string::npos) << solve.error().message;
  };
  refused("[organ]\nsource = \"lattice\"\nnodes = [3, 3, 3]\nspacing_mm = 10\n[run]\nseconds = 1\n",
          "has no tets");
  refused("[organ]\nsource = \"block\"\nnodes = [3, 3, 3]\nspacing_mm = 10\n[run]\nseconds = 1\n",
          "neo-hookean");
  std::string tense = kColumn + kStatic;
  tense.insert(tense.find("young_modulus_pa"), "tension = 0.1\n");
  refused(tense, "has no tension");
  refused(tense, "has no tension",
          {.material = *material::find_measured_material("human_liver_nava2008")});
  refused(kColumn +
              "[run]\nseconds = 1\n[[tool]]\nradius_mm = 5\nreach_mm = 10\n[[tool.key]]\n"
              "time_s = 0\nposition_mm = [0, 60, 0]\nverb = \"push\"\n",
          "has no tools");
}

}  // namespace
}  // namespace trocar::finite_elements
