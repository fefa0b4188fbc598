// Files of reduced models: what is written is read, and each way of being wrong has its line.

#include "server/papers/reduction/reduction_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>

#include "server/organs/organ/organ_file.h"
#include "server/organs/organ/packed_file.h"
#include "tests/papers/synthetic_reduction.h"
#include "tests/support/files.h"
#include "tests/support/packed_damage.h"

namespace trocar::reduction {
namespace {

using testing::block;
using testing::synthetic_reduction;
using trocar::testing::expect_bad_file;
using trocar::testing::save_file;
using trocar::testing::TemporaryFolder;

class ReductionFile : public ::testing::Test {
 protected:
  void expect_bad(BytesView file, const std::string& says) const {
    save_file(path_, file);
    const auto read = read_reduction(path_, organ_);
    ASSERT_FALSE(read.ok()) << says;
    expect_bad_file(read.error(), path_, says);
  }
  void expect_bad(const std::function<void(Reduction&)>& change, const std::string& says) const {
    auto changed = reduction_;
    change(changed);
    expect_bad(pack_reduction(changed), says);
  }

  const organ::Organ organ_ = block(3, 3, 2);
  const Reduction reduction_ = synthetic_reduction(organ_, 4);
  const TemporaryFolder folder_;
  const std::string path_ = folder_.file("a.reduction");
};

TEST_F(ReductionFile, WhatIsWrittenIsRead) {
  ASSERT_TRUE(validate(reduction_).ok()) << validate(reduction_).error().message;
  ASSERT_TRUE(write_reduction(path_, reduction_).ok());
  const auto read = read_reduction(path_, organ_);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(*read, reduction_);
  auto without_creep = reduction_;
  without_creep.creep.clear();
  without_creep.creep_times_s.clear();
  const auto unpacked = unpack_reduction(pack_reduction(without_creep));
  ASSERT_TRUE(unpacked.ok()) << unpacked.error().message;
  EXPECT_EQ(*unpacked, without_creep);
}

TEST_F(ReductionFile, NothingIsWrittenThatCouldNotBeRead) {
  auto wrong = reduction_;
  wrong.modes[0] = std::nan("");
  EXPECT_FALSE(write_reduction(path_, wrong).ok());
  EXPECT_FALSE(std::filesystem::exists(path_));
  const auto missing = read_reduction(path_, organ_);
  ASSERT_FALSE(missing.ok());
  EXPECT_NE(missing.error().message.find("cannot be opened"), std::string::npos);
}

TEST_F(ReductionFile, OneOfAnotherOrganIsRefused) {
  ASSERT_TRUE(write_reduction(path_, reduction_).ok());
  const auto says = [&](const organ::Organ& organ, const std::string& what) {
    const auto read = read_reduction(path_, organ);
    ASSERT_FALSE(read.ok()) << what;
    EXPECT_NE(read.error().message.find(what), std::string::npos) << read.error().message;
  };
  says(block(3, 3, 3), "is of another mesh: it has 18 nodes");
  auto moved = organ_;
  moved.mesh.rest_positions[4].x += 1e-6;
  says(moved, "is of another mesh than");
  auto held = organ_;
  held.fixed_nodes.pop_back();
  says(held, "or one that is held elsewhere");
  auto stiffer = organ_;
  stiffer.material.measured.coefficients_pa[1] += 1;
  says(stiffer, "is of another material than");
  auto slower = organ_;
  slower.material.measured.relaxation[0].relaxation_time_s *= 2;
  says(slower, "is of another material than");
  auto patched = organ_;
  patched.regions.push_back({"hard", patched.material, {NodeIndex(1), NodeIndex(2)}});
  says(patched, "is of another material than");
  // Figures that change no solution may differ.
  auto heavier = organ_;
  heavier.material.density_kg_m3 *= 2;
  heavier.name = "another";
  heavier.material.cut_energy_j_m2 = 5;
  EXPECT_TRUE(read_reduction(path_, heavier).ok());
}

TEST_F(ReductionFile, DamageIsNoticed) {
  const auto file = pack_reduction(reduction_);
  trocar::testing::expect_damage_is_noticed(
      file, 1, [](BytesView bytes) { return unpack_reduction(bytes).ok(); },
      [&](BytesView bytes) {
        const auto unpacked = unpack_reduction(bytes);
        return !unpacked.ok() || *unpacked == reduction_;
      },
      [&](BytesView bytes, const std::string& says) { expect_bad(bytes, says); });
  auto newer = file;
  newer[8] = 2;
  expect_bad(newer,
             "has version 2, this program reads version 1: make it again with trocar-organ reduce");
  expect_bad(pack_organ(organ_), "is not a .reduction file: make one with trocar-organ reduce");
}

TEST_F(ReductionFile, NumbersThatCannotBeAreRefused) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  expect_bad([](auto& r) { r.modes[7] = std::nan(""); }, "not finite");
  expect_bad([](auto& r) { r.best_tangent_n_m[1] = kInfinity; }, "not finite");
  expect_bad([](auto& r) { r.creep_times_s[1] = std::nan(""); }, "not finite");
  expect_bad([](auto& r) { r.influence_m = -1; }, "from 0 up");
  expect_bad([](auto& r) { r.modes[0] = 0.999; }, "modes 1 and 1 are not orthonormal");
  expect_bad([](auto& r) { r.modes[54] = 1e-6; }, "modes 1 and 2 are not orthonormal");
  expect_bad([](auto& r) { r.method = "magic"; }, "unknown method");
  expect_bad([](auto& r) { r.modes.pop_back(); }, "numbers in its modes");
  expect_bad([](auto& r) { r.eigenvalues_m2.clear(); }, "has 0 modes");
  expect_bad([](auto& r) { r.eigenvalues_m2.assign(65, 1); }, "has 65 modes");
  expect_bad([](auto& r) { std::swap(r.eigenvalues_m2[0], r.eigenvalues_m2[1]); }, "descending");
  expect_bad([](auto& r) { r.initial_tangent_n_m.pop_back(); }, "4 x 4 numbers");
  expect_bad([](auto& r) { r.initial_tangent_n_m[1] += 0.01; }, "not symmetric");
  expect_bad([](auto& r) { r.best_tangent_n_m[5] = -1; }, "positive definite");
  expect_bad([](auto& r) { r.creep.clear(); }, "times of creep without curves");
  expect_bad([](auto& r) { r.creep_times_s[2] = 0.5; }, "not ascending");
  expect_bad([](auto& r) { r.creep[0].node = NodeIndex(18); }, "creep around node 18");
  expect_bad([](auto& r) { r.creep[1].overall_growth.pop_back(); }, "creep around node 7");
  expect_bad([](auto& r) { r.creep[1].neighbours[0].growth[1] = std::nan(""); },
             "growths out of range");
  expect_bad([](auto& r) { std::swap(r.creep[1].neighbours[0], r.creep[1].neighbours[1]); },
             "not ascending");
}

}  // namespace
}  // namespace trocar::reduction
