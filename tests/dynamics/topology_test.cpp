// Following edits of the topology: always what building anew gives, and only where it changed.

#include "server/tissue/topology/topology.h"

#include <gtest/gtest.h>

#include <cstring>
#include <set>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/dynamics/block_descent.h"
#include "server/tissue/dynamics/hyperelastic.h"
#include "server/tissue/dynamics/tissue.h"
#include "tests/dynamics/edited_organ.h"
#include "tests/mesh/block_mesh.h"

namespace trocar::dynamics {
namespace {

using material::ElasticLaw;
using testing::EditedOrgan;

struct Case {
  const char* name;
  organ::Organ (*make)();
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << c.name;
}

organ::Organ block(int n) {
  organ::Organ organ;
  organ.name = "block";
  organ.mesh = trocar::testing::block_mesh(n, 0.01);
  for (std::size_t i = 0; i < organ.mesh.node_count(); ++i)  // no regular directions left
    organ.mesh.rest_positions[i] +=
        Vec3d{double(i * 7 % 11) - 5, double(i * 5 % 13) - 6, double(i * 3 % 7) - 3} * 2e-4;
  organ.mesh.build_adjacency();
  organ.node_masses_kg = organ::lumped_masses(organ);
  return organ;
}

organ::Organ block_of(ElasticLaw law, bool has_averaged_strain = false, int n = 4) {
  auto organ = block(n);
  organ.material.elastic_law = law;
  organ.material.has_averaged_strain = has_averaged_strain;
  return organ;
}

organ::Organ block_of_many_materials(bool has_averaged_strain) {
  auto organ = block_of(ElasticLaw::TensorMass);
  const auto half = [&](auto&& is_in) {
    std::vector<NodeIndex> nodes;
    for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n)
      if (is_in(organ.mesh.rest_positions[n])) nodes.emplace_back(n);
    return nodes;
  };
  organ.material.tension = 0.02;
  auto springs = organ.material, stiff = organ.material;
  springs.elastic_law = ElasticLaw::Springs;
  springs.fibre_direction = {1, 0, 1};
  springs.fibre_stiffness_ratio = 3;
  springs.tension = 0.03;
  stiff.elastic_law = ElasticLaw::NeoHookean;
  stiff.young_modulus_pa *= 10;
  stiff.has_averaged_strain = has_averaged_strain;
  stiff.fibre_direction = {0, 1, 2};
  stiff.fibre_tension = 0.04;
  organ.regions = {{"right", springs, half([](const Vec3d& p) { return p.x > -0.005; })},
                   {"top", stiff, half([](const Vec3d& p) { return p.y > -0.006; })}};
  for (const auto& p : organ.mesh.rest_positions)
    organ.stress_free_positions_m.push_back(Vec3d{p.x * 0.98, p.y, p.z * 1.01});
  return organ;
}

organ::Organ small_liver(bool has_averaged_strain) {
  auto organ = catalogue::make_liver(1500);
  organ->material.elastic_law = ElasticLaw::NeoHookean;
  organ->material.has_averaged_strain = has_averaged_strain;
  return *organ;
}

// Greedy colours are not needed to see that they are valid.
void expect_valid_groups(const topology::Topology& topology, const Groups& groups,
                         Coupling coupling) {
  std::size_t nodes = 0, in_slots = 0;
  for (Slot slot = 0; slot < groups.slot_count(); ++slot)
    if (groups.node_at(slot).is_valid()) {
      ++in_slots;
      ASSERT_EQ(groups.slot_of(groups.node_at(slot)), slot);
    }
  std::vector<NodeIndex> near, far;
  for (std::uint32_t n = 0; n < topology.node_count(); ++n) {
    const NodeIndex node(n);
    if (!topology.has_node(node)) {
      ASSERT_EQ(groups.slot_of(node), kNoSlot);
      continue;
    }
    ++nodes;
    ASSERT_LT(groups.colour_of(node), groups.colour_count());
    topology.neighbours_of(node, near);
    for (const auto j : near) {
      ASSERT_NE(groups.colour_of(j), groups.colour_of(node)) << node.value << ' ' << j.value;
      if (coupling == Coupling::Elements) continue;
      topology.neighbours_of(j, far);
      for (const auto k : far)
        if (k != node) {
          ASSERT_NE(groups.colour_of(k), groups.colour_of(node));
        }
    }
  }
  ASSERT_EQ(in_slots, nodes) << "each in one slot";
}

std::vector<Vec3f> some_displacements(std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  const auto uniform = [&] {
    return 0.0015f * (static_cast<float>(random()) / 2147483648.0f - 1.0f);
  };
  std::vector<Vec3f> u(count);
  for (auto& v : u) v = {uniform(), uniform(), uniform()};
  return u;
}

struct NodeResult {
  Vec3f gradient;
  SymMat3f block;
  bool operator==(const NodeResult& b) const { return std::memcmp(this, &b, sizeof b) == 0; }
};

// Holds the result of each node, by index, and the displacements after sweeps over all colours, as
// a solver does them.
struct Evaluated {
  std::vector<NodeResult> nodes;
  double energy = 0;
  std::vector<Vec3f> swept;
};

Evaluated evaluate(Tissue& tissue, const std::vector<Vec3f>& u) {
  const auto& groups = tissue.groups();
  std::vector<Float4> x(groups.slot_count());
  const auto each_node = [&](auto&& visit) {
    for (std::uint32_t n = 0; n < u.size(); ++n)
      if (const Slot slot = groups.slot_of(NodeIndex(n)); slot != kNoSlot) visit(n, slot);
  };
  each_node([&](std::uint32_t n, Slot slot) { x[slot] = to_float4(u[n]); });
  std::vector<Group> order;
  std::vector<std::uint32_t> begins;
  for (Group g = 0; g < groups.group_count(); ++g)
    if (groups.colour_of(g) != kNoColour) order.push_back(g);
  groups.order_by_colour(order, begins);
  const std::vector<Float4> start(x.size());
  for (const auto g : order) tissue.begin_group(g, start.data(), 1000);
  for (Group g = 0; g < groups.group_count(); ++g)
    if (auto* const strain = tissue.nodal_strain()) strain->restart_group(g, x.data());
  Evaluated result;
  result.nodes.resize(u.size());
  result.swept.resize(u.size());
  result.energy = tissue.energy_j(u);
  for (int sweep = 0; sweep < 3; ++sweep)
    for (const auto g : order) {
      NodeStep8 step{zero_vec8(), zero_sym_mat8()};
      if (sweep > 0) step.block.add_identity(all(5.0f));
      const Vec8 own = load_group(&x[g * kLanes]);
      tissue.add(g, x.data(), own, step);
      if (sweep == 0) {  // nothing moves yet
        Vec3Lanes gradient;
        SymMat3Lanes block;
        store(gradient, step.gradient);
        store(block, step.block);
        for (std::size_t lane = 0; lane < kLanes; ++lane)
          if (const auto node = groups.nodes_of(g)[lane]; node.is_valid())
            result.nodes[node.value] = {gradient.at(lane), block.at(lane)};
        continue;
      }
      const Vec8 dx = solve_positive_definite(step.block, step.gradient) * all(-1.0f);
      store_group(&x[g * kLanes], own + dx);
      if (auto* const strain = tissue.nodal_strain()) strain->after_move(g, dx, 0xff);
    }
  each_node([&](std::uint32_t n, Slot slot) { result.swept[n] = to_vec3(x[slot]); });
  return result;
}

std::vector<Colour> colours_of(const Tissue& tissue, const topology::Topology& topology) {
  std::vector<Colour> colours;
  for (std::uint32_t n = 0; n < topology.node_count(); ++n)
    colours.push_back(tissue.groups().colour_of(NodeIndex(n)));
  return colours;
}

void expect_as_built_anew(EditedOrgan& edited, Tissue& tissue, std::uint32_t seed) {
  const auto& topology = edited.topology();
  const auto u = some_displacements(topology.node_count(), seed);
  const auto followed = evaluate(tissue, u);

  std::vector<NodeIndex> node_of;
  const auto organ = edited.built_anew(node_of);
  Tissue fresh(organ);
  std::vector<Vec3f> fresh_u;
  for (const auto node : node_of) fresh_u.push_back(u[node.value]);
  const auto expected = evaluate(fresh, fresh_u);
  ASSERT_EQ(followed.energy, expected.energy);
  for (std::size_t n = 0; n < node_of.size(); ++n)
    ASSERT_EQ(followed.nodes[node_of[n].value], expected.nodes[n]) << "node " << node_of[n].value;

  // Other groups of the same colours.
  Tissue stored(topology, colours_of(tissue, topology));
  const auto again = evaluate(stored, u);
  ASSERT_EQ(followed.energy, again.energy);
  ASSERT_EQ(std::memcmp(followed.swept.data(), again.swept.data(), u.size() * sizeof u[0]), 0);
}

class FollowTopology : public ::testing::TestWithParam<Case> {};

TEST_P(FollowTopology, EveryEditGivesWhatBuildingAnewGives) {
  for (std::uint32_t seed = 1; seed <= 2; ++seed) {
    EditedOrgan edited(GetParam().make(), seed);
    auto& topology = edited.topology();
    Tissue tissue(edited.topology());
    const auto coupling =
        tissue.nodal_strain() != nullptr ? Coupling::NodalStrain : Coupling::Elements;
    std::size_t moved = 0;
    for (int edit = 0; edit < 40; ++edit) {
      SCOPED_TRACE("seed " + std::to_string(seed) + " edit " + std::to_string(edit));
      for (auto count = edited.below(3) + 1; count > 0; --count) edited.edit();
      moved += tissue.update_topology(topology).nodes_moved;
      topology.clear_changes();
      expect_valid_groups(topology, tissue.groups(), coupling);
      if (edit % 4 == 3) expect_as_built_anew(edited, tissue, seed);
      if (HasFatalFailure()) return;
    }
    EXPECT_GT(moved, 10u) << "the edits do something";
  }
}

TEST_P(FollowTopology, WorkIsInProportionToTheChange) {
  EditedOrgan edited(GetParam().make(), 7);
  auto& topology = edited.topology();
  Tissue tissue(edited.topology());
  std::vector<NodeIndex> neighbours;
  for (int edit = 0; edit < 100; ++edit) {
    edited.edit();
    const auto report = tissue.update_topology(topology);
    // A changed node, its neighbours if it moved or smoothing domains count, and slots left behind.
    std::set<NodeIndex> expected;
    const auto expect = [&](std::span<const NodeIndex> nodes, bool has_neighbours) {
      for (const auto node : nodes) {
        expected.insert(node);
        topology.neighbours_of(node, neighbours);
        if (has_neighbours) expected.insert(neighbours.begin(), neighbours.end());
      }
    };
    expect(topology.changed(), tissue.nodal_strain() != nullptr);
    expect(tissue.groups().moved(), true);
    EXPECT_EQ(report.nodes_changed, topology.changed().size());
    EXPECT_LE(report.lanes, expected.size() + tissue.groups().vacated().size());
    EXPECT_LE(report.groups, report.lanes);
    std::size_t incidences = 0;
    for (const auto node : expected)
      incidences += topology.tets_of(node).size() * 4 + topology.links_of(node).size();
    EXPECT_LE(report.rows, incidences);
    EXPECT_LE(report.nodes_moved, 8 * report.nodes_changed);
    topology.clear_changes();
  }
}

TEST_P(FollowTopology, NoChangeTouchesNothing) {
  EditedOrgan edited(GetParam().make(), 3);
  Tissue tissue(edited.topology());
  const auto report = tissue.update_topology(edited.topology());
  EXPECT_EQ(report.lanes + report.rows + report.nodes_changed, 0u);
  EXPECT_TRUE(tissue.touched().empty());
}

INSTANTIATE_TEST_SUITE_P(
    Laws, FollowTopology,
    ::testing::Values(
        Case{"Springs", [] { return block_of(ElasticLaw::Springs); }},
        Case{"TensorMass", [] { return block_of(ElasticLaw::TensorMass); }},
        Case{"NeoHookean", [] { return block_of(ElasticLaw::NeoHookean); }},
        Case{"NeoHookeanAveraged", [] { return block_of(ElasticLaw::NeoHookean, true); }},
        Case{"ManyMaterials", [] { return block_of_many_materials(false); }},
        Case{"ManyMaterialsAveraged", [] { return block_of_many_materials(true); }},
        Case{"Liver", [] { return small_liver(false); }},
        Case{"LiverAveraged", [] { return small_liver(true); }},
        Case{"Lattice", [] { return *catalogue::make_lattice({.nx = 7, .ny = 5, .nz = 6}); }}),
    [](const auto& tested) { return tested.param.name; });

TEST(FollowTopology, LawsThatNeedTheInvariantFollowToo) {
  EditedOrgan edited(block_of(ElasticLaw::NeoHookean), 4);
  auto& topology = edited.topology();
  Tissue tissue(topology);
  const ReducedPolynomialLaw law{{1.9f, 1.6f, 3.0f, 2.0f}};
  const auto parameters = hyperelastic_parameters(topology.organ(), material::is_hyperelastic);
  Hyperelastic<ReducedPolynomialLaw> energy(topology, tissue.groups(), nullptr, parameters, law);
  for (int edit = 0; edit < 30; ++edit) {
    edited.edit();
    tissue.update_topology(topology);
    energy.rebuild(topology, tissue.groups(), tissue.touched());
    topology.clear_changes();
  }
  const auto& groups = tissue.groups();
  const Hyperelastic<ReducedPolynomialLaw> fresh(topology, groups, nullptr, parameters, law);
  const auto u = some_displacements(groups.slot_count(), 1);
  std::vector<Float4> x;
  for (const auto& v : u) x.push_back(to_float4(v));
  for (Group g = 0; g < groups.group_count(); ++g) {
    Vec3Lanes gradients[2];
    for (const auto* e :
         {&fresh, static_cast<const Hyperelastic<ReducedPolynomialLaw>*>(&energy)}) {
      NodeStep8 step{zero_vec8(), zero_sym_mat8()};
      e->add(g, x.data(), load_group(&x[g * kLanes]), step);
      store(gradients[e == &fresh], step.gradient);
    }
    ASSERT_EQ(std::memcmp(&gradients[0], &gradients[1], sizeof gradients[0]), 0) << "group " << g;
  }
}

TEST(FollowTopology, ALargeOrganIsTouchedWhereItIsEdited) {
  auto organ = block(20);
  EditedOrgan edited(std::move(organ), 5);
  auto& topology = edited.topology();
  Tissue tissue(topology);
  for (int edit = 0; edit < 200; ++edit) {
    edited.bisect_edge();
    const auto report = tissue.update_topology(topology);
    EXPECT_LE(report.nodes_moved, 3u);
    EXPECT_LE(report.lanes, 60u) << "of " << topology.node_count();
    EXPECT_LE(report.rows, 2000u);
    topology.clear_changes();
  }
}

TEST(FollowTopology, FillAndMemoryStayBoundedOverThousandsOfEdits) {
  for (const bool has_averaged_strain : {false, true}) {
    EditedOrgan edited(block_of(ElasticLaw::NeoHookean, has_averaged_strain, 7), 11);
    auto& topology = edited.topology();
    Tissue tissue(topology);
    const double fill_before = tissue.groups().fill();
    double lowest = 1;
    for (int edit = 0; edit < 2000; ++edit) {
      if (edit / 250 % 2 == 0)  // growing and shrinking by turns
        edited.edit();
      else
        edited.edit_without_growth();
      tissue.update_topology(topology);
      topology.clear_changes();
      const auto& groups = tissue.groups();
      lowest = std::min(lowest, groups.fill());
      std::size_t nodes = 0, in_use = 0;
      for (std::uint32_t n = 0; n < topology.node_count(); ++n)
        nodes += topology.has_node(NodeIndex(n));
      for (Group g = 0; g < groups.group_count(); ++g) in_use += groups.colour_of(g) != kNoColour;
      // At most a quarter of the lanes may be vacant, and two groups of each colour besides.
      ASSERT_LE(in_use * 3 / 4, nodes / kLanes + 2 * groups.colour_count());
    }
    const Tissue fresh(topology);
    std::printf(
        "  fill %.2f at first, lowest %.2f, at the end %.2f, built anew %.2f; colours %zu, built "
        "anew %zu; %zu tets\n",
        fill_before, lowest, tissue.groups().fill(), fresh.groups().fill(),
        tissue.groups().colour_count(), fresh.groups().colour_count(), topology.tet_count());
    EXPECT_GT(lowest, 0.6);
    EXPECT_LE(tissue.groups().colour_count(), fresh.groups().colour_count() * 2);
    expect_as_built_anew(edited, tissue, 1);
  }
}

// --- The solver ---

void follow_nodes(const topology::Topology& topology, world::World& world) {
  world.rest_positions.resize(topology.node_count());
  world.masses.resize(topology.node_count());
  world.displacements.resize(topology.node_count());
  world.velocities.resize(topology.node_count());
  world.node_classes.resize(topology.node_count(), world::NodeClass::Far);
  world.quiet_ticks.resize(topology.node_count());
  for (const auto node : topology.changed()) {
    world.rest_positions[node.value] = to_float(topology.rest()[node.value]);
    world.masses[node.value] =
        topology.has_node(node) ? static_cast<float>(topology.lumped_mass(node)) : 0;
  }
}

TEST(FollowTopology, TheSolverFollowsWithAnyNumberOfWorkers) {
  for (const auto& make : {+[] { return block_of(ElasticLaw::Springs); },
                           +[] { return block_of(ElasticLaw::NeoHookean, true); },
                           +[] { return block_of_many_materials(false); }}) {
    std::vector<Vec3f> results[2];
    for (const unsigned workers : {1u, 2u}) {
      EditedOrgan edited(make(), 21);
      auto& topology = edited.topology();
      world::World world(topology.organ());
      BlockDescent solver(topology.organ(), world, workers);
      for (int edit = 0; edit < 40; ++edit) {
        edited.edit();
        follow_nodes(topology, world);
        solver.update_topology(topology, world);
        topology.clear_changes();
        std::vector<NodeIndex> near;
        for (std::uint32_t n = 0; n < topology.node_count(); ++n)
          if (topology.has_node(NodeIndex(n)) && world.masses[n] > 0) near.emplace_back(n);
        if (edit == 0) {
          world.velocities[near[30].value] = {0.5f, 0.2f, 0};
          solver.read_state(world, std::span(near).subspan(30, 1));
        }
        const auto report = solver.solve({}, near, {}, world);
        ASSERT_EQ(report.nodes_rejected, 0u);
      }
      results[workers - 1] = world.displacements;
    }
    float largest = 0;
    for (const auto& u : results[0]) largest = std::max(largest, length(u));
    EXPECT_GT(largest, 1e-6f);
    ASSERT_EQ(results[0], results[1]);
  }
}

// --- Adjacency and blocks ---

TEST(Topology, AdjacencyMassesAndMaterialsAreThoseOfTheOrganBuiltAnew) {
  EditedOrgan edited(block_of_many_materials(true), 31);
  auto& topology = edited.topology();
  for (int edit = 0; edit < 60; ++edit) edited.edit();
  std::vector<NodeIndex> node_of;
  const auto organ = edited.built_anew(node_of);
  const auto masses = organ::lumped_masses(organ);
  const auto map = organ::material_map(organ);
  std::vector<NodeIndex> neighbours;
  for (std::size_t n = 0; n < node_of.size(); ++n) {
    const auto node = node_of[n];
    EXPECT_EQ(topology.lumped_mass(node), masses[n]);
    EXPECT_EQ(topology.material_of(node), map.nodes[n]);
    const auto tets = organ.mesh.node_tets[NodeIndex(n)];
    ASSERT_EQ(topology.tets_of(node).size(), tets.size());
    for (std::size_t i = 0; i < tets.size(); ++i)
      EXPECT_EQ(topology.material_of(topology.tets_of(node)[i]), map.tets[tets[i].value]);
    topology.neighbours_of(node, neighbours);
    std::vector<NodeIndex> expected;
    for (const auto other : organ.mesh.node_neighbours[NodeIndex(n)])
      expected.push_back(node_of[other.value]);
    EXPECT_EQ(neighbours, expected);
  }
}

TEST(Blocks, HoldWhatIsPutInThemInBoundedMemory) {
  Blocks<std::uint32_t> blocks;
  std::vector<std::vector<std::uint32_t>> expected(2000);
  blocks.reserve(expected.size() * 100);
  blocks.extend(expected.size());
  std::mt19937 random(1);
  const auto resize = [&](std::size_t b, std::size_t size) {
    const auto old = expected[b].size();
    expected[b].resize(size);
    const auto items = blocks.resize(b, static_cast<std::uint32_t>(size));
    for (std::size_t i = old; i < size; ++i) {
      ASSERT_EQ(items[i], 0u);
      items[i] = expected[b][i] = static_cast<std::uint32_t>(random());
    }
  };
  for (std::size_t b = 0; b < expected.size(); ++b) resize(b, 100);
  EXPECT_EQ(blocks.capacity(), expected.size() * 100) << "without gaps";
  EXPECT_EQ(blocks[1].data(), blocks[0].data() + 100);
  blocks.end_building();
  for (std::size_t i = 0; i < 60000; ++i) {
    // Sizes around a mean that grows and shrinks.
    const auto mean = 80 + 80 * (i / 6000 % 3);
    resize(random() % expected.size(), random() % (2 * mean));
    blocks.tidy();
    ASSERT_LE(blocks.capacity(), 4 * blocks.live() + 100000);
  }
  for (std::size_t b = 0; b < expected.size(); ++b)
    ASSERT_TRUE(std::ranges::equal(blocks[b], expected[b])) << "block " << b;
  // Nothing more to do: all of them in order again.
  const auto in_order = [&] {
    std::size_t count = 0;
    for (std::size_t b = 1; b < expected.size(); ++b)
      count += blocks[b].data() >= blocks[b - 1].data();
    return count;
  };
  for (int i = 0; i < 100; ++i) blocks.tidy();
  EXPECT_GT(in_order(), expected.size() / 2);
  EXPECT_LT(blocks.capacity(), 3 * blocks.live());
}

}  // namespace
}  // namespace trocar::dynamics
