// Packs: each needed slot has a lane, eight together where they can be, and what is evaluated there
// is what its group would give, bit for bit, whatever was cut before.

#include "server/tissue/dynamics/lane_packs.h"

#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/dynamics/block_descent.h"
#include "tests/dynamics/edited_organ.h"
#include "tests/support/random.h"

namespace trocar::dynamics {
namespace {

using material::ElasticLaw;
using testing::EditedOrgan;

struct Kind {
  const char* name;
  ElasticLaw law;
  bool is_averaged = false;
};

organ::Organ liver_of(const Kind& kind, int tets = 1500) {
  auto organ = *catalogue::make_liver(tets);
  organ.material.elastic_law = kind.law;
  organ.material.has_averaged_strain = kind.is_averaged;
  organ.material.edge_damping_time_s = 1e-3;
  return organ;
}

// A ball of slots of nodes around a place.
std::vector<Slot> slots_around(const Groups& groups, const topology::Topology& topology,
                               const Vec3d& place, double radius) {
  std::vector<Slot> slots;
  for (std::uint32_t n = 0; n < topology.node_count(); ++n)
    if (topology.has_node(NodeIndex(n)) && length(topology.rest()[n] - place) < radius)
      slots.push_back(groups.slot_of(NodeIndex(n)));
  return slots;
}

Vec3d place_of(const topology::Topology& topology, std::mt19937& random) {
  for (;;) {
    const auto node = static_cast<std::uint32_t>(random() % topology.node_count());
    if (topology.has_node(NodeIndex(node))) return topology.rest()[node];
  }
}

// Says which slots the copies in each lane are of.
struct Copies {
  std::vector<SlotLanes> slots;

