#pragma once

// The ties of an organ (server/organs/organ/tie.h) on its topology: between which nodes each is
// now, and which ties meet at a node.
//
// A tie is where it was at rest, whatever is cut: after an edit it goes on from its rest place in
// the triangle that is there now; if that place is gone, so is the tie. Ties that have been pulled
// apart are broken: nothing is next to anything through them. But colours go by all ties that are
// not gone, so that they follow from the edits alone. One writer, as for the topology.

#include <algorithm>
#include <array>
#include <span>
#include <vector>

#include "common/base/blocks.h"
#include "server/organs/organ/organ.h"

namespace trocar::topology {

struct SurfaceEdit;

class TieNet {
 public:
  struct End {
    TriangleIndex triangle;  // of the surface, with its lasting number
    std::array<NodeIndex, 3> nodes;
    std::array<double, 3> weights{};
    Vec3d place_m;  // at rest
  };
  struct Tie {
    std::array<End, 2> ends;
    const organ::TieLaw* law = nullptr;
    double rest_length_m = 0, area_m2 = 0;
    bool is_gone = false;  // with the place of an end
    bool is_broken = false;
  };

  explicit TieNet(const organ::Organ& organ);

  std::size_t count() const { return ties_.size(); }
  const Tie& operator[](std::size_t tie) const { return ties_[tie]; }
  // Counts those that are neither gone nor broken.
  std::size_t whole_count() const {
    return static_cast<std::size_t>(std::ranges::count_if(
        ties_, [](const Tie& tie) { return !tie.is_gone && !tie.is_broken; }));
  }
  // Ties that meet at a node, ascending; none that is gone.
  std::span<const std::uint32_t> at(NodeIndex node) const {
    return node.value < at_node_.count() ? at_node_[node.value] : std::span<const std::uint32_t>{};
  }
  // Nodes at which a tie meets, ascending.
  std::vector<NodeIndex> nodes() const;

  // Calls visit(j) for each node to which a tie leads from this one; some more than once.
  template <typename Visit>
  void for_each_tied(NodeIndex node, Visit&& visit) const {
    visit_across(node, visit, [](const Tie&) { return true; });
  }
  // Only where the tie still holds.
  template <typename Visit>
  void for_each_held(NodeIndex node, Visit&& visit) const {
    visit_across(node, visit, [](const Tie& tie) { return !tie.is_broken; });
  }

  void set_broken(std::size_t tie) { ties_[tie].is_broken = true; }
  // Follows an edit of the surface. Adds the nodes of what has changed to `changed`, also such as
  // the edit has removed.
  void follow(const SurfaceEdit& surface, std::span<const Vec3d> rest,
              std::vector<NodeIndex>& changed);

 private:
  template <typename Visit, typename Holds>
  void visit_across(NodeIndex node, Visit&& visit, Holds&& holds) const {
    for (const auto i : at(node)) {
      const Tie& tie = ties_[i];
      if (!holds(tie)) continue;
      const auto& first = tie.ends[0].nodes;
      const bool is_first = first[0] == node || first[1] == node || first[2] == node;
      for (const auto j : tie.ends[is_first ? 1 : 0].nodes) visit(j);
    }
  }
  void meet(std::uint32_t tie);
  void part(std::uint32_t tie);

  std::vector<Tie> ties_;
  Blocks<std::uint32_t> at_node_;  // none where the organ has no ties
  std::size_t triangle_count_ = 0;
};

}  // namespace trocar::topology
