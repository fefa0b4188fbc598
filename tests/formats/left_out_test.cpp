// All that a file says twice, otherwise than its neighbours do, or beside its mesh is taken, or a
// line says that it is not.

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstdint>

#include "server/organs/formats/mesh_file.h"
#include "tests/support/files.h"

namespace trocar::formats {
namespace {

using Lines = std::vector<std::string>;

mesh::ImportedMesh imported(const std::string& text, const std::string& name) {
  auto file = parse_mesh(text, name);
  if (!file.ok() || !std::holds_alternative<mesh::RawTets>(*file)) {
    ADD_FAILURE() << (file.ok() ? "a surface" : file.error().message);
    return {};
  }
  auto mesh = mesh::make_mesh(std::get<mesh::RawTets>(std::move(*file)), mesh::Unit::Metre, name);
  if (!mesh.ok()) ADD_FAILURE() << mesh.error().message;
  return mesh.ok() ? std::move(*mesh) : mesh::ImportedMesh{};
}
std::string error_in(const std::string& text, const std::string& name) {
  const auto file = parse_mesh(text, name);
  return file.ok() ? "accepted" : file.error().message;
}
Lines names_of(const std::vector<mesh::NamedNodes>& sets) {
  Lines names;
  for (const auto& set : sets) names.push_back(set.name);
  return names;
}

const std::string kDeckNodes = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n5,0,0,-1\n";
const std::string kDeckTets = "*ELEMENT, TYPE=C3D4\n1,1,2,3,4\n2,1,3,2,5\n";
const std::string kDeck = kDeckNodes + kDeckTets;

TEST(LeftOut, SetsOfElementsAreTakenInTheOrderOfTheFile) {
  const auto mesh = imported(kDeck +
                                 "*ELSET, ELSET=Upper\n1\n*ELSET, ELSET=All\n1,2\n"
                                 "*ELSET, ELSET=Lower\n2\n*ELSET, ELSET=crest\n1\n",
                             "a.inp");
  EXPECT_EQ(names_of(mesh.regions), (Lines{"Lower", "crest"}));
  EXPECT_EQ(mesh.left_out,
            (Lines{"no region, as it holds all elements: 'All'",
                   "an element belongs to the last region that holds it, so these keep fewer: "
                   "'Upper: 0 of 1'"}));
}

TEST(LeftOut, SetsOfTrianglesAreSetsOfNodes) {
  const auto mesh = imported(
      kDeck +
          "*ELEMENT, TYPE=CPS3, ELSET=Surface1\n3,1,2,4\n4,1,3,4\n"
          "*ELEMENT, TYPE=T3D2\n5,1,2\n*ELEMENT, TYPE=R3D3\n6,1,2,3\n*ELSET, ELSET=hilum\n3\n",
      "a.inp");
  ASSERT_EQ(names_of(mesh.node_sets), (Lines{"Surface1", "hilum"}));
  EXPECT_EQ(mesh.node_sets[0].nodes.size(), 4u);
  EXPECT_EQ(mesh.node_sets[1].nodes, (std::vector{NodeIndex(0), NodeIndex(1), NodeIndex(3)}));
  EXPECT_EQ(mesh.left_out, Lines{"left out 2 triangles and lines of no set"});
}

TEST(LeftOut, LinesThatEndWithACommaGoOn) {
  const auto mesh = imported(kDeckNodes +
                                 "*ELEMENT, TYPE=C3D4,\n ELSET=LEFT\n1,1,2,\n3,4\n"
                                 "*ELEMENT,\nTYPE=C3D4, ELSET=RIGHT\n2,1,3,2,5\n",
                             "a.inp");
  EXPECT_EQ(names_of(mesh.regions), (Lines{"LEFT", "RIGHT"}));
  EXPECT_NE(error_in(kDeckNodes + "*ELEMENT, TYPE=C3D4\n1,1,2\n3,4\n", "a.inp").find("node ''"),
            std::string::npos);
}

TEST(LeftOut, WhatADeckMakesOrMovesIsRefusedOrSaid) {
  const auto expect = [](const std::string& text, const char* part) {
    EXPECT_NE(error_in(text, "a.inp").find(part), std::string::npos) << error_in(text, "a.inp");
  };
  expect(kDeck + "*INSTANCE, NAME=A\n*INSTANCE, NAME=B\n", "a second *INSTANCE");
  expect("*NODE, SYSTEM=C\n1,0,0,0\n", "*NODE, SYSTEM=C: save the nodes in rectangular");
  expect("*SYSTEM\n1,0,0\n" + kDeck, "*SYSTEM makes nodes or elements");
  expect(kDeck + "*NGEN\n1,4,1\n", "*NGEN makes nodes or elements");
  expect(kDeck + "*NSET, NSET=A, ELSET=B\n", "*NSET of the nodes of a set of elements");
  const auto mesh = imported("*HEADING\nx\n*PART, NAME=P\n" + kDeck +
                                 "*END PART\n*INSTANCE, NAME=I, PART=P\n100.,0.,0.\n"
                                 "*END INSTANCE\n*MATERIAL, NAME=M\n*ELASTIC\n1.,0.\n*ELASTIC\n",
                             "a.inp");
  EXPECT_EQ(mesh.left_out, Lines{"left out: 'the position of *INSTANCE', '*MATERIAL', '*ELASTIC'"});
}

const std::string kGroups =
    "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n4\n2 1 \"rim\"\n2 2 \"hilum\"\n"
    "3 3 \"whole\"\n3 4 \"tip\"\n$EndPhysicalNames\n$Entities\n0 0 2 2\n"
    "1 0 0 0 1 1 1 2 1 2 0\n2 0 0 0 1 1 1 0 0\n1 0 0 0 1 1 1 1 3 0\n2 0 0 0 1 1 1 2 3 -4 0\n"
    "$EndEntities\n$Nodes\n1 5 1 5\n3 1 0 5\n1\n2\n3\n4\n5\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 -1\n"
    "$EndNodes\n$Elements\n4 4 1 4\n2 1 2 1\n1 1 2 4\n2 2 2 1\n2 1 3 4\n3 1 4 1\n3 1 2 3 4\n"
    "3 2 4 1\n4 1 3 2 5\n$EndElements\n";

TEST(LeftOut, AnEntityMayBeInSeveralPhysicalGroups) {
  const auto mesh = imported(
      kGroups + "$NodeData\n1\n\"heat\"\n$EndNodeData\n$Comments\n$EndComments\n", "a.msh");
  ASSERT_EQ(names_of(mesh.node_sets), (Lines{"rim", "hilum"}));
  EXPECT_EQ(mesh.node_sets[0].nodes, mesh.node_sets[1].nodes);
  EXPECT_EQ(names_of(mesh.regions), (Lines{"rest", "tip"}));
  EXPECT_EQ(mesh.left_out, (Lines{"no region, as it holds all elements: 'whole'",
                                  "left out 1 points, lines and triangles of no physical group",
                                  "left out: '$NodeData'"}));
}

// Gmsh 2.2 lists it once for each group, 4.1 says the groups of the entity.
TEST(LeftOut, ATetThatIsListedOnceForEachGroupIsOneOfTheLast) {
  const auto mesh = imported(
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n"
      "5 0 0 -1\n$EndNodes\n$Elements\n3\n1 4 2 7 1 1 2 3 4\n2 4 2 8 1 1 3 2 5\n"
      "1 4 2 9 1 1 2 3 4\n$EndElements\n",
      "a.msh");
  EXPECT_EQ(names_of(mesh.regions), (Lines{"region 8", "region 9"}));
  EXPECT_EQ(mesh.mesh.tets.size(), 2u);
  EXPECT_EQ(mesh.left_out, Lines{"an element belongs to the last region that holds it, so these "
                                 "keep fewer: 'region 7: 0 of 1'"});
  EXPECT_EQ(mesh.warnings, Lines{});
}

TEST(LeftOut, VolumesOfNoPhysicalGroupAreSaid) {
  const auto mesh = imported(
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n"
      "5 0 0 -1\n$EndNodes\n$Elements\n2\n1 4 2 0 1 1 2 3 4\n2 4 2 0 2 1 3 2 5\n$EndElements\n",
      "a.msh");
  EXPECT_EQ(mesh.left_out, Lines{"no regions: its 2 volumes are in no physical group"});
}

TEST(LeftOut, WhatSurfacesHaveBesideTheirShapeIsSaid) {
  const auto said = [](const std::string& text, const std::string& name) {
    const auto file = parse_mesh(text, name);
    EXPECT_TRUE(file.ok()) << file.error().message;
    return file.ok() ? std::get<surface::RawSurface>(*file).left_out : Lines{};
  };
  EXPECT_EQ(said("ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                 "property float z\nproperty float nx\nproperty uchar red\nelement face 1\n"
                 "property list uchar int vertex_indices\nproperty int label\nend_header\n"
                 "0 0 0 0 1\n1 0 0 0 2\n0 1 0 0 3\n3 0 1 2 7\n",
                 "a.ply"),
            (Lines{"left out of each vertex: 'red'", "left out of each face: 'label'"}));
  const std::string corners = "o all\nv 0 0 0\nv 1 0 0\nv 0 1 0\n", face = "f 1 2 3\n";
  EXPECT_EQ(said(corners + "usemtl red paint\n" + face, "a.obj"),
            (Lines{"left out the names of materials: 'red paint'",
                   "left out the names of objects: 'all'"}));
  EXPECT_EQ(said(corners.substr(6) + "g lobe\n" + face + "g vein lobe\ng\n" + face, "a.obj"),
            Lines{"left out the names of groups: 'lobe', 'vein'"});
}

TEST(LeftOut, NamesOfSolidsAndColoursOfStlAreSaid) {
  const auto said = [](const std::string& text) {
    const auto file = parse_mesh(text, "a.stl");
    EXPECT_TRUE(file.ok()) << file.error().message;
    return file.ok() ? std::get<surface::RawSurface>(*file).left_out : Lines{};
  };
  const auto solid = [](const std::string& name) {
    return "solid " + name +
           "\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
           "endloop\nendfacet\nendsolid\n";
  };
  EXPECT_EQ(said(solid("liver")), Lines{"left out the names of solids: 'liver'"});
  EXPECT_EQ(said(solid("the liver") + solid("Foie") + solid("")),
            Lines{"left out the names of solids: 'Foie', 'the liver'"});
  EXPECT_EQ(said(solid("")), Lines{});
  std::string binary(84 + 50, '\0');
  binary[80] = 1;
  EXPECT_EQ(said(binary), Lines{});
  binary.back() = 'c';
  EXPECT_EQ(said(binary), Lines{"left out the attributes, such as colours, of 1 triangles"});
}

std::string of_vtk(const std::string& data) {
  return "# vtk DataFile Version 3.0\na\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 double\n"
         "0 0 0 1 0 0 0 1 0 0 0 1 0 0 -1\nCELLS 3 14\n4 0 1 2 3\n4 0 2 1 4\n3 0 1 3\n"
         "CELL_TYPES 3\n10\n10\n5\n" +
         data;
}

TEST(LeftOut, LabelsThatAreStoredAsFractionsAreRegions) {
  const auto mesh = imported(
      of_vtk("CELL_DATA 3\nSCALARS label float\nLOOKUP_TABLE default\n1.0\n2.0\n0\n"), "a.vtk");
  EXPECT_EQ(names_of(mesh.regions), (Lines{"region 1", "region 2"}));
  const auto parts =
      imported(of_vtk("CELL_DATA 3\nSCALARS label double\nLOOKUP_TABLE default\n1 2.5 "
                      "0\nSCALARS heat int\nLOOKUP_TABLE default\n1 2 3\n"
                      "POINT_DATA 5\nSCALARS wet int\nLOOKUP_TABLE default\n1 2 3 4 5"),
               "a.vtk");
  EXPECT_TRUE(parts.regions.empty());
  EXPECT_EQ(parts.left_out,
            (Lines{"left out 1 points, lines and triangles",
                   "left out: cell data 'label', which is no whole number in cell 1, cell data "
                   "'heat', point data 'wet'"}));
}

std::string of_vtu(const std::string& data) {
  return "<VTKFile type=\"UnstructuredGrid\" version=\"0.1\"><UnstructuredGrid>"
         "<Piece NumberOfPoints=\"5\" NumberOfCells=\"2\"><Points>"
         "<DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">"
         "0 0 0 1 0 0 0 1 0 0 0 1 0 0 -1</DataArray></Points><Cells>"
         "<DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">0 1 2 3 0 2 1 4"
         "</DataArray><DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">4 8</DataArray>"
         "<DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">10 10</DataArray></Cells>" +
         data + "</Piece></UnstructuredGrid></VTKFile>";
}
std::string array_of(const std::string& type, const std::string& name, const std::string& values) {
  return "<DataArray type=\"" + type + "\" Name=\"" + name + "\" format=\"ascii\">" + values +
         "</DataArray>";
}

TEST(LeftOut, TheSameOfTheFormatInXml) {
  const auto mesh = imported(
      of_vtu("<CellData>" + array_of("Float32", "label", "3 4") + array_of("Int32", "part", "1 2") +
             "</CellData><PointData>" + array_of("Int32", "heat", "1 2 3 4 5") + "</PointData>"),
      "a.vtu");
  EXPECT_EQ(names_of(mesh.regions), (Lines{"region 3", "region 4"}));
  EXPECT_EQ(mesh.left_out, Lines{"left out: cell data 'part', point data 'heat'"});
  const auto parts = imported(
      of_vtu("<CellData>" + array_of("Float32", "label", "3 4.5") + "</CellData>"), "a.vtu");
  EXPECT_EQ(parts.left_out,
            Lines{"left out: cell data 'label', which is no whole number in cell 1"});
}

std::string big_endian(std::initializer_list<std::uint32_t> numbers) {
  std::string bytes;
  for (const auto number : numbers)
    for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(number >> shift & 255);
  return bytes;
}

TEST(LeftOut, NumbersOfVtkIdTypeHaveFourBytes) {
  const auto real = [](float value) { return std::bit_cast<std::uint32_t>(value); };
  const auto one = real(1), less = real(-1);
  const auto mesh = imported(
      "# vtk DataFile Version 3.0\na\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 float\n" +
          big_endian({0, 0, 0, one, 0, 0, 0, one, 0, 0, 0, one, 0, 0, less}) + "\nCELLS 2 10\n" +
          big_endian({4, 0, 1, 2, 3, 4, 0, 2, 1, 4}) + "\nCELL_TYPES 2\n" + big_endian({10, 10}) +
          "\nCELL_DATA 2\nFIELD f 2\nvtkOriginalCellIds 1 2 vtkIdType\n" + big_endian({0, 1}) +
          "\nlabel 1 2 vtkIdType\n" + big_endian({5, 6}) + "\n",
      "a.vtk");
  EXPECT_EQ(names_of(mesh.regions), (Lines{"region 5", "region 6"}));
}

TEST(LeftOut, AByteOrderMarkIsNoText) {
  const std::string mark = "\xef\xbb\xbf";
  EXPECT_EQ(imported(mark + kDeck, "a.inp").mesh.tets.size(), 2u);
  EXPECT_EQ(imported(mark + kGroups, "a.msh").mesh.tets.size(), 2u);
  EXPECT_EQ(imported(mark + of_vtk(""), "a").mesh.tets.size(), 2u);
  EXPECT_EQ(imported(mark + of_vtu(""), "a.vtu").mesh.tets.size(), 2u);
  EXPECT_EQ(error_in("\xff\xfe*\0N\0", "a.inp"), "a.inp: is in UTF-16: save it in UTF-8");
  const trocar::testing::TemporaryFolder folder;
  const auto path = folder.file("a.node");
  std::ofstream(path) << mark << "4 3 1 0\n1 0 0 0 9\n2 1 0 0 9\n3 0 1 0 9\n4 0 0 1 9\n";
  std::ofstream(folder.file("a.ele")) << mark << "1 4 1\n1 1 2 3 4 2.0\n";
  const auto tetgen = read_mesh_file(path);
  ASSERT_TRUE(tetgen.ok()) << tetgen.error().message;
  EXPECT_EQ(std::get<mesh::RawTets>(*tetgen).left_out,
            Lines{"left out the attributes and markers of points"});
  std::ofstream(folder.file("a.ele")) << "1 4 1\n1 1 2 3 4 2.5\n";
  EXPECT_NE(read_mesh_file(path).error().message.find("its region must be a whole number"),
            std::string::npos);
}

TEST(LeftOut, LinesAndPointsOfSurfacesAreCounted) {
  const auto left_out = [](const std::string& text, const std::string& name) {
    const auto file = parse_mesh(text, name);
    return file.ok() ? std::get<surface::RawSurface>(*file).left_out : Lines{file.error().message};
  };
  EXPECT_EQ(left_out("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nl 1 2\np 1\n", "a.obj"),
            Lines{"left out 2 points and lines"});
  EXPECT_EQ(left_out("ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                     "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
                     "element edge 1\nproperty int vertex1\nend_header\n0 0 0\n1 0 0\n0 1 0\n"
                     "3 0 1 2\n0\n",
                     "a.ply"),
            Lines{"left out 1 elements 'edge'"});
  EXPECT_EQ(left_out("# vtk DataFile Version 3.0\na\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n"
                     "0 0 0 1 0 0 0 1 0\nLINES 1 3\n2 0 1\nPOLYGONS 1 4\n3 0 1 2\n",
                     "a.vtk"),
            Lines{"left out 1 points and lines"});
}

TEST(LeftOut, KeywordsOfStlAreOfEitherCase) {
  std::string text =
      "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
      "endloop\nendfacet\nendsolid a\n";
  std::ranges::transform(text, text.begin(), [](char c) { return std::toupper(c); });
  for (const auto& one : {text, "\xef\xbb\xbf" + text}) {
    const auto file = parse_mesh(one, "a.stl");
    ASSERT_TRUE(file.ok()) << file.error().message;
    EXPECT_EQ(std::get<surface::RawSurface>(*file).triangles.size(), 1u);
  }
}

}  // namespace
}  // namespace trocar::formats
