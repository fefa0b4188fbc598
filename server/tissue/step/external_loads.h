#pragma once

// External loads act on the tissue of an experiment besides tools: nodes are displaced, along all
// axes or some, and nodes have forces, each as a function of simulated time. A session has none.
//
// Loads are an input of a tick like the samples of hands, but one that is known beforehand: the
// rules stay, and at() evaluates them at the end of a step of time. They keep to the organ when it
// is cut: a node between two held ones is held between them, and a node's force is shared with its
// copy, so that the sum stays. What is held and loaded follows from the rules and World::origins
// alone, so a restored state continues bit for bit.
//
// Units: SI. at() allocates after an edit of the topology only. One thread.

#include <span>
#include <vector>

#include "common/base/result.h"
#include "common/math/vec3.h"
#include "server/tissue/dynamics/block_descent.h"
#include "server/tissue/world/world.h"

namespace trocar::step {

// A vector over time: linear between keys, constant before the first and after the last.
struct TimedVector {
  struct Key {
    double time_s = 0;  // strictly increasing
    Vec3d value;

    bool operator==(const Key&) const = default;
  };
  std::vector<Key> keys;  // at least one

  Vec3d at(double time_s) const;
  bool operator==(const TimedVector&) const = default;
};

inline constexpr std::uint8_t kAllAxes = 7;  // bit 0: x, bit 1: y, bit 2: z
// Beyond these a unit is wrong, or a file. Forces on nodes stay finite in float.
inline constexpr double kMaxDisplacementMetres = 10;
inline constexpr double kMaxLoad = 1e9;       // N or Pa
inline constexpr double kMaxLoadShare = 100;  // 1 or m^2

struct DisplacedNodes {
  std::vector<NodeIndex> nodes;  // ascending, distinct; of the uncut organ
  std::uint8_t axes = kAllAxes;  // The nodes are free along the others.
  TimedVector over_time;         // m

  bool operator==(const DisplacedNodes&) const = default;
};

// The force on nodes[i] is value x shares[i], or minus value.x x normal_areas_m2[i] for a pressure.
struct LoadedNodes {
  std::vector<NodeIndex> nodes;        // ascending, distinct; of the uncut organ
  TimedVector over_time;               // N or Pa
  std::vector<double> shares;          // 1 or m^2
  std::vector<Vec3d> normal_areas_m2;  // of a pressure; then `shares` is empty

  Vec3d on_node(std::size_t i, const Vec3d& value) const {
    return normal_areas_m2.empty() ? value * shares[i] : normal_areas_m2[i] * -value.x;
  }
  bool operator==(const LoadedNodes&) const = default;
};

struct LoadRules {
  std::vector<DisplacedNodes> displaced;  // No node is displaced twice along an axis.
  std::vector<LoadedNodes> forces;
  // The solver places the organ's fixed nodes in each step, so that the force there can be
  // measured. Tissue that relaxes is then advanced there in each tick, so it is part of the input.
  bool has_measured_reactions = false;

  bool empty() const { return displaced.empty() && forces.empty() && !has_measured_reactions; }
  bool operator==(const LoadRules&) const = default;
};

// Whether these are rules for that organ; error says which load is wrong, and how.
Status validate(const LoadRules& rules, const organ::Organ& organ);

class ExternalLoads {
 public:
  // rules: outlive it. fixed: nodes that stay where they are; node_count: of the uncut organ.
  ExternalLoads(const LoadRules& rules, std::span<const NodeIndex> fixed, std::size_t node_count);
  ExternalLoads(const ExternalLoads&) = delete;
  ExternalLoads& operator=(const ExternalLoads&) = delete;

  // Returns the loads at the end of a step of time; valid until the next call.
  dynamics::ExternalLoads at(double time_s, const world::World& world);

  // Returns the holds alone, with every held node where it is at rest.
  dynamics::ExternalLoads at_rest(const world::World& world);

  // Returns the nodes at which force enters the tissue: propagation starts there as from a contact.
  std::span<const std::span<const NodeIndex>> seeds() const { return seeds_; }
  const LoadRules& rules() const { return rules_; }
  // The state was replaced: what cuts have made between held nodes is looked up anew.
  void forget_cuts() { start(); }
  // Asks for the force that holds these nodes, of the uncut organ. Returns its number. In a tick,
  // rules without loads need has_measured_reactions.
  std::size_t watch(std::span<const NodeIndex> nodes);
  // After a solve with these loads, and before an edit of the topology.
  void measure(const dynamics::BlockDescent& solver, const contact::ContactList& contacts);
  // Returns the force on the tissue, N, as it was last measured; zero along axes that are free.
  Vec3d holding_force_n(std::size_t watched) const { return watched_[watched].force_n; }

 private:
  struct Watched {
    std::vector<NodeIndex> nodes;   // with those that cuts have made between them
    std::vector<std::uint8_t> has;  // per node
    Vec3d force_n;
  };
  // A node of a cut that is held, t of the way between two entries of the same list.
  struct Between {
    std::size_t entry = 0, a = 0, b = 0;
    float t = 0;
  };

  void start();
  void update(const world::World& world);
  void add_hold(NodeIndex node, const world::NodeOrigin& origin);
  void place(double time_s);
  void push(double time_s, const world::World& world);
  Vec3d on_held_axes(NodeIndex node, Vec3d force_n) const;

  const LoadRules& rules_;
  const std::vector<NodeIndex> fixed_;
  const std::size_t organ_nodes_;
  std::size_t node_count_ = 0;                         // that the lists below know
  std::vector<std::uint32_t> hold_of_, axis_hold_of_;  // per node: entry, or kNone
  std::vector<NodeIndex> held_;                        // fixed, then displaced along all axes
  std::vector<Vec3f> held_displacements_;
  std::vector<dynamics::AxisHold> axis_holds_;
  std::vector<Between> between_, axis_between_;
  std::vector<Vec3f> forces_;  // per node; empty without forces
  std::vector<Watched> watched_;
  std::vector<std::span<const NodeIndex>> seeds_;
};

}  // namespace trocar::step
