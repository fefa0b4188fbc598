#pragma once

// Cuts an organ's tets along the paths of blades, progressively: the wound follows the blade.
//
// Each tick says where blades are (move) and which have left (lift); cut() then does the work. An
// edge that a blade's path crosses is bisected or one of its ends is taken to lie on the wound
// (splitter.h); wound faces are opened as far as the surface stays manifold (opening.h); nodes are
// parted by topology alone (star.h). So at every return of cut():
//   - every tet has a positive volume; its dihedral angles keep the floor, half of it where a
//     pinch was repaired (Settings); a splitter of Settings' may know no floor;
//   - every piece is a closed manifold solid; volume and mass are those of before, to rounding;
//   - the edits listed in CutOutput, applied to a topology as it was before, make the one it is.
// Paths are in the world and meet tissue where it is now; floors are of the shape at rest.
//
// From outside: nothing is believed. A blade that is not finite, has no length or too many points
// is refused; one that jumps begins a new stroke. Work per call is bounded by
// Settings::edits_per_call; what is left over is a planned surface that follows in later calls, in
// order, and no longer than Settings says.
//
// Deterministic: the same calls give the same topology. Strokes are done in the order in which they
// began; where there are more than a call has time for, they take turns. Not for organs with links.
// One writer; the topology is edited by nobody else between construction and destruction, except
// that tets and nodes may be removed while no stroke is on.

#include "server/tissue/cutting/edge_resistance.h"
#include "server/tissue/cutting/opening.h"
#include "server/tissue/cutting/repair.h"
#include "server/tissue/cutting/side_cut.h"
#include "server/tissue/cutting/splitter.h"

namespace trocar::cutting {

inline constexpr std::uint32_t kMaxStrokes = 2 * kMaxBlades;

class Cutter {
 public:
  explicit Cutter(topology::Topology& topology, const Settings& settings = {});

  // Moves a blade's edge to these points, m, two to kMaxEdgePoints of them. Returns false if they
  // are refused; the stroke, if there is one, then waits where it was.
  bool move(std::uint32_t blade, std::span<const Vec3d> edge);
  void lift(std::uint32_t blade);
  // The tissue about a blade's edge has moved so far, m, at either end: what the blade has still to
  // cut moves with it.
  void carry(std::uint32_t blade, const std::array<Vec3d, 2>& moved);

  // Sets the inner faces, each from the side of the lower tet, ascending, that cut() opens first.
  void tear(std::span<const TetFace> faces) { torn_.assign(faces.begin(), faces.end()); }

  // displacements: of the nodes from rest, m, node_count of them; none: everything is at rest.
  // travel_m: a sum over ticks of the farthest that any node has moved, by which only what is near
  // the blades is looked at; the edits are the same without it.
  void cut(std::span<const Vec3f> displacements, CutOutput& out, double travel_m = kUnknownTravel);

  // Measures a line in tissue as it is now. Displacements and travel are as for cut(), which it may
  // precede; velocities are as for EdgeMeter.
  EdgeResistance resistance_of(std::span<const Vec3f> displacements,
                               std::span<const Vec3f> velocities, double travel_m,
                               const Vec3d& from, const Vec3d& to);

  // Does what another cutter did to the same topology: all its events, of all its calls, in order;
  // with no stroke on. What is wrong is refused; what comes before it has been done. made: the
  // nodes, as in CutOutput.
  Status repeat(const CutEvents& events, std::vector<topology::NewNode>& made);

  // Everything that later calls depend on besides topology and settings: the same bytes, the same
  // future. Six bytes while no stroke is on. To be read by a cutter whose topology has had the same
  // events and repeated them.
  void visit_state(world::StateArchive& archive);

  // To be told of what others remove between calls.
  Places& places() { return mesh_.places(); }

  // Nothing to do until a blade moves or something tears.
  bool is_idle() const;
  // How far the blade has gone since the place up to which all is cut, m.
  double behind_m(std::uint32_t blade) const;
  // Returns the mean edge length of the uncut mesh where the blade cut last, m.
  double h_at(std::uint32_t blade) const;
  double floor_sine() const { return mesh_.floor_sine(); }
  double mean_h() const { return mesh_.mean_h(); }

 private:
  static constexpr std::uint32_t kNone = 0xffffffffu;

  Stroke* begin_stroke(std::uint32_t blade);
  void visit_stroke(world::StateArchive& archive, std::uint32_t place);
  // kMaxBlades: it has ended.
  std::uint32_t blade_of(std::uint32_t place) const;
  void clear_strokes();
  void order_strokes();
  void refill();
  std::uint32_t serve(std::uint32_t place, std::uint32_t share);
  void let_others_go_first(std::span<const std::uint32_t> places);
  bool work(Stroke& stroke, std::uint32_t& budget);
  bool end(Stroke& stroke);
  void forget(Stroke& stroke);

  std::vector<Stroke> strokes_;
  CutMesh mesh_;
  std::unique_ptr<PatchSplitter> splitter_;
  Opening opening_;
  Repair repair_;
  SideCut side_cut_;
  EdgeMeter meter_;
  CutOutput unchanged_;                              // of calls that cut nothing
  std::array<std::uint32_t, kMaxBlades> stroke_of_;  // place in strokes_, or kNone
  std::uint32_t next_id_ = 0;
  std::uint32_t edits_left_;          // by Settings
  bool is_resting_ = false;           // until there are more
  std::vector<std::uint32_t> order_;  // places in strokes_ of some, by id
  std::vector<NodeIndex> kept_;
  std::vector<TetFace> torn_;
};

}  // namespace trocar::cutting
