#pragma once

// Opens the wound as far as the surface stays manifold.
//
// A face is proposed if its three nodes are labelled and its two tets lie on different sides of the
// blade's path. All proposals are cut at once and what comes of it is checked (star.h); besides,
// every opened face must part at least one of its nodes, or later edits would make four wound faces
// meet at one edge. For every breach the weakest face of those that cause it is closed again, until
// none is left: the empty proposal is valid, so this ends. Closed faces wait, and are proposed
// again when something changes beside them.

#include "server/tissue/cutting/cut_mesh.h"

namespace trocar::cutting {

class Opening {
 public:
  void run(CutMesh& mesh, Stroke& stroke);
  // Opens inner faces, whatever asks for it; those that would leave the surface not manifold stay.
  void open(CutMesh& mesh, std::span<const TetFace> faces);

  // Returns the side of the path on which a tet lies, -1 or 1. If all nodes of the tet are
  // labelled, its side is decided for good.
  int side(const CutMesh& mesh, Stroke& stroke, TetIndex tet);

  // Faces of waiting tets that are proposed again and again; and what would be wrong if all of them
  // were opened.
  struct Breach {
    NodeIndex node, other;  // other: the edge's other end, or invalid: the node's link is wrong
    int side = 0;           // of the component with the wrong link
  };
  double waiting_area(CutMesh& mesh, Stroke& stroke);
  // m^2, what would stay closed if waiting tets and these were proposed now.
  double closed_area(const CutMesh& mesh, Stroke& stroke, std::span<const TetIndex> others);
  std::span<const Breach> breaches_of_all(CutMesh& mesh, Stroke& stroke);

 private:
  struct Proposal {
    TetFace face;  // from the side of the lower tet
    TetIndex other;
    mesh::Triangle nodes;
    bool is_open = true;
  };

  int side_of_flat(const CutMesh& mesh, Stroke& stroke, TetIndex tet);
  void gather(const CutMesh& mesh, const Stroke& stroke);
  void propose(const CutMesh& mesh, Stroke& stroke);
  bool turn_debris(const CutMesh& mesh, Stroke& stroke);
  bool find_debris(const CutMesh& mesh, TetIndex start);
  void cut_all(const CutMesh& mesh);
  void analyse_all(const CutMesh& mesh);
  std::uint32_t parted_nodes(const Proposal& proposal) const;
  std::size_t star_index(NodeIndex node) const;
  template <typename Visit>
  void for_each_twin_breach(const Star& star, Visit&& visit) const;
  void find_offenders();
  template <typename Causes>
  void offend(std::size_t star, Causes&& causes);
  bool close_offenders(const CutMesh& mesh);
  void check_all(const CutMesh& mesh);
  void commit(CutMesh& mesh, Stroke& stroke);

  std::vector<TetIndex> tets_;            // with faces that may be proposed
  std::vector<TetIndex> still_waiting_;   // not looked at this time
  std::vector<std::uint8_t> is_reached_;  // per node
  std::vector<NodeIndex> reached_;
  std::vector<Proposal> proposals_;
  std::optional<CutFaces> cuts_;
  StarAnalysis analysis_;
  std::vector<NodeIndex> nodes_;                                   // of the proposals, ascending
  std::vector<Star> stars_;                                        // one per node
  std::vector<std::pair<std::uint32_t, std::uint32_t>> faces_at_;  // (star, proposal), ascending
  std::vector<std::uint32_t> first_face_at_;                       // per star, into faces_at_
  static constexpr std::uint8_t kFacesStale = 1, kBreachesStale = 2;
  std::vector<std::uint8_t> stale_;  // per star: what is to be checked again
  std::vector<std::uint32_t> offenders_, changed_;
  std::vector<TetIndex> debris_, debris_starts_;
  std::vector<TetFace> faces_;
  std::vector<Breach> breaches_;
};

}  // namespace trocar::cutting
