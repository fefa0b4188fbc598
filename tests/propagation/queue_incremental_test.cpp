// A queue that is filled again and again as contacts move, appear, vanish, meet and part and limits
// change gives what a queue gives that never saw anything else, and both give what a search that
// keeps nothing (sets and maps, from the definitions in queue.h) gives.

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <random>
#include <set>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/propagation/queue.h"

namespace trocar::propagation {
namespace {

constexpr auto kNoLimit = std::numeric_limits<std::uint32_t>::max();
using Contacts = std::vector<std::vector<NodeIndex>>;

std::vector<std::span<const NodeIndex>> spans(const Contacts& contacts) {
  return {contacts.begin(), contacts.end()};
}

struct Answer {
  std::vector<std::vector<std::uint32_t>> layers;
  std::map<std::uint32_t, std::uint16_t> regions;  // of nodes in the queue
  std::vector<std::uint16_t> region_of_contact;
  std::uint16_t region_count = 0;

  bool operator==(const Answer&) const = default;
};

Answer answer_of(const PropagationQueue& queue, std::size_t contact_count) {
  Answer out;
  std::vector<std::uint32_t> flat;
  for (std::size_t k = 0; k < queue.layer_count(); ++k) {
    out.layers.emplace_back();
    for (const auto node : queue.layer(k)) out.layers.back().push_back(node.value);
    flat.insert(flat.end(), out.layers.back().begin(), out.layers.back().end());
  }
  EXPECT_TRUE(std::equal(queue.nodes().begin(), queue.nodes().end(), flat.begin(), flat.end(),
                         [](NodeIndex a, std::uint32_t b) { return a.value == b; }));
  for (const auto node : queue.nodes()) out.regions[node.value] = queue.region(node);
  for (std::size_t c = 0; c < contact_count; ++c)
    out.region_of_contact.push_back(queue.region_of_contact(c));
  out.region_count = queue.region_count();
  return out;
}

// Checks the queries of single nodes for every node of the organ.
void expect_queries_agree(const PropagationQueue& queue, const Answer& answer,
                          std::size_t node_count) {
  std::vector<std::uint32_t> layers(node_count, kNoLayer);
  for (std::size_t k = 0; k < answer.layers.size(); ++k)
    for (const auto node : answer.layers[k]) layers[node] = static_cast<std::uint32_t>(k);
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < node_count; ++i) {
    wrong += queue.layer_of(NodeIndex(i)) != layers[i] ? 1 : 0;
    wrong += queue.contains(NodeIndex(i)) != (layers[i] != kNoLayer) ? 1 : 0;
    if (layers[i] == kNoLayer) wrong += queue.region(NodeIndex(i)) != 0 ? 1 : 0;
  }
  EXPECT_EQ(wrong, 0u);
}

// Layer by layer from nothing; contacts are merged wherever a node is reached by two of them.
Answer reference(const Neighbours& neighbours, const Contacts& contacts, QueueLimits limits) {
  Answer out;
  std::vector<std::size_t> parent(contacts.size());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  const auto root = [&](std::size_t c) {
    while (parent[c] != c) c = parent[c];
    return c;
  };
  std::map<std::uint32_t, std::size_t> contact_of, reached;
  const auto reach = [&](NodeIndex node, std::size_t contact) {
    const auto known = contact_of.find(node.value);
    const auto [it, is_new] = reached.emplace(node.value, contact);
    const std::size_t other = known != contact_of.end() ? known->second : it->second;
    const auto a = root(contact), b = root(other);
    parent[std::max(a, b)] = std::min(a, b);
    it->second = std::min(it->second, contact);
  };
  for (std::size_t c = 0; c < contacts.size(); ++c)
    for (const auto node : contacts[c]) reach(node, c);
  std::size_t sum = 0;
  std::vector<std::uint32_t> queued;
  for (std::uint32_t depth = 0;; ++depth) {
    std::map<std::size_t, std::vector<std::uint32_t>> shares;
    for (const auto& [node, contact] : reached)
      if (contact_of.emplace(node, contact).second) shares[contact].push_back(node);
    if (depth > 0 && shares.empty()) break;
    auto& layer = out.layers.emplace_back();
    for (std::size_t turn = 0, given = 1; given > 0; ++turn) {
      given = 0;
      for (const auto& [_, nodes] : shares)
        if (turn < nodes.size() && ++given > 0 && sum < limits.nodes) {
          layer.push_back(nodes[turn]);
          ++sum;
        }
    }
    queued.insert(queued.end(), layer.begin(), layer.end());
    if (depth == limits.depth || sum >= limits.nodes) break;
    reached.clear();
    for (const auto node : layer)
      for (const auto next : neighbours[NodeIndex(node)]) reach(next, contact_of[node]);
  }
  std::map<std::size_t, std::uint16_t> numbers;
  out.region_of_contact.assign(contacts.size(), 0);
  for (std::size_t c = 0; c < contacts.size(); ++c)
    if (!contacts[c].empty())
      out.region_of_contact[c] =
          numbers.emplace(root(c), static_cast<std::uint16_t>(numbers.size() + 1)).first->second;
  out.region_count = static_cast<std::uint16_t>(numbers.size());
  for (const auto node : queued) out.regions[node] = out.region_of_contact[contact_of[node]];
  return out;
}

// Contacts and limits that change a little or a lot from step to step.
class Walk {
 public:
  Walk(const Neighbours::Table& graph, unsigned seed) : graph_(graph), random_(seed) {}

