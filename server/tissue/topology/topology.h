#pragma once

// An organ whose topology changes: nodes, tets and links as they are now, what meets at each node,
// and which nodes a change has touched. Whoever cuts edits it between ticks; the solver follows.
//
// Places of nodes and tets are chosen by the caller: an unused one, or the next at the end. Unused
// places keep their numbers, so nobody else's change. Everything is in canonical order, tets at a
// node by their number and links by the other node's: what is computed from it is bit for bit what
// the same organ without unused places gives, built anew.
//
// Every edit costs in proportion to what meets at its nodes. A node has changed when its existence,
// its place in space, or the elements at it have. Regions of materials are those of the organ the
// topology was made from, which must outlive it; new nodes say which they belong to. One writer.

#include <span>
#include <vector>

#include "common/base/blocks.h"
#include "server/organs/organ/organ.h"
#include "server/tissue/topology/tie_net.h"

namespace trocar::topology {

class Topology {
 public:
  explicit Topology(const organ::Organ& organ);

  const organ::Organ& organ() const { return organ_; }
  // Places, used or not.
  std::size_t node_count() const { return rest_.size(); }
  std::size_t tet_count() const { return tets_.size(); }
  bool has_node(NodeIndex node) const { return has_node_[node.value] != 0; }
  bool has_tet(TetIndex tet) const { return tets_[tet.value][0].is_valid(); }
  // Whether springs are along links, else along edges of tets: as in the organ at the start.
  bool has_links() const { return !organ_.mesh.links.empty(); }

  std::span<const Vec3d> rest() const { return rest_; }                // m, per node
  std::span<const Vec3d> stress_free() const { return stress_free_; }  // m, per node
  const mesh::Tet& tet(TetIndex tet) const { return tets_[tet.value]; }
  std::span<const TetIndex> tets_of(NodeIndex node) const { return node_tets_[node.value]; }
  // The other ends, ascending.
  std::span<const NodeIndex> links_of(NodeIndex node) const { return node_links_[node.value]; }
  // Indices into organ().regions, ascending.
  std::span<const std::uint16_t> regions_of(NodeIndex node) const {
    return node_regions_[node.value];
  }
  // Nodes that share a tet or a link with this one, ascending, distinct.
  void neighbours_of(NodeIndex node, std::vector<NodeIndex>& out) const;
  // Calls visit(j) for each of these; some more than once.
  template <typename Visit>
  void for_each_neighbour(NodeIndex node, Visit&& visit) const {
    for (const auto t : tets_of(node))
      for (const auto j : tet(t))
        if (j != node) visit(j);
    for (const auto j : links_of(node)) visit(j);
  }

  // Returns the number of a material as organ::material_at() counts.
  std::uint16_t material_of(TetIndex tet) const { return tet_materials_[tet.value]; }
  std::uint16_t material_of(NodeIndex node) const;
  std::uint16_t material_of(NodeIndex a, NodeIndex b) const;
  // Returns the lumped mass of a node (Nakao 2003 eq. 4), kg.
  double lumped_mass(NodeIndex node) const;

  // Directions of fibres as organ::Organ::fibre_directions, of a node; of a tet or a spring the
  // sum of its nodes' (organ::sum_of_axes), or what the tet was given. Zero: the material's.
  Vec3d fibre_axis(NodeIndex node) const {
    return node_axes_.empty() ? Vec3d{} : node_axes_[node.value];
  }
  Vec3d fibre_axis(TetIndex tet) const {
    return tet_axes_.empty() ? Vec3d{} : tet_axes_[tet.value];
  }
  Vec3d fibre_axis(NodeIndex a, NodeIndex b) const;
  // After put_node() and put_tet(): a part of a tet keeps the direction of the whole, so that a
  // split changes neither forces nor energy. Nothing where the organ has no directions.
  void set_fibre_axis(NodeIndex node, const Vec3d& axis);
  void set_fibre_axis(TetIndex tet, const Vec3d& axis);

  // After put_tet(), likewise.
  void set_material(TetIndex tet, std::uint16_t material) { tet_materials_[tet.value] = material; }

  // A node at a place without one. Nothing meets at it yet.
  void put_node(NodeIndex place, const Vec3d& rest, const Vec3d& stress_free,
                std::span<const std::uint16_t> regions);
  // Nothing meets at it any more.
  void remove_node(NodeIndex node);
  void move_node(NodeIndex node, const Vec3d& rest, const Vec3d& stress_free);
  // A tet at a place without one; its volume is positive.
  void put_tet(TetIndex place, const mesh::Tet& tet);
  // After put_tet(): the new tet is a part of what the parent was.
  void add_part(TetIndex part, TetIndex parent) { parts_.push_back({part, parent}); }
  struct Part {
    TetIndex part, parent;
  };
  // Since clear_changes(), in their order.
  std::span<const Part> parts() const { return parts_; }
  void remove_tet(TetIndex tet);
  void put_link(NodeIndex a, NodeIndex b);
  void remove_link(NodeIndex a, NodeIndex b);

  // Bits by corner: the face opposite to it was opened by a cut, or comes from one that was. None
  // for a tet that has just been put.
  std::uint8_t wound_faces(TetIndex tet) const { return wound_faces_[tet.value]; }
  void mark_wound_faces(TetIndex tet, std::uint8_t faces) { wound_faces_[tet.value] = faces; }

  // Since the last clear_changes(): distinct, in the order of their first change.
  std::span<const NodeIndex> changed() const { return changed_; }
  void clear_changes();
  // Counts a node among these: what is tied to it has changed.
  void mark(NodeIndex node);

  const TieNet& ties() const { return ties_; }
  TieNet& ties() { return ties_; }

 private:
  std::uint16_t material_of_all(std::span<const NodeIndex> nodes) const;

  const organ::Organ& organ_;
  const bool has_fibre_axes_;
  std::vector<Vec3d> rest_, stress_free_;
  std::vector<Vec3d> node_axes_, tet_axes_;  // empty unless has_fibre_axes_
  std::vector<mesh::Tet> tets_;              // invalid nodes where there is none
  std::vector<std::uint16_t> tet_materials_;
  std::vector<std::uint8_t> wound_faces_;  // per tet
  std::vector<Part> parts_;
  std::vector<std::uint8_t> has_node_, is_changed_;
  Blocks<TetIndex> node_tets_;
  Blocks<NodeIndex> node_links_;
  Blocks<std::uint16_t> node_regions_;
  std::vector<NodeIndex> changed_;
  TieNet ties_;
};

}  // namespace trocar::topology
