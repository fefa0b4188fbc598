#pragma once

// The pairs of tissue that touches tissue (self_contact.h): state.

#include <span>
#include <vector>

#include "common/base/index.h"
#include "common/base/tick.h"
#include "common/math/vec3.h"
#include "server/tissue/world/state_archive.h"

namespace trocar::contact {

// A place is where a node lay on its triangle when the pair was last looked at.
struct SelfContactPlace {
  Vec3f weights;    // of the corners
  Vec3f normal;     // from the triangle to the node
  float shift = 0;  // m, the gap from which on it presses
};

// Faces that touch at rest may overlap so far for ever, m; no pair lies deeper than the other.
inline constexpr float kOverlapAtRest_m = 0.001f, kDeepest_m = 0.008f;

}  // namespace trocar::contact

template <>
struct trocar::world::IsPaddingFree<trocar::contact::SelfContactPlace> : std::true_type {};

namespace trocar::contact {

class SelfContactTable {
 public:
  SelfContactTable();

  std::span<const NodeIndex> nodes() const { return nodes_; }  // ascending, each once
  std::span<const TriangleIndex> triangles() const { return triangles_; }

  std::span<const SelfContactPlace> places() const { return places_; }

  // The tick of the last pass, and whether the topology was edited since. At first all is new.
  Tick last_pass() const { return last_pass_; }
  bool has_edit() const { return has_edit_ != 0; }
  void note_pass(Tick tick) { last_pass_ = tick, has_edit_ = 0; }
  void note_edit() { has_edit_ = 1; }

  void clear() { nodes_.clear(), triangles_.clear(), places_.clear(); }
  void swap_pairs(SelfContactTable& other) {
    nodes_.swap(other.nodes_), triangles_.swap(other.triangles_), places_.swap(other.places_);
  }
  void add(NodeIndex node, TriangleIndex triangle, const SelfContactPlace& place) {
    nodes_.push_back(node);
    triangles_.push_back(triangle);
    places_.push_back(place);
  }

  // Last in a state. surface_nodes: ascending; triangle_count: numbers given so far.
  void visit_state(world::StateArchive& archive, std::span<const NodeIndex> surface_nodes,
                   std::size_t triangle_count);

 private:
  std::vector<NodeIndex> nodes_;
  std::vector<TriangleIndex> triangles_;
  std::vector<SelfContactPlace> places_;
  Tick last_pass_ = 0;
  std::uint8_t has_edit_ = 1;
};

}  // namespace trocar::contact
