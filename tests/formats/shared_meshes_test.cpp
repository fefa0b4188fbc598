// The reader over real organs and over every damaged file of the shared test material.

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>
#include <sstream>

#include "server/organs/formats/mesh_file.h"
#include "server/organs/surface/closed_surface.h"
#include "tests/support/shared.h"

namespace trocar::formats {
namespace {

using namespace mesh;  // NOLINT: most of what is compared

// An import gets this of a file before a surface is filled.
struct Outcome {
  std::string error;  // empty: accepted
  std::vector<std::string> warnings;
  std::optional<ImportedMesh> mesh;  // of tetrahedra
};

Outcome outcome_of(const std::filesystem::path& path, Unit unit = Unit::Metre) {
  auto file = read_mesh_file(path);
  if (!file) return {file.error().message, {}, {}};
  if (auto* raw = std::get_if<surface::RawSurface>(&*file)) {
    auto solid = surface::check_surface(std::move(*raw), unit, path.string());
    if (!solid) return {solid.error().message, {}, {}};
    return {"", solid->warnings, {}};
  }
  auto mesh = make_mesh(std::move(std::get<RawTets>(*file)), unit, path.string());
  if (!mesh) return {mesh.error().message, {}, {}};
  return {"", mesh->warnings, std::move(*mesh)};
}

Result<ImportedMesh> read_gmsh(const std::filesystem::path& path, Unit unit = Unit::Metre) {
  auto outcome = outcome_of(path, unit);
  if (!outcome.error.empty()) return Error{ErrorCode::BadFile, outcome.error};
  return std::move(*outcome.mesh);
}

struct Expected {
  const char* file;
  const char* rejected_with;  // part of the error; null: accepted
  const char* warned_with;    // part of the only warning; null: none
};

// One line per file in organs/broken, as that folder's README states.
constexpr Expected kOutcomes[] = {
    {"empty.msh", "is empty", nullptr},
    {"header_only.msh", "without a $Nodes", nullptr},
    {"truncated_in_nodes.msh", ":201: node 191", nullptr},
    {"truncated_in_elements.msh", ":2153: element 16", nullptr},
    {"nan_coordinate.msh", ":61: node 51: coordinate 'nan'", nullptr},
    {"inf_coordinate.msh", ":61: node 51: coordinate 'inf'", nullptr},
    {"overflow_coordinate.msh", "node 51 has a coordinate beyond", nullptr},
    {"index_out_of_range.msh", ":1171: tet 11 (element 705) refers to node '999999'", nullptr},
    {"index_zero.msh", ":1171: tet 11 (element 705) refers to node '0'", nullptr},
    {"index_negative.msh", ":1171: tet 11 (element 705) refers to node '-3'", nullptr},
    {"index_int_overflow.msh", "tet 11 (element 705) refers to node '4294967297'", nullptr},
    {"repeated_node_in_tet.msh", ":1171: tet 11 (element 705) uses node 42 twice", nullptr},
    {"inverted_tets_10pct.msh", nullptr, "turned 155 of 1557 tets"},
    {"zero_volume_tets.msh", "element 695 is flat", nullptr},
    {"tangled.msh", "is tangled: element 695 and 1584", nullptr},
    {"duplicate_vertices.msh", nullptr, "welded 5775 nodes"},
    {"duplicate_tets.msh", nullptr, "dropped 20 tets that were listed twice"},
    {"face_shared_by_three.msh", "belongs to three tets (element 1072, 1558, 1559)", nullptr},
    {"unused_nodes.msh", nullptr, "dropped 30 nodes"},
    {"two_parts.msh", nullptr, "2 separate pieces"},
    {"units_mm.msh",
     "larger than 2 m: if the file is in millimetres, import it with "
     "trocar-organ import --unit mm",
     nullptr},
    {"all_nodes_equal.msh", "all nodes are at the same position", nullptr},
    {"far_from_origin.msh", nullptr, "far from the origin"},
    {"mesh_2d.msh", "no tetrahedra", nullptr},
    {"hexahedron.msh", "type 5 (hexahedron), which is not supported", nullptr},
    {"unknown_element_type.msh", "type 77", nullptr},
    {"huge_node_count.msh", "announces 4000000000 nodes", nullptr},
    {"huge_element_count.msh", "announces 9223372036854775807 elements", nullptr},
    {"negative_count.msh", "announces -5 elements", nullptr},
    {"bad_version.msh", ":2: is Gmsh version '9.9'", nullptr},
    {"not_a_mesh.msh", "does not begin with $MeshFormat", nullptr},
    {"comma_decimals.msh", "write decimals with a point", nullptr},
    {"duplicate_node_id.msh", "node number 7 is given twice", nullptr},
    {"truncated.vtk", ":459: announces 7785 numbers of cells", nullptr},
    {"inverted_all.vtk", nullptr, "turned 1557 of 1557 tets"},
    {"huge_points.vtk", ":5: announces 2000000000 points", nullptr},
    {"huge_binary_points.vtk", ":5: announces 1000000000 points", nullptr},
    {"huge_triangle_count.stl", "announces 4294967295 triangles", nullptr},
    {"surface_nan.stl", "triangle 49: a coordinate of corner 2 is not a finite number", nullptr},
    {"surface_open.obj", "is not closed, 40 edges", nullptr},
    {"surface_flipped_faces.obj", nullptr, "turned 200 of 1990 triangles"},
    {"surface_nonmanifold_edge.obj", "edge from vertex 243 to 328", nullptr},
    {"surface_index_out_of_range.obj", "refers to vertex 500001, the file has 997", nullptr},
    {"surface_self_intersecting.obj", "11 pairs of faces intersect", nullptr},
    {"ok_crlf.msh", nullptr, nullptr},
    {"ok_sparse_shuffled_ids.msh", nullptr, nullptr},
    {"ok_comments_extra_sections.msh", nullptr, nullptr},
};

// Expects the same mesh, whatever its numbering.
void expect_same_shape(const TetMesh& a, const TetMesh& b, double tolerance_m) {
  const auto sorted = [](const TetMesh& mesh) {
    std::vector<std::array<double, 3>> points;
    for (const Vec3d& p : mesh.rest_positions) points.push_back({p.x, p.y, p.z});
    std::sort(points.begin(), points.end());
    return points;
  };
  EXPECT_EQ(a.tets.size(), b.tets.size());
  EXPECT_EQ(a.edges.size(), b.edges.size());
  EXPECT_EQ(a.boundary_triangles.size(), b.boundary_triangles.size());
  EXPECT_NEAR(total_volume(a), total_volume(b), 1e-3 * total_volume(b));
  if (tolerance_m > 0) return;
  EXPECT_EQ(sorted(a), sorted(b));
}

TEST(SharedMeshes, EachBrokenFileHasItsOutcome) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/broken");
  const auto folder = trocar::testing::shared_folder() / "organs/broken";
  const auto whole = read_gmsh(trocar::testing::shared_folder() / "organs/liver_tiny.msh");
  ASSERT_TRUE(whole.ok()) << whole.error().message;
  std::set<std::string> expected;
  for (const Expected& outcome : kOutcomes) {
    SCOPED_TRACE(outcome.file);
    expected.insert(outcome.file);
    const auto result = outcome_of(folder / outcome.file);
    if (outcome.rejected_with) {
      EXPECT_NE(result.error.find(outcome.rejected_with), std::string::npos) << result.error;
      continue;
    }
    EXPECT_EQ(result.error, "");
    ASSERT_EQ(result.warnings.size(), outcome.warned_with ? 1u : 0u);
    if (outcome.warned_with) {
      EXPECT_NE(result.warnings[0].find(outcome.warned_with), std::string::npos)
          << result.warnings[0];
    }
    if (!result.mesh) continue;
    EXPECT_TRUE(validate(result.mesh->mesh));
    if (std::string(outcome.file) == "two_parts.msh") continue;
    const bool is_far = std::string(outcome.file) == "far_from_origin.msh";
    expect_same_shape(result.mesh->mesh, whole->mesh, is_far ? 1e-6 : 0);
  }
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".md") continue;
    EXPECT_TRUE(expected.contains(entry.path().filename().string()))
        << entry.path() << " has no outcome in this test";
  }
}

