// Labels of a map make the organ, chosen by number or by name.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "server/organs/catalogue/import_organ.h"
#include "tests/organs/two_halves.h"

namespace trocar::catalogue {
namespace {

using testing::two_halves;

std::vector<std::string> regions_of(const std::string& labels,
                                    label_map::LabelMap map = two_halves()) {
  const auto parsed = parse_labels(labels);
  if (!parsed) return {parsed.error().message};
  ImportOptions options;
  options.labels = *parsed;
  options.nodes = 300;
  const auto imported = import_labels(std::move(map), "map.dcm", options);
  if (!imported) return {imported.error().message};
  std::vector<std::string> names;
  for (const auto& region : imported->organ.regions) names.push_back(region.name);
  if (names.empty())
    names.push_back(fmt::format("one of {:.0f} ml", 1e6 * total_volume(imported->organ.mesh)));
  return names;
}

using Names = std::vector<std::string>;

TEST(Labels, HaveTheNamesThatSomebodySaysOrElseTheMaps) {
  EXPECT_EQ(regions_of(""), (Names{"Liver", "Left kidney"}));
  EXPECT_EQ(regions_of("4:spleen,7"), (Names{"spleen", "Left kidney"}));
  auto map = two_halves();
  map.names.clear();
  EXPECT_EQ(regions_of("4,7", map), (Names{"label 4", "label 7"}));
}

TEST(Labels, AreChosenByNumberOrByName) {
  EXPECT_EQ(regions_of("Liver"), (Names{"one of 108 ml"}));
  EXPECT_EQ(regions_of("7"), (Names{"one of 108 ml"}));
  EXPECT_EQ(regions_of("Left kidney,4"), (Names{"Liver", "Left kidney"}));
}

TEST(Labels, MoreThanAnOrganMayHaveAreRefusedBeforeTheyAreMeshed) {
  auto map = two_halves();
  std::uint16_t next = 0;
  for (auto& label : map.labels)
    if (label != 0) label = ++next;
  EXPECT_EQ(regions_of("", map),
            (Names{"map.dcm: has 8000 labels, an organ may have 1000: choose some (--labels)"}));
}

TEST(Labels, OfOneNumberOrNameAreRefused) {
  EXPECT_EQ(regions_of("4:a,7:a"),
            (Names{"--labels: 4 and 7 are both named 'a': say another name, such as 7:NAME"}));
  EXPECT_EQ(regions_of("4:Left kidney,7"), (Names{"--labels: 4 and 7 are both named 'Left kidney': "
                                                  "say another name, such as 7:NAME"}));
  EXPECT_EQ(regions_of("4:a,4:b"), (Names{"--labels: label 4 is there twice: say it once"}));
  EXPECT_EQ(regions_of("4,Liver"), (Names{"--labels: label 4 is there twice: say it once"}));
  EXPECT_EQ(regions_of("4:,7"), (Names{"--labels: '4:' has no name behind its colon: say one, or "
                                       "the number alone"}));
}

TEST(Labels, ThatTheMapNamesAlikeGetDistinctNames) {
  auto map = two_halves();
  map.names = {{4, "Lobe"}, {7, "Lobe"}};
  EXPECT_EQ(regions_of("", map), (Names{"Lobe", "Lobe-2"}));
  EXPECT_EQ(regions_of("4,7:other", map), (Names{"Lobe", "other"}));
  EXPECT_EQ(regions_of("Lobe", map),
            (Names{"--labels: map.dcm has more than one label 'Lobe': choose by number, such as "
                   "4:NAME"}));
}

TEST(Labels, WhatTheMapDoesNotHaveIsRefusedWithWhatItHas) {
  EXPECT_EQ(regions_of("Tumour"),
            (Names{"--labels: map.dcm has no label 'Tumour', it has 4:Liver, 7:Left kidney"}));
  EXPECT_EQ(regions_of("0"),
            (Names{"--labels: '0' is no label, such as 2 or 2:tumour, from 1 to 65535"}));
  EXPECT_EQ(regions_of("4,,7"),
            (Names{"--labels: '' is no label, such as 2 or 2:tumour, from 1 to 65535"}));
}

}  // namespace
}  // namespace trocar::catalogue
