#pragma once

// StarAnalysis finds what the tets around one node become when some faces are cut.
//
// A component is a set of tets at the node that hang together over faces at the node that are not
// cut; a fan is the same around an edge. After the cut every component gets a node of its own. Then
// the surface is manifold there if (all of it topology, no geometry)
//   - the link of each component is a disc or a sphere: chi = fans - faces + tets is 1 if it has a
//     boundary, 2 if not, where a face counts once per side that is free;
//   - no two fans of an edge lie in the same components at both of its ends.
// Cost: O(s log s) for s tets at the node.

#include <cstdint>
#include <vector>

#include "server/tissue/cutting/faces.h"

namespace trocar::cutting {

// CutFaces holds the faces that are cut, as a mask of corners per tet, on both sides of each face.
class CutFaces {
 public:
  explicit CutFaces(const topology::Topology& topology) : topology_(topology) {}

  // An inner face, not cut yet.
  void cut(const TetFace& face);
  void mend(const TetFace& face);
  bool is_cut(const TetFace& face) const {
    return face.tet.value < masks_.size() && (masks_[face.tet.value] >> face.corner & 1) != 0;
  }
  void clear();

 private:
  void flip(const TetFace& face);

  const topology::Topology& topology_;
  std::vector<std::uint8_t> masks_;  // per tet
  std::vector<TetIndex> masked_;
};

struct Star {
  // A fan of an edge of which another fan is in the same component at this node.
  struct Fan {
    NodeIndex other;  // end of the edge
    TetIndex tet;     // one of the fan's
    std::uint16_t component = 0;
  };

  NodeIndex node;
  std::vector<TetIndex> tets;             // ascending
  std::vector<std::uint16_t> components;  // per tet, numbered in the order of their first tet
  std::uint16_t component_count = 0;
  std::vector<std::uint16_t> bad_components;  // whose link is neither a disc nor a sphere
  std::vector<Fan> twin_fans;                 // by (other, component)

  // Returns the component of a tet at the node.
  std::uint16_t component_of(TetIndex tet) const;
};

class StarAnalysis {
 public:
  void run(const topology::Topology& topology, const CutFaces& cuts, NodeIndex node, Star& out);

 private:
  struct Side {  // of a face at the node
    std::uint64_t key;
    std::uint32_t tet;
    std::uint8_t corner;
    auto operator<=>(const Side&) const = default;
  };
  struct LinkCorner {
    NodeIndex other;
    std::uint32_t root;
    std::uint32_t tet;
  };

  static std::uint32_t find(std::vector<std::uint32_t>& parents, std::uint32_t item);
  static void join(std::vector<std::uint32_t>& parents, std::uint32_t a, std::uint32_t b);
  void join_over_faces(const topology::Topology& topology, const CutFaces& cuts, const Star& star);
  void number_components(Star& out);
  void find_fans(const topology::Topology& topology, Star& out);
  void judge(Star& out);

  std::vector<Side> sides_;
  std::vector<std::uint32_t> tet_parents_, corner_parents_;  // of tets; of their corners, 4 each
  std::vector<std::uint32_t> free_sides_;                    // per tet
  std::vector<LinkCorner> corners_;
  std::vector<std::int32_t> chi_, boundary_;  // per component
};

}  // namespace trocar::cutting
