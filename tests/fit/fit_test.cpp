// A fit finds the numbers from which a curve was made, noise and all, and says what it cannot do.

#include "server/lab/fit/fit.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>

#include "server/lab/fit/fit_model.h"
#include "server/lab/scenario/scenario_run.h"
#include "tests/scenario/scenario_texts.h"

namespace trocar::fit {
namespace {

using scenario::expect_resolved;

// A cube on a plate, pulled up by 4 mm.
std::string pulled(const std::string& material, const std::string& run) {
  return R"([organ]
source = "block"
nodes = [4, 4, 4]
spacing_mm = 8
[[nodes]]
name = "plate"
box_min_mm = [-12, 12, -12]
box_max_mm = [12, 12, 12]
[[displace]]
set = "plate"
key = [{time_s = 0, displacement_mm = [0, 0, 0]}, {time_s = 0.1, displacement_mm = [0, 4, 0]}]
[[probe]]
set = "plate"
quantity = "reaction"
rate_hz = 1000
[material]
)" + material +
         "[run]\nseconds = 0.2\n" + run;
}

std::string pulled_static(const std::string& material) {
  std::string text = pulled(material, "mode = \"static\"\nload_steps = 20\n");
  text.erase(text.find("rate_hz = 1000\n"), 15);
  return text;
}

// Returns what a testing machine would record of a scenario. The noise has a standard deviation of
// `noise` times the largest force and repeats itself nowhere.
MeasuredCurve recorded(const std::string& text, double noise) {
  const auto resolved = expect_resolved(text);
  const auto curve = scenario::load_curves(resolved).at(0);
  scenario::ScenarioRun run(resolved, scenario::Solver::Full);
  MeasuredCurve measured;
  measured.source = "measured.csv";
  measured.has_times = resolved.scenario.run.mode == scenario::RunMode::Dynamic;
  double largest = 0;
  while (!run.is_finished()) {
    run.step();
    const auto [displacement, force] = scenario::load_point(run, curve);
    largest = std::max(largest, force);
    if (measured.has_times && run.steps_done() % 4 != 0) continue;
    measured.points.push_back(
        {displacement, force, run.time_s(), static_cast<int>(measured.points.size()) + 2});
  }
  double phase = 0;
  for (auto& point : measured.points) {
    phase += std::numbers::phi;  // evenly spread, never periodic
    const double uniform = 2 * (phase - std::floor(phase)) - 1;
    point.force_n += noise * largest * uniform * std::numbers::sqrt3;
  }
  return measured;
}

TEST(Fit, FindsTheModulusFromANoisyCurve) {
  const auto measured = recorded(pulled_static("young_modulus_pa = 6000\n"), 0.02);
  const auto fitted =
      fit(expect_resolved(pulled_static("young_modulus_pa = 1000\n")), measured, {});
  ASSERT_TRUE(fitted.ok()) << fitted.error().message;
  ASSERT_EQ(fitted->parameters.size(), 1u);
  const auto& modulus = fitted->parameters[0];
  EXPECT_EQ(modulus.key, "young_modulus_pa");
  EXPECT_EQ(modulus.start, 1000);
  EXPECT_NEAR(modulus.value, 6000, 0.02 * 6000);
  ASSERT_TRUE(modulus.standard_error);
  EXPECT_LT(std::abs(modulus.value - 6000), 4 * *modulus.standard_error);
  EXPECT_GT(*modulus.standard_error, 5);
  EXPECT_NEAR(fitted->rms_percent, 2, 0.7) << "what is left is the noise";
  EXPECT_TRUE(fitted->is_converged);
  EXPECT_EQ(fitted->organ.material.young_modulus_pa, modulus.value);
  EXPECT_LT(fitted->runs, 15);
}

TEST(Fit, TheOrderOfMeasurementsDoesNotMatterInAStaticRun) {
  auto measured = recorded(pulled_static("young_modulus_pa = 6000\n"), 0);
  std::ranges::reverse(measured.points);
  measured.points.push_back(measured.points.front());
  const auto fitted =
      fit(expect_resolved(pulled_static("young_modulus_pa = 4000\n")), measured, {});
  ASSERT_TRUE(fitted.ok()) << fitted.error().message;
  EXPECT_NEAR(fitted->parameters[0].value, 6000, 6);
  EXPECT_LT(fitted->rms_percent, 0.1);
}

TEST(Fit, FindsStiffnessAndDampingFromACurveInTime) {
  const auto text = [](const char* modulus, const char* damping) {
    return pulled(std::string("node_damping_per_s = 2\nyoung_modulus_pa = ") + modulus +
                      "\nedge_damping_time_s = " + damping + "\n",
                  "tolerance_n = 1e-4\n");
  };
  const auto measured = recorded(text("6000", "0.02"), 0.01);
  FitOptions options;
  options.parameters = {"young_modulus_pa", "edge_damping_time_s"};
  const auto fitted = fit(expect_resolved(text("3000", "0.005")), measured, options);
  ASSERT_TRUE(fitted.ok()) << fitted.error().message;
  EXPECT_NEAR(fitted->parameters[0].value, 6000, 0.03 * 6000);
  EXPECT_NEAR(fitted->parameters[1].value, 0.02, 0.05 * 0.02);
  const std::string toml = to_toml(*fitted, options);
  EXPECT_TRUE(toml.starts_with("[material]\nyoung_modulus_pa = ")) << toml;
  EXPECT_NE(toml.find("\nedge_damping_time_s = 0.0"), std::string::npos) << toml;
}

TEST(Fit, RegionNamesAreQuotedAsTomlWantsThem) {
  Fit fitted;
  fitted.parameters = {{"young_modulus_pa", 1000, 6000, std::nullopt}};
  FitOptions options;
  options.region = "hard \"core\" \\ 2";
  EXPECT_EQ(to_toml(fitted, options),
            "[[region]]\nname = \"hard \\\"core\\\" \\\\ 2\"\nyoung_modulus_pa = 6000\n");
}

TEST(Fit, AToolCanBeTheMachine) {
  const auto text = [](const char* modulus) {
    return std::string(R"([organ]
source = "block"
nodes = [6, 4, 6]
spacing_mm = 8
[[tool]]
radius_mm = 12
ease = "linear"
key = [{time_s = 0, position_mm = [0, 12, 0], shaft = [0, 1, 0], verb = "push"},
       {time_s = 1, position_mm = [0, 10, 0]}]
[run]
mode = "static"
seconds = 1
load_steps = 4
tolerance_n = 1e-5
[[probe]]
tool = 0
quantity = "force"
[material]
young_modulus_pa = )") +
           modulus + "\n";
  };
  const auto measured = recorded(text("6000"), 0);
  EXPECT_GT(measured.points.back().force_n, 0.02) << "pressing is positive";
  EXPECT_NEAR(measured.points.back().displacement_m, 0.002, 1e-5);
  const auto fitted = fit(expect_resolved(text("4000")), measured, {});
  ASSERT_TRUE(fitted.ok()) << fitted.error().message;
  EXPECT_NEAR(fitted->parameters[0].value, 6000, 0.02 * 6000);
}

TEST(Fit, TheExampleFindsWhatItsCurveWasMadeWith) {
  const std::filesystem::path folder = std::filesystem::path(TROCAR_SOURCE_DIR) / "deploy/scenes";
  auto parsed = scenario::parse_scenario(folder / "stretch.toml");
  ASSERT_TRUE(parsed.ok()) << parsed.error().message;
  const auto resolved = scenario::resolve(std::move(*parsed));
  ASSERT_TRUE(resolved.ok()) << resolved.error().message;
  const auto measured = read_measurements(folder / "stretch.csv");
  ASSERT_TRUE(measured.ok()) << measured.error().message;
  const auto fitted = fit(*resolved, *measured, {});
  ASSERT_TRUE(fitted.ok()) << fitted.error().message;
  EXPECT_NEAR(fitted->parameters[0].value, 6000, 60);
}

TEST(Fit, WhatCannotBeFittedIsSaid) {
  const auto resolved = expect_resolved(pulled_static("young_modulus_pa = 1000\n"));
  const auto measured = recorded(pulled_static("young_modulus_pa = 6000\n"), 0);
  const auto message = [&](const MeasuredCurve& curve, std::vector<std::string> parameters) {
    FitOptions options;
    options.parameters = std::move(parameters);
    const auto fitted = fit(resolved, curve, options);
    return fitted.ok() ? "" : fitted.error().message;
  };
  EXPECT_NE(message(measured, {"stiffness"}).find("young_modulus_pa, spring_stiffness_n_m"),
            std::string::npos);
  EXPECT_NE(message(measured, {"poisson_ratio"}).find("springs have 1/4"), std::string::npos);
  EXPECT_NE(message(measured, {"edge_damping_time_s"}).find("no damping"), std::string::npos);
  EXPECT_NE(message(measured, {"spring_stiffness_n_m"}).find("fit that"), std::string::npos);
  auto far = measured;
  far.points.push_back({0.009, 1, 0, 99});
  EXPECT_TRUE(message(far, {}).starts_with("measured.csv:99: displacement 9 mm is not among"))
      << message(far, {});
  FitOptions options;
  options.region = "tumour";
  const auto no_region = fit(resolved, measured, options);
  ASSERT_FALSE(no_region.ok());
  EXPECT_NE(no_region.error().message.find("no region \"tumour\""), std::string::npos);
  const auto no_curve =
      fit(expect_resolved("[organ]\nsource = \"block\"\nnodes = [2, 2, 2]\n[run]\n"
                          "seconds = 1\n"),
          measured, {});
  ASSERT_FALSE(no_curve.ok());
  EXPECT_NE(no_curve.error().message.find("test.toml: has no force-displacement curve"),
            std::string::npos);
}

// Constants of a measured material are not moduli that a scenario could have.
TEST(Fit, AMaterialOfNoTissueIsRefused) {
  const auto in_regions = [](const char* own, const char* of_region) {
    return pulled_static(std::string("young_modulus_pa = ") + own +
                         "\n[[region]]\nset = \"all\"\nname = \"core\"\n"
                         "young_modulus_pa = " +
                         of_region + "\n");
  };
  const auto measured = recorded(pulled_static("young_modulus_pa = 6000\n"), 0);
  const auto resolved = expect_resolved(in_regions("4000", "5000"));
  const auto fitted = fit(resolved, measured, {});
  ASSERT_FALSE(fitted.ok());
  EXPECT_NE(fitted.error().message.find("does not depend on young_modulus_pa"), std::string::npos)
      << fitted.error().message;
  EXPECT_NE(fitted.error().message.find("--region with one of core"), std::string::npos)
      << fitted.error().message;
  FitOptions options;
  options.region = "core";
  const auto of_region = fit(resolved, measured, options);
  ASSERT_TRUE(of_region.ok()) << of_region.error().message;
  EXPECT_NEAR(of_region->parameters[0].value, 6000, 6);
  EXPECT_TRUE(of_region->remarks().empty()) << of_region->remarks().front();
}

TEST(Fit, ForcesOfTheWrongSignAreRemarkedOn) {
  auto measured = recorded(pulled_static("young_modulus_pa = 6000\n"), 0);
  for (auto& point : measured.points) point.force_n = -point.force_n;
  const auto fitted =
      fit(expect_resolved(pulled_static("young_modulus_pa = 4000\n")), measured, {});
  ASSERT_TRUE(fitted.ok()) << fitted.error().message;
  EXPECT_EQ(fitted->parameters[0].at, FittedParameter::Limit::Lower);
  const auto remarks = fitted->remarks();
  ASSERT_EQ(remarks.size(), 2u);
  EXPECT_TRUE(remarks[0].starts_with("young_modulus_pa ends at its lower limit, 1: "))
      << remarks[0];
  EXPECT_TRUE(remarks[1].starts_with("the residual is ")) << remarks[1];
  const auto toml = to_toml(*fitted, {});
  EXPECT_TRUE(toml.starts_with("# Warning: young_modulus_pa ends at ")) << toml;
  EXPECT_NE(toml.find(".\n[material]\n"), std::string::npos) << toml;
}

TEST(Fit, AMeasuredMaterialIsLeftToItsOwnIdentification) {
  const MeasuredCurve measured{"measured.csv", false, {{0.001, 0.1, 0, 2}, {0.002, 0.2, 0, 3}}};
  const auto resolved = expect_resolved(
      pulled("elastic_law = \"measured\"\nmeasured = \"human_liver_nava2008\"\n", ""));
  for (const std::vector<std::string>& keys :
       {std::vector<std::string>{}, {"young_modulus_pa"}, {"poisson_ratio"}}) {
    FitOptions options;
    options.parameters = keys;
    const auto fitted = fit(resolved, measured, options);
    ASSERT_FALSE(fitted.ok());
    EXPECT_NE(fitted.error().message.find("see trocar-organ identify"), std::string::npos)
        << fitted.error().message;
    EXPECT_NE(fitted.error().message.find(keys.empty() ? "young_modulus_pa" : keys[0]),
              std::string::npos);
  }
}

// Tension and fibre tension may shorten tissue by at most 0.9 together.
TEST(Fit, TensionStaysWhatAScenarioTakes) {
  const MeasuredCurve measured{"measured.csv", false, {{0.001, 0.1, 0, 2}, {0.002, 0.2, 0, 3}}};
  FitOptions options;
  options.parameters = {"tension"};
  const auto model = [&](const char* fibre_tension) {
    return FitModel::create(
        expect_resolved(pulled_static(
            std::string("young_modulus_pa = 6000\nfibre_direction = [0, 1, 0]\nfibre_tension = ") +
            fibre_tension + "\n")),
        measured, options);
  };
  ASSERT_TRUE(model("0").ok());
  EXPECT_EQ(model("0")->parameters()[0].high, 0.9);
  EXPECT_NEAR(model("0.6")->parameters()[0].high, 0.3, 1e-12);
  const auto none = model("0.9");
  ASSERT_FALSE(none.ok());
  EXPECT_NE(none.error().message.find("leaves it no room"), std::string::npos);
}

class Csv : public ::testing::Test {
 protected:
  Result<MeasuredCurve> read(const std::string& text) {
    std::ofstream(path_) << text;
    return read_measurements(path_);
  }
  ~Csv() override { std::filesystem::remove(path_); }

