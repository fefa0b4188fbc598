// The TOML form of scenarios: what is wrong is one line with file, line and key.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <random>

#include "common/scene/scenario.h"

namespace trocar::scene {
namespace {

struct Bad {
  const char* name;
  const char* text;  // wrong in its last line, unless `line` says otherwise (-1: none)
  const char* key;
  const char* says;
  int line = 0;
};

void PrintTo(const Bad& bad, std::ostream* out) {
  *out << bad.name;
}

// Ten lines that are right; the cases go on from here.
constexpr const char* kGood = R"([organ]
source = "lattice"
nodes = [3, 3, 3]
[run]
seconds = 1
[[nodes]]
name = "top"
box_min_mm = [-10, 10, -10]
box_max_mm = [10, 10, 10]
# end of what is right
)";

int lines_of(const std::string& text) {
  return static_cast<int>(std::count(text.begin(), text.end(), '\n')) +
         (text.empty() || text.back() == '\n' ? 0 : 1);
}

class BadScenario : public ::testing::TestWithParam<Bad> {};

TEST_P(BadScenario, IsOneLineWithFileLineAndKey) {
  const Bad& bad = GetParam();
  const std::string text = std::string(kGood) + bad.text;
  auto parsed = parse_scenario_text(text, "bad.toml");
  std::string message;
  if (parsed.ok()) {
    const auto resolved = resolve(std::move(*parsed));
    ASSERT_FALSE(resolved.ok()) << "was accepted";
    message = resolved.error().message;
  } else {
    message = parsed.error().message;
  }
  const int line = bad.line != 0 ? bad.line : lines_of(text);
  const std::string place = line < 0 ? "bad.toml" : "bad.toml:" + std::to_string(line);
  const std::string start = place + ": key " + bad.key + ": ";
  EXPECT_TRUE(message.starts_with(start)) << message << "\nexpected " << start;
  EXPECT_NE(message.find(bad.says), std::string::npos) << message;
  EXPECT_EQ(message.find('\n'), std::string::npos);
}

INSTANTIATE_TEST_SUITE_P(
    Table, BadScenario,
    ::testing::Values(
        Bad{"unknown_table", "[materials]", "materials", "unknown"},
        Bad{"unknown_key", "[material]\ndensity = 1000", "material.density", "unknown"},
        Bad{"wrong_unit", "[material]\nyoung_modulus_kpa = 4", "material.young_modulus_kpa",
            "young_modulus_pa"},
        Bad{"negative_density", "[material]\ndensity_kg_m3 = -1060", "material.density_kg_m3",
            "allowed are 1"},
        Bad{"text_for_number", "[material]\ndensity_kg_m3 = \"1060\"", "material.density_kg_m3",
            "not a number"},
        Bad{"not_a_number", "[material]\nnode_damping_per_s = nan", "material.node_damping_per_s",
            "not finite"},
        Bad{"young_on_links", "[material]\nyoung_modulus_pa = 4000", "material.young_modulus_pa",
            "spring_stiffness_n_m"},
        Bad{"nan_gravity", "[gravity]\nm_s2 = [0, nan, 0]", "gravity.m_s2", "not finite"},
        Bad{"inf_force",
            "[[force]]\nset = \"top\"\n[[force.key]]\ntime_s = 0\nforce_n = [inf, 0, 0]",
            "force[0].key[0].force_n", "not finite"},
        Bad{"node_out_of_range", "[[nodes]]\nids = [0, 27]\nname = \"x\"", "nodes[1].name",
            "node 27 does not exist, the organ has nodes 0 to 26"},
        Bad{"negative_node", "[[nodes]]\nids = [-1]\nname = \"x\"", "nodes[1].name", "node -1"},
        Bad{"empty_box",
            "[[nodes]]\nbox_min_mm = [50, 50, 50]\nbox_max_mm = [60, 60, 60]\nname = \"x\"",
            "nodes[1].name", "has no nodes"},
        Bad{"two_kinds", "[[nodes]]\nids = [1]\nnearest_mm = [0, 0, 0]\nname = \"x\"",
            "nodes[1].name", "exactly one"},
        Bad{"name_twice", "[[nodes]]\nids = [1]\nname = \"top\"", "nodes[1].name", "line 7"},
        Bad{"reserved_name", "[[nodes]]\nids = [1]\nname = \"fixed\"", "nodes[1].name", "is taken"},
        Bad{"box_upside_down",
            "[[nodes]]\nname = \"x\"\nbox_max_mm = [0, 0, 0]\nbox_min_mm = [0, 1, 0]",
            "nodes[1].box_min_mm", "exchange"},
        Bad{"unknown_set", "[fix]\nsets = [\"bottom\"]", "fix.sets", "no set \"bottom\""},
        Bad{"force_without_set",
            "[[force]]\n[[force.key]]\ntime_s = 0\nforce_n = [1, 0, 0]\n[[force]]\nset = \"fixed\"",
            "force[0].set", "is missing", 11},
        Bad{"load_on_fixed_node",
            "[[nodes]]\nids = [0]\nname = \"x\"\n[[force]]\nset = \"x\"\n[[force.key]]\n"
            "time_s = 0\nforce_n = [1, 0, 0]",
            "force[0].set", "node 0 of set \"x\" is fixed", 15},
        Bad{"load_on_extra_fixed",
            "[fix]\nsets = [\"top\"]\n[[displace]]\nset = \"top\"\n[[displace.key]]\ntime_s = 0\n"
            "displacement_mm = [0, 1, 0]",
            "displace[0].set", "is fixed", 14},
        Bad{"times_not_increasing",
            "[[force]]\nset = \"top\"\n[[force.key]]\ntime_s = 1\nforce_n = [1, 0, 0]\n"
            "[[force.key]]\nforce_n = [1, 0, 0]\ntime_s = 1",
            "force[0].key[1].time_s", "not after"},
        Bad{"two_numbers", "[gravity]\nm_s2 = [0, -9.81]", "gravity.m_s2", "three numbers"},
        Bad{"metres_for_mm",
            "[[displace]]\nset = \"top\"\n[[displace.key]]\ntime_s = 0\ndisplacement_m = [0, 1, 0]",
            "displace[0].key[0].displacement_mm", "is missing", 13},
        Bad{"reaction_of_free", "[[probe]]\nquantity = \"reaction\"\nset = \"top\"", "probe[0].set",
            "a reaction needs a held set"},
        Bad{"no_such_tool", "[[probe]]\nquantity = \"force\"\ntool = 0", "probe[0].tool",
            "there are 0"},
        Bad{"odd_rate", "[[probe]]\nset = \"top\"\nquantity = \"velocity\"\nrate_hz = 300",
            "probe[0].rate_hz", "does not divide 1000"},
        Bad{"unknown_quantity", "[[probe]]\nset = \"top\"\nquantity = \"stress\"",
            "probe[0].quantity", "\"reaction\""},
        Bad{"field_too_late", "[output]\nfields_s = [0.5, 1.5]", "output.fields_s",
            "from 0 to 1 s"},
        Bad{"fields_not_sorted", "[output]\nfields_s = [0.5, 0.25]", "output.fields_s", "order"},
        Bad{"far_tool",
            "[[tool]]\nanchor = [0, 1, 0]\n[[tool.key]]\ntime_s = 0\nposition_mm = [0, 1999, 0]",
            "tool[0].key[0].position_mm", "more than 2000 mm", -1},
        Bad{"tool_key", "[[tool]]\n[[tool.key]]\ntime_s = 0\nposition_mm = [0, 0, nan]",
            "tool[0].key[0].position_mm", "not finite"}),
    [](const auto& test) { return std::string(test.param.name); });

std::string message_of(const std::string& text) {
  const auto parsed = parse_scenario_text(text, "bad.toml");
  return parsed.ok() ? "" : parsed.error().message;
}

TEST(ScenarioParse, WhatIsMissingIsSaid) {
  EXPECT_NE(message_of("[run]\nseconds = 1\n").find("key organ: is missing"), std::string::npos);
  EXPECT_NE(message_of("[organ]\nsource = \"lattice\"\n").find("key run: is missing"),
            std::string::npos);
  EXPECT_TRUE(message_of("[organ\n").starts_with("bad.toml:1: is not TOML"));
}

TEST(ScenarioParse, GravityNeedsTheWholeOrgan) {
  auto parsed = parse_scenario_text(
      "[organ]\nsource = \"lattice\"\n[run]\nseconds = 1\ndepth = 3\n[gravity]\nm_s2 = [0, -1, "
      "0]\n",
      "bad.toml");
  ASSERT_TRUE(parsed.ok()) << parsed.error().message;
  const auto resolved = resolve(std::move(*parsed));
  ASSERT_FALSE(resolved.ok());
  EXPECT_TRUE(resolved.error().message.starts_with("bad.toml:7: key gravity.m_s2: "))
      << resolved.error().message;
}

TEST(ScenarioParse, TheExampleIsRightAndIsNoScript) {
  const auto path = std::filesystem::path(TROCAR_SOURCE_DIR) / "deploy/scenes/pull.toml";
  auto parsed = parse_scenario(path);
  ASSERT_TRUE(parsed.ok()) << parsed.error().message;
  const auto resolved = resolve(std::move(*parsed));
  ASSERT_TRUE(resolved.ok()) << resolved.error().message;
  EXPECT_EQ(resolved->organ.mesh.node_count(), 9u * 7 * 9);
  EXPECT_EQ(resolved->displacements.at(0).nodes.size(), 81u);
  const auto script = parse_script(path);
  ASSERT_FALSE(script.ok());
  EXPECT_NE(script.error().message.find("only in a scenario"), std::string::npos);
}

TEST(ScenarioParse, SetsSelectByBoxAndByDistance) {
  auto parsed = parse_scenario_text(std::string(kGood) +
                                        "[[nodes]]\nname = \"near\"\nnearest_mm = [1, 10, 1]\n"
                                        "[[nodes]]\nname = \"ball\"\nnearest_mm = [0, 10, 0]\n"
                                        "radius_mm = 10\n"
                                        "[[probe]]\nset = \"top\"\nquantity = \"velocity\"\n"
                                        "[[probe]]\nset = \"near\"\nquantity = \"velocity\"\n"
                                        "[[probe]]\nset = \"ball\"\nquantity = \"velocity\"\n"
                                        "[[probe]]\nset = \"fixed\"\nquantity = \"reaction\"\n",
                                    "good.toml");
  ASSERT_TRUE(parsed.ok()) << parsed.error().message;
  const auto resolved = resolve(std::move(*parsed));
  ASSERT_TRUE(resolved.ok()) << resolved.error().message;
  EXPECT_EQ(resolved->probe_nodes[0].size(), 9u);
  EXPECT_EQ(resolved->probe_nodes[1], (NodeList{NodeIndex(16)}));
  EXPECT_EQ(resolved->probe_nodes[2].size(), 6u) << "the node, four beside it, one below";
  EXPECT_EQ(resolved->probe_nodes[3].size(), 9u);
}

TEST(ScenarioParse, MaterialChangesMassAndSprings) {
  auto parsed = parse_scenario_text(
      std::string(kGood) + "[material]\ndensity_kg_m3 = 2120\nspring_stiffness_n_m = 7\n",
      "a.toml");
  ASSERT_TRUE(parsed.ok()) << parsed.error().message;
  const auto resolved = resolve(std::move(*parsed));
  ASSERT_TRUE(resolved.ok()) << resolved.error().message;
  double mass = 0;
  for (const double m : resolved->organ.node_masses_kg) mass += m;
  EXPECT_NEAR(mass, 2120 * 8e-6, 1e-9);
  for (const auto& s : springs_of(resolved->organ)) EXPECT_EQ(s.stiffness_n_m, 7);
}

TEST(ScenarioParse, TimedVectorsAreLinearBetweenKeysAndConstantOutside) {
  const TimedVector v{{{1, {0, 0, 0}}, {2, {2, 0, -4}}}};
  EXPECT_EQ(v.at(0), (Vec3d{0, 0, 0}));
  EXPECT_EQ(v.at(1.5), (Vec3d{1, 0, -2}));
  EXPECT_EQ(v.at(9), (Vec3d{2, 0, -4}));
}

// Whatever the bytes are, the answer is a scenario or an error of one line.
TEST(ScenarioParse, TruncatedAndDamagedTextIsAnsweredWithoutCrash) {
  std::ifstream file(std::filesystem::path(TROCAR_SOURCE_DIR) / "deploy/scenes/pull.toml");
  const std::string good{std::istreambuf_iterator<char>(file), {}};
  ASSERT_TRUE(parse_scenario_text(good, "pull.toml").ok());
  const auto check = [](const std::string& text) {
    const auto scenario = parse_scenario_text(text, "a.toml");
    if (scenario.ok()) return;
    EXPECT_TRUE(scenario.error().message.starts_with("a.toml")) << scenario.error().message;
  };
  for (std::size_t size = 0; size < good.size(); ++size) check(good.substr(0, size));
  std::mt19937 random(5);
  for (int i = 0; i < 2000; ++i) {
    std::string text = good;
    for (int j = 0; j < 3; ++j)
      text[random() % text.size()] =
          static_cast<char>(random() % 2 ? random() % 256 : "[]{}=\"'\n.,-1"[random() % 13]);
    check(text);
  }
}

}  // namespace
}  // namespace trocar::scene
