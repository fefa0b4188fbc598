#include "server/tissue/reduction/patch_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/reduce/small_organ.h"

namespace trocar::reduction {
namespace {

class PatchModelOfBlock : public ::testing::Test {
 protected:
  PatchModelOfBlock()
      : organ_(reduce::testing::block(5, 4, 5)),
        reduction_(reduce::testing::synthetic_local_reduction(organ_)),
        models_(reduction_, organ_) {}

  std::vector<float> amplitudes(const PatchModel& model) const {
    std::vector<float> x(model.stride());
    for (std::size_t c = 0; c < model.field_count(); ++c)
      x[c] = static_cast<float>(std::cos(static_cast<double>(c)));
    return x;
  }

  organ::Organ organ_;
  organ::LocalReduction reduction_;
  LocalModels models_;
};

TEST_F(PatchModelOfBlock, FieldsNearAndEverywhereAreTheSame) {
  for (std::uint32_t p = 0; p < models_.size(); ++p) {
    const auto& model = models_[p];
    const auto x = amplitudes(model);
    std::vector<float> near(3 * model.nodes().size()), all(3 * models_.node_count());
    add_fields(model.basis(), x, near);
    // In runs that end anywhere.
    for (std::size_t begin = 0; begin < models_.node_count(); begin += 37) {
      const auto end = std::min(begin + 37, models_.node_count());
      model.add_everywhere(begin, end, x, std::span(all).subspan(3 * begin, 3 * (end - begin)));
    }
    float largest = 0;
    for (const float value : all) largest = std::max(largest, std::abs(value));
    ASSERT_GT(largest, 0);
    for (std::size_t n = 0; n < model.nodes().size(); ++n)
      for (std::size_t k = 0; k < 3; ++k)
        EXPECT_NEAR(near[3 * n + k], all[3 * model.nodes()[n].value + k], 1e-5f * largest);
  }
}

TEST_F(PatchModelOfBlock, AlongIsTheTransposeOfEverywhere) {
  const auto& model = models_[0];
  const auto x = amplitudes(model);
  std::vector<float> f(3 * models_.node_count()), u(f.size()), along(model.stride());
  for (std::size_t i = 0; i < f.size(); ++i)
    f[i] = static_cast<float>(std::sin(static_cast<double>(3 * i)));
  model.add_everywhere(0, models_.node_count(), x, u);
  model.add_along_everywhere(0, 41, std::span(f).first(3 * 41), along);
  model.add_along_everywhere(41, models_.node_count(), std::span(f).subspan(3 * 41), along);
  double by_nodes = 0, by_fields = 0, size = 0;
  for (std::size_t i = 0; i < f.size(); ++i) {
    by_nodes += static_cast<double>(f[i]) * static_cast<double>(u[i]);
    size += std::abs(static_cast<double>(f[i]) * static_cast<double>(u[i]));
  }
  for (std::size_t c = 0; c < x.size(); ++c)
    by_fields += static_cast<double>(x[c]) * static_cast<double>(along[c]);
  EXPECT_NEAR(by_nodes, by_fields, 1e-5 * size);
}

// Stiffness and mass among the fields of two patches, against sums over the whole organ.
TEST_F(PatchModelOfBlock, PatchesTogetherHaveTheOrgansMatrices) {
  PatchSet both;
  ASSERT_TRUE(both.add(1));
  ASSERT_TRUE(both.add(0));
  const PatchModel joint(models_, both);
  ASSERT_EQ(joint.blocks().size(), 3u);
  // Fields that both patches have, such as vibrations, occur once.
  EXPECT_LT(joint.field_count(), models_[0].field_count() + models_[1].field_count());
  EXPECT_EQ(joint.blocks()[1], models_[0].field_count());
  const auto nodes = models_.node_count(), count = joint.field_count();
  std::vector<std::vector<double>> fields, forces;
  const auto& k = models_.rest_tangent();
  for (std::size_t c = 0; c < count; ++c) {
    std::vector<float> x(joint.stride()), out(3 * nodes);
    x[c] = 1;
    joint.add_everywhere(0, nodes, x, out);
    auto& field = fields.emplace_back(out.begin(), out.end());
    auto& force = forces.emplace_back(3 * nodes, 0.0);
    for (std::size_t n = 0; n < nodes; ++n)
      for (std::size_t b = 0; b < k.columns(n).size(); ++b)
        for (std::size_t e = 0; e < 9; ++e)
          force[3 * n + e / 3] +=
              static_cast<double>(k.blocks(n)[b][e]) * field[3 * k.columns(n)[b] + e % 3];
  }
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t j = 0; j < count; ++j) {
      double stiffness = 0, mass = 0, largest_mass = 0;
      for (std::size_t dof = 0; dof < 3 * nodes; ++dof) {
        stiffness += fields[i][dof] * forces[j][dof];
        const double m = organ_.node_masses_kg[dof / 3];
        mass += fields[i][dof] * m * fields[j][dof];
        largest_mass += m * (fields[i][dof] * fields[i][dof] + fields[j][dof] * fields[j][dof]);
      }
      const auto at = i * joint.stride() + j;
      EXPECT_NEAR(joint.outer_stiffness()[at] + joint.inner_stiffness()[at], stiffness, 2e-3);
      EXPECT_NEAR(joint.mass()[at], mass, 1e-5 * largest_mass);
    }
}

TEST_F(PatchModelOfBlock, NearFitIsTheLeastSum) {
  PatchSet both;
  ASSERT_TRUE(both.add(0) && both.add(1));
  const PatchModel model(models_, both);  // its masses are the organ's
  ASSERT_NE(model.near_fit(), nullptr);
  const auto nodes = models_.node_count(), count = model.field_count();
  std::vector<std::uint8_t> is_free(nodes);
  for (std::uint32_t local = 0; local < model.nodes().size(); ++local)
    if (model.may_be_free(local)) is_free[model.nodes()[local].value] = 1;
  std::vector<double> wanted(3 * nodes);
  for (std::size_t dof = 0; dof < 3 * nodes; ++dof)
    if (is_free[dof / 3] != 0) wanted[dof] = std::sin(static_cast<double>(dof * dof));
  const auto moved = [&](std::span<const double> x) {
    std::vector<float> factors(x.begin(), x.end()), out(3 * nodes);
    factors.resize(model.stride());
    model.add_everywhere(0, nodes, factors, out);
    return out;
  };
  const auto sum = [&](std::span<const double> x) {
    const auto u = moved(x);
    double near = 0, others = 0;
    for (std::size_t dof = 0; dof < 3 * nodes; ++dof) {
      const double off = static_cast<double>(u[dof]) - wanted[dof];
      (is_free[dof / 3] != 0 ? near : others) += organ_.node_masses_kg[dof / 3] * off * off;
    }
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t j = 0; j < count; ++j)
        others +=
            PatchModel::kBeside_s2 * x[i] * x[j] * model.outer_stiffness()[i * model.stride() + j];
    return near + PatchModel::kBeside * others;
  };
  std::vector<double> x(count);
  for (std::size_t c = 0; c < count; ++c) {
    std::vector<double> one(count);
    one[c] = 1;
    const auto field = moved(one);
    for (std::size_t dof = 0; dof < 3 * nodes; ++dof)
      x[c] += organ_.node_masses_kg[dof / 3] * static_cast<double>(field[dof]) * wanted[dof];
  }
  std::vector<double> scratch;
  model.near_fit()->solve(x, scratch, 200);
  const double least = sum(x),
               step =
                   std::abs(*std::ranges::max_element(x, {}, [](double v) { return std::abs(v); }));
  ASSERT_GT(step, 0);
  EXPECT_LT(least, sum(std::vector<double>(count)));
  // A quadratic: as much more to either side.
  for (std::size_t c = 0; c < count; ++c) {
    auto below = x, above = x;
    below[c] -= step, above[c] += step;
    const double down = sum(below) - least, up = sum(above) - least;
    EXPECT_GT(down + up, 0) << c;
    EXPECT_LT(std::abs(up - down), 0.01 * (up + down)) << c;
  }
}