  Contacts contacts;
  QueueLimits limits;

  void step() {
    const auto what = below(100);
    if (contacts.empty() || what < 3) {
      if (contacts.size() < 7)
        contacts.insert(contacts.begin() + below(contacts.size() + 1), patch(any_node()));
    } else if (what < 5) {
      contacts.erase(contacts.begin() + below(contacts.size()));
    } else if (what < 8) {
      any_contact().clear();
    } else if (what < 12) {
      any_contact() = patch(any_node());
    } else if (what < 16) {
      // One contact moves onto another.
      const auto& other = any_contact();
      const auto place = other.empty() ? any_node() : other[below(other.size())];
      any_contact() = patch(place);
    } else if (what < 20) {
      auto& contact = any_contact();
      if (!contact.empty()) contact.push_back(contact[below(contact.size())]);
      std::shuffle(contact.begin(), contact.end(), random_);
    } else if (what < 26) {
      constexpr std::uint32_t kDepths[] = {0, 1, 2, 3, 4, 5, 6, 8, 11, kNoLimit};
      limits.depth = kDepths[below(std::size(kDepths))];
    } else if (what < 32) {
      const std::uint32_t nodes[] = {0, 1, 7, 40, 200, 600, 1200, 3000, kNoLimit, kNoLimit};
      limits.nodes = nodes[below(std::size(nodes))];
      if (below(2) == 0 && limits.nodes > 0 && limits.nodes != kNoLimit)
        limits.nodes = static_cast<std::uint32_t>(below(limits.nodes));
    } else if (what < 96) {
      for (auto& contact : contacts)
        if (below(3) > 0) creep(contact);
    }
  }

 private:
  std::size_t below(std::size_t n) { return random_() % n; }
  NodeIndex any_node() { return NodeIndex(below(graph_.row_count())); }
  std::vector<NodeIndex>& any_contact() { return contacts[below(contacts.size())]; }

  std::vector<NodeIndex> patch(NodeIndex middle) {
    std::vector<NodeIndex> out{middle};
    const std::size_t size = 1 + below(16);
    for (std::size_t i = 0; i < out.size() && out.size() < size; ++i)
      for (const auto next : graph_[out[i]])
        if (std::find(out.begin(), out.end(), next) == out.end()) out.push_back(next);
    return out;
  }
  // One node more, one node less, or both.
  void creep(std::vector<NodeIndex>& contact) {
    if (contact.empty()) return;
    const auto what = below(3);
    const auto ring = graph_[contact[below(contact.size())]];
    if (what != 0 && !ring.empty()) contact.push_back(ring[below(ring.size())]);
    if (what != 1 && contact.size() > 1) contact.erase(contact.begin() + below(contact.size()));
  }

