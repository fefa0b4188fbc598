// The solver: against closed forms, and the momentum balance of the whole system with reactions.

#include "server/tissue/dynamics/block_descent.h"

#include <gtest/gtest.h>

#include <numeric>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/contact/proxies.h"

namespace trocar::dynamics {
namespace {

using contact::ContactList;
using contact::ContactPoint;

struct Bench {
  explicit Bench(organ::Organ o) : organ(std::move(o)), world(organ), solver(organ, world) {
    for (std::uint32_t i = 0; i < organ.mesh.node_count(); ++i)
      if (world.node_classes[i] != world::NodeClass::Fixed) free_nodes.push_back(NodeIndex(i));
  }
  SolveReport step(const SolveSettings& settings) {
    return solver.solve(contacts, free_nodes, settings, world);
  }
  void tie(NodeIndex node, const Vec3f& target, float stiffness) {
    contacts.points.push_back({.nodes = {node, node, node},
                               .weights = {1, 0, 0},
                               .kind = ContactPoint::Kind::Grip,
                               .node_count = 1,
                               .moved = 1,
                               .stiffness = stiffness,
                               .limit_n = 1e6f,
                               .anchor = target});
    contacts.tools = {
        {.tool = ToolSlot{0}, .end = static_cast<std::uint32_t>(contacts.points.size())}};
  }

