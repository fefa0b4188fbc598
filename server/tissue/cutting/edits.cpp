#include "server/tissue/cutting/edits.h"

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"

namespace trocar::cutting {
namespace {

Error mismatch(std::size_t event, const char* what) {
  return {ErrorCode::BadMessage, "cut event " + std::to_string(event) + ": " + what};
}

void replace_node(topology::Topology& topology, TetIndex place, NodeIndex old, NodeIndex node) {
  auto tet = topology.tet(place);
  const auto wound = topology.wound_faces(place);
  const auto axis = topology.fibre_axis(place);
  const auto material = topology.material_of(place);
  tet[corner_of(tet, old)] = node;
  topology.remove_tet(place);
  topology.put_tet(place, tet);
  topology.set_fibre_axis(place, axis);
  topology.set_material(place, material);
  topology.mark_wound_faces(place, wound);
}

// Returns the fibre axis at t between two nodes, or the other's where one has none. It is not
// normalised, so that it is exactly theirs where they are equal.
Vec3d axis_along(const Vec3d& a, const Vec3d& b, std::uint16_t t) {
  if (length_squared(a) == 0 || length_squared(b) == 0) return a + b;
  return along(a, dot(a, b) < 0 ? -b : b, t);
}

std::uint8_t bit(std::uint8_t corner) {
  return static_cast<std::uint8_t>(1u << corner);
}
void clear_wound(topology::Topology& topology, TetIndex tet, std::uint8_t corner) {
  topology.mark_wound_faces(tet,
                            static_cast<std::uint8_t>(topology.wound_faces(tet) & ~bit(corner)));
}

// A node's move may change the sum of its tets' volumes by this part of it, by rounding.
constexpr double kVolumeSlack = 1e-11;
// A tet must keep more than this part of its volume when one of its nodes moves.
constexpr double kLeastVolumeLeft = 1e-4;

// Replay applies events to a topology, one after another.
class Replay {
 public:
  Replay(const CutEvents& events, topology::Topology& topology, Places& places,
         const std::function<void(const topology::NewNode&)>& on_new_node)
      : events_(events),
        topology_(topology),
        places_(places),
        on_new_node_(on_new_node),
        cuts_(topology) {}

  Status run() {
    for (at_ = 0; at_ < events_.events.size(); ++at_)
      if (auto status = std::visit([&](const auto& e) { return repeat(e); }, events_.events[at_]);
          !status)
        return status;
    return check_copies();
  }

 private:
  bool has(NodeIndex n) const { return n.value < topology_.node_count() && topology_.has_node(n); }

  Status check_copies() const {
    return copied_ == copies_.size() ? Status() : mismatch(at_, "fewer copies of nodes than here");
  }

  Status repeat(const Split& split) {
    if (auto status = check_copies(); !status) return status;
    if (!has(split.a) || !has(split.b) || split.a == split.b || split.t == 0)
      return mismatch(at_, "no such edge to split");
    ring_of(topology_, split.a, split.b, ring_);
    if (ring_.empty()) return mismatch(at_, "no such edge to split");
    if (places_.next_node(topology_) != split.node)
      return mismatch(at_, "the new node has another number here");
    split_edge(topology_, places_, split.a, split.b, split.t, children_);
    on_new_node_({split.node, split.a, split.b, split.t});
    return {};
  }
  Status repeat(const Open& open) {
    if (auto status = check_copies(); !status) return status;
    if (open.first_face > events_.faces.size() ||
        open.face_count > events_.faces.size() - open.first_face)
      return mismatch(at_, "faces out of range");
    nodes_.clear();
    cuts_.clear();
    for (const auto& face : std::span(events_.faces).subspan(open.first_face, open.face_count)) {
      if (face.tet.value >= topology_.tet_count() || !topology_.has_tet(face.tet) ||
          face.corner > 3 || cuts_.is_cut(face) || !across(topology_, face))
        return mismatch(at_, "no such face to open");
      cuts_.cut(face);
      for (const auto node : face_nodes(topology_.tet(face.tet), face.corner))
        nodes_.push_back(node);
    }
    std::sort(nodes_.begin(), nodes_.end());
    nodes_.erase(std::unique(nodes_.begin(), nodes_.end()), nodes_.end());
    std::vector<Star> stars(nodes_.size());
    for (std::size_t i = 0; i < nodes_.size(); ++i)
      analysis_.run(topology_, cuts_, nodes_[i], stars[i]);
    copies_.clear();
    copied_ = 0;
    mark_wound(topology_, std::span(events_.faces).subspan(open.first_face, open.face_count));
    part(topology_, places_, stars, copies_);
    for (const auto& copy : copies_) on_new_node_({copy.copy, copy.node, copy.node, 0});
    return {};
  }
  Status repeat(const Duplicate& copy) {
    if (copied_ >= copies_.size() || copies_[copied_] != copy)
      return mismatch(at_, "another node was copied here");
    ++copied_;
    return {};
  }
  Status repeat(const Move& move) {
    if (auto status = check_copies(); !status) return status;
    if (!has(move.node) || !has(move.toward) || !can_move(topology_, move))
      return mismatch(at_, "no such way for a node to move");
    move_node(topology_, move);
    on_new_node_({move.node, move.node, move.toward, move.t});
    return {};
  }

