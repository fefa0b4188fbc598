// The TOML form of scenarios: what is wrong is one line with file, line and key.

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <random>

#include "server/lab/scenario/scenario.h"
#include "tests/scenario/scenario_texts.h"

namespace trocar::scenario {
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
  // Keys of [run] stand in its table, all else at the end.
  std::string text = kGood;
  const std::string_view run_key = "seconds = 1\n";
  const bool is_of_run = bad.text[0] != '[' && std::string_view(bad.key).starts_with("run.");
  const auto at = is_of_run ? text.find(run_key) + run_key.size() : text.size();
  text.insert(at, is_of_run ? std::string(bad.text) + "\n" : bad.text);
  auto parsed = parse_scenario_text(text, "bad.toml");
  std::string message;
  if (parsed.ok()) {
    const auto resolved = resolve(std::move(*parsed));
    ASSERT_FALSE(resolved.ok()) << "was accepted";
    message = resolved.error().message;
  } else {
    message = parsed.error().message;
  }
  const int line = bad.line != 0 ? bad.line : lines_of(text.substr(0, at) + bad.text);
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
            "write young_modulus_pa = 4000"},
        Bad{"no_unit", "[material]\ndensity = 1000", "material.density", "write density_kg_m3"},
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
        Bad{"node_out_of_range", "[[nodes]]\nname = \"x\"\nids = [0, 27]", "nodes[1].ids",
            "node 27 does not exist, the organ has nodes 0 to 26"},
        Bad{"negative_node", "[[nodes]]\nname = \"x\"\nids = [-1]", "nodes[1].ids", "node -1"},
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
            "displace[0].key[0].displacement_m", "write displacement_mm"},
        Bad{"reaction_of_free", "[[probe]]\nquantity = \"reaction\"\nset = \"top\"", "probe[0].set",
            "a reaction needs a held set"},
        Bad{"cuts", "[[tool]]\n[[tool.key]]\ntime_s = 0\nposition_mm = [0, 0, 0]\nverb = \"cut\"",
            "organ.source", "which no [[tool]] can cut", 2},
        Bad{"cutting_like_a_session", "cutting = \"nakao\"", "run.cutting",
            "needs boundary = \"whole\" and self_contact = false"},
        Bad{"like_whom", "like = \"server\"", "run.like", "session"},
        Bad{"like_and_step", "like = \"session\"\ndt_s = 0.0005", "run.dt_s",
            "follows from like = \"session\", remove it"},
        Bad{"far_field_of_nothing", "far_field = \"linear\"", "run.far_field",
            "is for boundary = \"graded\" or like = \"session\", remove it"},
        Bad{"unknown_far_field", "like = \"session\"\nfar_field = \"quadratic\"", "run.far_field",
            "linear"},
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
        Bad{"law_without_tets", "[material]\nelastic_law = \"neo-hookean\"", "material.elastic_law",
            "has no tets"},
        Bad{"unknown_law", "[material]\nelastic_law = \"jelly\"", "material.elastic_law",
            "\"tensor-mass\""},
        Bad{"poisson_of_springs", "[material]\npoisson_ratio = 0.3", "material.poisson_ratio",
            "springs have 1/4"},
        Bad{"incompressible", "[material]\npoisson_ratio = 0.5", "material.poisson_ratio",
            "0.4999"},
        Bad{"fibres_without_direction", "[material]\nfibre_tension = 0.1", "material.fibre_tension",
            "needs a fibre_direction"},
        Bad{"no_direction", "[material]\nfibre_direction = [0, 0, 0]", "material.fibre_direction",
            "has no direction"},
        Bad{"region_without_set", "[[region]]\ntension = 0.1\n[[region]]\nset = \"top\"",
            "region[0].set", "is missing", 11},
        Bad{"region_of_nothing",
            "[[nodes]]\nids = [0]\nname = \"x\"\n[[region]]\ntension = 0.1\nset = \"x\"",
            "region[0].set", "holds no whole spring"},
        Bad{"region_that_changes_nothing", "[[region]]\nset = \"top\"", "region[0]",
            "changes nothing", 11},
        Bad{"region_nobody_knows", "[[region]]\nname = \"tumour\"\ntension = 0.1", "region[0]",
            "no region \"tumour\"", 11},
        Bad{"region_twice", "[[region]]\nset = \"top\"\ntension = 0.1\n[[region]]\nset = \"top\"",
            "region[1].set", "line 11"},
        Bad{"region_with_negative_density", "[[region]]\nset = \"top\"\ndensity_kg_m3 = -1",
            "region[0].density_kg_m3", "allowed are 1"},
        Bad{"axes", "[[displace]]\nset = \"top\"\naxes = \"up\"", "displace[0].axes",
            "no list of axes"},
        Bad{"moved_along_a_free_axis",
            "[[displace]]\nset = \"top\"\n[[displace.key]]\ntime_s = 0\n"
            "displacement_mm = [1, 1, 0]\n[[displace]]\nset = \"top\"\naxes = \"y\"\n"
            "[[displace.key]]\ntime_s = 0\ndisplacement_mm = [1, 1, 0]",
            "displace[1].axes", "leaves an axis free", 18},
        Bad{"axis_held_twice",
            "[[displace]]\nset = \"top\"\naxes = \"xy\"\n[[displace]]\naxes = \"yz\"\nset = "
            "\"top\"",
            "displace[1].set", "displaced by another set"},
        Bad{"force_along_a_held_axis",
            "[[displace]]\nset = \"top\"\naxes = \"xy\"\n[[force]]\nset = \"top\"\n"
            "[[force.key]]\ntime_s = 0\nforce_n = [0, 1, 1]",
            "force[0].set", "is displaced", 15},
        Bad{"traction_without_a_triangle",
            "[[traction]]\nset = \"x\"\n[[traction.key]]\ntime_s = 0\npressure_pa = 10\n"
            "[[nodes]]\nname = \"x\"\nnearest_mm = [0, 10, 0]",
            "traction[0].set", "no whole triangle", 12},
        Bad{"traction_on_fixed",
            "[[traction]]\nset = \"fixed\"\n[[traction.key]]\ntime_s = 0\npressure_pa = 10",
            "traction[0].set", "would do nothing", 12},
        Bad{"pressure_with_directions",
            "[[traction]]\nset = \"top\"\n[[traction.key]]\ntime_s = 0\n"
            "pressure_pa = [0, 1, 0]",
            "traction[0].key[0].pressure_pa", "not a number"},
        Bad{"pressure_in_kpa",
            "[[traction]]\nset = \"top\"\n[[traction.key]]\ntime_s = 0\ntraction_kpa = [0, 1, 0]",
            "traction[0].key[0].traction_kpa", "write traction_pa"},
        Bad{"no_csv", "[[nodes]]\nname = \"x\"\ncsv = \"none.csv\"", "nodes[1].csv",
            "none.csv: cannot be opened"},
        Bad{"surface_of_nothing", "[[nodes]]\nids = [13]\nsurface = true\nname = \"middle\"",
            "nodes[1].name", "has no nodes"},
        Bad{"tool_key", "[[tool]]\n[[tool.key]]\ntime_s = 0\nposition_mm = [0, 0, nan]",
            "tool[0].key[0].position_mm", "not finite"}),
    [](const auto& test) { return std::string(test.param.name); });

