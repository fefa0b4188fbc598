// Files of local reductions: what is written is read, and each way of being wrong has its line.

#include "server/organs/organ/local_reduction_file.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <random>
#include <utility>

#include "server/organs/organ/organ_file.h"
#include "tests/reduce/small_organ.h"
#include "tests/support/files.h"
#include "tests/support/packed_damage.h"

namespace trocar::organ {
namespace {

using reduce::testing::block;
using reduce::testing::synthetic_local_reduction;
using trocar::testing::expect_bad_file;
using trocar::testing::save_file;
using trocar::testing::TemporaryFolder;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr float kNotANumber = std::numeric_limits<float>::quiet_NaN();

class LocalReductionFile : public ::testing::Test {
 protected:
  void expect_bad(BytesView file, const std::string& says) const {
    save_file(path_, file);
    const auto read = read_local_reduction(path_, organ_);
    ASSERT_FALSE(read.ok()) << says;
    expect_bad_file(read.error(), path_, says);
  }
  void expect_bad(const std::function<void(LocalReduction&)>& change,
                  const std::string& says) const {
    auto changed = reduction_;
    change(changed);
    const auto file = pack_local_reduction(changed);
    ASSERT_TRUE(file.ok()) << file.error().message;
    expect_bad(*file, says);
  }
  void expect_bad_patch(const std::function<void(LocalPatch&)>& change,
                        const std::string& says) const {
    expect_bad([&](LocalReduction& r) { change(r.patches[1]); }, says);
  }
  Bytes packed() const { return pack_local_reduction(reduction_).value(); }