// The table of that folder's README, row by row: rejected in one line with the file's name,
// repaired and said with a number, or accepted.
TEST(SharedMeshes, OutcomesAreThoseOfTheirTable) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/broken/README.md");
  const auto folder = trocar::testing::shared_folder() / "organs/broken";
  std::ifstream readme(folder / "README.md");
  int rows = 0;
  for (std::string line; std::getline(readme, line);) {
    std::vector<std::string> cells;
    std::stringstream parts(line);
    for (std::string cell; std::getline(parts, cell, '|');) cells.push_back(cell);
    if (cells.size() < 4 || cells[1].find('.') == std::string::npos) continue;
    const auto trim = [](std::string text) {
      text.erase(0, text.find_first_not_of(' '));
      return text.substr(0, text.find_last_not_of(' ') + 1);
    };
    const std::string file = trim(cells[1]), wanted = trim(cells[3]);
    SCOPED_TRACE(file + ": " + wanted);
    ++rows;
    const auto result = outcome_of(folder / file);
    if (wanted.starts_with("reject")) {
      EXPECT_NE(result.error.find(file), std::string::npos) << result.error;
      EXPECT_EQ(result.error.find('\n'), std::string::npos) << result.error;
      continue;
    }
    EXPECT_EQ(result.error, "");
    if (wanted == "ACCEPT") {
      EXPECT_TRUE(result.warnings.empty());
      continue;
    }
    ASSERT_EQ(result.warnings.size(), 1u);
    EXPECT_NE(result.warnings[0].find_first_of("0123456789"), std::string::npos);
  }
  EXPECT_EQ(rows, 47);
}

