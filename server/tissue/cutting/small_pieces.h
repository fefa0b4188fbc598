#pragma once

// SmallPieces finds the tets of pieces that are too small to be cut any further
// (Settings::whole_volume_h3). What is found out about a tet holds until clear(); so a piece is
// looked into once per patch, and only as far as it takes to know. Cost: O(tets in that volume) for
// the first tet of a piece.

#include "server/tissue/cutting/cut_mesh.h"

namespace trocar::cutting {

class SmallPieces {
 public:
  bool has(const CutMesh& mesh, TetIndex tet);
  void clear();

 private:
  enum Size : std::uint8_t { kUnknown, kSmall, kLarge };

  void look_into(const CutMesh& mesh, TetIndex start);

  std::vector<std::uint8_t> sizes_;  // per tet
  std::vector<TetIndex> known_, piece_;
};

}  // namespace trocar::cutting
