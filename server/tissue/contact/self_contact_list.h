#pragma once

// The list of those pairs of surface nodes that can come near each other, for self_contact.h. It
// has all pairs whose references are within range() and that may meet: if they faced each other at
// rest or one of the references at least is nearly moved_m from rest, and they are not near each
// other as the uncut organ is; or, of wounds, if they are not beside each other on one lip, or one
// of the references is as far from rest as what is beside. A reference is where the node was when
// its surroundings were last looked through; it is never farther than slack_m / 2 from where the
// node is now. So each pair that is within reach() is on the list, and only what moves is looked
// through again.
//
// A new list is made over several ticks: first references, then the surroundings of due nodes. An
// edit adds the pairs around it to the list, and to the one that is being made.

#include <algorithm>
#include <span>
#include <vector>

#include "common/base/stamps.h"
#include "server/tissue/contact/point_grid.h"
#include "server/tissue/contact/self_contact_law.h"
#include "server/tissue/contact/self_surface.h"
#include "server/tissue/world/world.h"

namespace trocar::contact {

struct NodePair {
  SelfSurface::Site node = 0, across = 0;
  auto operator<=>(const NodePair&) const = default;
};

// Pairs of nodes, each from both sides or not at all.
struct NodePairList {
  using Site = SelfSurface::Site;

  // Pairs of one node, up to where the next run begins.
  struct Run {
    Site node = 0;
    std::uint32_t first = 0;
  };

  std::vector<NodePair> pairs;  // ascending
  std::vector<Run> runs;        // of pairs, per node that has some; ascending
  // Per pair: it is beyond reach() before both nodes' travels together are this, m.
  std::vector<float> far_until;
  float least_distance = 1;  // m, of the references of a pair
  // Per node; and whether the reference is away from the node's rest position.
  std::vector<Vec3f> references;
  std::vector<std::uint8_t> has_left;

  void reserve(std::size_t most_pairs, std::size_t nodes);
  void resize(std::size_t nodes);
  void clear();
  std::size_t end_of_run(std::size_t run) const {
    return run + 1 < runs.size() ? runs[run + 1].first : pairs.size();
  }
  // Lowers least_distance to what the references of a pair are apart.
  void note_squared_distance(float squared);
  // Inserts pairs that the list lacks. `found` has each from both sides, some of them twice.
  void add(std::vector<NodePair>& found);
  // Nobody knows any more how far the node's pairs are, or any.
  void forget_distances(Site site);
  void forget_distances();
};

// How near two nodes come before a pair of one with a triangle at the other can begin.
struct SelfReach {
  using Site = SelfSurface::Site;

  explicit SelfReach(const SelfSurface& surface);

  float moved_m = 0;  // A pair needs a node that is so far from rest, unless it faced one there.
  float slack_m = 0;  // Nodes may move by half of it before the list looks around them again.
  // Per node: any point on a triangle at it whose nearest corner it is lies within so far, m, of
  // it; and the largest that there may be.
  std::vector<float> of_corner;
  float of_corner_m = 0;

  float greatest() const { return kSelfMaxMargin_m + of_corner_m; }
  // Returns how far apart two nodes may be, m, so that a pair of one with a triangle at the other
  // begins, with the greatest margin.
  float between(Site site, Site other) const {
    return std::max(of_corner[site], of_corner[other]) + kSelfMaxMargin_m;
  }
  float range(Site site, Site other) const { return between(site, other) + slack_m; }
  // Measures the triangles at a node; returns whether it now reaches farther.
  bool measure(Site site, const SelfSurface& surface);
};

class SelfContactList {
 public:
  using Site = SelfSurface::Site;
  using Sort = SelfSurface::Sort;

  explicit SelfContactList(const organ::Organ& organ);

  SelfSurface& surface() { return surface_; }
  const SelfSurface& surface() const { return surface_; }
  const SelfReach& reach() const { return reach_; }
  const NodePairList& now() const { return list_; }
  std::uint64_t lists_made() const { return lists_made_; }

  // Once in each pass: made anew when a node is far from its reference.
  void keep(const world::World& world);
  // The world has its new nodes.
  void update(const topology::Edit& edit, const world::World& world);

  // These are about now(), where pairs begin within a margin, m.
  bool is_all_far(float margin_m) const {
    // Two nodes are nearer to each other than their references by slack_m at most.
    return list_.runs.empty() ||
           list_.least_distance - reach_.slack_m > reach_.of_corner_m + margin_m;
  }
  // Returns whether no pair can begin between these two in this pass.
  bool is_far(std::size_t listed, float margin_m) const {
    const auto& [node, across] = list_.pairs[listed];
    return list_.far_until[listed] >
           travels_[node] + travels_[across] - (kSelfMaxMargin_m - margin_m);
  }
  // Returns the squared distance, m2, of two that are listed, and remembers it if it is large.
  float squared_distance(std::size_t listed, float margin_m, const world::World& world);

 private:
  // The next list, as far as it has come; it takes several ticks.
  struct Next {
    NodePairList list;                 // with the pairs that are kept
    std::vector<NodePair> found;       // and these, to be added
    std::size_t sites_seen = 0;        // whose references are taken
    std::size_t due_count = 0;         // of these
    std::vector<std::uint8_t> is_due;  // per node
    std::vector<Site> due;             // in the order in which they look around
    std::size_t sites_listed = 0;      // of due
    PointGrid grid;                    // of references
    std::vector<Site> grid_sites;      // what it numbers
  };

  void follow_motion(const world::World& world);
  void begin_list();
  void go_on_listing(double share, const world::World& world);
  void set_references(std::size_t end, const world::World& world);
  void keep_pairs();
  void order_due();
  void end_list();
  void list_around(Site site);
  void extend();
  void measure_corners(std::span<const Site> sites);
  void set_reference(Site site, const world::World& world, NodePairList& list) const;
  // Finds the pairs that these nodes are in and that the list lacks.
  void list_pairs_of(std::span<const Site> sites, NodePairList& list);
  bool looks_around(Site site, const NodePairList& list) const;
  bool may_meet(Site site, Site other, const NodePairList& list) const;

  SelfSurface surface_;
  SelfReach reach_;
  std::vector<std::uint8_t> is_close_at_rest_;  // per node: something may face it there
  bool has_list_ = false;
  NodePairList list_;
  std::uint64_t lists_made_ = 0;
  // Per node: where it was in the last pass, and how far it has gone, m.
  std::vector<Vec3f> places_;
  std::vector<float> travels_;
  float farthest_m_ = 0;  // of a node, from its reference
  bool is_listing_ = false;
  Next next_;
  // Scratch.
  Stamps is_near_;               // per node
  std::vector<NodePair> found_;  // of an edit
  std::vector<Site> around_, looking_;
};

}  // namespace trocar::contact
