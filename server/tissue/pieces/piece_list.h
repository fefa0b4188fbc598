#pragma once

// The pieces of a cut organ that nothing holds: connected tissue without a fixed node. All else,
// in however many parts, is the body.
//
// Pieces come from parting alone, so that an edit is followed in O(tissue between the change and
// the next fixed node + pieces that have changed). They stand by their lowest node: the list is a
// function of the topology.

#include <span>
#include <vector>

#include "common/base/stamps.h"
#include "server/tissue/topology/edit.h"
#include "server/tissue/world/world.h"

namespace trocar::pieces {

struct Piece {
  std::vector<NodeIndex> nodes;  // ascending, not empty
  double damping_per_s = 0;      // of its nodes' materials, the mean by mass
};

class PieceList {
 public:
  static constexpr std::uint32_t kBody = 0xffffffffu;

  // From the beginning.
  void find(const topology::Topology& topology, const world::World& world);
  // The world has the edit's nodes.
  void update(const topology::Edit& edit, const world::World& world);

  std::size_t size() const { return pieces_.size(); }
  std::size_t node_count() const { return piece_of_.size(); }  // with places that are not used
  const Piece& operator[](std::size_t piece) const { return pieces_[piece]; }
  // Returns kBody for a node that is of no piece.
  std::uint32_t piece_of(NodeIndex node) const { return piece_of_[node.value]; }
  // Nodes of the body that are not fixed, ascending.
  std::span<const NodeIndex> body() const { return body_; }

 private:
  void begin_search(const topology::Topology& topology);
  bool reaches_body(const topology::Topology& topology, const world::World& world, NodeIndex from);
  void number(const topology::Topology& topology, const world::World& world);

  std::vector<Piece> pieces_;
  std::vector<std::uint32_t> piece_of_;
  std::vector<NodeIndex> body_;
  // Scratch: whom a search has seen, and which of them belong to the body.
  Stamps seen_, held_, tets_seen_;
  std::vector<NodeIndex> found_;
};

}  // namespace trocar::pieces
