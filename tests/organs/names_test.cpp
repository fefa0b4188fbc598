// Names in files of other programs: those of printable UTF-8 are kept, of whatever language, and a
// line says what another one became.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "common/base/printable.h"
#include "server/organs/catalogue/import_organ.h"
#include "server/organs/organ/organ_file.h"
#include "tests/organs/two_halves.h"
#include "tests/support/files.h"

namespace trocar::catalogue {
namespace {

using Lines = std::vector<std::string>;
using namespace std::string_literals;

const std::string kVesselName = "Gef\u00e4\u00df", kLiverName = "\u809d\u81d3", kOtherName = "foie";
const std::string kLatinName = "Gef\xe4\xdf";

std::string gmsh(const std::string& first, const std::string& second) {
  return "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n3 1 \"" + first + "\"\n3 2 \"" +
         second + "\"\n2 3 \"" + first +
         "\"\n$EndPhysicalNames\n$Nodes\n5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 0 0 -1\n"
         "$EndNodes\n$Elements\n3\n1 4 2 1 1 1 2 3 4\n2 4 2 2 1 1 3 2 5\n3 2 2 3 1 1 2 3\n"
         "$EndElements\n";
}
std::string abaqus(const std::string& first, const std::string& second) {
  return "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n5,0,0,-1\n*ELEMENT, TYPE=C3D4, ELSET=" +
         first + "\n1,1,2,3,4\n*ELEMENT, TYPE=C3D4, ELSET=" + second +
         "\n2,1,3,2,5\n*NSET, NSET=" + first + "\n1,2,3\n";
}

Result<ImportedOrgan> imported(const std::string& text, const std::string& file,
                               ImportOptions options = {}) {
  const trocar::testing::TemporaryFolder folder;
  std::ofstream(folder.file(file), std::ios::binary) << text;
  return import_organ(folder.file(file), options);
}
Lines regions_of(const ImportedOrgan& result) {
  Lines names;
  for (const auto& region : result.organ.regions) names.push_back(region.name);
  return names;
}

TEST(Names, OfPrintableUtf8AreKept) {
  for (const auto& [text, file] : {std::pair(gmsh(kVesselName, kLiverName), "a.msh"),
                                   std::pair(abaqus(kVesselName, kLiverName), "a.inp")}) {
    SCOPED_TRACE(file);
    const auto result = imported(text, file);
    ASSERT_TRUE(result.ok()) << result.error().message;
    EXPECT_EQ(regions_of(*result), (Lines{kVesselName, kLiverName}));
    EXPECT_EQ(result->warnings, Lines{});
    const auto again = organ::unpack_organ(organ::pack_organ(result->organ));
    ASSERT_TRUE(again.ok()) << again.error().message;
    EXPECT_EQ(*again, result->organ);
  }
}

TEST(Names, OfTheFileAreThoseOfTheOrgan) {
  const auto result = imported(gmsh(kOtherName, kLiverName), kLiverName + ".msh");
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_EQ(result->organ.name, kLiverName);
  EXPECT_EQ(result->organ.source, kLiverName + ".msh, unit m, fix bottom:0.2");
  const auto latin = imported(gmsh(kOtherName, kLiverName), kLatinName + ".msh");
  ASSERT_TRUE(latin.ok()) << latin.error().message;
  EXPECT_EQ(latin->organ.name, kVesselName);
  EXPECT_EQ(latin->warnings,
            Lines{"names of organs must be 1 to 200 bytes of printable UTF-8, so 'Gef?\?' is '" +
                  kVesselName + "' here"});
}

TEST(Names, OfLatin1BecomeUtf8AndThatIsSaid) {
  for (const auto& [text, file] : {std::pair(gmsh(kLatinName, kOtherName), "a.msh"),
                                   std::pair(abaqus(kLatinName, kOtherName), "a.inp")}) {
    SCOPED_TRACE(file);
    ImportOptions options;
    options.fix_set = kVesselName;
    const auto result = imported(text, file, options);
    ASSERT_TRUE(result.ok()) << result.error().message;
    EXPECT_EQ(regions_of(*result), (Lines{kVesselName, kOtherName}));
    EXPECT_EQ(result->organ.fixed_nodes.size(), 3u);
    const std::string end =
        " must be 1 to 200 bytes of printable UTF-8, so 'Gef?\?' is '" + kVesselName + "' here";
    EXPECT_EQ(result->warnings, (Lines{"names of regions" + end, "names of sets of nodes" + end}));
    options.fix_set = kLatinName;  // as a terminal in Latin-1 gives it
    EXPECT_TRUE(imported(text, file, options).ok());
  }
}

TEST(Names, ThatAreTooLongEmptyOrNotPrintableAreSaid) {
  std::string much, kept;
  for (int i = 0; i < 150; ++i) much += "\u00e4";
  kept = much.substr(0, 200);
  for (const auto& [name, became] :
       {std::pair("a\0b"s, "a_b"s), std::pair("a\x1b[31m"s, "a_[31m"s),
        std::pair("a\u202e"s, "a_"s), std::pair(""s, "unnamed"s), std::pair(much, kept)}) {
    const auto result = imported(gmsh(name, kOtherName), "a.msh");
    ASSERT_TRUE(result.ok()) << result.error().message;
    EXPECT_EQ(regions_of(*result), (Lines{became, kOtherName}));
    ASSERT_EQ(result->warnings.size(), 2u);
    EXPECT_TRUE(result->warnings[0].ends_with(" is '" + became + "' here")) << result->warnings[0];
  }
}

TEST(Names, ThatBecomeTheSameAreTold) {
  const auto result = imported(gmsh(kLatinName, kVesselName), "a.msh");
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_EQ(regions_of(*result), (Lines{kVesselName, kVesselName + "-2"}));
  EXPECT_EQ(result->warnings[1], "regions share a name, so the next '" + kVesselName + "' is '" +
                                     kVesselName + "-2' here");
}

TEST(Names, OfLabelsAreKeptAndFoundOrSaid) {
  auto map = testing::two_halves();
  map.names = {{4, kLatinName}, {7, kLiverName}};
  ImportOptions options;
  options.nodes = 300;
  const auto all = import_labels(map, "map.dcm", options);
  ASSERT_TRUE(all.ok()) << all.error().message;
  EXPECT_EQ(regions_of(*all), (Lines{kVesselName, kLiverName}));
  EXPECT_EQ(all->warnings,
            Lines{"names of labels must be 1 to 200 bytes of printable UTF-8, so 'Gef?\?' is '" +
                  kVesselName + "' here"});
  options.labels = *parse_labels(kVesselName + ",7:" + kOtherName);
  const auto chosen = import_labels(map, "map.dcm", options);
  ASSERT_TRUE(chosen.ok()) << chosen.error().message;
  EXPECT_EQ(regions_of(*chosen), (Lines{kVesselName, kOtherName}));
  map.names = {{4, ""}};
  options.labels.clear();
  const auto unnamed = import_labels(map, "map.dcm", options);
  ASSERT_TRUE(unnamed.ok()) << unnamed.error().message;
  EXPECT_EQ(regions_of(*unnamed), (Lines{"label 4", "label 7"}));
}

// Whatever bytes a file has for a name, an organ file holds what became of them.
TEST(Names, OfAnyBytesMakeAnOrganThatCanBeReadAgain) {
  unsigned state = 1;
  for (int n = 0; n < 200; ++n) {
    std::string name;
    for (unsigned i = 0; i < 1 + state % 40; ++i) {
      state = state * 1664525u + 1013904223u;
      if (const char c = static_cast<char>(state >> 24); c != '"' && c != '\n' && c != '\r')
        name += c;
    }
    const auto result = imported(gmsh("x" + name + "x", kOtherName), "a.msh");
    ASSERT_TRUE(result.ok()) << result.error().message;
    for (const auto& region : result->organ.regions) {
      EXPECT_TRUE(is_printable(region.name));
      EXPECT_LE(region.name.size(), organ::kMostNameBytes);
    }
    const auto again = organ::unpack_organ(organ::pack_organ(result->organ));
    ASSERT_TRUE(again.ok()) << again.error().message;
    EXPECT_EQ(again->regions, result->organ.regions);
  }
}

}  // namespace
}  // namespace trocar::catalogue
