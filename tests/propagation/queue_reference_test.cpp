// Two tools press into a lattice and slide towards each other. Queue, regions and solve are
// compared every tick with a reference that shares no code with the engine's: distances by plain
// breadth-first search per contact, sets instead of stamps, double precision instead of float.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <optional>
#include <set>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/step/simulation.h"

namespace trocar::propagation {
namespace {

using Graph = std::vector<std::vector<std::uint32_t>>;

std::map<std::uint32_t, std::uint32_t> distances(const Graph& graph,
                                                 const std::set<std::uint32_t>& from,
                                                 std::uint32_t limit) {
  std::map<std::uint32_t, std::uint32_t> distance;
  std::deque<std::uint32_t> open;
  for (const auto node : from) {
    distance[node] = 0;
    open.push_back(node);
  }
  while (!open.empty()) {
    const auto node = open.front();
    open.pop_front();
    if (distance[node] == limit) continue;
    for (const auto next : graph[node])
      if (distance.emplace(next, distance[node] + 1).second) open.push_back(next);
  }
  return distance;
}

struct ReferenceQueue {
  std::vector<std::uint32_t> nodes;
  bool is_merged = false;
};

// By the definitions in queue.h: layer = fewest layers of any contact; owner = lowest such contact;
// within a layer contacts take turns with their nodes ascending; merged = some node in both balls.
ReferenceQueue reference_queue(const Graph& graph,
                               const std::vector<std::set<std::uint32_t>>& contacts,
                               std::uint32_t depth) {
  std::vector<std::map<std::uint32_t, std::uint32_t>> balls;
  for (const auto& contact : contacts) balls.push_back(distances(graph, contact, depth));
  ReferenceQueue out;
  std::map<std::uint32_t, std::map<std::size_t, std::vector<std::uint32_t>>> layers;
  std::set<std::uint32_t> all;
  for (const auto& ball : balls)
    for (const auto& [node, _] : ball) out.is_merged |= !all.insert(node).second;
  for (const auto node : all) {
    std::size_t owner = 0;
    std::uint32_t best = 1'000'000;
    for (std::size_t c = 0; c < balls.size(); ++c)
      if (const auto it = balls[c].find(node); it != balls[c].end() && it->second < best) {
        best = it->second;
        owner = c;
      }
    layers[best][owner].push_back(node);
  }
  for (auto& [layer, by_contact] : layers)
    for (std::size_t turn = 0, left = 1; left > 0; ++turn) {
      left = 0;
      for (auto& [contact, nodes] : by_contact)
        if (turn < nodes.size()) {
          out.nodes.push_back(nodes[turn]);
          ++left;
        }
    }
  return out;
}

// Eq. 1 of Choi 2002 by implicit Euler in double: minimises each node's own potential in turn.
class ReferenceSolver {
 public:
  ReferenceSolver(const organ::Organ& o, const Graph& g) : organ(o), graph(g) {
    u.resize(o.mesh.node_count());
    v.resize(o.mesh.node_count());
  }

  void start_from(const world::World& world) {
    for (std::size_t i = 0; i < u.size(); ++i) {
      u[i] = to_double(world.displacements[i]);
      v[i] = to_double(world.velocities[i]);
    }
  }

