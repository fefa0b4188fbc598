#pragma once

// This table says which nodes are next to which, over elements and ties that hold: it is the
// organ's, and instead of its rows those of nodes that are tied, or that an edit of the topology
// has changed since. Symmetric; rows ascending.

#include "common/base/blocks.h"
#include "common/base/index.h"
#include "server/organs/mesh/csr.h"
#include "server/tissue/topology/topology.h"

namespace trocar::propagation {

class Neighbours {
 public:
  using Table = mesh::Csr<NodeIndex, NodeIndex>;

  // The table must outlive it. Implicit: a table is what most have.
  Neighbours(const Table& table) : table_(&table), row_count_(table.row_count()) {
    rows_.end_building();
  }

  std::size_t row_count() const { return row_count_; }
  const Table& table() const { return *table_; }
  std::span<const NodeIndex> operator[](NodeIndex node) const {
    if (node.value < changed_.size() && changed_[node.value] != 0)
      return rows_[changed_[node.value] - 1];
    return (*table_)[node];
  }

  // Takes the rows of topology.changed(). O(rows), and O(nodes) the first time.
  void update_changed(const topology::Topology& topology) { update(topology, topology.changed()); }
  // Takes the rows of these nodes.
  void update(const topology::Topology& topology, std::span<const NodeIndex> nodes);

 private:
  void set(NodeIndex node, std::span<const NodeIndex> neighbours);

  const Table* table_;
  std::size_t row_count_;
  std::vector<std::uint32_t> changed_;  // per node: 1 + place in rows_; 0: as in the table
  Blocks<NodeIndex> rows_;
  std::vector<NodeIndex> row_;  // scratch
};

}  // namespace trocar::propagation
