#include "server/tissue/pieces/piece_list.h"

#include <algorithm>

#include "server/organs/organ/organ.h"

namespace trocar::pieces {

using world::NodeClass;

void PieceList::begin_search(const topology::Topology& topology) {
  seen_.resize(topology.node_count());
  held_.resize(topology.node_count());
  tets_seen_.resize(topology.tet_count());
  for (auto* stamps : {&seen_, &held_, &tets_seen_}) stamps->begin();
}

// Searches from a node into found_, until it is known that the body has it; false: found_ is all
// of a piece.
bool PieceList::reaches_body(const topology::Topology& topology, const world::World& world,
                             NodeIndex from) {
  found_.assign(1, from);
  seen_.insert(from.value);
  bool is_held = world.node_classes[from.value] == NodeClass::Fixed;
  const auto visit = [&](NodeIndex node) {
    is_held |= world.node_classes[node.value] == NodeClass::Fixed || held_.has(node.value);
    if (seen_.insert(node.value)) found_.push_back(node);
  };
  for (std::size_t i = 0; i < found_.size() && !is_held; ++i) {
    for (const auto t : topology.tets_of(found_[i])) {
      if (!tets_seen_.insert(t.value)) continue;
      for (const auto node : topology.tet(t)) visit(node);
    }
    for (const auto node : topology.links_of(found_[i])) visit(node);
    topology.ties().for_each_held(found_[i], visit);
  }
  if (is_held)
    for (const auto node : found_) held_.insert(node.value);
  return is_held;
}

void PieceList::find(const topology::Topology& topology, const world::World& world) {
  pieces_.clear();
  piece_of_.assign(topology.node_count(), kBody);
  begin_search(topology);
  for (std::uint32_t n = 0; n < topology.node_count(); ++n) {
    if (!topology.has_node(NodeIndex(n)) || seen_.has(n)) continue;
    if (reaches_body(topology, world, NodeIndex(n))) continue;
    std::ranges::sort(found_);
    pieces_.push_back({found_});
  }
  number(topology, world);
}

void PieceList::update(const topology::Edit& edit, const world::World& world) {
  const auto& topology = edit.topology;
  const auto before = piece_of_.size();
  piece_of_.resize(topology.node_count(), kBody);
  begin_search(topology);
  bool has_changed = piece_of_.size() != before;
  for (const auto node : topology.changed()) {
    const auto old = piece_of_[node.value];
    if (old != kBody && !pieces_[old].nodes.empty()) {
      for (const auto n : pieces_[old].nodes) piece_of_[n.value] = kBody;
      pieces_[old].nodes.clear();
      has_changed = true;
    }
  }
  for (const auto node : topology.changed()) {
    if (!topology.has_node(node) || seen_.has(node.value)) continue;
    if (reaches_body(topology, world, node)) continue;
    std::ranges::sort(found_);
    pieces_.push_back({found_});
    has_changed = true;
  }
  if (!has_changed) return;
  std::erase_if(pieces_, [](const Piece& piece) { return piece.nodes.empty(); });
  std::ranges::sort(pieces_, {}, [](const Piece& piece) { return piece.nodes.front(); });
  number(topology, world);
}

void PieceList::number(const topology::Topology& topology, const world::World& world) {
  for (std::uint32_t i = 0; i < pieces_.size(); ++i) {
    auto& piece = pieces_[i];
    double mass = 0, damping = 0;
    for (const auto node : piece.nodes) {
      piece_of_[node.value] = i;
      const auto m = static_cast<double>(world.masses[node.value]);
      mass += m;
      damping +=
          m * organ::material_at(topology.organ(), topology.material_of(node)).node_damping_per_s;
    }
    piece.damping_per_s = mass > 0 ? damping / mass : 0;
  }
  body_.clear();
  for (std::uint32_t n = 0; n < piece_of_.size(); ++n)
    if (piece_of_[n] == kBody && topology.has_node(NodeIndex(n)) &&
        world.node_classes[n] != NodeClass::Fixed)
      body_.push_back(NodeIndex(n));
}

}  // namespace trocar::pieces
