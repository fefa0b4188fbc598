// The reader over real organs and over every damaged file of the shared test material.

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "server/organs/mesh/gmsh_reader.h"
#include "tests/support/shared.h"

namespace trocar::mesh {
namespace {

struct Outcome {
  const char* file;
  const char* rejected_with;  // part of the error; null: accepted
  const char* warned_with;    // part of the only warning; null: none
};

// One line per .msh file in organs/broken, as that folder's README states.
constexpr Outcome kOutcomes[] = {
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
    {"all_nodes_equal.msh", "all nodes are at the same place", nullptr},
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
  for (const Outcome& outcome : kOutcomes) {
    expected.insert(outcome.file);
    const auto result = read_gmsh(folder / outcome.file);
    if (outcome.rejected_with) {
      ASSERT_FALSE(result.ok()) << outcome.file << " was accepted";
      const std::string& text = result.error().message;
      EXPECT_NE(text.find(outcome.rejected_with), std::string::npos) << text;
      EXPECT_EQ(result.error().code, ErrorCode::BadFile);
      continue;
    }
    ASSERT_TRUE(result.ok()) << result.error().message;
    EXPECT_TRUE(validate(result->mesh));
    ASSERT_EQ(result->warnings.size(), outcome.warned_with ? 1u : 0u) << outcome.file;
    if (outcome.warned_with) {
      EXPECT_NE(result->warnings[0].find(outcome.warned_with), std::string::npos)
          << result->warnings[0];
    }
    if (std::string(outcome.file) == "two_parts.msh") continue;
    const bool is_far = std::string(outcome.file) == "far_from_origin.msh";
    expect_same_shape(result->mesh, whole->mesh, is_far ? 1e-6 : 0);
  }
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".msh") {
      EXPECT_TRUE(expected.contains(entry.path().filename().string()))
          << entry.path() << " has no outcome in this test";
    }
  }
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
  for (const char* file : {"huge_node_count.msh", "huge_element_count.msh"})
    EXPECT_FALSE(read_gmsh(folder / file).ok());
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
                          Counts{"stomach_wall.msh", 2754, 8439, 13927, 5472, 7.1, 164.9}}) {
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

}  // namespace
}  // namespace trocar::mesh