  const Organ organ_ = block(3, 3, 2);
  const LocalReduction reduction_ = synthetic_local_reduction(organ_);
  const TemporaryFolder folder_;
  const std::string path_ = folder_.file("a.reduction");
};

TEST_F(LocalReductionFile, WhatIsWrittenIsRead) {
  ASSERT_TRUE(validate(reduction_).ok()) << validate(reduction_).error().message;
  ASSERT_TRUE(check_organ(reduction_, organ_).ok());
  ASSERT_EQ(reduction_.patches.size(), 2);
  ASSERT_TRUE(write_local_reduction(path_, reduction_).ok());
  const auto read = read_local_reduction(path_, organ_);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(*read, reduction_);
  auto without_cubature = reduction_;
  without_cubature.patches[0].cubature.clear();
  without_cubature.free_layers = 0;
  without_cubature.force_error = 0.02;
  const auto unpacked = unpack_local_reduction(*pack_local_reduction(without_cubature));
  ASSERT_TRUE(unpacked.ok()) << unpacked.error().message;
  EXPECT_EQ(*unpacked, without_cubature);
}

TEST_F(LocalReductionFile, NothingIsWrittenThatCouldNotBeRead) {
  auto wrong = reduction_;
  wrong.patches[0].modes[0].step = kNotANumber;
  EXPECT_FALSE(write_local_reduction(path_, wrong).ok());
  EXPECT_FALSE(std::filesystem::exists(path_));
  const auto missing = read_local_reduction(path_, organ_);
  ASSERT_FALSE(missing.ok());
  EXPECT_NE(missing.error().message.find("cannot be opened"), std::string::npos);
  const auto large = pack_local_reduction(reduction_, 1000);
  ASSERT_FALSE(large.ok());
  EXPECT_EQ(large.error().message,
            "the reduction takes 1 MiB, a file at most 1 MiB: make it with fewer modes or larger "
            "patches");
}

TEST_F(LocalReductionFile, OneOfAnotherOrganIsRefused) {
  ASSERT_TRUE(write_local_reduction(path_, reduction_).ok());
  const auto says = [&](const Organ& organ, const std::string& what) {
    const auto read = read_local_reduction(path_, organ);
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
  auto heavier = organ_;
  heavier.material.density_kg_m3 *= 2;
  EXPECT_TRUE(read_local_reduction(path_, heavier).ok());
}

// The synthetic one moves 1 kg per node.
TEST_F(LocalReductionFile, SessionsAskForMoreOfAnOrgan) {
  ASSERT_TRUE(write_local_reduction(path_, reduction_).ok());
  auto organ = organ_;
  organ.node_masses_kg.assign(organ.mesh.node_count(), 1.0);
  EXPECT_TRUE(read_session_reduction(path_, organ).ok());
  const auto says = [&](const std::function<void(Organ&)>& change, const std::string& what) {
    auto changed = organ;
    change(changed);
    const auto read = read_session_reduction(path_, changed);
    ASSERT_FALSE(read.ok()) << what;
    EXPECT_EQ(read.error().code, ErrorCode::BadFile);
    EXPECT_NE(read.error().message.find(what), std::string::npos) << read.error().message;
    EXPECT_EQ(read.error().message.find('\n'), std::string::npos);
  };
  says([](Organ& o) { o.gravity_m_s2.y = -9.81; }, "can have no reduction: it is under gravity");
  says([](Organ& o) { o.stress_free_positions_m = o.mesh.rest_positions; }, "it is settled");
  says([](Organ& o) { o.material.has_averaged_strain = true; }, "its strain is averaged");
  says([](Organ& o) { o.material.tension = 0.1; }, "it is under tension");
  says([](Organ& o) { o.material.fibre_tension = 0.1; }, "it is under tension");
  says([](Organ& o) { o.material.elastic_law = material::ElasticLaw::Springs; },
       "not all of it is of tets of a neo-Hookean or measured law");
  const auto in_a_region = [](Organ& o) {
    o.regions.push_back({"lump", o.material, {NodeIndex(0)}});
    o.regions.back().material.has_averaged_strain = true;
  };
  says(in_a_region, "its strain is averaged");
  says([](Organ& o) { o.node_masses_kg.assign(o.node_masses_kg.size(), 1.05); },
       path_ + ": is of tissue of another density");
  says([](Organ& o) { o.node_masses_kg[0] = std::nan(""); }, "is of tissue of another density");
  says([](Organ& o) { o.mesh.rest_positions[4].x += 1e-6; }, "is of another mesh than");
}

TEST_F(LocalReductionFile, ItsHashIsOfAllThatMakesADifference) {
  const auto hash = reduction_hash(reduction_);
  EXPECT_EQ(reduction_hash(*unpack_local_reduction(packed())), hash);
  auto renamed = reduction_;
  renamed.source = "by another name";
  EXPECT_EQ(reduction_hash(renamed), hash);
  const std::vector<std::function<void(LocalReduction&)>> changes{
      [](LocalReduction& r) { ++r.mesh_hash; },
      [](LocalReduction& r) { ++r.elasticity_hash; },
      [](LocalReduction& r) { r.force_n *= 2; },
      [](LocalReduction& r) { ++r.free_layers; },
      [](LocalReduction& r) { ++r.vibrations[0].values[5]; },
      [](LocalReduction& r) { r.vibrations.pop_back(); },
      [](LocalReduction& r) { ++r.greens[1].fields[2].values[5]; },
      [](LocalReduction& r) { r.greens[0].fields[0].step *= 2; },
      [](LocalReduction& r) { r.patches[1].centre = r.patches[0].centre; },
      [](LocalReduction& r) { r.patches[0].members.push_back(NodeIndex(17)); },
      [](LocalReduction& r) { r.patches[1].reach.pop_back(); },
      [](LocalReduction& r) { ++r.patches[0].modes[1].values[3]; },
      [](LocalReduction& r) { r.patches[0].inner_tets.pop_back(); },
      [](LocalReduction& r) { r.patches[1].cubature[0].weight += 1; },
      [](LocalReduction& r) { r.patches[1].outer_stiffness[4] += 1; },
      [](LocalReduction& r) { r.patches[1].mass[4] += 1; },
      [](LocalReduction& r) { std::swap(r.patches[0], r.patches[1]); }};
  std::vector<std::uint64_t> hashes{hash};
  for (const auto& change : changes) {
    auto changed = reduction_;
    change(changed);
    hashes.push_back(reduction_hash(changed));
  }
  std::ranges::sort(hashes);
  EXPECT_EQ(std::ranges::adjacent_find(hashes), hashes.end());
}

TEST_F(LocalReductionFile, OneOfTheOtherMethodIsNamed) {
  expect_bad(pack(PackedKind{kDoganReductionMagic, "", "", "", 1, 1}, 1, {}),
             "is a reduction by --method dogan, which sessions cannot use: make one with "
             "trocar-organ reduce --method local");
}

TEST_F(LocalReductionFile, DamageIsNoticed) {
  const auto file = packed();
  trocar::testing::expect_damage_is_noticed(
      file, 5, [](BytesView bytes) { return unpack_local_reduction(bytes).ok(); },
      [&](BytesView bytes) {
        const auto unpacked = unpack_local_reduction(bytes);
        return !unpacked.ok() || *unpacked == reduction_;
      },
      [&](BytesView bytes, const std::string& says) { expect_bad(bytes, says); });
  auto newer = file;
  newer[8] = 3;
  expect_bad(newer,
             "has version 3, this program reads version 2: make it again with trocar-organ reduce "
             "--method local");
  expect_bad(pack_organ(organ_),
             "is not a .reduction file: make one with trocar-organ reduce --method local");
}

// A checksum does not guard against what somebody makes on purpose.
TEST_F(LocalReductionFile, BodiesThatFitTheirChecksumAreNotTrustedEither) {
  constexpr PackedKind kKind{kLocalReductionMagic, "", "", "", 2, 2};
  const auto body = unpack(kKind, packed())->body;
  // A body that ends between its patches is whole, with fewer of them.
  for (std::size_t length = 0; length < body.size(); length += 37) {
    const Bytes cut(body.begin(), body.begin() + static_cast<std::ptrdiff_t>(length));
    const auto unpacked = unpack_local_reduction(pack(kKind, 2, cut));
    EXPECT_TRUE(!unpacked.ok() || unpacked->patches.size() == 1) << length;
  }
  std::mt19937 random(1);
  std::size_t accepted = 0;
  for (int round = 0; round < 2000; ++round) {
    auto changed = body;
    for (std::uint32_t k = 0; k < 1 + random() % 4; ++k)
      changed[random() % changed.size()] = static_cast<std::uint8_t>(random());
    const auto unpacked = unpack_local_reduction(pack(kKind, 2, changed));
    if (!unpacked) {
      EXPECT_EQ(unpacked.error().message.find('\n'), std::string::npos);
      continue;
    }
    ++accepted;
    EXPECT_TRUE(validate(*unpacked).ok());
    const auto checked = check_organ(*unpacked, organ_);
    EXPECT_TRUE(checked.ok() || !checked.error().message.empty());
  }
  EXPECT_LT(accepted, 2000);
  EXPECT_GT(accepted, 0);
}

TEST_F(LocalReductionFile, CountsAndScalarsHaveLimits) {
  expect_bad([](auto& r) { r.source = "two\nlines"; }, "its source is not one line");
  expect_bad([](auto& r) { r.patches.clear(); }, "has 0 patches, must have 1 to 4096");
  expect_bad([](auto& r) { r.patches.resize(4097); }, "has 4097 patches");
  for (const double force : {0.0, -1.0, 100.5, kInfinity, std::nan("")})
    expect_bad([&](auto& r) { r.force_n = force; }, "N, must be above 0 and at most 100");
  for (const double error : {-0.01, 1e6, std::nan("")})
    expect_bad([&](auto& r) { r.force_error = error; }, "must be from 0 to below 1");
  expect_bad([](auto& r) { r.free_layers = 4; }, "has 4 free layers, may have 3");
  expect_bad([](auto& r) { r.greens.resize(100001); }, "has 100001 Green's functions");
  expect_bad_patch([](auto& p) { p.modes.clear(); }, "patch 2 has 0 modes, must have 1 to 64");
  expect_bad_patch([](auto& p) { p.modes.resize(65); }, "patch 2 has 65 modes");
  expect_bad_patch([](auto& p) { p.reach.resize(133); }, "patch 2 has 405 fields");
}

TEST_F(LocalReductionFile, FieldsAreChecked) {
  const auto node = std::to_string(reduction_.greens[1].node.value);
  const auto greens = "Green's function of node " + node;
  expect_bad([](auto& r) { r.greens[1].node = NodeIndex(18); },
             "Green's function of node 18 is of none of the 18 nodes");
  expect_bad([](auto& r) { std::swap(r.greens[0], r.greens[1]); }, "must be ascending");
  expect_bad([](auto& r) { r.greens[1].node = r.greens[0].node; }, "must be ascending");
  expect_bad([](auto& r) { r.greens[1].fields[2].values.pop_back(); },
             greens + " along z has 53 numbers, must have 3 x 18");
  expect_bad([](auto& r) { r.greens[1].fields[0].step = kNotANumber; },
             greens + " along x has steps of nan, must be from 0 to 1");
  expect_bad([](auto& r) { r.greens[1].fields[1].step = -1e-6F; }, greens + " along y has steps");
  expect_bad([](auto& r) { r.greens[1].fields[1].step = 1e30F; }, greens + " along y has steps");
  expect_bad([](auto& r) { r.node_count = 0xffffffff; }, "must have 3 x 4294967295");
  expect_bad_patch([](auto& p) { p.modes[1].values.push_back(0); },
                   "mode 2 of patch 2 has 55 numbers, must have 3 x 18");
  expect_bad_patch([](auto& p) { p.modes[1].step = kNotANumber; }, "mode 2 of patch 2 has steps");
  expect_bad_patch([](auto& p) { p.modes[1].step = static_cast<float>(kInfinity); },
                   "mode 2 of patch 2 has steps of inf");
  expect_bad_patch([](auto& p) { p.modes[1].step = 0; }, "mode 2 of patch 2 has steps of 0");
  expect_bad_patch([](auto& p) { p.modes[1].step *= 1.001F; },
                   "modes 2 and 2 of patch 2 are not orthonormal, their product is 1.002");
  expect_bad_patch([](auto& p) { p.modes[1] = p.modes[0]; },
                   "modes 1 and 2 of patch 2 are not orthonormal");
  expect_bad_patch([](auto& p) { p.modes[1].values.assign(54, -32768); }, "are not orthonormal");
}

TEST_F(LocalReductionFile, VibrationsAreChecked) {
  expect_bad([](auto& r) { r.vibrations.resize(65); }, "has 65 vibrations, may have 64");
  expect_bad([](auto& r) { r.vibrations[1].values.pop_back(); }, "vibration 2 has 53 numbers");
  expect_bad([](auto& r) { r.vibrations[0].step = kNotANumber; }, "vibration 1 has steps");
  expect_bad([](auto& r) { r.vibrations[1] = r.vibrations[0]; },
             "vibrations 1 and 2 are not orthonormal");
  expect_bad([](auto& r) { r.vibrations[1] = r.patches[0].modes[2]; },
             "mode 3 of patch 1 and vibration 2 are not orthogonal");
  expect_bad([](auto& r) { r.vibrations.pop_back(); }, "numbers, must have 105 of 14 fields");
}

TEST_F(LocalReductionFile, NodesAreChecked) {
  expect_bad_patch([](auto& p) { p.centre = NodeIndex(18); },
                   "centre of patch 2 is node 18, must be below 18");
  expect_bad_patch([](auto& p) { p.members.clear(); }, "patch 2 has no members");
  expect_bad_patch([](auto& p) { p.members.push_back(NodeIndex(40)); },
                   "members of patch 2 has node 40, must be below 18");
  expect_bad_patch([](auto& p) { p.members.push_back(p.members.back()); }, "must be ascending");
  expect_bad_patch([](auto& p) { std::swap(p.reach[0], p.reach[1]); }, "reach of patch 2 has node");
  expect_bad_patch([](auto& p) { p.reach.back() = NodeIndex(18); },
                   "reach of patch 2 has node 18, must be below 18");
  expect_bad_patch([](auto& p) { std::erase(p.reach, p.members[0]); }, "of its members");
  expect_bad(
      [](auto& r) {
        const auto last = r.patches[1].reach.back();
        std::erase_if(r.greens, [&](const auto& greens) { return greens.node == last; });
      },
      "which has no Green's function");
  expect_bad([](auto& r) { r.patches[1] = r.patches[0]; }, "belongs to patch 1 and to patch 2");
}

TEST_F(LocalReductionFile, TetsAreChecked) {
  expect_bad_patch([](auto& p) { std::swap(p.inner_tets[0], p.inner_tets[1]); },
                   "inner tets of patch 2 has tet");
  expect_bad_patch([](auto& p) { p.inner_tets.push_back(TetIndex(0x80000000u)); },
                   "has tet 2147483648, must be below 2147483648");
  expect_bad_patch([](auto& p) { std::swap(p.cubature[0], p.cubature[1]); },
                   "cubature of patch 2 has tet");
  expect_bad_patch([](auto& p) { p.cubature = {{p.inner_tets[0], 1}}; }, "which is an inner one");
  for (const float weight : {0.0F, -1.0F, 2e6F, kNotANumber, static_cast<float>(kInfinity)})
    expect_bad_patch([&](auto& p) { p.cubature[0].weight = weight; },
                     "must be above 0 and at most 1e+06");
}

TEST_F(LocalReductionFile, MatricesAreChecked) {
  expect_bad_patch([](auto& p) { p.mass.pop_back(); },
                   "mass of patch 2 has 119 numbers, must have 120 of 15 fields");
  expect_bad_patch([](auto& p) { p.outer_stiffness.push_back(1); },
                   "outer stiffness of patch 2 has 121 numbers");
  expect_bad_patch([](auto& p) { p.mass[7] = std::nan(""); }, "mass of patch 2 has numbers that");
  expect_bad_patch([](auto& p) { p.outer_stiffness[7] = kInfinity; },
                   "outer stiffness of patch 2 has numbers that are not finite");
  expect_bad_patch([](auto& p) { p.outer_stiffness[5] = -0.5; },
                   "outer stiffness of patch 2 is -0.5 for field 3, must be from 0 up");
  expect_bad_patch([](auto& p) { p.mass[1] = 2; }, "mass of patch 2 is not positive definite");
  // A field twice.
  expect_bad_patch([](auto& p) { p.mass[1] = p.mass[2] = p.mass[0]; }, "not positive definite");
  expect_bad_patch([](auto& p) { p.mass.assign(p.mass.size(), 0); }, "not positive definite");
}

TEST_F(LocalReductionFile, NodesAndTetsMustFitTheOrgan) {
  const auto tets = std::to_string(organ_.mesh.tets.size());
  expect_bad_patch([&](auto& p) { p.inner_tets.push_back(TetIndex(organ_.mesh.tets.size())); },
                   "patch 2 has tet " + tets + ", " + organ_.name + " has " + tets);
  expect_bad_patch(
      [&](auto& p) {
        p.cubature.push_back({TetIndex(organ_.mesh.tets.size()), 1});
      },
      "patch 2 has tet " + tets);
  expect_bad_patch([](auto& p) { p.inner_tets.clear(), p.cubature.clear(); },
                   "which is at none of its tets");

  const auto larger = block(3, 3, 3);  // with a node inside
  const NodeIndex inside(13);
  ASSERT_EQ(larger.mesh.is_surface_node[inside.value], 0);
  auto r = synthetic_local_reduction(larger);
  EXPECT_TRUE(check_organ(r, larger).ok());
  const auto says = [&](const std::string& what) {
    ASSERT_TRUE(validate(r).ok()) << validate(r).error().message;
    const auto status = check_organ(r, larger);
    ASSERT_FALSE(status.ok());
    EXPECT_EQ(status.error().message,
              what + " is of node 13, which is not on the surface of " + larger.name);
  };
  const auto centre = std::exchange(r.patches[0].centre, inside);
  says("centre of patch 1");
  r.patches[0].centre = centre;
  const auto place = std::ranges::lower_bound(r.greens, inside, {}, &GreensFunction::node);
  r.greens.insert(place, {inside, r.greens[0].fields});
  says("a Green's function");
}

// The modes are smooth fields with peaks of all widths, on as many nodes as organs have.
TEST_F(LocalReductionFile, PackingLeavesModesOrthonormal) {
  constexpr std::size_t kNodes = 4000, kModes = 16;
  std::mt19937 random(1);
  const auto uniform = [&] { return static_cast<double>(random()) / 4294967296.0; };
  std::vector<std::vector<double>> fields(kModes, std::vector<double>(3 * kNodes));
  for (auto& field : fields) {
    const double middle = uniform(), width = std::pow(10, -3 * uniform()), phase = 6 * uniform();
    for (std::size_t i = 0; i < field.size(); ++i) {
      const double x = static_cast<double>(i) / static_cast<double>(field.size()) - middle;
      field[i] = std::exp(-x * x / (2 * width * width)) + 0.01 * std::cos(9 * x + phase);
    }
    for (const auto& other : fields) {
      if (&other == &field) break;
      double along = 0;
      for (std::size_t i = 0; i < field.size(); ++i) along += field[i] * other[i];
      for (std::size_t i = 0; i < field.size(); ++i) field[i] -= along * other[i];
    }
    double square = 0;
    for (const double value : field) square += value * value;
    for (double& value : field) value /= std::sqrt(square);
  }
  std::vector<PackedField> modes;
  for (const auto& field : fields) modes.push_back(pack_field(field));
  for (std::size_t a = 0; a < kModes; ++a)
    for (std::size_t b = 0; b <= a; ++b) {
      double product = 0;
      for (std::size_t i = 0; i < 3 * kNodes; ++i)
        product +=
            static_cast<double>(modes[a].values[i]) * static_cast<double>(modes[b].values[i]);
      product *= static_cast<double>(modes[a].step) * static_cast<double>(modes[b].step);
      EXPECT_NEAR(product, a == b ? 1 : 0, kLocalOrthonormality / 10) << a << " " << b;
    }
}

}  // namespace
}  // namespace trocar::organ
