#include "server/organs/mesh/gmsh_reader.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <sstream>

namespace trocar::mesh {
namespace {

const std::string kHead = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n";
const std::string kNodes = "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n";
const std::string kElements = "$Elements\n1\n1 4 2 1 1 1 2 3 4\n$EndElements\n";

Result<ImportedMesh> parse(const std::string& text, Unit unit = Unit::Metre) {
  return parse_gmsh(text, unit, "a.msh");
}
std::string message(const std::string& text) {
  const auto result = parse(text);
  return result.ok() ? "accepted" : result.error().message;
}
// `text` with the first `from` replaced by `to`.
std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(GmshReader, ReadsATetAndCentresIt) {
  const auto result = parse(kHead + kNodes + kElements);
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_EQ(result->mesh.node_count(), 4u);
  EXPECT_EQ(result->mesh.boundary_triangles.size(), 4u);
  EXPECT_EQ(result->offset_m, (Vec3d{0.5, 0.5, 0.5}));
  EXPECT_EQ(result->mesh.rest_positions[1], (Vec3d{0.5, -0.5, -0.5}));
  EXPECT_TRUE(result->warnings.empty());
}

TEST(GmshReader, UnitsScale) {
  const auto mm = parse(kHead + kNodes + kElements, Unit::Millimetre);
  ASSERT_TRUE(mm.ok());
  EXPECT_NEAR(total_volume(mm->mesh), 1e-9 / 6, 1e-22);
  const auto cm = parse(kHead + kNodes + kElements, Unit::Centimetre);
  ASSERT_TRUE(cm.ok());
  EXPECT_NEAR(total_volume(cm->mesh), 1e-6 / 6, 1e-19);
  EXPECT_TRUE(parse_unit("m").ok() && parse_unit("cm").ok() && parse_unit("mm").ok());
  EXPECT_FALSE(parse_unit("inch").ok());
}

TEST(GmshReader, AcceptsOtherElementsTagsAndBlanks) {
  const auto result =
      parse(kHead + "$PhysicalNames\n1\n3 1 \"x\"\n$EndPhysicalNames\n\n" + kNodes +
            "$Elements\n4\n1 15 2 0 1 1\n2 1 0 1 2\n3 2 3 1 1 7 1 2 3\n"
            "\t9  4 4 1 1 1 0 1 2 3 4 \r\n$EndElements\n$NodeData\n1\n$EndNodeData");
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_EQ(result->mesh.tets.size(), 1u);
}

TEST(GmshReader, ErrorsSayWhereAndWhat) {
  const std::string good = kHead + kNodes + kElements;
  const auto expect = [](const std::string& text, const char* part) {
    EXPECT_NE(message(text).find(part), std::string::npos) << part << " / " << message(text);
  };
  expect("", "a.msh: is empty");
  expect("$NOD\n1\n", "a.msh:1: is Gmsh version 1");
  expect("# vtk DataFile Version 3.0\n", "a.msh:1: is a VTK file");
  expect(replaced(good, "2.2 0 8", "4.1 0 8"), "a.msh:2: is Gmsh version '4.1'");
  expect(replaced(good, "2.2 0 8", "2.2 1 8"), "a.msh:2: is a binary");
  expect(replaced(good, "2.2 0 8", "2.2 0 4"), "a.msh:2: format line");
  expect(replaced(good, "2 1 0 0", "2 1 x 0"), "a.msh:7: node 2: coordinate 'x'");
  expect(replaced(good, "2 1 0 0", "2 1 0"), "a.msh:7: node 2: coordinate ''");
  expect(replaced(good, "2 1 0 0", "2 1 0 0 0"), "a.msh:7: node 2: more than three");
  expect(replaced(good, "2 1 0 0", "0 1 0 0"), "a.msh:7: node number '0'");
  expect(replaced(good, "2 1 0 0", "2 1e999 0 0"), "node 2: coordinate '1e999'");
  expect(replaced(good, "$Nodes\n4", "$Nodes\n5"), "announced 5 nodes, found 4");
  expect(replaced(good, "$Nodes\n4", "$Nodes\n3"), "more nodes than the announced 3");
  expect(replaced(good, "$Nodes\n4", "$Nodes\nx"), "number of nodes is 'x'");
  expect(replaced(good, "$EndNodes\n", ""), "a.msh:10: expected $EndNodes, found '$Elements'");
  expect(replaced(good, "4 2 1 1 1 2 3 4", "4 2 1 1 1 2 3 9"),
         "a.msh:13: tet 1 (element 1) refers to node '9'");
  expect(replaced(good, "4 2 1 1 1 2 3 4", "4 2 1 1 1 2 3"), "refers to node ''");
  expect(replaced(good, "4 2 1 1 1 2 3 4", "4 2 1 1 1 2 3 4 4"), "more than 4 nodes");
  expect(replaced(good, "4 2 1 1 1 2 3 4", "4 -1 1 1 1 2 3 4"), "number of tags");
  expect(replaced(good, "4 2 1 1 1 2 3 4", "11 0 1 2 3 4"), "second order");
  expect(kHead + kElements + kNodes, "$Elements comes before $Nodes");
  expect(kHead + kNodes + kNodes + kElements, "a second $Nodes");
  expect(kHead + kNodes + kElements + kElements, "a second $Elements");
  expect(kHead + "loose\n" + kNodes + kElements, "a.msh:4: 'loose' is outside any section");
  expect(kHead + "$Odd\n1\n" + kNodes + kElements, "a.msh:4: section '$Odd' is never closed");
  expect(kHead + kNodes, "without an $Elements");
  expect(replaced(good, "2 1 0 0", std::string("2 \x1b[31m 0 0")), "coordinate '?[31m'");
}

TEST(GmshReader, EveryTruncationIsAnErrorOrTheWholeMesh) {
  const std::string good = kHead + kNodes + kElements;
  for (std::size_t n = 0; n < good.size(); ++n) {
    const auto result = parse(good.substr(0, n));
    // Without its last line end the file is whole.
    EXPECT_EQ(result.ok(), n + 1 == good.size()) << n;
  }
}

TEST(GmshReader, RandomDamageNeverGivesAnInvalidMesh) {
  const std::string good = kHead + kNodes + kElements;
  std::uint32_t state = 7;
  const auto random = [&](std::uint32_t below) {
    state = state * 1664525u + 1013904223u;
    return (state >> 8) % below;
  };
  for (int i = 0; i < 20000; ++i) {
    std::string text = good;
    for (std::uint32_t k = 1 + random(4); k > 0; --k) {
      const auto at = random(static_cast<std::uint32_t>(text.size()));
      switch (random(3)) {
        case 0:
          text[at] = static_cast<char>(random(256));
          break;
        case 1:
          text[at] = "0123456789 -.e$\n"[random(16)];
          break;
        default:
          text.erase(at, 1 + random(3));
          break;
      }
      if (text.empty()) text = "x";
    }
    const auto result = parse(text);
    if (result.ok()) {
      EXPECT_TRUE(validate(result->mesh)) << text;
    } else {
      EXPECT_EQ(result.error().message.find('\n'), std::string::npos) << text;
    }
  }
}

}  // namespace
}  // namespace trocar::mesh
