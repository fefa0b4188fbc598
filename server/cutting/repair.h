#pragma once

// When the blade has gone on, or the stroke is over: cures what keeps faces waiting. A pinched
// edge, two fans of which would stay in the same two components, gets a node in its middle, which
// is then parted instead. A pinched node, whose link would be a ring, is taken off the wound, which
// then goes through the middle of the node's edges on the side that is not pinched. Both with half
// of the floor of angles. What cannot be cured stays closed. Cost of a round: a pass over the
// waiting faces.

#include "server/cutting/opening.h"

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

  std::vector<NodeIndex> others_;
  std::vector<Opening::Breach> breaches_;
  std::vector<TetIndex> ring_;
};

}  // namespace trocar::cutting
