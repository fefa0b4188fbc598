#include "server/tissue/cutting/places.h"

#include <algorithm>
#include <functional>

namespace trocar::cutting {
namespace {

template <typename Index>
Index take(std::vector<Index>& unused, std::size_t end) {
  if (unused.empty()) return Index(end);
  const Index place = unused.back();
  unused.pop_back();
  return place;
}
template <typename Index>
void put(std::vector<Index>& unused, Index place) {
  unused.insert(std::lower_bound(unused.begin(), unused.end(), place, std::greater<>()), place);
}

}  // namespace

Places::Places(const topology::Topology& topology) {
  for (auto n = topology.node_count(); n-- > 0;)
    if (!topology.has_node(NodeIndex(n))) nodes_.emplace_back(n);
  for (auto t = topology.tet_count(); t-- > 0;)
    if (!topology.has_tet(TetIndex(t))) tets_.emplace_back(t);
}

NodeIndex Places::next_node(const topology::Topology& topology) const {
  return nodes_.empty() ? NodeIndex(topology.node_count()) : nodes_.back();
}
NodeIndex Places::occupy_node(const topology::Topology& topology) {
  return take(nodes_, topology.node_count());
}
TetIndex Places::occupy_tet(const topology::Topology& topology) {
  return take(tets_, topology.tet_count());
}
void Places::release(NodeIndex node) {
  put(nodes_, node);
}
void Places::release(TetIndex tet) {
  put(tets_, tet);
}

}  // namespace trocar::cutting