TEST(SharedMeshes, MillimetresAreAcceptedWhenSaid) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/broken");
  const auto result =
      read_gmsh(trocar::testing::shared_folder() / "organs/broken/units_mm.msh", Unit::Millimetre);
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_NEAR(total_volume(result->mesh), 2.05e-3, 0.01e-3);
}

TEST(SharedMeshes, AnnouncedCountsTakeNoMemory) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/broken");
  const auto folder = trocar::testing::shared_folder() / "organs/broken";
  rusage before{}, after{};
  getrusage(RUSAGE_SELF, &before);
  for (const char* file : {"huge_node_count.msh", "huge_element_count.msh", "huge_points.vtk",
                           "huge_binary_points.vtk", "huge_triangle_count.stl"})
    EXPECT_NE(outcome_of(folder / file).error, "");
  getrusage(RUSAGE_SELF, &after);
  EXPECT_LT(after.ru_maxrss - before.ru_maxrss, 8 * 1024) << "KiB";
}

TEST(SharedMeshes, RealOrgansHaveTheStatedCounts) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/liver_coarse.msh");
  struct Counts {
    const char* file;
    std::size_t nodes, tets, edges, triangles;
    double min_deg, max_deg;
  };
  for (const Counts& c : {Counts{"liver_tiny.msh", 453, 1557, 2356, 694, 12.0, 161.2},
                          Counts{"liver_coarse.msh", 3796, 17984, 23330, 3102, 13.2, 155.6},
                          Counts{"liver_fine.msh", 16961, 71183, 97714, 19142, 12.0, 161.7},
                          Counts{"gallbladder_wall.msh", 998, 2982, 4974, 1990, 4.1, 164.7},
                          Counts{"stomach_wall.msh", 2754, 8439, 13927, 5472, 7.1, 164.9},
                          Counts{"liver_tiny.vtk", 453, 1557, 2356, 694, 12.0, 161.2},
                          Counts{"liver_coarse.vtk", 3796, 17984, 23330, 3102, 13.2, 155.6},
                          Counts{"liver_coarse_v41.msh", 3796, 17984, 23330, 3102, 13.2, 155.6}}) {
    const auto result = read_gmsh(trocar::testing::shared_folder() / "organs" / c.file);
    ASSERT_TRUE(result.ok()) << result.error().message;
    EXPECT_TRUE(result->warnings.empty()) << c.file;
    EXPECT_EQ(result->mesh.node_count(), c.nodes) << c.file;
    EXPECT_EQ(result->mesh.tets.size(), c.tets) << c.file;
    EXPECT_EQ(result->mesh.edges.size(), c.edges) << c.file;
    EXPECT_EQ(result->mesh.boundary_triangles.size(), c.triangles) << c.file;
    const auto angles = dihedral_range(result->mesh);
    EXPECT_NEAR(angles.min_deg, c.min_deg, 0.06) << c.file;
    EXPECT_NEAR(angles.max_deg, c.max_deg, 0.06) << c.file;
  }
}

