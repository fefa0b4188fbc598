#pragma once

// One blade contact: the motion that is still to be cut, and what the stroke knows of the mesh.
//
// Labels: nodes that lie on the wound. Heights: signed distances of other nodes from the nearest
// part of the path, measured while the blade was there, because tissue moves. Sides: of tets, once
// decided. All are dense arrays with lists beside them, so that a stroke costs what it touches.

#include "server/tissue/cutting/blade_patch.h"
#include "server/tissue/cutting/faces.h"
#include "server/tissue/cutting/settings.h"
#include "server/tissue/world/state_archive.h"

namespace trocar::cutting {

// Collects the motion of one blade into strips.
class BladeMotion {
 public:
  enum class Verdict { Accepted, Refused, Appeared };

  // h: m. Appeared: another blade, or one that has jumped: a stroke of its own has to begin.
  Verdict move(std::span<const Vec3d> points, double h, const Settings& settings);
  // Moves what has not been cut yet with the tissue: so far, m, at either end of the edge.
  void carry(const std::array<Vec3d, 2>& moved);
  // Makes a strip of the collected motion that is left.
  void finish(double h, const Settings& settings);
  void clear();

  // Without the places of a blade that has left.
  void visit_state(world::StateArchive& archive, bool has_left);

  // How far the blade has gone since the place up to which all is cut, m.
  double behind() const { return longest_motion(has_strip() ? strip().from : anchor_, now_); }
  std::uint32_t points() const { return now_.count; }  // of the edge
  bool has_strip() const { return strips() > 0; }
  std::size_t strips() const { return strips_.size() - next_; }
  const Strip& strip() const { return strips_[next_]; }
  void pop();

 private:
  void add_strips(double h, const Settings& settings);
  void visit_strips(world::StateArchive& archive);

  BladeEdge anchor_, now_;   // where collecting began; the last place
  Vec3d heading_;            // m, the mean motion before; zero: there was none
  std::uint32_t ticks_ = 0;  // since then; counts no further than is asked
  bool is_first_ = true;
  std::vector<Strip> strips_;
  std::size_t next_ = 0;
};

class Stroke {
 public:
  bool is_labelled(NodeIndex n) const { return n.value < labels_.size() && labels_[n.value] != 0; }
  std::span<const NodeIndex> labelled() const { return labelled_; }
  void label(NodeIndex node);
  void remove_label(NodeIndex node);  // as if it had never been labelled
  // A labelled node belongs to one side after all.
  void remove_from_wound(NodeIndex node, int side);

  struct Height {
    double nearest_squared = -1;  // m^2, distance from the path; negative: never measured
    double height = 0;            // m, above the path's nearest part
  };
  Height height(NodeIndex n) const {
    return n.value < heights_.size() ? heights_[n.value] : Height{};
  }
  // Returns whether the node changed sides.
  bool measure(NodeIndex node, const Height& height);
  bool measure_again(NodeIndex node, const Height& height);  // whatever was known

  // -1, 1, or 0 if not decided.
  int side(TetIndex t) const { return t.value < sides_.size() ? sides_[t.value] : 0; }
  void decide(TetIndex tet, int side);  // 0: undecided again

  // Passes what is known of a tet that was split, or of a node that was copied, on to the new one.
  void inherit(TetIndex parent, TetIndex child);
  void inherit(NodeIndex original, NodeIndex copy);

  // Forgets labels and heights of far nodes, and sides of tets without a labelled node.
  template <typename IsFar>
  void forget_if(IsFar&& is_far, const topology::Topology& topology) {
    std::erase_if(labelled_,
                  [&](NodeIndex n) { return is_far(n) ? (labels_[n.value] = 0, true) : false; });
    std::erase_if(measured_,
                  [&](NodeIndex n) { return is_far(n) ? (heights_[n.value] = {}, true) : false; });
    std::erase_if(sided_, [&](TetIndex t) {
      for (const auto node : topology.tet(t))
        if (is_labelled(node)) return false;
      sides_[t.value] = 0;
      return true;
    });
  }
  void clear();

  // All but the id. What is read must fit the topology and be what a stroke can be; if it does
  // not, archive.fail(), and what is left is good for clear() only.
  void visit_state(world::StateArchive& archive, const topology::Topology& topology);

  std::uint32_t id = 0;
  bool is_active = false, has_ended = false;
  BladeMotion motion;
  std::uint32_t repairs = 0;         // rounds done since the end
  double way = 0;                    // m, of the blade since the last repair behind it
  Sides sides_before{};              // of the strip before the one that is being cut
  std::vector<PatchTriangle> patch;  // the last one
  Sides sides{};                     // its own; with a strip alone
  std::vector<PatchTriangle> path;   // it without extension; with a strip alone
  double h = 0;                      // m, mean of the mesh where the blade cut last
  std::vector<TetIndex> waiting;     // tets with faces that could not be opened yet, ascending
  std::vector<NodeIndex> fresh;      // labelled or changed sides since the last opening

 private:
  void forget_height(NodeIndex node);
  void visit_patch(world::StateArchive& archive);
  void visit_nodes(world::StateArchive& archive, const topology::Topology& topology);
  void visit_tets(world::StateArchive& archive, const topology::Topology& topology);

  std::vector<std::uint8_t> labels_;
  std::vector<NodeIndex> labelled_;
  std::vector<Height> heights_;
  std::vector<NodeIndex> measured_;
  std::vector<std::int8_t> sides_;
  std::vector<TetIndex> sided_;
};

}  // namespace trocar::cutting