  const std::filesystem::path path_ =
      std::filesystem::temp_directory_path() / ("trocar-fit-" + std::to_string(getpid()) + ".csv");
};

TEST_F(Csv, ColumnsAreFoundByName) {
  const auto curve =
      read("# by hand\nforce_n,note,displacement_mm\r\n0.5, a ,2\r\n\r\n\"1\",\"b, c\",+4\n");
  ASSERT_TRUE(curve.ok()) << curve.error().message;
  ASSERT_EQ(curve->points.size(), 2u);
  EXPECT_DOUBLE_EQ(curve->points[0].displacement_m, 0.002);
  EXPECT_EQ(curve->points[1].force_n, 1);
  EXPECT_EQ(curve->points[1].line, 5);
  EXPECT_FALSE(curve->has_times);
}

TEST_F(Csv, TheHeaderSaysWhatSeparates) {
  for (const std::string text :
       {"displacement_mm;force_n\n1.5;0.5\n", "displacement_mm\tforce_n\n1.5\t0.5\n",
        "\xEF\xBB\xBF\"displacement_mm\";\"force_n\"\n1.5;0.5\n"}) {
    const auto curve = read(text);
    ASSERT_TRUE(curve.ok()) << curve.error().message;
    EXPECT_DOUBLE_EQ(curve->points[0].displacement_m, 1.5e-3);
    EXPECT_EQ(curve->points[0].force_n, 0.5);
  }
}

// Never two numbers where one was meant.
TEST_F(Csv, DecimalCommasAreRefused) {
  const auto says = [&](const std::string& text) {
    const auto curve = read(text);
    return curve.ok() ? "" : curve.error().message.substr(path_.string().size());
  };
  for (const std::string text :
       {"displacement_mm;force_n\n0;0\n1,5;0,1\n", "displacement_mm;force_n\n0;0\n1.5;0,1\n",
        "displacement_mm,force_n\n0,0\n1,5,0,1\n", "displacement_mm,force_n\n0,0\n1,5,0\n",
        "displacement_mm,force_n\n0,0\n\"1,5\",\"0,1\"\n"}) {
    EXPECT_TRUE(says(text).starts_with(":3: ")) << text << says(text);
    EXPECT_NE(says(text).find("decimal point"), std::string::npos) << says(text);
  }
}

TEST_F(Csv, WhatIsWrongIsOneLineWithItsPlace) {
  const auto says = [&](const std::string& text) {
    const auto curve = read(text);
    return curve.ok() ? "" : curve.error().message.substr(path_.string().size());
  };
  EXPECT_TRUE(says("1,2\n").starts_with(":1: is no header")) << says("1,2\n");
  EXPECT_TRUE(says("displacement_mm,force_n\n1,nan\n").starts_with(":2: "));
  EXPECT_TRUE(says("displacement_mm,force_n\n1\n").starts_with(":2: "));
  EXPECT_TRUE(says("displacement_mm,force_n,time_s\n1,1,1\n1,1,1\n").starts_with(":3: time_s"));
  EXPECT_EQ(says("displacement_mm,force_n\n"), ": has no measurements");
  EXPECT_TRUE(says("displacement_mm,force_n,force_n\n1,1,1\n").starts_with(":1: has two columns"));
  EXPECT_FALSE(read_measurements("/nowhere/x.csv").ok());
}

}  // namespace
}  // namespace trocar::fit
