#pragma once

// The topology under the knives: where its nodes are now, its local scale, and every edit of it,
// told to all strokes and to whoever repeats it.

#include <array>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "server/tissue/cutting/edits.h"
#include "server/tissue/cutting/node_bundles.h"
#include "server/tissue/cutting/settings.h"
#include "server/tissue/cutting/stroke.h"

namespace trocar::cutting {

// This travel means that nobody has added up how far nodes moved: all nodes are looked at.
inline constexpr double kUnknownTravel = std::numeric_limits<double>::infinity();

inline constexpr std::uint32_t kMaxBlades = 32;

struct CutOutput {
  CutEvents events;
  std::vector<topology::NewNode>
      new_nodes;               // in order: a parent may be new, too; those that moved among them
  double opened_area_m2 = 0;   // one side of the wound, at rest
  double torn_area_m2 = 0;     // part of it
  double work_j = 0;           // by the materials' energy per area
  double waiting_area_m2 = 0;  // of strokes that ended: faces that could not be opened
  std::uint32_t crossed_tets = 0, splits = 0, labels = 0, refused_splits = 0, pinch_splits = 0;
  // A splitter with patterns (Nakao 2003) counts tets of its two patterns and other crossed ones,
  // and nodes outside the patch that came to its border or could not.
  std::uint32_t four_tets = 0, six_tets = 0, other_tets = 0, moved_nodes = 0, refused_moves = 0;
  std::uint32_t smoothed_nodes = 0;
  bool is_behind = false;                         // work is left for the next call
  std::array<double, kMaxBlades> blade_work_j{};  // part of work_j: of blades that have not left

  void clear();
};

class CutMesh {
 public:
  CutMesh(topology::Topology& topology, const Settings& settings, std::span<Stroke> strokes);

  // A call: displacements as in Cutter::cut(), until end().
  void begin(std::span<const Vec3f> displacements, double travel_m, CutOutput& out);
  void end();

  const topology::Topology& topology() const { return topology_; }
  const Settings& settings() const { return settings_; }
  Vec3d position(NodeIndex n) const {  // now, m
    if (n.value < is_made_.size() && is_made_[n.value] != 0) return made_[n.value];
    const auto& rest = topology_.rest()[n.value];
    return n.value < displacements_.size() ? rest + to_double(displacements_[n.value]) : rest;
  }
  // Nodes no farther from a patch than `reaches` times their reach, ascending, and some others near
  // by.
  void collect(std::span<const PatchTriangle> patch, double reaches, std::vector<NodeIndex>& out);
  // Nodes may have moved farther than the next call will say.
  void forget_places() { bundles_->forget(); }
  double h(NodeIndex n) const { return h_[n.value]; }
  double mean_h() const { return mean_h_; }
  // Returns the length of the longest edge at the node in the uncut mesh, m.
  double reach(NodeIndex n) const { return reach_[n.value]; }
  double longest_reach() const { return longest_reach_; }
  double floor_sine() const { return floor_sine_; }
  CutOutput& out() { return *out_; }
  Places& places() { return places_; }

  // Returns what no part of an edge that a blade splits may be shorter than, by how much the mesh
  // has grown, in h.
  double length_floor_h() const;
  // The smallest sine of all tets that a split would make, or -1 if a part would be shorter than
  // this many h.
  double sine_after_split(NodeIndex a, NodeIndex b, std::uint16_t t, double least_h);
  NodeIndex split(NodeIndex a, NodeIndex b, std::uint16_t t);
  // Moves a node; can_move() must allow it.
  void move(const Move& move);
  // Faces from the side of the lower tet, ascending; the stars of their nodes, ascending, with
  // these faces cut.
  void open(std::span<const TetFace> faces, std::span<const Star> stars);
  // Does what another cutter of the same topology did; made: its nodes.
  Status repeat(const CutEvents& events, std::vector<topology::NewNode>& made);
  // Tets bisected by the last split().
  std::size_t last_ring() const { return children_.size(); }

 private:
  void measure_scale();
  void measure_scale_of(const topology::NewNode& node);
  void add_node(const topology::NewNode& node);
  void update_moved_node(const topology::NewNode& moved);

  topology::Topology& topology_;
  const Settings settings_;
  const std::span<Stroke> strokes_;
  Places places_;
  std::optional<NodeBundles> bundles_;
  std::span<const Vec3f> displacements_;
  double travel_m_ = 0;
  std::vector<Vec3d> made_;  // positions, by node, of those that this call made
  std::vector<std::uint8_t> is_made_;
  std::vector<double> h_, reach_;  // m, per node
  double mean_h_ = 0, longest_reach_ = 0, floor_sine_ = 0;
  CutOutput* out_ = nullptr;
  std::vector<TetChild> children_;
  std::vector<TetIndex> ring_;
  std::vector<Duplicate> copies_;
};

}  // namespace trocar::cutting
