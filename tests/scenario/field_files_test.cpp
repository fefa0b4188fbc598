// Fields as another program reads them.

#include "server/lab/scenario/field_files.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "server/lab/scenario/field_times.h"
#include "tests/scenario/scenario_texts.h"

namespace trocar::scenario {
namespace {

namespace fs = std::filesystem;

// A block of 2 x 2 x 2 cubes with two regions: its upper four, and then two of these.
const std::string kBlock = R"([organ]
source = "block"
nodes = [3, 3, 3]
spacing_mm = 10
[material]
young_modulus_pa = 5000
[[nodes]]
name = "upper"
box_min_mm = [-10, 0, -10]
box_max_mm = [10, 10, 10]
[[nodes]]
name = "edge"
box_min_mm = [0, 0, -10]
box_max_mm = [10, 10, 10]
[[region]]
set = "upper"
name = "stiff & stiffer"
young_modulus_pa = 9000
[[region]]
set = "edge"
young_modulus_pa = 12000
[run]
seconds = 0.001
)";

class FieldFiles : public ::testing::Test {
 protected:
  FieldFiles() { fs::create_directories(folder_); }
  ~FieldFiles() override { fs::remove_all(folder_); }

  static std::string read(const fs::path& path) {
    std::ifstream in(path, std::ios::binary);
    std::ostringstream out;
    out << in.rdbuf();
    return out.str();
  }
  void write(const std::string& text) {
    run_ = make(text, Solver::Live);
    ASSERT_TRUE(run_);
    finish(*run_);
    ASSERT_TRUE(write_field(folder_, *run_).ok());
    vtu_ = read(folder_ / "field_0000001ms.vtu");
    csv_ = read(folder_ / "field_0000001ms.csv");
  }
  // Returns the text of the first array of this name after the start of `section`.
  std::string body(const std::string& section, const std::string& array) const {
    const auto begin = vtu_.find("Name=\"" + array + "\"", vtu_.find("<" + section + ">"));
    const auto end = vtu_.find("</" + section + ">");
    EXPECT_LT(begin, end) << array << " in " << section;
    if (begin >= end) return {};
    const auto first = vtu_.find('>', begin) + 1;
    return vtu_.substr(first, vtu_.find("</DataArray>", first) - first);
  }
  template <typename T>
  std::vector<T> numbers(const std::string& section, const std::string& array) const {
    std::istringstream text(body(section, array));
    std::vector<T> out;
    for (T value; text >> value;) out.push_back(value);
    return out;
  }
  std::vector<std::string> region_names() const {
    std::vector<std::string> names(1);
    for (const int byte : numbers<int>("FieldData", "region_names"))
      byte == 0 ? void(names.emplace_back()) : names.back().push_back(static_cast<char>(byte));
    EXPECT_TRUE(names.back().empty()) << "a string without its end";
    names.pop_back();
    return names;
  }

  const fs::path folder_ = fs::temp_directory_path() / ("trocar-field-" + std::to_string(getpid()));
  std::unique_ptr<ScenarioRun> run_;
  std::string vtu_, csv_;
};

TEST_F(FieldFiles, RegionsOfNodesAndCellsAndTheirNamesReadBack) {
  write(kBlock);
  EXPECT_EQ(region_names(),
            (std::vector<std::string>{run_->organ().name, "stiff & stiffer", "edge"}));
  const auto& mesh = run_->organ().mesh;
  const auto positions = numbers<double>("Points", "rest_m");
  const auto nodes = numbers<int>("PointData", "region");
  ASSERT_EQ(positions.size(), 3 * mesh.node_count());
  ASSERT_EQ(nodes.size(), mesh.node_count());
  int counts[3] = {};
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const bool is_upper = positions[3 * i + 1] > -1e-6;
    const bool is_edge = is_upper && positions[3 * i] > -1e-6;
    EXPECT_EQ(nodes[i], is_edge ? 2 : is_upper ? 1 : 0) << "node " << i;
    ++counts[nodes[i]];
  }
  EXPECT_EQ(counts[1], 6);
  EXPECT_EQ(counts[2], 12);

  const auto cells = numbers<int>("CellData", "region");
  const auto corners = numbers<std::size_t>("Cells", "connectivity");
  ASSERT_EQ(cells.size(), mesh.tets.size());
  ASSERT_EQ(corners.size(), 4 * mesh.tets.size());
  std::size_t cell_counts[3] = {};
  for (std::size_t c = 0; c < cells.size(); ++c) {
    bool is_upper = true, is_edge = true;
    for (std::size_t k = 0; k < 4; ++k) {
      const double* corner = &positions[3 * corners[4 * c + k]];
      is_upper &= corner[1] > -1e-6;
      is_edge &= corner[0] > -1e-6;
    }
    EXPECT_EQ(cells[c], is_upper && is_edge ? 2 : is_upper ? 1 : 0) << "cell " << c;
    ++cell_counts[cells[c]];
  }
  EXPECT_EQ(cell_counts[1], cells.size() / 4);
  EXPECT_EQ(cell_counts[2], cells.size() / 4);

  std::istringstream rows(csv_);
  std::string row;
  std::getline(rows, row);
  EXPECT_TRUE(row.ends_with(",held,region")) << row;
  for (const int region : nodes) {
    ASSERT_TRUE(std::getline(rows, row));
    EXPECT_TRUE(row.ends_with("," + std::to_string(region))) << row;
  }
}

TEST_F(FieldFiles, AnOrganOfSpringsHasTheRegionsOfItsSprings) {
  write(kColumn + "[[region]]\nset = \"top\"\nspring_stiffness_n_m = 80\n[run]\nseconds = 0.001\n");
  EXPECT_EQ(region_names().size(), 2u);
  const auto cells = numbers<int>("CellData", "region");
  ASSERT_EQ(cells.size(), run_->organ().mesh.links.size());
  EXPECT_EQ(std::count(cells.begin(), cells.end(), 1), 4) << "the springs across the top";
  EXPECT_EQ(std::count(cells.begin(), cells.end(), 0), static_cast<long>(cells.size()) - 4);
}

TEST_F(FieldFiles, AnOrganWithoutRegionsIsAllRegionZero) {
  write(kColumn + "[run]\nseconds = 0.001\n");
  EXPECT_EQ(region_names(), std::vector<std::string>{run_->organ().name});
  for (const int region : numbers<int>("PointData", "region")) EXPECT_EQ(region, 0);
}

// The steps at which a field is written, of `count` steps and the start.
std::vector<int> field_steps(const std::vector<double>& times_s, double step_s, int count) {
  FieldTimes times(times_s, step_s);
  std::vector<int> steps;
  for (int i = 0; i <= count; ++i)
    if (times.pop_due(i * step_s)) steps.push_back(i);
  return steps;
}

TEST(FieldTimes, AreDueAtTheFirstStepThatReachesThem) {
  using Steps = std::vector<int>;
  EXPECT_EQ(field_steps({0, 0.0021, 0.0026, 0.005}, 1e-3, 5), (Steps{0, 2, 3, 5}))
      << "a tick is within half of one";
  EXPECT_EQ(field_steps({0, 0.0004, 0.001}, 1e-5, 100), (Steps{0, 40, 100}))
      << "short steps are told apart";
  EXPECT_EQ(field_steps({0.5, 1}, 1, 1), (Steps{1})) << "a long step is no step before its time";
  EXPECT_EQ(field_steps({}, 1, 3), Steps{});
}

}  // namespace
}  // namespace trocar::scenario