  void step(const std::vector<std::uint32_t>& order, const contact::ContactList& contacts,
            std::uint32_t sweeps) {
    const double dt = 1e-3;
    const auto start = u;
    std::map<std::uint32_t, std::vector<std::pair<const contact::ContactPoint*, int>>> points;
    for (const auto& point : contacts.points)
      for (std::size_t k = 0; k < point.nodes.size(); ++k)
        points[point.nodes[k].value].emplace_back(&point, k);
    for (const auto i : order) u[i] += v[i] * dt;
    for (std::uint32_t sweep = 0; sweep < sweeps; ++sweep)
      for (const auto i : order) {
        const double m = organ.node_masses_kg[i];
        const double drag = m * organ.material.node_damping_per_s;
        Vec3d g = (u[i] - start[i] - v[i] * dt) * (m / dt / dt) + (u[i] - start[i]) * (drag / dt);
        double h[3][3] = {};
        const auto add_block = [&h](double along, double across, const Vec3d& e) {
          const double c[3] = {e.x, e.y, e.z};
          for (int a = 0; a < 3; ++a)
            for (int b = 0; b < 3; ++b)
              h[a][b] += along * c[a] * c[b] + across * ((a == b ? 1.0 : 0.0) - c[a] * c[b]);
        };
        add_block(m / dt / dt + drag / dt, m / dt / dt + drag / dt, {1, 0, 0});
        for (const auto j : graph[i]) {
          const Vec3d rest = organ.mesh.rest_positions[j] - organ.mesh.rest_positions[i];
          const double l0 = length(rest), k = organ.material.spring_stiffness_n_m;
          const double b = k * organ.material.edge_damping_time_s / dt;
          const Vec3d r = rest + u[j] - u[i], r0 = rest + start[j] - start[i];
          const Vec3d e = r / length(r), e0 = r0 / length(r0);
          g -= e * (k * (length(r) - l0)) + e0 * (b * dot(e0, r - r0));
          add_block(k, k * std::max(0.0, 1 - l0 / length(r)), e);
          add_block(b, 0, e0);
        }
        for (const auto& [point, corner] : points[i]) {
          Vec3d d;
          for (std::size_t k = 0; k < 3; ++k)
            d += u[point->nodes[k].value] * static_cast<double>(point->weights[k]);
          const Vec3d n = to_double(point->normal);
          const double gap = dot(n, d - to_double(point->plane));
          if (gap >= 0) continue;
          Vec3d slip = d - to_double(point->anchor);
          slip -= n * dot(n, slip);
          const double k = static_cast<double>(point->stiffness);
          const double weight =
              static_cast<double>(point->weights[static_cast<std::size_t>(corner)]);
          const double hold =
              std::min(static_cast<double>(point->hold_stiffness),
                       static_cast<double>(point->friction) * k * -gap / length(slip));
          g += (n * (k * gap) + slip * hold) * weight;
          add_block(k * weight * weight, hold * weight * weight, n);
        }
        u[i] -= solve(h, g);
      }
    for (const auto i : order) v[i] = (u[i] - start[i]) / dt;
  }

  std::vector<Vec3d> u, v;

 private:
  // Gaussian elimination; the blocks are positive definite.
  static Vec3d solve(double (&h)[3][3], const Vec3d& g) {
    double b[3] = {g.x, g.y, g.z};
    for (int p = 0; p < 3; ++p)
      for (int r = p + 1; r < 3; ++r) {
        const double f = h[r][p] / h[p][p];
        for (int c = p; c < 3; ++c) h[r][c] -= f * h[p][c];
        b[r] -= f * b[p];
      }
    for (int r = 2; r >= 0; --r) {
      for (int c = r + 1; c < 3; ++c) b[r] -= h[r][c] * b[c];
      b[r] /= h[r][r];
    }
    return {b[0], b[1], b[2]};
  }