class BadRun : public ::testing::TestWithParam<Bad> {};

TEST_P(BadRun, IsOneLineWithFileLineAndKey) {
  const std::string text =
      std::string("[organ]\nsource = \"lattice\"\n[run]\nseconds = 1\n") + GetParam().text;
  const auto parsed = parse_scenario_text(text, "bad.toml");
  ASSERT_FALSE(parsed.ok());
  const std::string start =
      "bad.toml:" + std::to_string(lines_of(text)) + ": key " + GetParam().key + ": ";
  EXPECT_TRUE(parsed.error().message.starts_with(start)) << parsed.error().message;
  EXPECT_NE(parsed.error().message.find(GetParam().says), std::string::npos)
      << parsed.error().message;
}

INSTANTIATE_TEST_SUITE_P(
    Table, BadRun,
    ::testing::Values(
        Bad{"mode", "mode = \"quick\"", "run.mode", "\"static\""},
        Bad{"static_depth", "mode = \"static\"\nnodes = 100", "run.nodes", "mode = \"dynamic\""},
        Bad{"static_step", "mode = \"static\"\ndt_s = 0.001", "run.dt_s", "mode = \"dynamic\""},
        Bad{"load_steps", "load_steps = 3", "run.load_steps", "mode = \"static\""},
        Bad{"graded_without_limit", "boundary = \"graded\"", "run.boundary", "depth or nodes"},
        Bad{"whole_with_limit", "boundary = \"whole\"\ndepth = 3", "run.depth", "\"frozen\""},
        Bad{"far_of_frozen", "depth = 3\nfar_sweeps = 2", "run.far_sweeps", "\"graded\""},
        Bad{"self_contact_static", "mode = \"static\"\nself_contact = false", "run.self_contact",
            "\"dynamic\""},
        Bad{"explicit_sweeps", "integrator = \"explicit\"\nsweeps = 2", "run.sweeps", "implicit"},
        Bad{"explicit_frozen", "depth = 3\nintegrator = \"explicit\"", "run.integrator",
            "whole organ"},
        Bad{"long_step", "dt_s = 0.002", "run.dt_s", "0.001"},
        Bad{"odd_step", "dt_s = 0.0003", "run.dt_s", "write 0.00025"},
        Bad{"step_in_ms", "dt_ms = 0.5", "run.dt_ms", "write dt_s = 0.0005"},
        Bad{"start", "start = \"settled\"", "run.start", "\"equilibrium\""},
        Bad{"static_rate",
            "mode = \"static\"\n[[probe]]\nset = \"all\"\nquantity = \"displacement\"\n"
            "rate_hz = 100",
            "probe[0].rate_hz", "load step"}),
    [](const auto& test) { return std::string(test.param.name); });

