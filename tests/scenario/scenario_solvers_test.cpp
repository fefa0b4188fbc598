// Tests what a scenario sets of the solver: laws, regions, boundaries, integrators.

#include "tests/scenario/scenario_texts.h"

namespace trocar::scenario {
namespace {

// A block of tets pulled at its top; `law` are lines of [material].
std::string pulled_block(const std::string& law, const std::string& run) {
  return R"([organ]
source = "block"
nodes = [3, 9, 3]
spacing_mm = 5
[[nodes]]
name = "top"
box_min_mm = [-5, 20, -5]
box_max_mm = [5, 20, 5]
[[traction]]
set = "top"
key = [{time_s = 0, traction_pa = [0, 40, 0]}]
[[probe]]
set = "top"
quantity = "displacement"
[[probe]]
set = "fixed"
quantity = "reaction"
[material]
young_modulus_pa = 4000
)" + law +
         "[run]\nseconds = 1\n" + run;
}

TEST(ScenarioRun, EachLawStretchesLikeABar) {
  for (const char* law :
       {"", "elastic_law = \"tensor-mass\"\npoisson_ratio = 0.2\n",
        "elastic_law = \"neo-hookean\"\npoisson_ratio = 0.2\n",
        "elastic_law = \"neo-hookean\"\npoisson_ratio = 0.2\naveraged_strain = true\n"}) {
    const auto run = make(pulled_block(law, "mode = \"static\"\n"));
    ASSERT_TRUE(run);
    EXPECT_TRUE(run->step().is_converged) << law;
    // Stress / E x length; stiffer where the clamped base keeps it from getting thinner.
    constexpr double kExpected = 40.0 / 4000 * 0.04;
    EXPECT_NEAR(run->probe(0).y, kExpected, 0.06 * kExpected) << law;
    EXPECT_NEAR(run->probe(1).y, -40 * 1e-4, 0.002 * 40 * 1e-4) << law;
  }
}

TEST(ScenarioRun, AGraspLiftsInAStaticRun) {
  const auto run = make(R"([organ]
source = "block"
nodes = [3, 9, 3]
spacing_mm = 5
[material]
young_modulus_pa = 4000
[[tool]]
reach_mm = 8
grip_n = 50
anchor = [0, 1, 0]
key = [{time_s = 0, position_mm = [0, 0, 0], shaft = [0, 1, 0], verb = "grasp"},
       {time_s = 0.5, position_mm = [0, 0, 0]}, {time_s = 1, position_mm = [0, 2, 0]}]
[run]
mode = "static"
seconds = 1
load_steps = 4
[[probe]]
set = "fixed"
quantity = "reaction"
)");
  ASSERT_TRUE(run);
  for (int i = 0; i < 4; ++i) run->step();
  // Stress of a bar of 4 cm that is 2 mm longer, over a cross-section of 1 cm2.
  constexpr double kExpected = -0.002 / 0.04 * 4000 * 1e-4;
  EXPECT_NEAR(run->probe(0).y, kExpected, 0.3 * std::abs(kExpected));
}

TEST(ScenarioRun, AStiffRegionStretchesLess) {
  const auto run = make(pulled_block("", "mode = \"static\"\n") + R"([[nodes]]
name = "half"
box_min_mm = [-5, 0, -5]
box_max_mm = [5, 20, 5]
[[region]]
set = "half"
young_modulus_pa = 16000
)");
  ASSERT_TRUE(run);
  run->step();
  constexpr double kExpected = 40.0 * 0.02 * (1.0 / 4000 + 1.0 / 16000);
  EXPECT_NEAR(run->probe(0).y, kExpected, 0.06 * kExpected);
}

// An eighth of a block between greased plates: three planes of symmetry, the top moved along y and
// free to get narrower. A linear field, which tets represent exactly.
TEST(ScenarioRun, SetsHeldAlongOneAxisSlideAlongTheOthers) {
  const auto run = make(R"([organ]
source = "block"
nodes = [4, 5, 4]
spacing_mm = 5
[material]
elastic_law = "tensor-mass"
young_modulus_pa = 4000
poisson_ratio = 0.4
[fix]
organ = false
[[nodes]]
name = "x0"
box_min_mm = [-7.5, -10, -7.5]
box_max_mm = [-7.5, 10, 7.5]
[[nodes]]
name = "bottom"
box_min_mm = [-7.5, -10, -7.5]
box_max_mm = [7.5, -10, 7.5]
[[nodes]]
name = "z0"
box_min_mm = [-7.5, -10, -7.5]
box_max_mm = [7.5, 10, -7.5]
[[nodes]]
name = "top"
box_min_mm = [-7.5, 10, -7.5]
box_max_mm = [7.5, 10, 7.5]
[[nodes]]
name = "corner"
nearest_mm = [7.5, 10, 7.5]
[[displace]]
set = "x0"
axes = "x"
[[displace]]
set = "bottom"
axes = "y"
[[displace]]
set = "z0"
axes = "z"
[[displace]]
set = "top"
axes = "y"
key = [{time_s = 0, displacement_mm = [0, 1, 0]}]
[[probe]]
set = "top"
quantity = "reaction"
[[probe]]
set = "bottom"
quantity = "reaction"
[[probe]]
set = "corner"
quantity = "displacement"
[run]
mode = "static"
seconds = 1
)");
  ASSERT_TRUE(run);
  EXPECT_TRUE(run->step().is_converged);
  constexpr double kForce = 4000 * 0.001 / 0.020 * 0.015 * 0.015;
  EXPECT_NEAR(run->probe(0).y, kForce, 2e-3 * kForce);
  EXPECT_NEAR(run->probe(1).y, -kForce, 2e-3 * kForce);
  EXPECT_EQ(run->probe(2).y, static_cast<double>(0.001f));
  EXPECT_NEAR(run->probe(2).x, -0.4 * 0.05 * 0.015, 1e-6);
  EXPECT_NEAR(run->probe(2).z, -0.4 * 0.05 * 0.015, 1e-6);
}

TEST(ScenarioRun, GradedMovesEverythingAndFrozenTheQueueOnly) {
  const auto graded =
      make(pulled_block("", "boundary = \"graded\"\ndepth = 1\nfar_sweeps = 2\n"), Solver::Live);
  const auto frozen = make(pulled_block("", "boundary = \"frozen\"\ndepth = 1\n"), Solver::Live);
  ASSERT_TRUE(graded && frozen);
  finish(*graded);
  finish(*frozen);
  constexpr double kExpected = 40.0 / 4000 * 0.04;
  EXPECT_NEAR(graded->probe(0).y, kExpected, 0.06 * kExpected);
  EXPECT_LT(frozen->probe(0).y, 0.3 * kExpected) << "what does not move does not stretch";
}

TEST(ScenarioRun, WhatTheSolverCannotDoIsRefusedWithItsLine) {
  const auto refusal = [](const std::string& text) {
    const auto supported = check_supported(expect_resolved(text));
    return supported.ok() ? std::string("accepted") : supported.error().message;
  };
  EXPECT_EQ(refusal(pulled_block("", "integrator = \"explicit\"\n")),
            "test.toml:16: key probe[1].set: a reaction needs integrator = \"implicit\" in [run]");
  const auto refused =
      refusal(pulled_block("", "depth = 2\n") +
              "[[nodes]]\nname = \"side\"\nids = [40]\n[[displace]]\nset = \"side\"\naxes = "
              "\"x\"\n");
  EXPECT_TRUE(refused.starts_with("test.toml:27: key displace[0].set: is held along some axes"))
      << refused;
  EXPECT_EQ(refusal(pulled_block("", "")), "accepted");
}

std::string swinging(const std::string& run) {
  return kColumn + R"([[force]]
set = "top"
key = [{time_s = 0, force_n = [0, 0.4, 0]}]
[[probe]]
set = "top"
quantity = "displacement"
[run]
seconds = 0.1
)" + run;
}