  const organ::Organ& organ;
  const Graph& graph;
};

TEST(TwoContactsThatApproach, QueueMergeAndSolveEqualAnIndependentReference) {
  const auto organ = catalogue::make_lattice();
  Graph graph(organ.mesh.node_count());
  for (const auto& [a, b] : organ.mesh.links) {
    graph[a.value].push_back(b.value);
    graph[b.value].push_back(a.value);
  }
  const std::set<std::uint32_t> fixed = [&] {
    std::set<std::uint32_t> out;
    for (const auto node : organ.fixed_nodes) out.insert(node.value);
    return out;
  }();

  step::Simulation simulation(catalogue::make_lattice());
  ReferenceSolver reference(organ, graph);
  step::TickDecisions decisions{
      .depth_limit = 5, .node_limit = 100'000, .sweeps = 6, .boundary = world::Boundary::Frozen};
  // Over-relaxation has a safeguard that compares sums: a tie would be decided by rounding.
  decisions.over_relaxation = 1.0f;

  hands::TickInputs inputs;
  for (std::uint8_t hand = 0; hand < 2; ++hand) {
    hands::HandJoin join{.slot = {hand}};
    join.shapes[0].radius_m = 0.012f;
    inputs.joins.push_back(join);
  }
  double top = 0;
  for (const auto& p : organ.mesh.rest_positions) top = std::max(top, p.y);

  constexpr int kTicks = 700;
  std::optional<int> engine_merged, reference_merged;
  double worst = 0, largest = 0;
  for (int tick = 1; tick <= kTicks; ++tick) {
    for (const int hand : {0, 1}) {
      const double x = (hand == 0 ? -1 : 1) * (0.10 - 0.09 * tick / kTicks);
      const double depth = 0.004 * std::min(1.0, tick / 100.0);
      hands::ToolInput sample{.tool = tool_slot({static_cast<std::uint8_t>(hand)}, 0)};
      sample.sample.world_from_tool = {to_float(Vec3d{x, top - depth, 0.004}),
                                       rotation_from_z({0, 1, 0})};
      sample.sample.verb = tool::Verb::Push;
      inputs.samples.push_back(sample);
    }
    // Each tick's solve starts from the engine's state: what differs after it is one tick's
    // rounding.
    reference.start_from(simulation.state().world);
    simulation.tick(inputs, decisions);
    inputs.clear();

    const auto& contacts = simulation.context().contact.found;
    std::vector<std::set<std::uint32_t>> seeds;
    for (const auto& tool : contacts.tools) {
      seeds.emplace_back();
      for (const auto node : contacts.seeds_of(tool)) seeds.back().insert(node.value);
    }
    const auto expected = reference_queue(graph, seeds, decisions.depth_limit);
    const auto& queue = simulation.context().near.queue;
    std::vector<std::uint32_t> order;
    for (const auto node : queue.nodes()) order.push_back(node.value);
    ASSERT_EQ(order, expected.nodes) << "queue order, tick " << tick;

    const bool is_merged = seeds.size() == 2 && !seeds[0].empty() && !seeds[1].empty() &&
                           queue.region_of_contact(contacts.tools[0].tool.value) ==
                               queue.region_of_contact(contacts.tools[1].tool.value);
    ASSERT_EQ(is_merged, expected.is_merged) << "tick " << tick;
    if (is_merged && !engine_merged) engine_merged = tick;
    if (expected.is_merged && !reference_merged) reference_merged = tick;

    // Nodes left behind by the moving contacts are still swept, after the queue, ascending.
    std::vector<std::uint32_t> swept;
    for (const auto node : expected.nodes)
      if (!fixed.contains(node)) swept.push_back(node);
    const auto active = simulation.context().near.active.nodes();
    for (std::size_t i = swept.size(); i < active.size(); ++i) swept.push_back(active[i].value);
    ASSERT_EQ(swept.size(), active.size());
    reference.step(swept, contacts, decisions.sweeps);
    for (std::uint32_t i = 0; i < organ.mesh.node_count(); ++i) {
      // A node that froze in this tick was put to rest by the rule, not by the solve.
      if (simulation.state().world.node_classes[i] == world::NodeClass::Far) continue;
      const auto& ours = simulation.state().world.displacements[i];
      worst = std::max(worst, length(to_double(ours) - reference.u[i]));
      largest = std::max(largest, length(reference.u[i]));
    }
  }
  ASSERT_TRUE(engine_merged.has_value());
  EXPECT_EQ(engine_merged, reference_merged);
  EXPECT_GT(*engine_merged, 200);
  EXPECT_GT(largest, 2e-3);
  EXPECT_LT(worst, 1e-6) << "float against double";
  std::printf(
      "merged at tick %d, largest displacement %.2f mm, worst difference of a tick %.3g um\n",
      *engine_merged, largest * 1e3, worst * 1e6);
}

}  // namespace
}  // namespace trocar::propagation