std::string message_of(const std::string& text) {
  const auto parsed = parse_scenario_text(text, "bad.toml");
  return parsed.ok() ? "" : parsed.error().message;
}

TEST(ScenarioParse, WhatIsMissingIsSaid) {
  EXPECT_NE(message_of("[run]\nseconds = 1\n").find("key organ: is missing"), std::string::npos);
  EXPECT_NE(message_of("[organ]\nsource = \"lattice\"\n").find("key run: is missing"),
            std::string::npos);
  // A misspelt key is named itself, not the one that it leaves missing.
  EXPECT_NE(message_of("[organ]\nsourc = \"lattice\"\n[run]\nseconds = 1\n")
                .find("bad.toml:2: key organ.sourc: is unknown, the keys here are source"),
            std::string::npos);
  EXPECT_NE(
      message_of("[orgn]\nsource = \"lattice\"\n[run]\nseconds = 1\n").find("key orgn: is unknown"),
      std::string::npos);
  // A key that another table lacks stays what is wrong.
  EXPECT_NE(message_of("[organ]\n[run]\nseconds = 1\n[rum]\n").find("key organ.source: is missing"),
            std::string::npos);
  EXPECT_TRUE(message_of("[organ\n").starts_with("bad.toml:1: is not TOML"));
}

TEST(ScenarioParse, GravityNeedsTheWholeOrgan) {
  const auto resolved = resolve_text(
      "[organ]\nsource = \"lattice\"\n[run]\nseconds = 1\ndepth = 3\n[gravity]\nm_s2 = [0, -1, "
      "0]\n",
      "bad.toml");
  ASSERT_FALSE(resolved.ok());
  EXPECT_TRUE(resolved.error().message.starts_with("bad.toml:7: key gravity.m_s2: "))
      << resolved.error().message;
}

