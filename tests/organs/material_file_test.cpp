// Files of measured materials: every constant is read, and what cannot be meant is refused in one
// line with file and key.

#include "server/organs/material/material_file.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "server/lab/scenario/scenario.h"
#include "tests/support/random.h"

namespace trocar::material {
namespace {

const std::string kGood = R"([hyperelastic]
name = "a \"quoted\" one"
form = "isochoric"
c_i0_pa = [883.8, 1707.9]
bulk_modulus_pa = 35352
weights = [0.5054, 0.1485]
relaxation_times_s = [0.5784, 6.8863]
)";

const std::string kExponential =
    "[hyperelastic]\nname = \"x\"\nc_i0_pa = [500]\nexponent = 2.5\nbulk_modulus_pa = 20000\n";

std::string with(const std::string& from, const std::string& to) {
  std::string text = kGood;
  return text.replace(text.find(from), from.size(), to);
}

TEST(MaterialFile, HoldsEveryConstant) {
  const auto m = parse_material_text(kGood, "m.toml");
  ASSERT_TRUE(m.ok()) << m.error().message;
  EXPECT_EQ(m->name, "a \"quoted\" one");
  EXPECT_EQ(m->source, "m.toml");
  EXPECT_EQ(m->split, VolumeSplit::Isochoric);
  EXPECT_EQ(m->coefficients_pa, (std::array<double, 5>{883.8, 1707.9, 0, 0, 0}));
  EXPECT_EQ(m->bulk_modulus_pa, 35352);
  EXPECT_EQ(m->relaxation, (std::vector<PronyTerm>{{0.5054, 0.5784}, {0.1485, 6.8863}}));
  const auto plain = parse_material_text(
      "[hyperelastic]\nname = \"x\"\nc_i0_pa = [500]\nbulk_modulus_pa = 20000\n", "m.toml");
  ASSERT_TRUE(plain.ok()) << plain.error().message;
  EXPECT_EQ(plain->split, VolumeSplit::Unsplit);
  EXPECT_TRUE(plain->relaxation.empty());
}

TEST(MaterialFile, WithAnExponentIsExponential) {
  const auto m = parse_material_text(kExponential, "m.toml");
  ASSERT_TRUE(m.ok()) << m.error().message;
  EXPECT_EQ(m->energy, StrainEnergy::Exponential);
  EXPECT_EQ(m->exponent, 2.5);
}

TEST(MaterialFile, WhatIsWrongIsOneLineWithItsKey) {
  const auto refused = [](const std::string& text, const std::string& says) {
    const auto m = parse_material_text(text, "m.toml");
    ASSERT_FALSE(m.ok()) << says;
    EXPECT_EQ(m.error().code, ErrorCode::BadFile);
    EXPECT_TRUE(m.error().message.starts_with("m.toml")) << m.error().message;
    EXPECT_NE(m.error().message.find(says), std::string::npos) << m.error().message;
    EXPECT_EQ(m.error().message.find('\n'), std::string::npos);
  };
  refused("", "key hyperelastic: is missing");
  refused(with("weights =", "exponent = 3\nweights ="), "an exponential law has C10 alone");
  refused(with("[883.8, 1707.9]", "[883.8]\nexponent = 60"), "is not above 0 and at most 50");
  refused("[material]\nyoung_modulus_pa = 6000\n", ":1: key material: is unknown");
  refused("[hyperelastic\n", "is not TOML");
  refused(with("c_i0_pa", "c_i0_kpa"), "write c_i0_pa");
  refused(with("[883.8, 1707.9]", "[1, 2, 3, 4, 5, 6]"),
          ":4: key hyperelastic.c_i0_pa: has 6 numbers, allowed are 5");
  refused(with("[883.8, 1707.9]", "[1e13]"), "c_i0_pa: has 1e+13, allowed are -1e+12 to 1e+12");
  refused(with("[883.8, 1707.9]", "[inf]"), "c_i0_pa: is not a list of numbers");
  refused(with("35352", "\"stiff\""), ":5: key hyperelastic.bulk_modulus_pa: is not a number");
  refused(with("35352", "1"), "bulk modulus 1 Pa is not from 2 to 1e6 times C10");
  refused(with("weights = [0.5054, 0.1485]\n", ""), "weights: are 0 for 2 relaxation_times_s");
  refused(with("0.1485]", "1.5]"), "weights: has 1.5, allowed are 0 to 1");
  refused(with("0.1485]", "0.6]"), "add up to 1.1054");
  refused(with("6.8863]", "0]"), "relaxation_times_s: has 0, allowed are");
  refused(with("isochoric", "split"), "write one of \"unsplit\", \"isochoric\"");
  refused(with("name", "label"), "hyperelastic.label: is unknown");
  refused(with("1707.9]", "-1707.9]"), "is unstable");
  refused(kGood + "colour = 3\n", ":8: key hyperelastic.colour: is unknown");
}

TEST(MaterialFile, AnyBytesAreRefusedOrRead) {
  trocar::testing::Random random(11);
  for (int trial = 0; trial < 500; ++trial) {
    std::string text = kGood;
    for (std::uint32_t i = 1 + random.below(4); i > 0; --i)
      text[random.below(static_cast<std::uint32_t>(text.size()))] =
          static_cast<char>(32 + random.below(95));
    const auto m = parse_material_text(text, "m.toml");
    if (m.ok()) {
      EXPECT_TRUE(validate(*m).ok()) << text;
    }
  }
}

TEST(MaterialFile, AScenarioNamesOneBesideIt) {
  const auto folder =
      std::filesystem::temp_directory_path() / ("trocar_material_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "own.toml") << kExponential;
  const auto resolved = [&](const std::string& measured) {
    auto scenario = scenario::parse_scenario_text(
        "[organ]\nsource = \"block\"\nnodes = [3, 3, 3]\nspacing_mm = 10\n[material]\n"
        "elastic_law = \"measured\"\nmeasured = \"" +
            measured + "\"\n[run]\nseconds = 1\n",
        (folder / "scene.toml").string());
    EXPECT_TRUE(scenario.ok()) << (scenario.ok() ? "" : scenario.error().message);
    return resolve(std::move(*scenario));
  };
  const auto own = resolved("own.toml");
  ASSERT_TRUE(own.ok()) << own.error().message;
  EXPECT_EQ(own->organ.material.measured.exponent, 2.5);
  const auto missing = resolved("none.toml");
  ASSERT_FALSE(missing.ok());
  EXPECT_NE(missing.error().message.find("none.toml: cannot be opened"), std::string::npos)
      << missing.error().message;
  const auto unknown = resolved("rubber");
  ASSERT_FALSE(unknown.ok());
  EXPECT_NE(unknown.error().message.find("nor the name of a .toml file"), std::string::npos);
  std::filesystem::remove_all(folder);
}

TEST(MaterialFile, AnOptionNamesABuiltInOneOrAFile) {
  const auto built_in = measured_material("human_liver_nava2008");
  ASSERT_TRUE(built_in.ok());
  EXPECT_EQ(*built_in, measured_materials().front());
  const auto unknown = measured_material("rubber");
  ASSERT_FALSE(unknown.ok());
  EXPECT_EQ(unknown.error().code, ErrorCode::Usage);
  EXPECT_NE(unknown.error().message.find("write human_liver_nava2008 or"), std::string::npos);
  const auto missing = measured_material("nowhere/rubber.toml");
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().message.find("nowhere/rubber.toml: cannot be opened"), 0u)
      << missing.error().message;
}

}  // namespace
}  // namespace trocar::material
