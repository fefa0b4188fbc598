#pragma once

// An organ under random edits such as cuts make, and the same organ as one that never had another
// topology.

#include <map>
#include <random>

#include "server/tissue/topology/topology.h"

namespace trocar::dynamics::testing {

class EditedOrgan {
 public:
  EditedOrgan(organ::Organ organ, std::uint32_t seed)
      : organ_(std::move(organ)), topology_(organ_), random_(seed) {}
  EditedOrgan(const EditedOrgan&) = delete;
  EditedOrgan& operator=(const EditedOrgan&) = delete;

  topology::Topology& topology() { return topology_; }
  std::uint32_t below(std::size_t count) { return static_cast<std::uint32_t>(random_() % count); }

  // One of the edits below, of a kind that fits the organ, and then sometimes remove_bare_nodes().
  void edit();
  // One that leaves the number of tets about as it is.
  void edit_without_growth();

  // Up to so many tets around a node go.
  void remove_tets(std::size_t most);
  // All that went come back, as far as their nodes still exist.
  void restore_tets();
  // Some of a node's tets, or links, get a copy of it instead.
  void split_node();
  // An edge gets a node between its ends, and each of its tets becomes two.
  void bisect_edge();
  void nudge_node();
  void toggle_links();
  void remove_bare_nodes();

  // Without the unused places, adjacency built. node_of gets the place of each of its nodes.
  organ::Organ built_anew(std::vector<NodeIndex>& node_of) const;

 private:
  NodeIndex any_node();
  NodeIndex free_node_place() const;
  TetIndex free_tet_place() const;

  const organ::Organ organ_;
  topology::Topology topology_;
  std::mt19937 random_;
  std::map<TetIndex, mesh::Tet> removed_;
  std::vector<mesh::NodePair> removed_links_;
};

}  // namespace trocar::dynamics::testing
