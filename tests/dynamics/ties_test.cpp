// The energy of ties through all of its law: rising, falling, let go, broken, pressed together.

#include "server/tissue/dynamics/ties.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/tissue/dynamics/tissue.h"
#include "tests/support/random.h"
#include "tests/support/tied_strip.h"

namespace trocar::dynamics {
namespace {

// The ties of a strip alone, with one memory for all.
class TieProbe {
 public:
  explicit TieProbe(float most_m)
      : organ_(testing::make_strip({.spacing_mm = 10, .each_mm2 = 40})),
        topology_(organ_),
        groups_(topology_, Coupling::Elements),
        ties_(topology_, groups_),
        memory_(topology_.ties().count(), most_m) {
    ties_.use_memory(memory_.data());
  }

  Vec3d gradient(NodeIndex node, const std::vector<Vec3f>& u) { return step_at(node, u).first; }
  std::pair<Vec3d, SymMat3f> step_at(NodeIndex node, const std::vector<Vec3f>& u) {
    std::vector<Float4> slots(groups_.slot_count());
    for (std::uint32_t n = 0; n < u.size(); ++n)
      slots[groups_.slot_of(NodeIndex(n))] = to_float4(u[n]);
    const Slot slot = groups_.slot_of(node);
    const Group g = slot / kLanes;
    NodeStep8 step{zero_vec8(), zero_sym_mat8()};
    const Vec8 own = load_group(&slots[g * kLanes]);
    ties_.begin_group(g, slots.data(), own, 0);
    ties_.add(g, slots.data(), own, step);
    Vec3Lanes gradient;
    SymMat3Lanes block;
    store(gradient, step.gradient);
    store(block, step.block);
    return {to_double(gradient.at(slot % kLanes)), block.at(slot % kLanes)};
  }
  double energy(const std::vector<Vec3f>& u) {
    for (Group g = 0; g < groups_.group_count(); ++g) ties_.begin_group(g, nullptr, zero_vec8(), 0);
    std::vector<Vec3d> slots(groups_.slot_count());
    std::vector<double> energies(slots.size());
    for (std::uint32_t n = 0; n < u.size(); ++n)
      slots[groups_.slot_of(NodeIndex(n))] = to_double(u[n]);
    ties_.add_energies_j(slots, energies);
    double sum = 0;
    for (const double energy : energies) sum += energy;
    return sum;
  }
  const organ::Organ& organ() const { return organ_; }
  double area_m2() const {
    double sum = 0;
    for (const auto& tie : organ_.ties[0].ties) sum += tie.area_m2;
    return sum;
  }
  // The strip lifted off its bed, and shaken.
  std::vector<Vec3f> lifted(float by_m, float shaken_m = 0) const {
    auto u = testing::random_vectors(organ_.mesh.node_count(), shaken_m, 7);
    for (const auto node : organ_.regions[1].nodes) u[node.value].y += by_m;
    return u;
  }

