// What a scenario asks of the solver: laws, regions, boundaries, integrators.

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
[[traction.key]]
time_s = 0
traction_pa = [0, 40, 0]
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
        "elastic_law = \"neo-hookean\"\npoisson_ratio = 0.2\naveraged_volume = true\n"}) {
    const auto run = make(pulled_block(law, "mode = \"static\"\n"));
    ASSERT_TRUE(run);
    EXPECT_TRUE(run->step().is_converged) << law;
    // Stress / E x length; stiffer where the clamped base keeps it from getting thinner.
    constexpr double kExpected = 40.0 / 4000 * 0.04;
    EXPECT_NEAR(run->probe(0).y, kExpected, 0.06 * kExpected) << law;
    EXPECT_NEAR(run->probe(1).y, -40 * 1e-4, 0.002 * 40 * 1e-4) << law;
  }
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
    auto parsed = scene::parse_scenario_text(text, "test.toml");
    EXPECT_TRUE(parsed.ok()) << (parsed.ok() ? "" : parsed.error().message);
    if (!parsed) return std::string();
    const auto resolved = scene::resolve(std::move(*parsed));
    EXPECT_TRUE(resolved.ok()) << (resolved.ok() ? "" : resolved.error().message);
    if (!resolved) return std::string();
    const auto supported = check_supported(*resolved);
    return supported.ok() ? std::string("accepted") : supported.error().message;
  };
  EXPECT_EQ(refusal(pulled_block("", "integrator = \"explicit\"\n")),
            "test.toml:18: key probe[1].set: a reaction needs integrator = \"implicit\" in [run]");
  EXPECT_EQ(refusal(pulled_block("", "") + "[[nodes]]\nname = \"side\"\nids = [40]\n"
                                           "[[displace]]\nset = \"side\"\naxes = \"x\"\n"),
            "test.toml:28: key displace[0].set: a set that is held along some axes only is not "
            "simulated yet");
  EXPECT_EQ(refusal(pulled_block("", "")), "accepted");
}

std::string swinging(const std::string& run) {
  return kColumn + R"([[force]]
set = "top"
[[force.key]]
time_s = 0
force_n = [0, 0.4, 0]
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
    const auto resolved = scene::resolve(*scene::parse_scenario_text(stiff, "test.toml"));
    const auto supported = check_supported(*resolved);
    return supported.ok() ? std::string() : supported.error().message;
  };
  std::string text = message("integrator = \"explicit\"\ndt_s = 0.001\n");
  EXPECT_TRUE(
      text.starts_with("test.toml:23: key run.dt_s: is 0.001, \"explicit\" is stable up to "))
      << text;
  const auto advised = text.substr(text.rfind(' ') + 1);
  EXPECT_EQ(message("integrator = \"explicit\"\ndt_s = " + advised + "\n"), "");
  text = message("integrator = \"explicit\"\n");
  EXPECT_TRUE(text.starts_with("test.toml:22: key run.integrator: is 0.001")) << text;
}

TEST(ScenarioRun, ThreadsChangeNothing) {
  const auto text = pulled_block("elastic_law = \"neo-hookean\"\naveraged_volume = true\n", "");
  auto resolved = scene::resolve(*scene::parse_scenario_text(text, "test.toml"));
  ASSERT_TRUE(resolved.ok());
  ScenarioRun one(*resolved, Solver::Live, 1), two(*resolved, Solver::Live, 2);
  for (int i = 0; i < 100; ++i) {
    one.step();
    two.step();
  }
  EXPECT_EQ(one.world().displacements, two.world().displacements);
}

}  // namespace
}  // namespace trocar::scenario