TEST(SharedMeshes, OrgansWithoutUnitAreRead) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/sofa_liver_181.msh");
  const auto folder = trocar::testing::shared_folder() / "organs";
  // Their unit is none; a hundredth of it is a size that an organ may have.
  const auto first = read_gmsh(folder / "sofa_liver_181.msh", Unit::Centimetre);
  ASSERT_TRUE(first.ok()) << first.error().message;
  EXPECT_EQ(first->mesh.node_count(), 181u);
  EXPECT_EQ(first->mesh.tets.size(), 596u);
  const auto second = read_gmsh(folder / "sofa_liver2_507.msh", Unit::Centimetre);
  ASSERT_TRUE(second.ok()) << second.error().message;
  EXPECT_EQ(second->mesh.node_count(), 507u);
  EXPECT_EQ(second->mesh.tets.size(), 1493u);
}

TEST(SharedMeshes, RealSurfacesAreClosed) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/liver_surface_m.obj");
  struct Surface {
    const char* file;
    Unit unit;
    std::size_t vertices, triangles;
    double volume_ml, tolerance_ml;  // as the folder's README rounds them
  };
  for (const Surface& s :
       {Surface{"liver_surface_m.obj", Unit::Metre, 17951, 35898, 2140, 5},
        Surface{"liver_surface_mm.stl", Unit::Millimetre, 17951, 35898, 2140, 5},
        Surface{"stomach_surface_mm.stl", Unit::Millimetre, 5587, 11170, 190, 1},
        Surface{"gallbladder_surface_m.obj", Unit::Metre, 997, 1990, 5.1, 0.05}}) {
    const auto path = trocar::testing::shared_folder() / "organs" / s.file;
    auto file = read_mesh_file(path);
    ASSERT_TRUE(file.ok()) << file.error().message;
    const auto solid =
        surface::check_surface(std::get<surface::RawSurface>(std::move(*file)), s.unit, s.file);
    ASSERT_TRUE(solid.ok()) << solid.error().message;
    EXPECT_TRUE(solid->warnings.empty()) << s.file << ": " << solid->warnings[0];
    EXPECT_EQ(solid->positions.size(), s.vertices);
    EXPECT_EQ(solid->triangles.size(), s.triangles);
    EXPECT_NEAR(1e6 * solid->volume_m3, s.volume_ml, s.tolerance_ml) << s.file;
  }
}

TEST(SharedMeshes, PolygonsOfVtkAreRead) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/sofa_liver_surface_binary.vtk");
  const auto folder = trocar::testing::shared_folder() / "organs";
  for (const auto& [name, triangles] :
       {std::pair("stomach_surface_voxel_units_original.vtk", 11170u),
        std::pair("sofa_liver_surface_binary.vtk", 10000u)}) {
    const auto file = read_mesh_file(folder / name);
    ASSERT_TRUE(file.ok()) << file.error().message;
    EXPECT_EQ(std::get<surface::RawSurface>(*file).triangles.size(), triangles);
  }
}

}  // namespace
}  // namespace trocar::formats
