#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "server/organs/formats/abaqus_reader.h"
#include "server/organs/formats/medit_reader.h"
#include "server/organs/formats/tetgen_reader.h"
#include "tests/formats/reader_samples.h"

namespace trocar::formats {
namespace {

using testing::changed;
using testing::error_of;
using testing::kAbaqus;
using testing::kMedit;
using testing::kTetgenElements;
using testing::kTetgenNodes;

TEST(MeditReader, ReadsTetsRegionsAndSets) {
  const auto raw = parse_medit(kMedit, "a.mesh");
  ASSERT_TRUE(raw.ok()) << raw.error().message;
  EXPECT_EQ(raw->tets.size(), 1u);
  EXPECT_EQ(raw->tet_regions, std::vector<std::int64_t>{7});
  ASSERT_EQ(raw->node_sets.size(), 2u);
  EXPECT_EQ(raw->node_sets[0].name, "5");
  EXPECT_EQ(raw->node_sets[0].nodes.size(), 3u);
  EXPECT_EQ(raw->node_sets[1].nodes, std::vector{NodeIndex(3)});
}

TEST(MeditReader, EachBlockMayHaveItsListOfTets) {
  const auto text =
      changed(changed(kMedit, "Vertices\n4", "Vertices\n5"), "0 0 1 9\n", "0 0 1 9\n0 0 -1 0\n");
  const auto raw =
      parse_medit(changed(text, "Corners", "Tetrahedra\n1\n1 3 2 5 8\nCorners"), "a.mesh");
  ASSERT_TRUE(raw.ok()) << raw.error().message;
  EXPECT_EQ(raw->tet_regions, (std::vector<std::int64_t>{7, 8}));
  EXPECT_EQ(raw->element_ids, (std::vector<std::int64_t>{1, 2}));
}

TEST(MeditReader, ErrorsSayWhereAndWhat) {
  const auto expect = [](const std::string& text, const char* part) {
    ASSERT_FALSE(text.empty()) << part;
    EXPECT_NE(error_of(text, "a.mesh").find(part), std::string::npos) << error_of(text, "a.mesh");
  };
  expect(changed(kMedit, "Dimension\n3", "Dimension\n2"), "has dimension 2, must be 3");
  expect(changed(kMedit, "Vertices\n4", "Vertices\n4000000000"), "announces 4000000000 Vertices");
  expect(changed(kMedit, "1 2 3 4 7", "1 2 3 8 7"), "element 1 refers to node 8");
  expect(changed(kMedit, "1 2 3 4 7", "1 2 3 3 7"), "element 1 uses node 3 twice");
  expect(changed(kMedit, "Tetrahedra", "Hexahedra"), "has Hexahedra");
  expect(changed(kMedit, "Corners", "Coroners"), "keyword 'Coroners' is not known");
  expect(changed(kMedit, "0 1 0 0", "0 1 inf 0"), "node 3: coordinate 'inf'");
  expect(kMedit.substr(0, kMedit.find("0 0 1 9") + 4), "it is cut off");
}

TEST(AbaqusReader, ReadsTetsRegionsAndSets) {
  const auto raw = parse_abaqus(kAbaqus, "a.inp");
  ASSERT_TRUE(raw.ok()) << raw.error().message;
  ASSERT_EQ(raw->tets.size(), 2u);
  // The set of all elements is no region; what is in none is the rest.
  EXPECT_EQ(raw->tet_regions, (std::vector<std::int64_t>{0, 2}));
  EXPECT_EQ(raw->region_names.at(2), "TUMOUR");
  EXPECT_EQ(raw->region_names.at(0), "rest");
  ASSERT_EQ(raw->node_sets.size(), 2u);
  EXPECT_EQ(raw->node_sets[1].name, "BASE");
  EXPECT_EQ(raw->node_sets[1].nodes, (std::vector{NodeIndex(0), NodeIndex(1), NodeIndex(2)}));
  const auto mesh = mesh::make_mesh(*raw, mesh::Unit::Metre, "a.inp");
  ASSERT_TRUE(mesh.ok()) << mesh.error().message;
  ASSERT_EQ(mesh->regions.size(), 2u);
  EXPECT_EQ(mesh->regions[1].name, "TUMOUR");
  EXPECT_EQ(mesh->regions[1].nodes.size(), 4u);
}

TEST(AbaqusReader, ErrorsSayWhereAndWhat) {
  const auto expect = [](const std::string& text, const char* part) {
    ASSERT_FALSE(text.empty()) << part;
    EXPECT_NE(error_of(text, "a.inp").find(part), std::string::npos) << error_of(text, "a.inp");
  };
  expect(changed(kAbaqus, "C3D4", "C3D10"), "a.inp:10: elements of type 'C3D10'");
  expect(changed(kAbaqus, "2, 11, 13, 12, 15", "2, 11, 13, 12, 16"),
         "a.inp:12: element 2 refers to node 16");
  expect(changed(kAbaqus, "12, 1., 0., 0.", "12, 1., 0."), "node 12: coordinate ''");
  expect(changed(kAbaqus, "12, 1., 0., 0.", "11, 1., 0., 0."), "node number 11 is given twice");
  expect(changed(kAbaqus, "2, 11, 13, 12, 15", "1, 11, 13, 12, 15"),
         "element number 1 is given twice");
  expect(changed(kAbaqus, "*HEADING", "*INCLUDE, INPUT=b.inp"), "reads another file");
  expect(changed(kAbaqus, "11, 13, 1\n", "11, 9000000000000, 1\n"), "a range must ascend");
  expect("*HEADING\n", "the file ends without nodes");
}

TEST(TetgenReader, ReadsTwoFilesByEitherName) {
  const auto folder =
      std::filesystem::temp_directory_path() / ("trocar-tetgen-" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "a.node") << kTetgenNodes;
  std::ofstream(folder / "a.ele") << kTetgenElements;
  for (const char* name : {"a.node", "a.ele"}) {
    const auto read = read_mesh_file(folder / name);
    ASSERT_TRUE(read.ok()) << read.error().message;
    const auto& raw = std::get<mesh::RawTets>(*read);
    EXPECT_EQ(raw.tets.size(), 1u);
    EXPECT_EQ(raw.tet_regions, std::vector<std::int64_t>{7});
  }
  std::filesystem::remove(folder / "a.node");
  const auto lost = read_mesh_file(folder / "a.ele");
  ASSERT_FALSE(lost.ok());
  EXPECT_NE(lost.error().message.find("a.node: cannot be opened"), std::string::npos);
  std::filesystem::remove_all(folder);
}

TEST(TetgenReader, ErrorsSayWhichFileAndWhere) {
  const auto expect = [](const std::string& nodes, const std::string& elements, const char* part) {
    const auto result = parse_tetgen(nodes, "a.node", elements, "a.ele");
    ASSERT_FALSE(result.ok()) << part;
    EXPECT_NE(result.error().message.find(part), std::string::npos) << result.error().message;
  };
  expect(changed(kTetgenNodes, "4 3 1 0", "5 3 1 0"), kTetgenElements,
         "the file ends inside the list of points");
  expect(changed(kTetgenNodes, "4 3 1 0", "3 3 1 0"), kTetgenElements,
         "a.node:6: more points than the first line announces");
  expect(changed(kTetgenNodes, "4 3 1 0", "4 2 1 0"), kTetgenElements, "has 2 coordinates");
  expect(kTetgenNodes, changed(kTetgenElements, "1 4 1", "1 10 1"), "has 10 nodes an element");
  expect(kTetgenNodes, changed(kTetgenElements, "0 0 1 2 3 7", "0 0 1 2 4 7"),
         "a.ele:2: element 0 refers to node 4");
  expect(kTetgenNodes, "9000000000 4 0\n", "announces 9000000000 elements");
}

TEST(MeshFile, ContentGoesBeforeTheName) {
  EXPECT_NE(error_of("MeshVersionFormatted 9", "a.msh").find("is version 9"), std::string::npos);
  EXPECT_NE(error_of("anything", "a.doc").find("is of no kind that can be imported"),
            std::string::npos);
  EXPECT_NE(error_of("", "a.inp").find("is empty"), std::string::npos);
  EXPECT_TRUE(is_mesh_file("A.STL"));
  EXPECT_FALSE(is_mesh_file("a.organ"));
}

}  // namespace
}  // namespace trocar::formats
