#pragma once

// Places holds the unused places of nodes and tets. The lowest is taken first, then the next at the
// end, so that two who hold the same topology choose the same. Whoever removes something gives its
// place back.

#include <vector>

#include "server/tissue/topology/topology.h"

namespace trocar::cutting {

class Places {
 public:
  explicit Places(const topology::Topology& topology);

  NodeIndex next_node(const topology::Topology& topology) const;
  NodeIndex occupy_node(const topology::Topology& topology);
  TetIndex occupy_tet(const topology::Topology& topology);
  void release(NodeIndex node);
  void release(TetIndex tet);

 private:
  std::vector<NodeIndex> nodes_;  // descending
  std::vector<TetIndex> tets_;
};

}  // namespace trocar::cutting
