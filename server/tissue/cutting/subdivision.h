#pragma once

// In which order edges are bisected so that the tets around them become well shaped.
//
// A tet with three edges cut becomes four, one with four six, by bisection alone; which diagonals
// the faces between get is a matter of order only: the diagonal starts at the node that was first.
// So neighbours agree by themselves, and every order is a pattern of all tets at once.
//
// Nakao 2003 sec. 3.3 asks for a small largest and a large smallest dihedral angle; eq. 5 as
// printed sums smallest angles and calls less better, which contradicts that. Here a pattern is as
// good as the sum over cut tets of the smallest sine of a dihedral angle of their parts. From
// "longest edge first", the orders of each tet's own edges are tried in turn, those of its
// neighbours being what they are. Cost: 24 orders x neighbours x parts, per cut tet and round.

#include "server/tissue/cutting/faces.h"

namespace trocar::cutting {

struct EdgeCut {
  NodeIndex a, b;  // a < b
  std::uint16_t t = 0;
  Vec3d place;  // of the new node in the end, at rest, m
};

class Subdivision {
 public:
  // Places in `cuts`, which are distinct edges, in the order to be bisected in.
  std::span<const std::uint32_t> order(const topology::Topology& topology,
                                       std::span<const EdgeCut> cuts);

 private:
  struct CutTet {
    TetIndex tet;
    std::vector<std::uint32_t> cuts;  // ascending
  };

  void find_tets(const topology::Topology& topology);
  void rank_by_length(const topology::Topology& topology);
  // Returns the smallest sine of a dihedral angle among the parts of a tet.
  double score(const topology::Topology& topology, const CutTet& cut_tet);
  double score_around(const topology::Topology& topology);
  bool improve(const topology::Topology& topology, const CutTet& cut_tet);

  std::span<const EdgeCut> cuts_;
  std::vector<CutTet> tets_;
  std::vector<std::vector<std::uint32_t>> tets_of_;  // per cut, into tets_
  std::vector<std::uint32_t> ranks_, order_;         // per cut; by rank
  std::vector<std::uint32_t> around_, own_;
};

}  // namespace trocar::cutting