 private:
  organ::Organ organ_;
  topology::Topology topology_;
  Groups groups_;
  Ties ties_;
  std::vector<float> memory_;
};

constexpr float Vec3f::*kTieAxes[3] = {&Vec3f::x, &Vec3f::y, &Vec3f::z};

// Rise is 1 mm, all is over at 5 mm.
constexpr float kMemories_m[] = {0, 0.0005f, 0.002f, 0.0045f};
constexpr float kLifts_m[] = {0.0004f, 0.0015f, 0.003f, 0.0042f};

TEST(TieEnergy, HasItsDerivativeAsGradient) {
  for (const float memory : kMemories_m)
    for (const float lift : kLifts_m) {
      TieProbe probe(memory);
      auto u = probe.lifted(lift, 1e-4f);
      double largest = 0, worst = 0;
      for (std::uint32_t n = 0; n < u.size(); n += 3) {
        const Vec3d g = probe.gradient(NodeIndex(n), u);
        largest = std::max(largest, length(g));
        const double parts[3] = {g.x, g.y, g.z};
        for (int axis = 0; axis < 3; ++axis) {
          const float kept = u[n].*kTieAxes[axis], h = 2e-5f;
          u[n].*kTieAxes[axis] = kept + h;
          const double plus = probe.energy(u), up = u[n].*kTieAxes[axis];
          u[n].*kTieAxes[axis] = kept - h;
          const double minus = probe.energy(u), down = u[n].*kTieAxes[axis];
          u[n].*kTieAxes[axis] = kept;
          worst = std::max(worst, std::abs((plus - minus) / (up - down) - parts[axis]));
        }
      }
      EXPECT_GT(largest, 1e-4);
      EXPECT_LT(worst, 2e-3 * largest) << memory << " m of memory, lifted by " << lift << " m";
    }
}

TEST(TieEnergy, TakesTheToughnessOfItsArea) {
  TieProbe probe(0);
  EXPECT_NEAR(probe.energy(probe.lifted(0.006f)) / (20 * probe.area_m2()), 1, 1e-3);
  EXPECT_NEAR(probe.energy(probe.lifted(0.001f)) / (0.5 * 8000 * 0.001 * probe.area_m2()), 1, 1e-3);
}

TEST(TieEnergy, HasPositiveBlocksWhileItWeakens) {
  for (const float memory : kMemories_m)
    for (const float lift : kLifts_m) {
      TieProbe probe(memory);
      const auto u = probe.lifted(lift, 5e-4f);
      for (std::uint32_t n = 0; n < u.size(); n += 2) {
        const auto b = probe.step_at(NodeIndex(n), u).second;
        const float trace = b.xx + b.yy + b.zz;
        EXPECT_GE(b.xx, -1e-6f * trace);
        EXPECT_GE(b.xx * b.yy - b.xy * b.xy, -1e-5f * trace * trace);
        const float determinant = b.xx * (b.yy * b.zz - b.yz * b.yz) -
                                  b.xy * (b.xy * b.zz - b.yz * b.xz) +
                                  b.xz * (b.xy * b.yz - b.yy * b.xz);
        EXPECT_GE(determinant, -1e-5f * trace * trace * trace);
      }
    }
}

TEST(TieEnergy, DoesNothingPressedTogetherOrBroken) {
  for (const auto& [memory, lift] : {std::pair{0.0f, -0.001f}, std::pair{0.01f, 0.002f}}) {
    TieProbe probe(memory);
    const auto u = probe.lifted(lift);
    EXPECT_EQ(probe.energy(u), 0);
    for (std::uint32_t n = 0; n < u.size(); ++n)
      EXPECT_EQ(length(probe.gradient(NodeIndex(n), u)), 0);
  }
}

TEST(TieEnergy, ActsOnBothBodiesAlike) {
  TieProbe probe(0.002f);
  const auto u = probe.lifted(0.003f, 5e-4f);
  Vec3d force, torque;
  double size = 0;
  for (std::uint32_t n = 0; n < u.size(); ++n) {
    const Vec3d g = probe.gradient(NodeIndex(n), u);
    force += g;
    torque += cross(probe.organ().mesh.rest_positions[n] + to_double(u[n]), g);
    size += length(g);
  }
  EXPECT_GT(size, 1e-3);
  EXPECT_LT(length(force), 1e-6 * size);
  EXPECT_LT(length(torque), 1e-6 * size * 0.03);
}

// No two nodes of a tie have one colour: lanes and workers may do them at once.
TEST(TieEnergy, CouplesItsNodes) {
  const auto organ = testing::make_strip({.spacing_mm = 5});
  const topology::Topology topology(organ);
  const Groups groups(topology, Coupling::Elements);
  for (std::size_t i = 0; i < topology.ties().count(); ++i)
    for (const auto a : topology.ties()[i].ends[0].nodes)
      for (const auto b : topology.ties()[i].ends[1].nodes)
        EXPECT_NE(groups.colour_of(a), groups.colour_of(b)) << "tie " << i;
}

}  // namespace
}  // namespace trocar::dynamics
