#include "server/organs/organ/fibre_rule.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/organ/organ.h"
#include "tests/support/random.h"

namespace trocar::organ {
namespace {

TEST(FibreRule, IsReadOrRefused) {
  EXPECT_EQ(*parse_fibre_rule("x"), (FibreRule{FibreRule::Kind::Along, {1, 0, 0}, {}}));
  EXPECT_EQ(*parse_fibre_rule("around:z"), (FibreRule{FibreRule::Kind::Around, {0, 0, 1}, {}}));
  EXPECT_EQ(*parse_fibre_rule("a b.csv"), (FibreRule{FibreRule::Kind::Table, {}, "a b.csv"}));
  for (const char* text : {"", "w", "around:", "around:w", "around:xy", "X", "file.txt", "-x"})
    EXPECT_FALSE(parse_fibre_rule(text).ok()) << text;
}

TEST(FibreRule, RunsAlongOrAroundAnAxis) {
  const auto organ = *catalogue::make_lattice(catalogue::LatticeSize{5, 4, 3, 0.02});
  const auto& mesh = organ.mesh;
  const auto along = *fibre_directions_by(*parse_fibre_rule("y"), mesh);
  EXPECT_EQ(along, std::vector<Vec3d>(mesh.node_count(), {0, 1, 0}));
  const auto around = *fibre_directions_by(*parse_fibre_rule("around:z"), mesh);
  ASSERT_EQ(around.size(), mesh.node_count());
  for (std::size_t n = 0; n < around.size(); ++n) {
    const auto& p = mesh.rest_positions[n];
    EXPECT_NEAR(dot(around[n], p), 0, 1e-15);
    EXPECT_EQ(around[n].z, 0);
    EXPECT_NEAR(length(around[n]), std::hypot(p.x, p.y) > 1e-9 ? 1 : 0, 1e-12);
  }
}

class FibreTable : public ::testing::Test {
 protected:
  FibreTable() : organ_(*catalogue::make_lattice(catalogue::LatticeSize{2, 2, 2, 0.02})) {}
  ~FibreTable() override { std::filesystem::remove(path_); }

  Result<std::vector<Vec3d>> read(const std::string& text) {
    std::ofstream(path_, std::ios::binary) << text;
    return fibre_directions_by({FibreRule::Kind::Table, {}, path_}, organ_.mesh);
  }
  void expect_refused(const std::string& text, const std::string& where, const char* what) {
    const auto result = read(text);
    ASSERT_FALSE(result.ok()) << text;
    const auto& message = result.error().message;
    EXPECT_EQ(message.find(path_.string() + where), 0u) << message;
    EXPECT_NE(message.find(what), std::string::npos) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }

  const Organ organ_;
  const std::filesystem::path path_ = std::filesystem::temp_directory_path() /
                                      ("trocar_fibres_" + std::to_string(::getpid()) + ".csv");
};

TEST_F(FibreTable, GivesEveryNodeItsDirection) {
  const auto read_back = read(
      "id,x,y,z\r\n1,0,2,0\r\n0, 3, 0, 4\n2,-1,0,0\n3,1e-200,0,0\n4,1e200,0,0\n5,0,0,1\n6,0,0,1\n"
      "7,0,0,1e-310\n");
  ASSERT_TRUE(read_back.ok()) << read_back.error().message;
  EXPECT_EQ((*read_back)[1], (Vec3d{0, 1, 0}));
  EXPECT_NEAR((*read_back)[0].x, 0.6, 1e-15);
  for (const auto& d : *read_back) EXPECT_NEAR(length(d), 1, 1e-12);
  auto organ = organ_;
  organ.fibre_directions = *read_back;
  EXPECT_TRUE(validate(organ));
}

TEST_F(FibreTable, IsRefusedWithItsLine) {
  const std::string rows = "id,x,y,z\n0,1,0,0\n1,1,0,0\n2,1,0,0\n3,1,0,0\n4,1,0,0\n5,1,0,0\n";
  ASSERT_TRUE(read(rows + "6,1,0,0\n7,1,0,0\n").ok());
  expect_refused("", "", "is empty");
  expect_refused("0,1,0,0\n", ":1", "id,x,y,z");
  expect_refused(rows + "6,1,0,0\n", ":", "directions for 7 nodes, the organ has 8");
  expect_refused(rows + "6,1,0,0\n7,1,0,0\n8,1,0,0\n", ":10", "no node 8");
  expect_refused(rows + "6,1,0,0\n5,1,0,0\n", ":9", "node 5 has a direction already");
  expect_refused(rows + "6,0,0,0\n", ":8", "no length");
  expect_refused(rows + "6,nan,0,0\n", ":8", "not finite");
  expect_refused(rows + "6,1,inf,0\n", ":8", "not finite");
  for (const char* bad : {"6,1,0\n", "6,1,0,0,0\n", "6;1;0;0\n", "-6,1,0,0\n", "6.5,1,0,0\n",
                          "x,1,0,0\n", "\n", "6,1,0,\n", "6,1,0,0x\n", "6,1e999,0,0\n"})
    expect_refused(rows + bad, ":8", "four numbers");
  const auto missing =
      fibre_directions_by({FibreRule::Kind::Table, {}, "/nonexistent.csv"}, organ_.mesh);
  ASSERT_FALSE(missing.ok());
  EXPECT_NE(missing.error().message.find("cannot be opened"), std::string::npos);
}

TEST(SumOfAxes, KnowsNoSignsAndNeverCancels) {
  trocar::testing::Random random(5);
  const auto any = [&] {
    return normalized(Vec3d{random.between(-1, 1), random.between(-1, 1), random.between(-1, 1)},
                      {1, 0, 0});
  };
  for (int i = 0; i < 1000; ++i) {
    std::array<Vec3d, 4> axes{any(), any(), any(), any()};
    const Vec3d sum = sum_of_axes(axes);
    EXPECT_GE(dot(sum, axes[0]), 1 - 1e-12);
    for (std::size_t k = 1; k < 4; ++k) {
      auto turned = axes;
      turned[k] = -turned[k];
      EXPECT_EQ(sum_of_axes(turned), sum);
    }
    axes[0] = -axes[0];
    EXPECT_EQ(sum_of_axes(axes), -sum);
    EXPECT_EQ(sum_of_axes(std::array{Vec3d{}, axes[1], Vec3d{}, Vec3d{}}), axes[1]);
    EXPECT_EQ(sum_of_axes(std::array{axes[1], -axes[1], axes[1], axes[1]}), axes[1] * 4);
  }
  EXPECT_EQ(sum_of_axes(std::array{Vec3d{}, Vec3d{}}), Vec3d{});
}

}  // namespace
}  // namespace trocar::organ
