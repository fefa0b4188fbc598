#pragma once

// The set knows which contact starts at which node, and what changed in that since the last call. A
// node that several contacts touch belongs to the lowest. Seeds may come in any order and repeat.
// O(seeds before + seeds now).

#include <cstdint>
#include <span>
#include <vector>

#include "common/base/index.h"
#include "common/base/stamps.h"

namespace trocar::propagation {

using Seeds = std::span<const std::span<const NodeIndex>>;

class SeedSet {
 public:
  static constexpr std::uint16_t kNoContact = 0xffff;

  struct Change {
    NodeIndex node;
    std::uint16_t before = kNoContact, after = kNoContact;
  };

  void resize(std::size_t node_count);

  bool equals(Seeds seeds) const;
  void replace(Seeds seeds);

  // Nodes stand as they were given, contact after contact.
  std::span<const NodeIndex> nodes() const { return nodes_; }
  std::uint16_t contact_of(NodeIndex node) const { return contacts_[node.value]; }
  // These are the changes of the last replace(); each node is there once.
  std::span<const Change> changes() const { return changes_; }

 private:
  std::vector<NodeIndex> nodes_, previous_nodes_;
  std::vector<std::uint32_t> ends_;      // per contact, into nodes_
  std::vector<std::uint16_t> contacts_;  // per node
  Stamps is_named_;                      // per node: by the last replace()
  std::vector<Change> changes_;
};

}  // namespace trocar::propagation
