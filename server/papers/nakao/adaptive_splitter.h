#pragma once

// Adaptive tetrahedral subdivision as Nakao 2003 sec. 3.3 prints it, beside the one of sessions
// (server/tissue/cutting/splitter.h).
//
// The patch is the paper's clipping plane C. A tet of which C crosses an edge is cut right through:
// also its edges that only the plane beyond C's border B crosses get a node. Each of these then
// goes along the mean direction of those sides of the tets' sections that cross B until it is on B
// (fig. 5), so all cut tets have one of two sections: a triangle, and become four, or a
// quadrilateral, and become six. Which parts, subdivision.h chooses. Nodes beside those that moved
// are smoothed (Laplace) where that improves the worst angle around them.
//
// What the paper does not say, and what is done here:
//   - a tet that C enters through a face, crossing no edge, is not cut;
//   - tets beyond that share a cut edge are bisected too, else the mesh would not be conforming;
//   - a node as near to C as kOnPlane of an edge is taken to be on it; the paper leaves that case
//     out; then a tet has other patterns than the two;
//   - a node of the organ's surface moves within that only; one that cannot move, because a tet
//     would be inverted or the solid changed (can_move()), stays where it is outside C.
//
// Of nodes outside C a sixth cannot move in a plate, a third in a block; and the worst angle is
// what the crossings make it, down to 0.02 degrees (tests/cutting/nakao_test.cpp counts both). A
// patch should be at least an edge long: short ones pull the same nodes again and again.
//
// There is no floor of angles and no budget: a patch is done at once.

#include "server/tissue/cutting/cut_mesh.h"
#include "server/tissue/cutting/patch_splitter.h"
#include "server/tissue/cutting/subdivision.h"

namespace trocar::nakao {

enum class Variant : std::uint8_t {
  Adaptive,  // as printed
  Plain,     // nothing moves, and edges are bisected in the order of their nodes' numbers
};

// The settings of a cutter that cuts by this method, and by no rule of Trocar's own: it does not
// extend patches beyond the blade, and parts of any size come off. Motion is cut in patches of
// `piece_h` mean edges; the default makes one patch of a whole stroke.
cutting::Settings settings_of(Variant variant, double piece_h = 1e3);

class AdaptiveSplitter final : public cutting::PatchSplitter {
 public:
  explicit AdaptiveSplitter(Variant variant) : is_adaptive_(variant == Variant::Adaptive) {}

  // Always finishes.
  bool run(cutting::CutMesh& mesh, cutting::Stroke& stroke,
           std::span<const cutting::PatchTriangle> patch, std::uint32_t& budget) override;

 private:
  using CutMesh = cutting::CutMesh;
  using Stroke = cutting::Stroke;
  using PatchTriangle = cutting::PatchTriangle;

  // An edge crosses the plane here.
  struct Crossing {
    NodeIndex a, b;  // a < b
    double t = 0;
    bool is_inside = false;  // C
    NodeIndex node;          // once there is one
  };
  // A crossing outside that is to move: the other ends of sides that cross B, and how far to go to
  // their mean.
  struct Pull {
    std::uint32_t crossing = 0;
    std::vector<std::uint32_t> crossings;  // ends, ascending
    std::vector<NodeIndex> nodes;          // others, labelled, ascending
    double share = 0;
  };

  void measure(CutMesh& mesh, Stroke& stroke, std::span<const PatchTriangle> patch);
  double height(const CutMesh& mesh, std::span<const PatchTriangle> patch, NodeIndex n) const;
  void find_inside(const CutMesh& mesh, const Stroke& stroke, std::span<const PatchTriangle> patch);
  void label_on_plane(CutMesh& mesh, Stroke& stroke);
  void complete_tets(CutMesh& mesh, const Stroke& stroke, std::span<const PatchTriangle> patch);
  void find_pulls(const CutMesh& mesh, const Stroke& stroke, std::span<const PatchTriangle> patch);
  void add_ends(const CutMesh& mesh, const Stroke& stroke, std::span<const PatchTriangle> patch,
                Pull& pull) const;
  Vec3d mean_end(const CutMesh& mesh, const Pull& pull, bool is_at_rest) const;
  void split(CutMesh& mesh, Stroke& stroke);
  void pull_all(CutMesh& mesh);
  void smooth(CutMesh& mesh, const Stroke& stroke);
  bool smooth(CutMesh& mesh, NodeIndex node);
  // Index in crossings_ or none.
  std::optional<std::uint32_t> find(NodeIndex a, NodeIndex b) const;

  std::vector<NodeIndex> near_, ends_;
  std::vector<Crossing> crossings_;  // by nodes
  std::vector<TetIndex> tets_, ring_;
  std::vector<Pull> pulls_;
  std::vector<cutting::EdgeCut> cuts_;
  std::vector<NodeIndex> pulled_;
  cutting::Subdivision subdivision_;
  const bool is_adaptive_;
};

}  // namespace trocar::nakao