TEST(ScenarioParse, TheExampleIsRightAndHasNoToolsToPlay) {
  const auto path = std::filesystem::path(TROCAR_SOURCE_DIR) / "deploy/scenes/pull.toml";
  auto parsed = parse_scenario(path);
  ASSERT_TRUE(parsed.ok()) << parsed.error().message;
  const auto resolved = resolve(std::move(*parsed));
  ASSERT_TRUE(resolved.ok()) << resolved.error().message;
  EXPECT_EQ(resolved->organ.mesh.node_count(), 9u * 7 * 9);
  EXPECT_EQ(resolved->displacements.at(0).nodes.size(), 81u);
  const auto script = tool::parse_script(path);
  ASSERT_FALSE(script.ok());
  EXPECT_NE(script.error().message.find("key tool: is missing"), std::string::npos)
      << script.error().message;
}

TEST(ScenarioParse, SetsSelectByBoxAndByDistance) {
  const auto resolved = resolve_text(std::string(kGood) +
                                         "[[nodes]]\nname = \"near\"\nnearest_mm = [1, 10, 1]\n"
                                         "[[nodes]]\nname = \"ball\"\nnearest_mm = [0, 10, 0]\n"
                                         "radius_mm = 10\n"
                                         "[[probe]]\nset = \"top\"\nquantity = \"velocity\"\n"
                                         "[[probe]]\nset = \"near\"\nquantity = \"velocity\"\n"
                                         "[[probe]]\nset = \"ball\"\nquantity = \"velocity\"\n"
                                         "[[probe]]\nset = \"fixed\"\nquantity = \"reaction\"\n",
                                     "good.toml");
  ASSERT_TRUE(resolved.ok()) << resolved.error().message;
  EXPECT_EQ(resolved->probe_nodes[0].size(), 9u);
  EXPECT_EQ(resolved->probe_nodes[1], (NodeList{NodeIndex(16)}));
  EXPECT_EQ(resolved->probe_nodes[2].size(), 6u) << "the node, four beside it, one below";
  EXPECT_EQ(resolved->probe_nodes[3].size(), 9u);
}

TEST(ScenarioParse, MaterialChangesMassAndSprings) {
  const auto resolved = resolve_text(
      std::string(kGood) + "[material]\ndensity_kg_m3 = 2120\nspring_stiffness_n_m = 7\n",
      "a.toml");
  ASSERT_TRUE(resolved.ok()) << resolved.error().message;
  double mass = 0;
  for (const double m : resolved->organ.node_masses_kg) mass += m;
  EXPECT_NEAR(mass, 2120 * 8e-6, 1e-9);
  for (const auto& s : organ::springs_of(resolved->organ)) EXPECT_EQ(s.stiffness_n_m, 7);
}

TEST(ScenarioParse, RegionsHaveTheirMaterialAndTheirMass) {
  const auto resolved = resolve_text(
      R"([organ]
source = "plate"
[material]
density_kg_m3 = 1000
young_modulus_pa = 5000
[[nodes]]
name = "half"
box_min_mm = [-100, -100, -100]
box_max_mm = [0, 100, 100]
[[region]]
set = "half"
density_kg_m3 = 2000
elastic_law = "neo-hookean"
poisson_ratio = 0.4
averaged_strain = true
[run]
seconds = 1
)",
      "a.toml");
  ASSERT_TRUE(resolved.ok()) << resolved.error().message;
  const organ::Organ& organ = resolved->organ;
  ASSERT_EQ(organ.regions.size(), 1u);
  EXPECT_EQ(organ.regions[0].name, "half");
  EXPECT_EQ(organ.regions[0].material.elastic_law, material::ElasticLaw::NeoHookean);
  EXPECT_TRUE(organ.regions[0].material.has_averaged_strain);
  EXPECT_EQ(organ.regions[0].material.young_modulus_pa, 5000) << "what is left out is the organ's";
  EXPECT_EQ(organ.material.elastic_law, material::ElasticLaw::Springs);
  double mass = 0, volume_inside = 0, volume = 0;
  for (const double m : organ.node_masses_kg) mass += m;
  const auto map = organ::material_map(organ);
  for (std::size_t t = 0; t < organ.mesh.tets.size(); ++t) {
    const double v = mesh::tet_volume(organ.mesh, TetIndex(t));
    volume += v;
    if (map.tets[t] == 1) volume_inside += v;
  }
  EXPECT_GT(volume_inside, 0.4 * volume);
  EXPECT_NEAR(mass, 1000 * (volume + volume_inside), 1e-9);
}

