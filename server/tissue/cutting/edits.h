#pragma once

// The edits that a cut consists of, and the list of them by which whoever holds the same topology
// repeats it: integers only. The order is that in which they were done.
//
//   Split      an edge gets a node at t/65536 from a to b; each tet at it becomes two: the old one
//              keeps a, a new one gets b. The new node is in the regions that both ends are in, so
//              no tet changes its material.
//   Open       inner faces become surface, and nodes are parted as far as that parts their stars:
//              the component with the lowest tet keeps the node, the others get copies.
//   Duplicate  one such copy; says what Open did, and does nothing itself.
//   Move       a node goes t/65536 of the way along an edge, at rest and free of stress, where that
//              inverts no tet and changes neither the solid nor its materials (can_move()).
//
// Physics needs of a new node between which nodes it is, and where (topology::NewNode), so that its
// displacement and velocity follow. Masses are the topology's.

#include <cstdint>
#include <functional>
#include <span>
#include <variant>
#include <vector>

#include "common/base/result.h"
#include "server/tissue/cutting/places.h"
#include "server/tissue/cutting/star.h"
#include "server/tissue/topology/edit.h"

namespace trocar::cutting {

struct Split {
  NodeIndex a, b;
  std::uint16_t t = 0;
  NodeIndex node;  // the new one
  bool operator==(const Split&) const = default;
};
struct Open {
  std::uint32_t first_face = 0, face_count = 0;  // in CutEvents::faces
  bool operator==(const Open&) const = default;
};
struct Duplicate {
  NodeIndex node, copy;
  bool operator==(const Duplicate&) const = default;
};
struct Move {
  NodeIndex node, toward;
  std::uint16_t t = 0;
  bool operator==(const Move&) const = default;
};
using CutEvent = std::variant<Split, Open, Duplicate, Move>;

struct CutEvents {
  std::vector<CutEvent> events;
  std::vector<TetFace> faces;  // from the side of the lower tet

  void clear();
  void append(const CutEvents& later);
  bool operator==(const CutEvents&) const = default;
};

struct TetChild {
  TetIndex parent, child;
};

// Splits an edge of a tet at t from a to b, 0 < t. Returns the new node; `children` gets each tet
// that keeps a with the new tet that has b.
NodeIndex split_edge(topology::Topology& topology, Places& places, NodeIndex a, NodeIndex b,
                     std::uint16_t t, std::vector<TetChild>& children);

// Both sides of inner faces become wound (Topology::wound_faces()); before part().
void mark_wound(topology::Topology& topology, std::span<const TetFace> faces);

// Gives every component of the stars but the first a copy of its node.
void part(topology::Topology& topology, Places& places, std::span<const Star> stars,
          std::vector<Duplicate>& copies);

// Whether there is that edge, all tets at the node keep a positive volume, and the sum of their
// volumes stays what it is: a node of the surface stays in it where that is flat, and elsewhere
// takes as much as it gives. No node of a wound moves, nor one that the organ holds; all tets at
// the node are of one material and free of stress at rest.
bool can_move(const topology::Topology& topology, const Move& move);
// Moves a node; can_move() must allow it.
void move_node(topology::Topology& topology, const Move& move);

// Repeats a cut. Everything is checked before it is done; after an error the edits before it have
// been done. on_new_node is told of each new node once all is in place that its edit changes.
Status apply(
    const CutEvents& events, topology::Topology& topology, Places& places,
    const std::function<void(const topology::NewNode&)>& on_new_node =
        [](const topology::NewNode&) {});

}  // namespace trocar::cutting
