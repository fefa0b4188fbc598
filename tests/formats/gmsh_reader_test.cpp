#include "server/organs/formats/gmsh_reader.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "common/base/bytes.h"

namespace trocar::formats {
namespace {

const std::string kHead = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n";
const std::string kNodes = "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n";
const std::string kElements = "$Elements\n1\n1 4 2 1 1 1 2 3 4\n$EndElements\n";

using mesh::Unit;

Result<mesh::ImportedMesh> parse(const std::string& text, Unit unit = Unit::Metre) {
  auto raw = parse_gmsh(text, "a.msh");
  if (!raw) return raw.error();
  return mesh::make_mesh(std::move(*raw), unit, "a.msh");
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
  EXPECT_NEAR(mesh::total_volume(mm->mesh), 1e-9 / 6, 1e-22);
  const auto cm = parse(kHead + kNodes + kElements, Unit::Centimetre);
  ASSERT_TRUE(cm.ok());
  EXPECT_NEAR(mesh::total_volume(cm->mesh), 1e-6 / 6, 1e-19);
  EXPECT_TRUE(mesh::parse_unit("m").ok() && mesh::parse_unit("cm").ok() &&
              mesh::parse_unit("mm").ok());
  EXPECT_FALSE(mesh::parse_unit("inch").ok());
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
  for (const auto* version : {"2.000000 0 8", "2 0 8", "2.1 0 8"})
    EXPECT_TRUE(parse_gmsh(replaced(good, "2.2 0 8", version), "a.msh").ok()) << version;
  expect(replaced(good, "2.2 0 8", "2.3 0 8"), "a.msh:2: is Gmsh version '2.3'");
  expect(replaced(good, "2.2 0 8", "4.0 0 8"), "a.msh:2: is Gmsh version '4.0'");
  expect(replaced(good, "2.2 0 8", "2.2 1 8"), "the byte order is not that of this machine");
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
  expect(kHead + "$ParametricNodes\n1\n", "a.msh:4: has $ParametricNodes: save the mesh without");
  expect(kHead + "$Odd\n1\n" + kNodes + kElements, "a.msh:4: section '$Odd' is never closed");
  expect(kHead + kNodes, "without an $Elements");
  expect(replaced(good, "2 1 0 0", std::string("2 \x1b[31m 0 0")), "coordinate '?[31m'");
}

// Version 1: a number of region and one of nodes stand before the nodes.
const std::string kVersion1 =
    "$NOD\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$ENDNOD\n"
    "$ELM\n2\n1 4 7 1 4 1 2 3 4\n2 2 5 1 3 1 2 3\n$ENDELM\n";

// Version 4.1, as Gmsh writes it.
const std::string kVersion4 =
    "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n"
    "$PhysicalNames\n2\n2 5 \"capsule\"\n3 7 \"inside\"\n$EndPhysicalNames\n"
    "$Entities\n1 0 1 1\n1 0 0 0 0\n1 0 0 0 1 1 1 1 5 0\n1 0 0 0 1 1 1 1 7 1 1\n$EndEntities\n"
    "$Nodes\n2 4 1 4\n0 1 0 1\n1\n0 0 0\n3 1 0 3\n2\n3\n4\n1 0 0\n0 1 0\n0 0 1\n$EndNodes\n"
    "$Elements\n2 2 1 2\n2 1 2 1\n1 1 2 3\n3 1 4 1\n2 1 2 3 4\n$EndElements\n";

TEST(GmshReader, ReadsVersions1And4) {
  for (const auto& text : {kVersion1, kVersion4}) {
    const auto raw = parse_gmsh(text, "a.msh");
    ASSERT_TRUE(raw.ok()) << raw.error().message;
    EXPECT_EQ(raw->positions.size(), 4u);
    ASSERT_EQ(raw->tets.size(), 1u);
    EXPECT_TRUE(raw->tet_regions.empty());
    EXPECT_EQ(raw->left_out,
              std::vector<std::string>{"no region, as it holds all elements: '" +
                                       std::string(text == kVersion1 ? "region 7'" : "inside'")});
    ASSERT_EQ(raw->node_sets.size(), 1u);
    EXPECT_EQ(raw->node_sets[0].name, text == kVersion1 ? "5" : "capsule");
    EXPECT_EQ(raw->node_sets[0].nodes.size(), 3u);
    EXPECT_TRUE(parse(text).ok());
  }
}

TEST(GmshReader, ErrorsOfVersions1And4SayWhere) {
  const auto expect = [](const std::string& text, const char* part) {
    EXPECT_NE(message(text).find(part), std::string::npos) << part << " / " << message(text);
  };
  expect(replaced(kVersion1, "1 4 7 1 4 1 2 3 4", "1 4 7 1 3 1 2 3 4"),
         "element 1 announces 3 nodes, its type has 4");
  expect(replaced(kVersion1, "$ENDELM", "$EndElements"), "expected $ENDELM");
  expect(replaced(kVersion4, "2 4 1 4", "2 4000000000 1 4"), "announces 4000000000 nodes");
  expect(replaced(kVersion4, "2 4 1 4", "9223372036854775807 4 1 4"), "blocks, the rest");
  expect(replaced(kVersion4, "3 1 0 3", "3 1 0 2"), "announced 4 nodes, found 3");
  expect(replaced(kVersion4, "0 0 1\n$EndNodes", "0 nan 1\n$EndNodes"), "node 4: coordinate 'nan'");
  expect(replaced(kVersion4, "2 1 2 3 4", "2 1 2 3 9"), "tet 1 (element 2) refers to node '9'");
  expect(replaced(kVersion4, "3 1 4 1\n2", "3 1 5 1\n2"), "type 5 (hexahedron)");
}

// Writes the same tet as binary.
Bytes binary(int version) {
  Bytes bytes;
  ByteWriter out(bytes);
  const auto text = [&](std::string_view t) { out.put_bytes(bytes_of(t)); };
  const auto ints = [&](std::initializer_list<std::int32_t> values) {
    for (const auto v : values) out.put(v);
  };
  const auto sizes = [&](std::initializer_list<std::uint64_t> values) {
    for (const auto v : values) out.put(v);
  };
  text(version == 2 ? "$MeshFormat\n2.2 1 8\n" : "$MeshFormat\n4.1 1 8\n");
  ints({1});
  text("\n$EndMeshFormat\n$Nodes\n");
  const double places[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  if (version == 2) {
    text("4\n");
    for (int i = 0; i < 4; ++i) {
      ints({i + 1});
      for (const double c : places[i]) out.put(c);
    }
  } else {
    sizes({1, 4, 1, 4});
    ints({3, 1, 0});
    sizes({4, 1, 2, 3, 4});
    for (const auto& place : places)
      for (const double c : place) out.put(c);
  }
  text("\n$EndNodes\n$Elements\n");
  if (version == 2) {
    text("1\n");
    ints({4, 1, 2, 1, 7, 7, 1, 2, 3, 4});
  } else {
    sizes({1, 1, 1, 1});
    ints({3, 1, 4});
    sizes({1, 1, 1, 2, 3, 4});
  }
  text("\n$EndElements\n");
  return bytes;
}

TEST(GmshReader, ReadsBinaryFilesAndNoPartOfOne) {
  for (const int version : {2, 4}) {
    const Bytes bytes = binary(version);
    const std::string_view whole(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    const auto raw = parse_gmsh(whole, "a.msh");
    ASSERT_TRUE(raw.ok()) << raw.error().message;
    EXPECT_EQ(raw->tets.size(), 1u);
    EXPECT_EQ(raw->positions[3], (Vec3d{0, 0, 1}));
    for (std::size_t n = 0; n + 1 < whole.size(); ++n) {
      const auto part = parse_gmsh(whole.substr(0, n), "a.msh");
      ASSERT_FALSE(part.ok()) << version << " " << n;
      EXPECT_EQ(part.error().message.find('\n'), std::string::npos);
    }
  }
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
      EXPECT_TRUE(mesh::validate(result->mesh)) << text;
    } else {
      EXPECT_EQ(result.error().message.find('\n'), std::string::npos) << text;
    }
  }
}

}  // namespace
}  // namespace trocar::formats
