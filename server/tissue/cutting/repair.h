#pragma once

// When the blade has gone on, or the stroke is over: cures what keeps faces waiting. A pinched
// edge, two fans of which would stay in the same two components, gets a node in its middle, which
// is then parted instead. A pinched node, whose link would be a ring, is taken off the wound, which
// then goes through the middle of the node's edges on the side that is not pinched. Both with half
// of the floor of angles, and less than half of that of lengths. Where that is refused, and the
// stroke is over, tets beside the pinch go to the other side, so that the wound goes round it along
// faces that are there already, if more can then be opened. What cannot be cured stays closed. Cost
// of a round: a pass over the waiting faces; for tets that change sides, one per trial.

#include "server/tissue/cutting/opening.h"

namespace trocar::cutting {

class Repair {
 public:
  // One round when the stroke is over. Returns whether another would change nothing.
  bool finish(CutMesh& mesh, Stroke& stroke, Opening& opening);
  // One round farther than Settings::repair_h from the blade, where nothing will pass by itself.
  void run_behind(CutMesh& mesh, Stroke& stroke, Opening& opening);

 private:
  void find_breaches(CutMesh& mesh, Stroke& stroke, Opening& opening, double beyond);
  bool run(CutMesh& mesh, Stroke& stroke, Opening& opening);
  bool split_pinched_edges(CutMesh& mesh, Stroke& stroke);
  bool pull_back_all(CutMesh& mesh, Stroke& stroke, Opening& opening);
  bool pull_back(CutMesh& mesh, Stroke& stroke, Opening& opening, const Opening::Breach& breach);

  bool turn_any(CutMesh& mesh, Stroke& stroke, Opening& opening);
  bool turn_best(CutMesh& mesh, Stroke& stroke, Opening& opening, const Opening::Breach& breach);
  void find_parts(CutMesh& mesh, Stroke& stroke, Opening& opening, const Opening::Breach& breach);
  void turn(CutMesh& mesh, Stroke& stroke, Opening& opening, std::span<const TetIndex> part);
  void turn_back(Stroke& stroke);

  struct OldSide {
    TetIndex tet;
    int side;
  };

  std::vector<NodeIndex> others_;
  std::vector<Opening::Breach> breaches_;
  std::vector<TetIndex> ring_;
  // Tets at a breach that hang together on one side; part i from part_ends_[i - 1].
  std::vector<TetIndex> parts_;
  std::vector<std::size_t> part_ends_;
  std::vector<TetIndex> around_;
  std::vector<NodeIndex> turned_nodes_;  // labelled for it
  std::vector<OldSide> old_sides_;
  std::uint32_t trials_ = 0;  // left in this call
};

}  // namespace trocar::cutting
