#pragma once

// Lays the edges that a patch crosses onto the wound: an edge crossed near an end labels that end;
// another is split there and the new node labelled, unless a tet or an edge would become too thin
// or short: then the nearer end is labelled instead, which is always possible and costs no quality.
// After every split the mesh is conforming, so no case table is needed: 1 + 3 gives four tets and
// 2 + 2 six by themselves. A piece too small to give two is left as it is (small_pieces.h).
//
// Repeating a patch changes nothing, because an edge with a labelled end is settled; so one that
// could not be finished within a budget is simply begun again.

#include "server/tissue/cutting/patch_splitter.h"
#include "server/tissue/cutting/small_pieces.h"

namespace trocar::cutting {

class Splitter final : public PatchSplitter {
 public:
  bool run(CutMesh& mesh, Stroke& stroke, std::span<const PatchTriangle> patch,
           std::uint32_t& budget) override;

 private:
  struct Crossing {
    NodeIndex a, b;  // a < b
    double t = 0, height_a = 0, height_b = 0;
    double length_squared = 0;  // at rest
  };
  struct Snap {
    double height;
    NodeIndex node, other;
  };

  enum class Nearness { Far, Near, Close };  // Close: within half of the reach

  Nearness look_at(std::span<const PatchTriangle> patch, const Vec3d& p, double reach);
  void find_near(CutMesh& mesh, std::span<const PatchTriangle> patch);
  void measure(Stroke& stroke) const;
  void find_crossings(const CutMesh& mesh, const Stroke& stroke,
                      std::span<const PatchTriangle> patch);
  bool is_close(NodeIndex n) const;
  bool are_parted(NodeIndex a, NodeIndex b, std::size_t triangles) const;
  void cross(const CutMesh& mesh, std::span<const PatchTriangle> patch, NodeIndex a, NodeIndex b);
  void leave_out_small_pieces(const CutMesh& mesh);
  void count_crossed_tets(CutMesh& mesh);
  bool snap(CutMesh& mesh, Stroke& stroke, std::uint32_t& budget);
  bool split(CutMesh& mesh, Stroke& stroke, std::uint32_t& budget);

  std::vector<NodeIndex> near_;
  std::vector<std::uint32_t> rank_;       // per node: 1 + its place in near_, or 0
  std::vector<std::uint8_t> is_close_;    // as near_
  std::vector<Vec3d> positions_;          // as near_
  std::vector<std::uint32_t> seen_from_;  // as near_: rank of the last node it was a neighbour of
  std::vector<double> heights_;           // near_ x patch
  std::vector<NodeIndex> others_;
  std::vector<Crossing> crossings_;
  std::vector<Snap> snaps_;
  std::vector<TetIndex> ring_, crossed_;
  SmallPieces small_pieces_;
};

}  // namespace trocar::cutting