TEST_F(PatchModelOfBlock, HasNoNearFitWhereStiffnessMakesNone) {
  reduction_.patches[0].outer_stiffness[0] = -1e12;
  const LocalModels models(reduction_, organ_);
  EXPECT_EQ(models[0].near_fit(), nullptr);
  EXPECT_NE(models[1].near_fit(), nullptr);
}

TEST_F(PatchModelOfBlock, KnowsItsNodes) {
  const auto& model = models_[1];
  std::size_t free = 0;
  for (std::uint32_t i = 0; i < organ_.mesh.node_count(); ++i) {
    const NodeIndex node(i);
    const bool is_there = std::ranges::binary_search(model.nodes(), node);
    const auto local = model.local(node);
    EXPECT_EQ(is_there, local != PatchModel::kNone);
    if (!is_there) continue;
    EXPECT_EQ(model.nodes()[local], node);
    if (!model.may_be_free(local)) continue;
    ++free;
    EXPECT_FALSE(std::ranges::binary_search(organ_.fixed_nodes, node));
    for (const auto tet : organ_.mesh.node_tets[node])
      EXPECT_TRUE(std::ranges::binary_search(reduction_.patches[1].inner_tets, tet));
    EXPECT_FALSE(std::ranges::count(model.rim(), local));
  }
  EXPECT_GT(free, 0u);
  for (const auto stiffness : model.rim_stiffness()) EXPECT_GT(stiffness, 0);
}

}  // namespace
}  // namespace trocar::reduction
