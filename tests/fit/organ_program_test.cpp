// trocar-organ fit and settle as processes: the figures they find, and what they say of each
// mistake: one line with the file, and an exit code.

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <sstream>
#include <string_view>

#include "server/organs/organ/organ_file.h"
#include "tests/support/program_fixture.h"

namespace trocar {
namespace {

class OrganProgram : public testing::ProgramFixture {
 protected:
  OrganProgram() : ProgramFixture("trocar-organ") {}

  static std::string scene(const char* name) {
    return std::string(TROCAR_SOURCE_DIR) + "/deploy/scenes/" + name;
  }
  int fit(const std::string& scenario, const std::string& curve,
          const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"fit", scenario, curve, "--out", at("out")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  int settle(const std::string& organ, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"settle", organ};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  // Returns the number after `word` in `text`.
  static double number_after(const std::string& text, const std::string& word) {
    const auto found = text.find(word);
    EXPECT_NE(found, std::string::npos) << word << " is missing in " << text;
    return found == std::string::npos ? NAN : std::strtod(&text[found + word.size()], nullptr);
  }
  // The log is one line of the program's, and `says` is in it.
  const std::string scenario_ = scene("stretch.toml"), curve_ = scene("stretch.csv");
};

TEST_F(OrganProgram, MakesOrgansWithFibresAndShowsThem) {
  ASSERT_EQ(
      run({"make", "plate", "--fibres", "around:y", "--fibre-tension", "0.08", "--fibre-stiffness",
           "3", "--blade-friction", "900", "--tear-stretch", "1.5", "--out", at("a.organ")}),
      0)
      << log();
  const auto organ = organ::read_organ(at("a.organ"));
  ASSERT_TRUE(organ.ok());
  EXPECT_EQ(organ->fibre_directions.size(), organ->mesh.node_count());
  EXPECT_EQ(organ->material.fibre_tension, 0.08);
  ASSERT_EQ(run({"inspect", at("a.organ"), "--json"}), 0);
  const auto json = log();
  EXPECT_GT(number_after(json, "\"fibre_nodes\": "), 100);
  EXPECT_EQ(number_after(json, "\"fibre_tension\": "), 0.08);
  EXPECT_EQ(number_after(json, "\"fibre_stiffness_ratio\": "), 3);
  EXPECT_EQ(number_after(json, "\"tension\": "), 0);
  EXPECT_EQ(number_after(json, "\"cut_energy_j_m2\": "), 150);
  EXPECT_EQ(number_after(json, "\"blade_friction_pa\": "), 900);
  EXPECT_EQ(number_after(json, "\"tear_stretch\": "), 1.5);
  ASSERT_EQ(run({"inspect", at("a.organ")}), 0);
  EXPECT_NE(log().find("directed fibres     at "), std::string::npos) << log();
}

// A binary STL file in which each vertex is turned, and whose header says the axes.
std::string turned_stl(std::string file, std::string_view header, float side) {
  std::copy(header.begin(), header.end(), file.begin());
  for (std::size_t at = 84 + 12; at + 36 <= file.size(); at += 50)
    for (std::size_t corner = at; corner < at + 36; corner += 12)
      for (const std::size_t axis : {0u, 4u}) {
        float value = 0;
        std::memcpy(&value, &file[corner + axis], sizeof value);
        value *= side;
        std::memcpy(&file[corner + axis], &value, sizeof value);
      }
  return file;
}

TEST_F(OrganProgram, AFineSurfaceIsTurnedFromItsAxesToThoseOfTheOtherFile) {
  ASSERT_EQ(run({"export", "liver", "--unit", "mm", "--out", at("unsaid.stl")}), 0) << log();
  std::ifstream in(at("unsaid.stl"), std::ios::binary);
  const std::string file{std::istreambuf_iterator<char>(in), {}};
  const auto unsaid = at("unsaid.stl"), lps = write("lps.stl", turned_stl(file, "SPACE=LPS", 1)),
             ras = write("ras.stl", turned_stl(file, "SPACE=RAS", -1));
  const auto embed = [&](const std::string& organ, const std::string& fine,
                         const std::string& frame = "auto") {
    return run({"import", organ, "--unit", "mm", "--nodes", "1000", "--embed", fine,
                "--embed-frame", frame, "--out", at("fine.organ")});
  };
  ASSERT_EQ(embed(lps, ras), 0) << log();
  EXPECT_NE(log().find("ras.stl: read in mm, turned from RAS, as the file says"), std::string::npos)
      << log();
  ASSERT_EQ(embed(lps, lps), 0) << log();
  EXPECT_EQ(log().find("turned"), std::string::npos) << log();
  EXPECT_EQ(embed(unsaid, lps), 2);
  expect_line("lps.stl: says that its axes are LPS, and ");
  EXPECT_EQ(embed(unsaid, lps, "file"), 0) << log();
  EXPECT_EQ(embed(lps, unsaid), 0) << log();
}

TEST_F(OrganProgram, NothingTakesThePlaceOfWhatItWasMadeFrom) {
  ASSERT_EQ(run({"export", "liver", "--unit", "mm", "--out", at("own.stl")}), 0) << log();
  const auto size = std::filesystem::file_size(at("own.stl"));
  EXPECT_EQ(run({"import", at("own.stl"), "--unit", "mm", "--out", at("own.stl")}), 2);
  expect_line("own.stl: the file's name must end with .organ");
  ASSERT_EQ(
      run({"import", at("own.stl"), "--unit", "mm", "--nodes", "500", "--out", at("a.organ")}), 0)
      << log();
  EXPECT_EQ(run({"inspect", at("a.organ"), "--picture", at("a.organ")}), 2);
  expect_line("a.organ: the file's name must end with .png");
  EXPECT_EQ(run({"export", at("a.organ"), "--unit", "mm", "--out", at("own.stl")}), 2);
  expect_line("own.stl: the organ was made from a file of this name");
  EXPECT_EQ(run({"make", "plate", "--out", at("own.stl")}), 2);
  EXPECT_EQ(std::filesystem::file_size(at("own.stl")), size);
}

TEST_F(OrganProgram, AnOrganFarAwayIsNotWrittenInShortNumbers) {
  ASSERT_EQ(run({"make", "plate", "--out", at("plate.organ")}), 0);
  ASSERT_EQ(run({"export", at("plate.organ"), "--out", at("near.msh")}), 0) << log();
  std::ifstream in(at("near.msh"));
  std::string far;
  bool is_node = false;
  for (std::string line; std::getline(in, line); far += line + "\n") {
    if (line == "$EndNodes") is_node = false;
    std::istringstream words(line);
    int id = 0;
    double x = 0, y = 0, z = 0;
    if (is_node && words >> id >> x >> y >> z) {
      std::ostringstream moved;
      moved << std::setprecision(17) << id << ' ' << x + 1e5 << ' ' << y << ' ' << z;
      line = moved.str();
    }
    if (line == "$Nodes") is_node = true;
  }
  ASSERT_EQ(run({"import", write("far.msh", far), "--out", at("far.organ")}), 0) << log();
  EXPECT_EQ(run({"export", at("far.organ"), "--out", at("far.stl")}), 2);
  expect_line("far.organ lies so far from its file's origin");
  EXPECT_EQ(run({"export", at("far.organ"), "--out", at("far.vtu")}), 0) << log();
}

TEST_F(OrganProgram, AGlbFileIsInMetres) {
  EXPECT_EQ(run({"export", "plate", "--unit", "mm", "--out", at("plate.glb")}), 2);
  expect_line("plate.glb: .glb is in m");
  EXPECT_FALSE(std::filesystem::exists(at("plate.glb")));
  EXPECT_EQ(run({"export", "plate", "--out", at("plate.glb")}), 0) << log();
}

TEST_F(OrganProgram, OptionsOfAFineSurfaceNeedOne) {
  for (const auto& [option, value] :
       {std::pair{"--embed-frame", "ras"}, {"--embed-unit", "mm"}, {"--embed-picture", "a.png"}}) {
    EXPECT_EQ(run({"import", "a.stl", option, value}), 2);
    expect_line(option);
    expect_line("requires --embed");
  }
}

TEST_F(OrganProgram, RefusesFibresAndTearsThatCannotBe) {
  const auto refused = [&](std::vector<std::string> arguments, int code, const char* says) {
    arguments.insert(arguments.end(), {"--out", at("b.organ")});
    EXPECT_EQ(run(arguments), code) << log();
    expect_line(says);
    EXPECT_FALSE(std::filesystem::exists(at("b.organ")));
  };
  refused({"make", "lattice", "--tear-stretch", "1.5"}, 2, "organs of links do not tear");
  refused({"make", "plate", "--fibres", "around"}, 2, "--fibres: 'around' is not");
  refused({"make", "plate", "--fibre-tension", "0.1"}, 2, "need --fibres");
  refused({"make", "plate", "--tension", "0.5", "--fibres", "x", "--fibre-tension", "0.5"}, 3,
          "tension and fibre tension together is 1");
  refused({"make", "liver", "--fibres", "x", "--fibre-stiffness", "3"}, 2, "is of springs");
  refused({"make", "plate", "--averaged-strain"}, 2, "is of neo-hookean and measured tets");
  const auto table = write("f.csv", "id,x,y,z\n0,1,0,0\n1,0,0,0\n");
  refused({"make", "plate", "--fibres", table}, 3, "f.csv:3: the direction has no length");
}

TEST_F(OrganProgram, MakesTheOrganOfAScenario) {
  const auto scene = std::filesystem::path(TROCAR_SOURCE_DIR) / "deploy/scenes/tumour.toml";
  ASSERT_EQ(run({"make", scene.string(), "--averaged-strain", "--out", at("a.organ")}), 0) << log();
  const auto organ = organ::read_organ(at("a.organ"));
  ASSERT_TRUE(organ.ok());
  EXPECT_EQ(organ->name, "tumour");
  ASSERT_EQ(organ->regions.size(), 2u);
  for (const auto& region : organ->regions) EXPECT_TRUE(region.material.has_averaged_strain);
  EXPECT_EQ(organ->material.elastic_law, material::ElasticLaw::Measured);
  EXPECT_EQ(run({"make", scene.string(), "--tets", "2000", "--out", at("b.organ")}), 2);
  expect_line("--tets does not apply");
  EXPECT_EQ(run({"make", at("none.toml"), "--out", at("b.organ")}), 3);
  expect_line("cannot be opened");
}

TEST_F(OrganProgram, MakesOrgansWhoseStrainIsAveraged) {
  ASSERT_EQ(run({"make", "liver", "--tets", "2000", "--averaged-strain", "--out", at("a.organ")}),
            0)
      << log();
  EXPECT_NE(log().find("strain              averaged over nodes"), std::string::npos) << log();
  ASSERT_EQ(run({"inspect", at("a.organ"), "--json"}), 0);
  EXPECT_NE(log().find("\"averaged_strain\": true"), std::string::npos) << log();
}

TEST_F(OrganProgram, FitFindsTheStiffnessFromWhichTheExamplesCurveWasMade) {
  ASSERT_EQ(fit(scenario_, curve_, {"--organ", at("fitted.organ")}), 0) << log();
  const double printed = number_after(log(), "young_modulus_pa       ");
  const double error = number_after(log(), "+- ");
  EXPECT_NEAR(printed, 6000, 60);
  EXPECT_LT(error, 60) << "noise of 1 %";
  EXPECT_LT(std::abs(printed - 6000), 3 * error) << "the standard error says how far it may be off";
  EXPECT_NEAR(number_after(log(), "started from "), 4000, 1e-9);
  EXPECT_LT(number_after(log(), "rms, "), 1);

  const auto material = read(folder_ / "out" / "material.toml");
  EXPECT_TRUE(material.starts_with("[material]\n")) << material;
  EXPECT_EQ(number_after(material, "young_modulus_pa = "), printed);
  const auto organ = organ::read_organ(at("fitted.organ"));
  ASSERT_TRUE(organ.ok()) << organ.error().message;
  EXPECT_NEAR(organ->material.young_modulus_pa, printed, 0.01);
  EXPECT_NE(read(folder_ / "out" / "fit.svg").find("</svg>"), std::string::npos);
}

TEST_F(OrganProgram, FitsTableHasTheMeasuredForcesAndItsResidual) {
  ASSERT_EQ(fit(scenario_, curve_), 0) << log();
  std::istringstream fitted(read(folder_ / "out" / "fit.csv")), measured(read(curve_));
  std::string row, measured_row;
  std::getline(fitted, row);
  EXPECT_EQ(row, "displacement_mm,measured_force_n,fitted_force_n");
  std::getline(measured, measured_row);  // a comment
  std::getline(measured, measured_row);  // the header
  double sum = 0, last = -1;
  int rows = 0;
  while (std::getline(measured, measured_row)) {
    ASSERT_TRUE(std::getline(fitted, row)) << "a row for each measurement";
    double x = 0, force = 0, expected_x = 0, expected_force = 0, ours = 0;
    ASSERT_EQ(std::sscanf(measured_row.c_str(), "%lf,%lf", &expected_x, &expected_force), 2);
    ASSERT_EQ(std::sscanf(row.c_str(), "%lf,%lf,%lf", &x, &force, &ours), 3) << row;
    EXPECT_NEAR(x, expected_x, 1e-9);
    EXPECT_NEAR(force, expected_force, 1e-9);
    EXPECT_GT(ours, last) << "more stretch, more force";
    last = ours;
    sum += (ours - force) * (ours - force);
    ++rows;
  }
  EXPECT_FALSE(std::getline(fitted, row));
  ASSERT_GE(rows, 10);
  const double rms = number_after(log(), "residual               ");
  EXPECT_NEAR(rms, std::sqrt(sum / rows), 0.01 * rms);
}

TEST_F(OrganProgram, FitSaysWhereACurveIsWrong) {
  struct Case {
    const char *name, *text, *says;
  };
  for (const Case& c : {
           Case{"word.csv", "displacement_mm,force_n\n0,0\n1,much\n", "word.csv:3: "},
           Case{"short.csv", "displacement_mm,force_n\n\n# a comment\n0\n", "short.csv:4: "},
           Case{"order.csv", "time_s,displacement_mm,force_n\n0,0,0\n0.2,1,1\n0.1,2,2\n",
                "order.csv:4: "},
           Case{"unit.csv", "displacement_m,force_n\n0,0\n0.001,1\n", "unit.csv:1: "},
           Case{"force_unit.csv", "displacement_mm,force_mn\n0,0\n1,1\n", "force_unit.csv:1: "},
           Case{"far.csv", "displacement_mm,force_n\n0,0\n900,1\n", "far.csv:3: "},
           Case{"empty.csv", "displacement_mm,force_n\n", "empty.csv: has no measurements"},
       }) {
    EXPECT_EQ(fit(scenario_, write(c.name, c.text)), 3) << c.name;
    expect_line(c.says);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out" / "material.toml")) << c.name;
  }
}

TEST_F(OrganProgram, FitSaysWhatElseIsWrong) {
  std::string text = read(scenario_);
  const std::string key = "young_modulus_pa = 4000";
  ASSERT_NE(text.find(key), std::string::npos);
  const auto line =
      1 + std::count(text.begin(), text.begin() + std::ptrdiff_t(text.find(key)), '\n');
  text.replace(text.find(key), key.size(), "young_modulus_kpa = 4");
  EXPECT_EQ(fit(write("unit.toml", text), curve_), 3);
  expect_line("unit.toml:" + std::to_string(line) + ": key material.young_modulus_kpa: ");
  EXPECT_NE(log().find("write young_modulus_pa = 4000"), std::string::npos) << log();

  EXPECT_EQ(fit(at("missing.toml"), curve_), 3);
  expect_line("missing.toml: cannot be opened");
  EXPECT_EQ(fit(scenario_, at("missing.csv")), 3);
  expect_line("missing.csv: cannot be opened");
  EXPECT_EQ(fit(scenario_, curve_, {"--parameters", "youngs_modulus"}), 2);
  expect_line("'youngs_modulus' cannot be fitted");
  EXPECT_EQ(run({"fit", scenario_}), 2);
  expect_line("CURVE");
  const auto file = write("file", "");
  EXPECT_EQ(run({"fit", scenario_, curve_, "--out", file + "/x"}), 5);
  expect_line("file/x: cannot be made");
}

TEST_F(OrganProgram, FitSaysWhenTheOrganCannotBeWritten) {
  const auto file = write("file", "");
  EXPECT_EQ(fit(scenario_, curve_, {"--organ", file + "/x.organ"}), 5);
  EXPECT_NE(log().find("trocar-organ: " + file + "/x.organ: cannot be written"), std::string::npos)
      << log();
}

TEST_F(OrganProgram, NothingIsRunForAFileThatCannotBeWritten) {
  EXPECT_EQ(fit(scenario_, curve_, {"--organ", at("none/x.organ")}), 5);
  expect_line("none/x.organ: cannot be written, its folder is not there");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
  EXPECT_EQ(run({"calibrate", "liver", "--results", at("out"), "--out", at("none/x.organ")}), 5);
  expect_line("none/x.organ: cannot be written, its folder is not there");
}

TEST_F(OrganProgram, CalibrateRefusesWhatItCannotPress) {
  EXPECT_EQ(run({"calibrate", "liver", "--radius", "0", "--results", at("out")}), 2);
  expect_line("--radius must be 0.5 to 50 mm");
  ASSERT_EQ(run({"export", "liver", "--unit", "mm", "--out", at("a.stl")}), 0) << log();
  ASSERT_EQ(run({"import", at("a.stl"), "--unit", "mm", "--nodes", "500", "--fix", "none", "--out",
                 at("free.organ")}),
            0)
      << log();
  EXPECT_EQ(run({"calibrate", at("free.organ"), "--results", at("out"), "--out", at("x.organ")}),
            3);
  expect_line("nothing holds it, so a press moves all of it");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "x.organ"));
}

TEST_F(OrganProgram, SettleWritesAnOrganThatIsAtRestUnderItsGravity) {
  const auto settled = at("settled.organ");
  ASSERT_EQ(settle(scenario_, {"--gravity", "0,-2,0", "-o", settled}), 0) << log();
  const double largest = number_after(log(), "nodes moved by "),
               mean = number_after(log(), "most, ");
  EXPECT_GT(largest, 0.5);
  EXPECT_LT(largest, 2);
  EXPECT_GT(mean, 0.3 * largest);
  EXPECT_LT(mean, largest);
  EXPECT_LE(number_after(log(), "sweeps, "), 1e-6);
  const auto organ = organ::read_organ(settled);
  ASSERT_TRUE(organ.ok()) << organ.error().message;
  EXPECT_EQ(organ->gravity_m_s2, (Vec3d{0, -2, 0}));
  EXPECT_EQ(organ->stress_free_positions_m.size(), organ->mesh.node_count());

  ASSERT_EQ(settle(settled, {"-o", at("again.organ")}), 0) << log();
  EXPECT_LT(number_after(log(), "nodes moved by "), 0.01) << "its own gravity, and it rests there";
  // The state of rest under more weight does not depend on where the organ starts.
  ASSERT_EQ(settle(settled, {"--gravity", "0,-6,0", "-o", at("on.organ")}), 0) << log();
  ASSERT_EQ(settle(scenario_, {"--gravity", "0,-6,0", "-o", at("at_once.organ")}), 0) << log();
  EXPECT_GT(number_after(log(), "nodes moved by "), 2.9 * largest);
  const auto on = organ::read_organ(at("on.organ")), once = organ::read_organ(at("at_once.organ"));
  ASSERT_TRUE(on.ok() && once.ok());
  ASSERT_EQ(on->mesh.node_count(), once->mesh.node_count());
  for (std::size_t i = 0; i < on->mesh.node_count(); ++i)
    ASSERT_LT(length(on->mesh.rest_positions[i] + on->source_offset_m -
                     once->mesh.rest_positions[i] - once->source_offset_m),
              1e-5)
        << "node " << i;
}

TEST_F(OrganProgram, SettleSaysWhatIsWrong) {
  EXPECT_EQ(settle(at("missing.organ")), 3);
  expect_line("missing.organ: cannot be opened");
  EXPECT_EQ(settle("kidney"), 3);
  expect_line("'kidney'");
  EXPECT_EQ(settle(write("unit.toml",
                         "[organ]\nsource = \"block\"\nnodes = [3, 3, 3]\n"
                         "spacing_cm = 1\n[run]\nseconds = 1\n")),
            3);
  expect_line("unit.toml:4: key organ.spacing_cm: ");
  EXPECT_EQ(settle(write("torn.organ", read(scenario_))), 3);
  expect_line("torn.organ: ");
  EXPECT_EQ(settle(scenario_, {"--gravity", "0,-9.81"}), 2);
  expect_line("--gravity");
  EXPECT_EQ(settle(scenario_, {"--gravity", "0,-9810,0"}), 2);
  expect_line("--gravity must be finite and at most 1000 m/s^2");
  const auto file = write("file", "");
  EXPECT_EQ(settle(scenario_, {"-o", file + "/x.organ"}), 5);
  expect_line("file/x.organ: cannot be written");
  EXPECT_EQ(settle(write("free.toml",
                         "[organ]\nsource = \"block\"\nnodes = [3, 3, 3]\n"
                         "spacing_mm = 8\n[fix]\norgan = false\n[run]\nseconds = 1\n"),
                   {"-o", at("x.organ")}),
            3);
  expect_line("nothing holds it");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "x.organ"));
}

}  // namespace
}  // namespace trocar