TEST(ScenarioParse, TractionsAreTheSurfaceIntegral) {
  const auto resolved = resolve_text(
      std::string(kGood) +
          "[[traction]]\nset = \"top\"\n[[traction.key]]\ntime_s = 0\ntraction_pa = [50, 0, 100]\n"
          "[[traction]]\nset = \"top\"\n[[traction.key]]\ntime_s = 0\npressure_pa = 100\n"
          "[[nodes]]\nname = \"skin\"\nsurface = true\n"
          "[[traction]]\nset = \"skin\"\n[[traction.key]]\ntime_s = 0\npressure_pa = 100\n",
      "a.toml");
  ASSERT_TRUE(resolved.ok()) << resolved.error().message;
  const auto total = [&](std::size_t load) {
    const auto& force = resolved->forces.at(load);
    Vec3d sum;
    for (std::size_t i = 0; i < force.nodes.size(); ++i)
      sum += force.on_node(i, force.over_time.at(0));
    return sum;
  };
  constexpr double kArea = 4e-4;  // 20 mm x 20 mm
  EXPECT_LT(length(total(0) - Vec3d{50, 0, 100} * kArea), 1e-12);
  EXPECT_LT(length(total(1) - Vec3d{0, -100, 0} * kArea), 1e-12) << "a pressure pushes inwards";
  EXPECT_LT(length(total(2)), 1e-12) << "all around it cancels";
  EXPECT_EQ(resolved->forces[2].nodes.size(), 26u);
}

TEST(ScenarioParse, SetsComeFromCsvFilesBesideTheScenario) {
  const auto folder =
      std::filesystem::temp_directory_path() / ("trocar-sets-" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  const auto resolve_with = [&](const std::string& csv) {
    std::ofstream(folder / "ids.csv") << csv;
    return resolve_text(std::string(kGood) + "[[nodes]]\nname = \"x\"\ncsv = \"ids.csv\"\n" +
                            "[[probe]]\nset = \"x\"\nquantity = \"displacement\"\n",
                        (folder / "a.toml").string());
  };
  const auto good = resolve_with("node,rest_x_mm\r\n26,1\n# a comment\n\n3, 2\n3\n");
  ASSERT_TRUE(good.ok()) << good.error().message;
  EXPECT_EQ(good->probe_nodes[0], (NodeList{NodeIndex(3), NodeIndex(26)}));
  const auto word = resolve_with("node\n1\nmiddle\n");
  ASSERT_FALSE(word.ok());
  EXPECT_NE(word.error().message.find("a.toml:13: key nodes[1].csv: "), std::string::npos)
      << word.error().message;
  EXPECT_NE(word.error().message.find("ids.csv:3: "), std::string::npos) << word.error().message;
  const auto far = resolve_with("27\n");
  ASSERT_FALSE(far.ok());
  EXPECT_NE(far.error().message.find("node 27 does not exist"), std::string::npos);
  std::filesystem::remove_all(folder);
}

TEST(ScenarioParse, GravityReplacesTheOrgansOwn) {
  const auto resolved =
      resolve_text(std::string(kGood) + "[gravity]\nm_s2 = [0, -9.81, 0]\n", "a.toml");
  ASSERT_TRUE(resolved.ok()) << resolved.error().message;
  EXPECT_EQ(resolved->organ.gravity_m_s2, (Vec3d{0, -9.81, 0}));
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
}  // namespace trocar::scenario