  void follow(const LanePacks& packs) {
    slots.resize(packs.size());
    for (const auto& [pack, lanes] : packs.changed())
      for (std::size_t lane = 0; lane < kLanes; ++lane)
        if (lanes >> lane & 1) slots[pack].v[lane] = packs.slots(pack).v[lane];
  }
};

TEST(LanePacks, HoldEachNeededSlotInAPackOfItsColourAndFewPacksDo) {
  const auto organ = *catalogue::make_liver(18'500);
  const topology::Topology topology(organ);
  const Groups groups(topology, Coupling::Elements);
  LanePacks packs;
  packs.extend(groups);
  Copies copies;
  std::mt19937 random(3);
  std::size_t in_groups = 0, in_packs = 0;
  for (int round = 0; round < 60; ++round) {
    const double radius = 0.01 + 0.01 * static_cast<double>(random() % 3);
    const auto slots = slots_around(groups, topology, place_of(topology, random), radius);
    packs.place(groups, slots);
    copies.follow(packs);
    std::vector<std::size_t> of_colour(groups.colour_count());
    std::vector<std::vector<Group>> used(groups.colour_count());
    std::vector<Group> homes;
    for (const Slot slot : slots) {
      const Slot place = packs.place_of(slot);
      ASSERT_NE(place, kNoSlot);
      ASSERT_EQ(packs.slots(place / kLanes).v[place % kLanes], slot);
      ASSERT_EQ(copies.slots[place / kLanes].v[place % kLanes], slot) << "it was copied";
      ASSERT_TRUE(packs.held(place / kLanes) >> (place % kLanes) & 1);
      ++of_colour[groups.colour_of(slot / kLanes)];
      used[groups.colour_of(slot / kLanes)].push_back(place / kLanes);
      homes.push_back(slot / kLanes);
    }
    const auto count_distinct = [](std::vector<Group>& list) {
      std::ranges::sort(list);
      list.erase(std::unique(list.begin(), list.end()), list.end());
      return list.size();
    };
    in_groups += count_distinct(homes);
    std::vector<Group> all;
    for (std::size_t colour = 0; colour < used.size(); ++colour) {
      in_packs += count_distinct(used[colour]);
      all.insert(all.end(), used[colour].begin(), used[colour].end());
    }
    std::vector<std::uint32_t> begins;
    packs.order_by_colour(all, begins);
    ASSERT_EQ(begins.back(), all.size());
    ASSERT_EQ(count_distinct(all), begins.back()) << "a pack is of one colour";
    // Some go, as after a cut; the others must stay right.
    for (int i = 0; i < 5 && !slots.empty(); ++i) packs.remove(slots[random() % slots.size()]);
  }
  EXPECT_LT(2 * in_packs, in_groups);
}

TEST(LanePacks, LeaveANodeWhereItIsWhileItIsNeeded) {
  const auto organ = *catalogue::make_liver(6000);
  const topology::Topology topology(organ);
  const Groups groups(topology, Coupling::Elements);
  LanePacks packs;
  packs.extend(groups);
  const Vec3d place = organ.mesh.rest_positions[organ.mesh.surface_nodes[40].value];
  packs.place(groups, slots_around(groups, topology, place, 0.03));
  packs.place(groups, slots_around(groups, topology, place, 0.03));
  EXPECT_TRUE(packs.changed().empty());
}

class PackedEnergies : public ::testing::TestWithParam<Kind> {};

TEST_P(PackedEnergies, AreThoseOfTheGroups) {
  EditedOrgan edited(liver_of(GetParam()), 5);
  auto& topology = edited.topology();
  Tissue tissue(topology);
  LanePacks packs;
  packs.extend(tissue.groups());
  std::mt19937 random(7);
  for (int round = 0; round < 12; ++round) {
    const auto& groups = tissue.groups();
    const auto slots = slots_around(groups, topology, place_of(topology, random), 0.03);
    packs.place(groups, slots);
    for (const auto& [pack, changed] : packs.changed())
      tissue.pack({kFirstPack + pack, packs.slots(pack), changed, packs.held(pack)});
    std::vector<Float4> x, start;
    for (auto* pose : {&x, &start})
      for (const auto& v : trocar::testing::random_vectors(groups.slot_count(), 0.001f, random()))
        pose->push_back(to_float4(v));
    if (auto* const strain = tissue.nodal_strain())
      for (Group g = 0; g < groups.group_count(); ++g) strain->restart_group(g, x.data());
    const auto result_of = [&](Group group, const SlotLanes& from, std::size_t lane) {
      const Vec8 own = gather(x.data(), from);
      tissue.begin_group(group, start.data(), gather(start.data(), from), 1000);
      NodeStep8 step{zero_vec8(), zero_sym_mat8()};
      tissue.add(group, x.data(), own, step);
      Vec3Lanes gradient;
      SymMat3Lanes block;
      store(gradient, step.gradient);
      store(block, step.block);
      return std::pair(gradient.at(lane), block.at(lane));
    };
    for (const Slot slot : slots) {
      const Slot at = packs.place_of(slot);
      const Group pack = at / kLanes;
      const auto packed = result_of(kFirstPack + pack, packs.slots(pack), at % kLanes);
      const auto own = result_of(slot / kLanes, slots_of(slot / kLanes), slot % kLanes);
      ASSERT_EQ(packed.first, own.first);
      ASSERT_EQ(std::memcmp(&packed.second, &own.second, sizeof packed.second), 0);
    }
    edited.edit();
    tissue.update_topology(topology);
    topology.clear_changes();
    packs.extend(tissue.groups());
    for (const auto lanes : tissue.rebuilt())
      for (std::uint32_t lane = 0; lane < kLanes; ++lane)
        if (lanes.has(lane)) packs.remove(lanes.group * kLanes + lane);
  }
}

INSTANTIATE_TEST_SUITE_P(Laws, PackedEnergies,
                         ::testing::Values(Kind{"springs", ElasticLaw::Springs},
                                           Kind{"linear", ElasticLaw::TensorMass},
                                           Kind{"neo", ElasticLaw::NeoHookean},
                                           Kind{"averaged", ElasticLaw::NeoHookean, true}),
                         [](const auto& entry) { return entry.param.name; });

// The same few nodes solved in packs, by one worker and by three, and in their groups.
TEST(LanePacks, ChangeNoResult) {
  const Kind kind{"neo", ElasticLaw::NeoHookean};
  const auto organ = liver_of(kind, 6000);
  struct Run {
    Run(const organ::Organ& organ, unsigned workers, bool is_packed)
        : world(organ), solver(organ, world, workers) {
      if (is_packed) solver.use_linear_far_field(world);
    }
    world::World world;
    BlockDescent solver;
  };
  Run in_groups(organ, 1, false), packed(organ, 1, true), by_three(organ, 3, true);
  std::mt19937 random(11);
  const topology::Topology topology(organ);
  std::size_t moved = 0;
  for (int round = 0; round < 20; ++round) {
    const Vec3d place = place_of(topology, random);
    std::vector<NodeIndex> near;
    for (std::uint32_t n = 0; n < topology.node_count(); ++n)
      if (length(topology.rest()[n] - place) < 0.03 &&
          in_groups.world.node_classes[n] != world::NodeClass::Fixed)
        near.push_back(NodeIndex(n));
    if (near.empty()) continue;
    const contact::ContactPoint pull{.nodes = {near[0], near[0], near[0]},
                                     .weights = {1, 0, 0},
                                     .kind = contact::ContactPoint::Kind::Grip,
                                     .node_count = 1,
                                     .moved = 1,
                                     .stiffness = 50,
                                     .limit_n = 1,
                                     .anchor = {0.004f, 0, 0.002f}};
    contact::ContactList contacts;
    contacts.points = {pull};
    contacts.tools = {{.tool = ToolSlot{0}, .end = 1}};
    const SweepBand bands[] = {{near.size() / 3, 4}, {near.size(), 2}};
    for (int step = 0; step < 4; ++step)
      for (Run* run : {&in_groups, &packed, &by_three})
        run->solver.solve(contacts, near, {.sweeps = 4, .bands = bands}, run->world);
    for (const auto node : near) moved += length(packed.world.displacements[node.value]) > 1e-6f;
    ASSERT_EQ(packed.world.displacements, in_groups.world.displacements) << "round " << round;
    ASSERT_EQ(by_three.world.displacements, in_groups.world.displacements) << "round " << round;
    ASSERT_EQ(by_three.world.velocities, in_groups.world.velocities) << "round " << round;
  }
  EXPECT_GT(moved, 100u);
}

}  // namespace
}  // namespace trocar::dynamics