TEST(ScenarioRun, TheExplicitIntegratorAgreesWithShortImplicitSteps) {
  const auto reference = make(swinging("integrator = \"explicit\"\ndt_s = 0.0001\n"));
  // With so short a step inertia is nearly all, and over-relaxation would overshoot it.
  const auto implicit = make(swinging("dt_s = 0.0001\nover_relaxation = 1\n"), Solver::Live);
  ASSERT_TRUE(reference && implicit);
  EXPECT_GT(reference->stable_dt_s().value_or(0), 0.0001);
  double worst = 0;
  while (!reference->is_finished()) {
    reference->step();
    implicit->step();
    worst = std::max(worst, std::abs(reference->probe(0).y - implicit->probe(0).y));
  }
  EXPECT_LT(worst, 0.03 * 0.0125);
}

TEST(ScenarioRun, AnUnstableExplicitStepIsRefusedWithTheOneToWrite) {
  const auto message = [](const std::string& run) {
    std::string stiff = swinging(run);
    stiff.replace(stiff.find("= 40"), 4, "= 40000");
    const auto supported = check_supported(expect_resolved(stiff));
    return supported.ok() ? std::string() : supported.error().message;
  };
  std::string text = message("integrator = \"explicit\"\ndt_s = 0.001\n");
  EXPECT_TRUE(
      text.starts_with("test.toml:21: key run.dt_s: is 0.001, \"explicit\" is stable up to "))
      << text;
  const auto advised = text.substr(text.rfind(' ') + 1);
  EXPECT_EQ(message("integrator = \"explicit\"\ndt_s = " + advised + "\n"), "");
  text = message("integrator = \"explicit\"\n");
  EXPECT_TRUE(text.starts_with("test.toml:20: key run.integrator: is 0.001")) << text;
}

TEST(ScenarioRun, ThreadsChangeNothing) {
  const auto text = pulled_block("elastic_law = \"neo-hookean\"\naveraged_strain = true\n", "");
  ScenarioRun one(expect_resolved(text), Solver::Live, 1),
      two(expect_resolved(text), Solver::Live, 2);
  for (int i = 0; i < 100; ++i) {
    one.step();
    two.step();
  }
  EXPECT_EQ(one.world().displacements, two.world().displacements);
}

}  // namespace
}  // namespace trocar::scenario
