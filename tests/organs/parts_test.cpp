// Part files: organs of several bodies, and the ties between them.

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <string>

#include "server/organs/catalogue/join_parts.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/organs/mesh/pieces.h"
#include "server/organs/organ/organ_file.h"
#include "tests/support/files.h"

namespace trocar::catalogue {
namespace {

const std::string kPlate =
    "[[part]]\nname = 'plate'\nsource = 'box'\nsize_mm = [40, 10, 40]\ncells = [4, 1, 4]\n"
    "hold = 'all'\nyoung_modulus_pa = 9000\nlook = 'liver'\n";
const std::string kLid =
    "[[part]]\nname = 'lid'\nsource = 'box'\nsize_mm = [20, 10, 20]\ncells = [2, 1, 2]\n"
    "at_mm = [0, 11, 0]\nelastic_law = 'tensor-mass'\npoisson_ratio = 0.3\n";
const std::string kTies =
    "[[ties]]\nbetween = ['lid', 'plate']\nwithin_mm = 2\neach_mm2 = 10\ntoughness_j_m2 = 30\n";

Result<organ::Organ> joined(const std::string& text) {
  const auto file = parse_parts_text(text, "test.toml");
  if (!file) return file.error();
  auto result = join_parts(*file);
  if (!result) return result.error();
  return std::move(result->organ);
}

TEST(Parts, EachHasItsOwnMaterialAndHolding) {
  const auto organ = joined(kPlate + kLid);
  ASSERT_TRUE(organ.ok()) << organ.error().message;
  EXPECT_EQ(organ->name, "test");
  EXPECT_EQ(mesh::find_pieces(organ->mesh).count, 2u);
  ASSERT_EQ(organ->regions.size(), 2u);
  const auto &plate = organ->regions[0], &lid = organ->regions[1];
  EXPECT_EQ(plate.name, "plate");
  EXPECT_EQ(plate.look, "liver");
  EXPECT_EQ(plate.nodes, organ->fixed_nodes);
  EXPECT_EQ(plate.nodes.size() + lid.nodes.size(), organ->mesh.node_count());
  EXPECT_EQ(plate.material.young_modulus_pa, 9000);
  EXPECT_EQ(plate.material.elastic_law, material::ElasticLaw::NeoHookean);
  EXPECT_EQ(lid.material.elastic_law, material::ElasticLaw::TensorMass);
  EXPECT_EQ(lid.material.poisson_ratio, 0.3);
  // One frame: the lid's middle is 11 mm above the plate's.
  const auto height = [&](const material::MaterialRegion& region) {
    double sum = 0;
    for (const auto node : region.nodes) sum += organ->mesh.rest_positions[node.value].y;
    return sum / static_cast<double>(region.nodes.size());
  };
  EXPECT_NEAR(height(lid) - height(plate), 0.011, 1e-9);
  EXPECT_NEAR(mesh::total_volume(organ->mesh), 20e-6, 1e-12);
}

TEST(Parts, TiesStandForTheWholeAreaThatFaces) {
  const auto organ = joined(kPlate + kLid + kTies);
  ASSERT_TRUE(organ.ok()) << organ.error().message;
  ASSERT_EQ(organ->ties.size(), 1u);
  const auto& band = organ->ties[0];
  EXPECT_EQ(band.name, "lid-plate");
  EXPECT_EQ(band.law, (organ::TieLaw{.strength_pa = 8000, .toughness_j_m2 = 30, .rise_m = 1e-3}));
  double area = 0;
  for (const auto& tie : band.ties) {
    area += tie.area_m2;
    const auto at = [&](int e) {
      return place_of(tie.ends[static_cast<std::size_t>(e)], organ->mesh,
                      organ->mesh.rest_positions);
    };
    EXPECT_NEAR(length(at(1) - at(0)), 1e-3, 1e-9) << "straight across the gap";
    EXPECT_LE(tie.area_m2 * 1e6, 10);
    EXPECT_GE(tie.area_m2 * 1e6, 2);
  }
  EXPECT_NEAR(area, 400e-6, 1e-9);
}

TEST(Parts, AreTheSameFromTheirOrganFile) {
  const auto organ = joined(kPlate + kLid + kTies);
  ASSERT_TRUE(organ.ok());
  const auto again = organ::unpack_organ(organ::pack_organ(*organ));
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_EQ(*again, *organ);
  auto other = *organ;
  other.ties[0].law.toughness_j_m2 = 31;
  EXPECT_NE(organ_hash(other), organ_hash(*organ));
  other.ties.clear();
  EXPECT_NE(organ_hash(other), organ_hash(*organ));
}

TEST(Parts, KeepTheLargestBodyOfASource) {
  const trocar::testing::TemporaryFolder folder;
  // The file has a tetrahedron of 30 mm, and beside it one of 3.
  std::ofstream(folder.file("two.msh"))
      << "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n1 100 0 0\n2 103 0 0\n3 100 3 0\n"
         "4 100 0 3\n5 0 0 0\n6 30 0 0\n7 0 30 0\n8 0 0 30\n$EndNodes\n$Elements\n2\n"
         "1 4 2 0 1 1 2 3 4\n2 4 2 0 1 5 6 7 8\n$EndElements\n";
  std::ofstream(folder.file("organ.toml"))
      << "[[part]]\nname = 'a'\nsource = 'two.msh'\nunit = 'mm'\nhold = 'bottom:0.5'\n"
         "[[part]]\nname = 'b'\nsource = 'two.msh'\nunit = 'mm'\nat_mm = [0, 0, 50]\n"
         "hold = 'none'\n";
  const auto organ = load_organ(folder.file("organ.toml"));
  ASSERT_TRUE(organ.ok()) << organ.error().message;
  EXPECT_EQ(organ->mesh.tets.size(), 2u);
  EXPECT_EQ(organ->mesh.node_count(), 8u);
  EXPECT_NEAR(mesh::total_volume(organ->mesh), 2 * 4.5e-6, 1e-12);
  EXPECT_EQ(organ->fixed_nodes, (std::vector<NodeIndex>{NodeIndex(0), NodeIndex(1), NodeIndex(3)}));
}

TEST(Parts, RegionsOfASourceAreNamedAfterIt) {
  const trocar::testing::TemporaryFolder folder;
  auto organ = *joined(kPlate);
  organ.regions[0].name = "lump";
  ASSERT_TRUE(write_organ(folder.file("lumpy.organ"), organ).ok());
  std::ofstream(folder.file("organ.toml")) << "[[part]]\nname = 'liver'\nsource = 'lumpy.organ'\n";
  const auto whole = load_organ(folder.file("organ.toml"));
  ASSERT_TRUE(whole.ok()) << whole.error().message;
  ASSERT_EQ(whole->regions.size(), 2u);
  EXPECT_EQ(whole->regions[1].name, "liver/lump");
  EXPECT_EQ(whole->regions[1].material.young_modulus_pa, 9000) << "its own: none was given";
  EXPECT_EQ(whole->fixed_nodes.size(), organ.fixed_nodes.size()) << "its own: no hold was given";
}

TEST(Parts, EllipsoidsHaveTheirVolume) {
  const auto organ =
      joined("[[part]]\nname = 'e'\nsource = 'ellipsoid'\nsize_mm = [70, 26, 30]\nnodes = 500\n");
  ASSERT_TRUE(organ.ok()) << organ.error().message;
  EXPECT_NEAR(mesh::total_volume(organ->mesh) * 1e6, 4.0 / 3 * 3.14159265 * 35 * 13 * 15 * 1e-3,
              0.3);
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(Parts, MistakesAreSaidInOneLine) {
  const std::string all = kPlate + kLid + kTies;
  const std::pair<std::string, const char*> cases[] = {
      {"[organ]\nsource = 'liver'\n", "key part: is missing, write [[part]]"},
      {replaced(all, "'all'", "'some'"), "key part[0].hold: is \"some\", write \"none\", \"all\""},
      {replaced(all, "hold = 'all'", "hold = 'set:x'"), "names a set"},
      {replaced(all, "cells = [4, 1, 4]\n", ""), "key part[0].cells: is missing"},
      {replaced(all, "cells = [4, 1, 4]", "cells = [4, 0, 4]"), "three numbers from 1 to 200"},
      {replaced(all, "size_mm = [40, 10, 40]", "size_mm = [40, 0, 40]"), "allowed are 1 to 2000"},
      {replaced(all, "look = 'liver'", "nodes = 500"), "is for surfaces"},
      {replaced(all, "name = 'lid'", "name = 'plate'"), "is another part already"},
      {replaced(all, "poisson_ratio = 0.3", "spring_stiffness_n_m = 3"),
       "part \"lid\": spring_stiffness_n_m: is of springs"},
      {replaced(all, "['lid', 'plate']", "['lid', 'lid']"), "names one part twice"},
      {replaced(all, "['lid', 'plate']", "['lid', 'pot']"), "\"pot\", which is no [[part]]"},
      {replaced(all, "within_mm = 2\n", ""), "key ties[0].within_mm: is missing"},
      {replaced(all, "within_mm = 2\n", "within_mm = 0.5\n"), "within 0.5 mm of plate and faces"},
      {replaced(all, "each_mm2 = 10", "each_mm2 = 10\nrise_mm = 9"), "must be less than"},
      {replaced(all, "each_mm2 = 10", "each_mm2 = 10\nstrength_kpa = 9"), "strength_kpa"},
      {all + kTies, "a second [[ties]] named \"lid-plate\""},
      {replaced(all, "source = 'box'", "source = 'lattice'"), "size_mm"},
      {"[[part]]\nname = 'x'\nsource = 'lattice'\n", "is of links"},
      {"[[part]]\nname = 'x'\nsource = 'livre'\n", "'livre' is no built-in organ"},
      {"[[part]]\nname = 'x'\nsource = 'other.toml'\n", "is a part file or a scenario"},
  };
  for (const auto& [text, says] : cases) {
    const auto organ = joined(text);
    ASSERT_FALSE(organ.ok()) << says;
    const auto& message = organ.error().message;
    EXPECT_NE(message.find(says), std::string::npos) << message;
    EXPECT_TRUE(message.starts_with("test.toml")) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
}

TEST(Ties, OfAnOrganAreChecked) {
  const auto good = *joined(kPlate + kLid + kTies);
  const auto says = [&](auto&& change) {
    auto organ = good;
    change(organ.ties);
    const auto status = validate(organ);
    return status.ok() ? std::string() : status.error().message;
  };
  using Bands = std::vector<organ::TieBand>;
  const auto has = [](const std::string& text, const char* part) {
    return text.find(part) != std::string::npos;
  };
  EXPECT_EQ(says([](Bands&) {}), "");
  EXPECT_TRUE(has(says([](Bands& b) { b[0].name = ""; }), "a name of 1 to 200 bytes"));
  EXPECT_TRUE(has(says([](Bands& b) { b[0].ties.clear(); }), "at least one tie"));
  EXPECT_TRUE(has(says([](Bands& b) { b[0].law.strength_pa = 0; }), "strength (Pa) is 0"));
  EXPECT_TRUE(has(says([](Bands& b) { b[0].law.rise_m = 0.05; }), "rise is 0.05 m"));
  EXPECT_TRUE(has(says([](Bands& b) { b[0].ties[2].area_m2 = 0; }), "tie 2 stands for an area"));
  EXPECT_TRUE(has(says([](Bands& b) { b[0].ties[2].ends[0].triangle = TriangleIndex(99999); }),
                  "tie 2 does not begin and end"));
  EXPECT_TRUE(has(says([](Bands& b) {
                    b[0].ties[2].ends[1].weights = {0.5, 0.6, -0.1};
                  }),
                  "tie 2 does not begin and end"));
  EXPECT_TRUE(has(says([](Bands& b) { b[0].ties[2].ends[1] = b[0].ties[2].ends[0]; }),
                  "ties a triangle to itself"));
  EXPECT_TRUE(
      has(says([](Bands& b) { b.resize(organ::kMaxTieBands + 1, b[0]); }), "more than 100 bands"));
}

}  // namespace
}  // namespace trocar::catalogue