  const Neighbours::Table& graph_;
  std::mt19937 random_;
};

Neighbours::Table random_graph(std::uint32_t node_count, std::uint32_t edge_count, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::set<std::uint32_t>> rows(node_count);
  for (std::uint32_t i = 0; i < edge_count; ++i) {
    const auto a = static_cast<std::uint32_t>(random() % node_count);
    const auto b = static_cast<std::uint32_t>(random() % node_count);
    if (a == b) continue;
    rows[a].insert(b);
    rows[b].insert(a);
  }
  Neighbours::Table out;
  out.offsets.push_back(0);
  for (const auto& row : rows) {
    for (const auto node : row) out.items.emplace_back(node);
    out.offsets.push_back(static_cast<std::uint32_t>(out.items.size()));
  }
  return out;
}

void expect_history_has_no_effect(const Neighbours::Table& graph, unsigned seed, int steps) {
  PropagationQueue queue(graph.row_count());
  Walk walk(graph, seed);
  int merges = 0, cuts = 0, cheap = 0;
  for (int step = 0; step < steps; ++step) {
    walk.step();
    if (step % 97 == 0) queue.forget();
    queue.fill(graph, spans(walk.contacts), walk.limits);
    PropagationQueue fresh(graph.row_count());
    fresh.fill(graph, spans(walk.contacts), walk.limits);

    const auto answer = answer_of(queue, walk.contacts.size());
    ASSERT_EQ(answer, answer_of(fresh, walk.contacts.size())) << "step " << step;
    ASSERT_EQ(answer, reference(graph, walk.contacts, walk.limits)) << "step " << step;
    expect_queries_agree(queue, answer, graph.row_count());
    ASSERT_FALSE(::testing::Test::HasFailure()) << "step " << step;

    std::size_t touching = 0;
    for (const auto& contact : walk.contacts) touching += contact.empty() ? 0 : 1;
    merges += queue.region_count() < touching ? 1 : 0;
    cuts += queue.nodes().size() == walk.limits.nodes ? 1 : 0;
    cheap += 4 * queue.nodes_visited() < fresh.nodes_visited() ? 1 : 0;
  }
  EXPECT_GT(merges, steps / 20);
  EXPECT_LT(merges, steps);
  EXPECT_GT(cuts, steps / 20);
  EXPECT_GT(cheap, steps / 20);
}

TEST(QueueHistory, HasNoEffectOnTheLattice) {
  const auto organ = catalogue::make_lattice({12, 8, 12, 0.01});
  expect_history_has_no_effect(organ.value().mesh.node_neighbours, 1, 2000);
}

TEST(QueueHistory, HasNoEffectOnTheLiver) {
  const auto organ = catalogue::make_liver();
  expect_history_has_no_effect(organ.value().mesh.node_neighbours, 2, 1000);
}

TEST(QueueHistory, HasNoEffectOnARandomGraphInPieces) {
  expect_history_has_no_effect(random_graph(900, 1300, 3), 4, 3000);
  expect_history_has_no_effect(random_graph(60, 80, 5), 6, 8000);
}

TEST(QueueHistory, IsForgottenWhenTheTopologyChanges) {
  auto graph = random_graph(300, 700, 7);
  PropagationQueue queue(graph.row_count());
  const Contacts contacts{{NodeIndex(3), NodeIndex(4)}, {NodeIndex(200)}};
  queue.fill(graph, spans(contacts), {4, 100});
  // In place: the same storage, other edges.
  const auto other = random_graph(300, 700, 8);
  graph.items.reserve(std::max(graph.items.size(), other.items.size()));
  graph.offsets = other.offsets;
  graph.items.assign(other.items.begin(), other.items.end());
  queue.forget();
  queue.fill(graph, spans(contacts), {4, 100});
  EXPECT_EQ(answer_of(queue, 2), reference(graph, contacts, {4, 100}));
  // Another table, with more nodes.
  const auto larger = random_graph(5000, 12'000, 9);
  const Contacts far{{NodeIndex(4990)}};
  queue.fill(larger, spans(far), {6, kNoLimit});
  EXPECT_EQ(answer_of(queue, 1), reference(larger, far, {6, kNoLimit}));
  expect_queries_agree(queue, answer_of(queue, 1), larger.row_count());
}

}  // namespace
}  // namespace trocar::propagation
