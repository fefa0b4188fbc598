#pragma once

// SideCut decides sides where a stroke meets a wound that is there already, or itself. Some tets
// lie there on the path's one side and hang on the other side's tissue: signs of heights alone
// leave a bridge. So when a stroke is over, the sides of all tets at its wound are decided
// together: as the least cut (Dinic 1970) between what is clearly above the path and
// what is clearly below it. A face whose nodes are all on the wound costs its area, any other a
// thousand times that, since it cannot be opened; and a tet that changes sides costs a little.
// Cost: some passes over the tets at labelled nodes. A node of an old
// wound's rim that is near the path, too, is labelled where the cut goes through it: two wounds
// that run side by side are led together.

#include "server/tissue/cutting/opening.h"

namespace trocar::cutting {

class SideCut {
 public:
  // Decides the sides; returns whether any is another now. Nodes beside it are fresh then.
  bool run(CutMesh& mesh, Stroke& stroke, Opening& opening);

 private:
  using Capacity = std::int64_t;
  struct Arc {
    std::uint32_t to, back;  // node; arc
    Capacity left;
  };

  // A face to an old wound, between two of tets_.
  struct LedFace {
    std::uint32_t a, b;
    mesh::Triangle nodes;
  };

  std::uint32_t place_of(TetIndex t) const;
  // Whether all of its nodes that are not on the wound are clearly above the path, or below it.
  static bool is_clear(const CutMesh& mesh, const Stroke& stroke, TetIndex t);
  bool can_label(const CutMesh& mesh, const Stroke& stroke, NodeIndex node) const;
  double cost_of(const CutMesh& mesh, const Stroke& stroke, const mesh::Triangle& nodes) const;
  void gather(const CutMesh& mesh, const Stroke& stroke);
  void connect(const CutMesh& mesh, Stroke& stroke, Opening& opening);
  void add_arc(std::uint32_t a, std::uint32_t b, Capacity there, Capacity back);
  void label(const CutMesh& mesh, Stroke& stroke, Opening& opening);
  bool find_distances();
  bool fill_way();

  std::vector<TetIndex> tets_;  // ascending; node i + 2 of the graph is tets_[i]
  std::vector<NodeIndex> nodes_;
  std::vector<std::int8_t> sides_;  // as tets_
  std::vector<LedFace> led_;
  std::vector<Arc> arcs_;
  std::vector<std::vector<std::uint32_t>> arcs_of_;
  std::vector<std::uint32_t> distances_, queue_, next_arc_, way_;
};

}  // namespace trocar::cutting