  const CutEvents& events_;
  topology::Topology& topology_;
  Places& places_;
  const std::function<void(const topology::NewNode&)>& on_new_node_;
  CutFaces cuts_;
  StarAnalysis analysis_;
  std::vector<NodeIndex> nodes_;
  std::vector<TetIndex> ring_;
  std::vector<TetChild> children_;
  std::vector<Duplicate> copies_;
  std::size_t at_ = 0, copied_ = 0;
};

}  // namespace

void CutEvents::clear() {
  events.clear();
  faces.clear();
}

void CutEvents::append(const CutEvents& later) {
  const auto offset = static_cast<std::uint32_t>(faces.size());
  faces.insert(faces.end(), later.faces.begin(), later.faces.end());
  for (auto event : later.events) {
    if (auto* const open = std::get_if<Open>(&event)) open->first_face += offset;
    events.push_back(event);
  }
}

NodeIndex split_edge(topology::Topology& topology, Places& places, NodeIndex a, NodeIndex b,
                     std::uint16_t t, std::vector<TetChild>& children) {
  TROCAR_ASSERT(t > 0);
  std::vector<TetIndex> ring;
  ring_of(topology, a, b, ring);
  std::vector<std::uint16_t> regions;
  std::ranges::set_intersection(topology.regions_of(a), topology.regions_of(b),
                                std::back_inserter(regions));
  const auto node = places.occupy_node(topology);
  const auto middle = [&](std::span<const Vec3d> positions) {
    return along(positions[a.value], positions[b.value], t);
  };
  topology.put_node(node, middle(topology.rest()), middle(topology.stress_free()), regions);
  topology.set_fibre_axis(node, axis_along(topology.fibre_axis(a), topology.fibre_axis(b), t));
  children.clear();
  for (const auto parent : ring) {
    // The face between the two is inside: of the old one opposite to a, of the new one to b.
    auto child = topology.tet(parent);
    const auto wound = topology.wound_faces(parent);
    const auto corner_a = corner_of(child, a), corner_b = corner_of(child, b);
    child[corner_a] = node;
    replace_node(topology, parent, b, node);
    clear_wound(topology, parent, corner_a);
    const auto place = places.occupy_tet(topology);
    topology.put_tet(place, child);
    topology.set_fibre_axis(place, topology.fibre_axis(parent));
    topology.set_material(place, topology.material_of(parent));
    topology.add_part(place, parent);
    topology.mark_wound_faces(place, wound);
    clear_wound(topology, place, corner_b);
    children.push_back({parent, place});
  }
  return node;
}

void mark_wound(topology::Topology& topology, std::span<const TetFace> faces) {
  for (const auto& face : faces) {
    const auto other = across(topology, face);
    TROCAR_ASSERT(other);
    for (const auto& side : {face, *other})
      topology.mark_wound_faces(
          side.tet, static_cast<std::uint8_t>(topology.wound_faces(side.tet) | bit(side.corner)));
  }
}

void part(topology::Topology& topology, Places& places, std::span<const Star> stars,
          std::vector<Duplicate>& copies) {
  for (const auto& star : stars)
    for (std::uint16_t c = 1; c < star.component_count; ++c) {
      const auto copy = places.occupy_node(topology);
      const auto regions = topology.regions_of(star.node);
      const std::vector<std::uint16_t> own(regions.begin(), regions.end());
      const auto rest = topology.rest()[star.node.value];
      const auto stress_free = topology.stress_free()[star.node.value];
      topology.put_node(copy, rest, stress_free, own);
      topology.set_fibre_axis(copy, topology.fibre_axis(star.node));
      for (std::size_t k = 0; k < star.tets.size(); ++k)
        if (star.components[k] == c) replace_node(topology, star.tets[k], star.node, copy);
      copies.push_back({star.node, copy});
    }
}

bool can_move(const topology::Topology& topology, const Move& move) {
  const auto [node, toward, t] = move;
  const auto rest = topology.rest();
  const auto is_end = [&, node = node](NodeIndex n) { return n == node; };
  if (node == toward || t == 0 || topology.tets_of(node).empty() ||
      std::ranges::any_of(topology.organ().fixed_nodes, is_end))
    return false;
  const Vec3d place = along(rest[node.value], rest[toward.value], t);
  const auto material = topology.material_of(topology.tets_of(node).front());
  double before = 0, after = 0;
  bool is_edge = false;
  for (const auto place_of_tet : topology.tets_of(node)) {
    const auto& tet = topology.tet(place_of_tet);
    if (topology.material_of(place_of_tet) != material) return false;
    for (const auto n : tet)
      if (rest[n.value] != topology.stress_free()[n.value]) return false;
    const auto own_corner = corner_of(tet, node);
    if ((topology.wound_faces(place_of_tet) & ~bit(own_corner)) != 0) return false;
    is_edge = is_edge || corner_of(tet, toward) < 4;
    auto corners = rest_corners(topology, tet);
    const double old = six_volumes(corners);
    corners[own_corner] = place;
    const double changed = six_volumes(corners);
    if (!(changed > kLeastVolumeLeft * old)) return false;
    before += old;
    after += changed;
  }
  return is_edge && std::abs(after - before) <= kVolumeSlack * before;
}

void move_node(topology::Topology& topology, const Move& move) {
  const auto [node, toward, t] = move;
  const auto middle = [&, node = node, toward = toward, t = t](std::span<const Vec3d> positions) {
    return along(positions[node.value], positions[toward.value], t);
  };
  topology.move_node(node, middle(topology.rest()), middle(topology.stress_free()));
}

Status apply(const CutEvents& events, topology::Topology& topology, Places& places,
             const std::function<void(const topology::NewNode&)>& on_new_node) {
  return Replay(events, topology, places, on_new_node).run();
}

}  // namespace trocar::cutting
