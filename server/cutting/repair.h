#pragma once

// When a stroke is over: cures what keeps faces waiting. A pinched edge, two fans of which would
// stay in the same two components, gets a node in its middle, which is then parted instead, with
// half of the floors; at a pinched node one tet is tried on the other side, or the wound is laid
// through the middle of the node's edges instead. What cannot be cured stays closed. Cost: a few
// passes over the waiting faces.

#include "server/cutting/opening.h"

namespace trocar::cutting {

class Repair {
 public:
  void run(CutMesh& mesh, Stroke& stroke, Opening& opening);

 private:
  bool split_pinched_edges(CutMesh& mesh, Stroke& stroke);
  bool turn_pinched_nodes(CutMesh& mesh, Stroke& stroke, Opening& opening);
  bool pull_back_all(CutMesh& mesh, Stroke& stroke, Opening& opening);
  bool pull_back(CutMesh& mesh, Stroke& stroke, Opening& opening, const Opening::Breach& breach);

  void turn(CutMesh& mesh, Stroke& stroke, Opening& opening, TetIndex t);
  void undo(Stroke& stroke);
  bool is_attached(CutMesh& mesh, Stroke& stroke, Opening& opening, TetIndex t);

  std::vector<std::pair<TetIndex, int>> decided_;  // by the last turn(): what was before
  std::vector<NodeIndex> labelled_;
  std::vector<TetIndex> waiting_;
  std::vector<NodeIndex> others_;
  std::vector<Opening::Breach> breaches_;
  std::vector<TetIndex> ring_;
};

}  // namespace trocar::cutting