  organ::Organ organ;
  world::World world;
  BlockDescent solver;
  ContactList contacts;
  std::vector<NodeIndex> free_nodes;
};

organ::Organ lattice(int nx, int ny, int nz) {
  auto organ = catalogue::make_lattice({.nx = nx, .ny = ny, .nz = nz});
  EXPECT_TRUE(organ.ok()) << (organ.ok() ? "" : organ.error().message);
  return *organ;
}

TEST(BlockDescent, AColumnUnderAPullStretchesLikeSpringsInSeries) {
  Bench bench(lattice(2, 6, 2));
  double top = 0;
  for (const auto& p : bench.organ.mesh.rest_positions) top = std::max(top, p.y);
  // Ties so weak that they are all but constant forces: F = k_tie x distance.
  const float k_tie = 1e-3f, far = 100.0f;
  for (std::uint32_t i = 0; i < bench.organ.mesh.node_count(); ++i)
    if (bench.organ.mesh.rest_positions[i].y > top - 1e-6)
      bench.tie(NodeIndex(i), {0, far, 0}, k_tie);
  for (int tick = 0; tick < 4000; ++tick) bench.step({.sweeps = 8});
  const double force = static_cast<double>(k_tie * far);
  const double expected = force * 5 / bench.organ.material.spring_stiffness_n_m;
  for (std::uint32_t i = 0; i < bench.organ.mesh.node_count(); ++i)
    if (bench.organ.mesh.rest_positions[i].y > top - 1e-6) {
      EXPECT_NEAR(bench.world.displacements[i].y, expected, 1e-3 * expected);
    }
  const Vec3f reaction =
      contact::reaction_on(bench.contacts, bench.contacts.tools[0], bench.world).force_n;
  EXPECT_NEAR(reaction.y, -4 * force, 4e-3 * force) << "the tissue pulls the tool down";
}

TEST(BlockDescent, FreeFlightWithNodalDampingFollowsImplicitEuler) {
  // One unsprung axis of motion: all nodes move alike, so springs are silent and
  // v_{n+1} = v_n / (1 + rate dt) exactly.
  auto organ = lattice(3, 3, 3);
  organ.fixed_nodes.clear();
  Bench bench(organ);
  for (auto& v : bench.world.velocities) v = {0.2f, 0, 0};
  bench.solver.read_state(bench.world);
  for (int tick = 0; tick < 100; ++tick) bench.step({.sweeps = 60});
  const double rate = bench.organ.material.node_damping_per_s;
  const double expected = 0.2 * std::pow(1.0 + rate * 1e-3, -100);
  for (const auto& v : bench.world.velocities) {
    EXPECT_NEAR(v.x, expected, 1e-3 * expected);
    EXPECT_NEAR(v.y, 0, 1e-4);
  }
}

TEST(BlockDescent, MomentumChangesByTheForcesOfToolsAndDampingAlone) {
  auto organ = lattice(5, 5, 5);
  organ.fixed_nodes.clear();
  organ.material.node_damping_per_s = 0;
  Bench bench(organ);
  bench.tie(NodeIndex(7), {0.004f, 0.002f, -0.003f}, 500.0f);
  const auto momentum = [&] {
    Vec3d p;
    for (std::size_t i = 0; i < bench.world.node_count(); ++i)
      p += to_double(bench.world.velocities[i]) * static_cast<double>(bench.world.masses[i]);
    return p;
  };
  for (int tick = 0; tick < 200; ++tick) {
    const Vec3d before = momentum();
    const auto report = bench.step({.sweeps = 60, .over_relaxation = 1.2f});
    const Vec3d on_tool = to_double(
        contact::reaction_on(bench.contacts, bench.contacts.tools[0], bench.world).force_n);
    const Vec3d change = momentum() - before;
    // Each node's imbalance enters the sum: the residual bounds the error of the balance.
    const double bound = 1e-3 * (static_cast<double>(report.residual_n) *
                                     static_cast<double>(bench.world.node_count()) +
                                 1e-4);
    EXPECT_LT(length(change + on_tool * 1e-3), bound) << "tick " << tick;
  }
}

TEST(BlockDescent, EnergyNeverGrowsWithoutATool) {
  auto organ = lattice(5, 5, 5);
  Bench bench(organ);
  for (std::uint32_t i = 0; i < bench.world.node_count(); ++i)
    if (bench.world.node_classes[i] != world::NodeClass::Fixed)
      bench.world.velocities[i] = {0.3f * static_cast<float>(i % 3), -0.2f, 0.1f};
  bench.solver.read_state(bench.world);
  const auto energy = [&] {
    double e = bench.solver.tissue().energy_j(bench.world.displacements);
    for (std::size_t i = 0; i < bench.world.node_count(); ++i)
      e += 0.5 * static_cast<double>(bench.world.masses[i]) *
           length_squared(to_double(bench.world.velocities[i]));
    return e;
  };
  double last = energy();
  const double first = last;
  for (int tick = 0; tick < 500; ++tick) {
    bench.step({.sweeps = 20, .over_relaxation = 1.3f});
    const double now = energy();
    EXPECT_LE(now, last + 1e-6 * first) << "tick " << tick;
    last = now;
  }
  EXPECT_LT(last, 0.2 * first);
}

TEST(BlockDescent, MoreSweepsReduceTheResidual) {
  double last = INFINITY;
  for (const std::uint32_t sweeps : {1u, 4u, 16u, 64u}) {
    Bench bench(lattice(6, 6, 6));
    bench.tie(NodeIndex(100), {0.003f, 0.004f, 0}, 2000.0f);
    const double residual = bench.step({.sweeps = sweeps}).residual_n;
    EXPECT_LT(residual, 0.5 * last);
    last = residual;
  }
}

TEST(BlockDescent, ANonFiniteNodeIsRejectedAndCounted) {
  Bench bench(lattice(4, 4, 4));
  bench.tie(NodeIndex(40), {INFINITY, 0, 0}, 2000.0f);
  const auto report = bench.step({});
  EXPECT_EQ(report.nodes_rejected, 1u);
  for (const auto& u : bench.world.displacements) EXPECT_TRUE(is_finite(u));
}

TEST(BlockDescent, ForcesInProportionToMassMakeItFallFreely) {
  auto organ = lattice(3, 3, 3);
  organ.fixed_nodes.clear();
  organ.material.node_damping_per_s = 0;
  Bench bench(organ);
  std::vector<Vec3f> forces;
  for (const float mass : bench.world.masses) forces.push_back({0, -9.81f * mass, 0});
  for (int tick = 0; tick < 100; ++tick)
    bench.solver.solve(bench.contacts, bench.free_nodes, {.sweeps = 60}, bench.world,
                       {.forces = forces});
  for (const auto& v : bench.world.velocities) {
    EXPECT_NEAR(v.y, -0.981, 1e-4);
    EXPECT_NEAR(v.x, 0, 1e-5);
  }
}

TEST(BlockDescent, HeldNodesGoWhereTheyArePutAndTheForceForThatIsKnown) {
  Bench bench(lattice(2, 6, 2));
  std::vector<NodeIndex> held = bench.organ.fixed_nodes;
  const std::size_t fixed_count = held.size();
  std::vector<NodeIndex> active;
  for (const auto node : bench.free_nodes)
    (bench.organ.mesh.rest_positions[node.value].y > 0.0249 ? held : active).push_back(node);
  ASSERT_EQ(held.size(), 8u);
  std::vector<Vec3f> places(held.size());
  for (std::size_t i = fixed_count; i < held.size(); ++i) places[i] = {0, 0.010f, 0};
  SolveReport report;
  for (int tick = 0; tick < 3000; ++tick)
    report =
        bench.solver.solve(bench.contacts, active, {.sweeps = 500, .residual_tolerance_n = 1e-6f},
                           bench.world, {.held = held, .held_displacements = places});
  EXPECT_LT(report.sweeps, 500u) << "the tolerance ends the sweeps";
  EXPECT_LE(report.residual_n, 1e-6f);
  const double expected = 0.010 / 5 * bench.organ.material.spring_stiffness_n_m;
  for (std::size_t i = 0; i < held.size(); ++i) {
    EXPECT_EQ(bench.world.displacements[held[i].value], places[i]);
    const Vec3f force = bench.solver.holding_force(bench.contacts, held[i]);
    EXPECT_NEAR(force.y, i < fixed_count ? -expected : expected, 1e-3 * expected);
  }
}

TEST(BlockDescent, ANodeHeldAlongOneAxisSlidesAlongTheOthers) {
  auto organ = lattice(2, 6, 2);
  Bench bench(organ);
  std::vector<AxisHold> holds;
  std::vector<Vec3f> forces(organ.mesh.node_count());
  for (const auto node : bench.free_nodes)
    if (organ.mesh.rest_positions[node.value].y > 0.0249) {
      holds.push_back({.node = node, .axes = 2, .displacement = {0, 0.005f, 0}});
      forces[node.value] = {0.0005f, 0.3f, 0};
    }
  ASSERT_EQ(holds.size(), 4u);
  for (int tick = 0; tick < 2000; ++tick)
    bench.solver.solve(bench.contacts, bench.free_nodes, {.sweeps = 20}, bench.world,
                       {.forces = forces, .axis_holds = holds});
  const double pull = 0.005 / 5 * organ.material.spring_stiffness_n_m;
  for (const auto& hold : holds) {
    EXPECT_EQ(bench.world.displacements[hold.node.value].y, 0.005f);
    EXPECT_GT(bench.world.displacements[hold.node.value].x, 1e-4f);
    const Vec3f force = bench.solver.holding_force(bench.contacts, hold.node);
    EXPECT_NEAR(force.y, pull - 0.3, 0.05 * pull) << "what the load leaves of it";
    EXPECT_NEAR(force.x, 0, 1e-3);
  }
}

TEST(BlockDescent, WhatIsNotFiniteSendsItsRegionBackToTheStartOfTheStep) {
  Bench bench(lattice(6, 6, 6));
  for (int tick = 0; tick < 20; ++tick) {  // something moves everywhere
    std::vector<Vec3f> forces(bench.world.node_count(), Vec3f{0, 0.01f, 0});
    bench.solver.solve(bench.contacts, bench.free_nodes, {}, bench.world, {.forces = forces});
  }
  const auto before = bench.world.displacements;
  const NodeIndex broken = catalogue::lattice_node({.nx = 6, .ny = 6, .nz = 6}, 3, 5, 3);
  bench.tie(broken, {NAN, 0, 0}, 2000.0f);
  const auto report = bench.step({});
  EXPECT_EQ(report.nodes_rejected, 1u);
  EXPECT_GT(report.nodes_restored, 20u);
  EXPECT_LT(report.nodes_restored, 150u) << "a region, not the organ";
  EXPECT_EQ(bench.world.displacements[broken.value], before[broken.value]);
  EXPECT_EQ(bench.world.velocities[broken.value], Vec3f{});
  bench.contacts = {};
  for (int tick = 0; tick < 2000; ++tick) EXPECT_EQ(bench.step({}).nodes_rejected, 0u);
  EXPECT_LT(bench.step({}).residual_n, 1e-4f) << "goes on, and comes to rest";
  for (const auto& u : bench.world.displacements) EXPECT_TRUE(is_finite(u));
}

}  // namespace
}  // namespace trocar::dynamics
