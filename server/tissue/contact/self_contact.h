#pragma once

// Tissue against tissue of one organ: the walls of a hollow one, a fold, a flap laid on its base.
//
// A node of the surface does not pass through a triangle across from it. What holds them apart is a
// Push (contact_list.h) of the node against the closest point of a triangle: displacement of the
// node less that of the point, so that the force on one is minus that on the other, along a
// normal that is the mean of both sides' and changes smoothly over edges. It starts at touch, has
// no friction (wet serosa slips) and no limit. Nodes of both sides meet the other's triangles, each
// for half of its surface.
//
// A node meets a triangle from outside only: in front of it, facing it, within the margin of the
// tick's motion. That node and triangle then stay a pair while the node is near, however deep it is
// pressed and wherever it slides, so that nothing flips: pairs are state. What is near a node in
// the tissue (self_surface.h) never meets it: its neighbourhood, and the other face of a thin wall.
// Above all not the face across from it in a tet: a pair of these would hold a tet inside out.
// What touches or overlaps at rest may stay as it is.
//
// Cuts: the two sides of a wound are face to face from the start, and pairs like any others, which
// press once they overlap: cutting adds no force and no energy. Wounds and skin are surfaces of
// their own: a node at the rim has a normal of each, and a node on a wound meets the other side of
// wounds first. A pair whose triangle an edit has replaced goes on with what is there now.
//
// Slow tissue costs little. A pair stays where it lies on its triangle until the node may
// have drifted by kDrift_m from there (kNearDrift_m where nodes are swept most), as fast as it
// moves against the triangle now, but for no more than kLookEvery ticks. Where it lies is state,
// too. Where nodes are not swept most, a pair that drifts by less in a tick is given to the solver
// only while it presses, and such a pair is no reason to sweep its surroundings more: both sides of
// a wound may move together however fast. Nodes look for new pairs before one of them may have
// moved by kLookDrift_m, which is little beside the margin. Pairs of nodes that are asleep
// (server/tissue/pieces) stay as they are and are given to nobody.
//
// All this is done in passes, kPassEvery ticks apart: each tick while something is fast, and in the
// tick after an edit. In between pairs press where they are.
//
// Work: pairs of nodes that can come near are listed with slack, and again for those nodes that
// have moved a part of it: O(surface nodes + these x their surroundings), over several ticks. Each
// pass: O(pairs with nodes that look), nothing where nothing is near; each tick O(surface nodes +
// pairs).
// An edit adds the pairs around it to the list, and to the one that is being made: O(what is within
// reach of it), and a look at each surface node's place.
// Pairs are a function of the state: results do not depend on when lists were made.

#include <algorithm>
#include <span>
#include <vector>

#include "server/tissue/contact/contact_list.h"
#include "server/tissue/contact/point_grid.h"
#include "server/tissue/contact/self_surface.h"
#include "server/tissue/world/state_archive.h"

namespace trocar::contact {

// Pa/m, of both sides together: twice a tool's (contact_finder.h), for there is no hand that could
// back off. 10 kPa press walls 0.2 mm into each other.
inline constexpr float kSelfStiffnessPaPerM = 5e7f;
// Pairs are made when this near, or so many ticks before they touch at their present speed as there
// are from pass to pass and kSelfTicksAhead, but never from farther than kSelfMaxMargin_m: enough
// for 1.3 m/s.
inline constexpr float kSelfMargin_m = 0.001f, kSelfMaxMargin_m = 0.003f;
inline constexpr float kSelfTicksAhead = 0.5f;
inline constexpr float kDrift_m = 6.4e-6f, kNearDrift_m = 0.8e-6f, kLookDrift_m = 1e-4f;
// A pair that presses and drifts by so much in a tick is swept most.
inline constexpr float kSeedDrift_m = 1.28e-5f;
inline constexpr Tick kLookEvery = 64;  // a power of two
// From one pass to the next nothing goes farther than kPassDrift_m, if it goes on as fast.
inline constexpr Tick kPassEvery = 4;  // a power of two
inline constexpr float kPassDrift_m = 8e-4f;

// A place is where a node lay on its triangle when the pair was last looked at.
struct SelfContactPlace {
  Vec3f weights;    // of the corners
  Vec3f normal;     // from the triangle to the node
  float shift = 0;  // m, the gap from which on it presses
};

}  // namespace trocar::contact

template <>
struct trocar::world::IsPaddingFree<trocar::contact::SelfContactPlace> : std::true_type {};

namespace trocar::contact {

// The pairs: state.
class SelfContactTable {
 public:
  SelfContactTable();

  std::span<const NodeIndex> nodes() const { return nodes_; }  // ascending, each once
  std::span<const TriangleIndex> triangles() const { return triangles_; }

  std::span<const SelfContactPlace> places() const { return places_; }

  // The tick of the last pass, and whether the topology was edited since. At first all is new.
  Tick last_pass() const { return last_pass_; }
  bool has_edit() const { return has_edit_ != 0; }
  void note_pass(Tick tick) { last_pass_ = tick, has_edit_ = 0; }
  void note_edit() { has_edit_ = 1; }

  void clear() { nodes_.clear(), triangles_.clear(), places_.clear(); }
  void swap_pairs(SelfContactTable& other) {
    nodes_.swap(other.nodes_), triangles_.swap(other.triangles_), places_.swap(other.places_);
  }
  void add(NodeIndex node, TriangleIndex triangle, const SelfContactPlace& place) {
    nodes_.push_back(node);
    triangles_.push_back(triangle);
    places_.push_back(place);
  }

  // Last in a state. surface_nodes: ascending; triangle_count: numbers given so far.
  void visit_state(world::StateArchive& archive, std::span<const NodeIndex> surface_nodes,
                   std::size_t triangle_count);

 private:
  std::vector<NodeIndex> nodes_;
  std::vector<TriangleIndex> triangles_;
  std::vector<SelfContactPlace> places_;
  Tick last_pass_ = 0;
  std::uint8_t has_edit_ = 1;
};

class SelfContactFinder {
 public:
  explicit SelfContactFinder(const organ::Organ& organ);

  // After ContactFinder::find(): brings the pairs up to date, if it is time for a pass, and adds
  // their points to `out`.
  void find(const world::World& world, SelfContactTable& pairs, ContactList& out);
  // Once more in the same tick, for tissue that has woken, and with a pass in any case.
  void find_again(const world::World& world, SelfContactTable& pairs, ContactList& out);

  // The world has its new nodes.
  void update(const topology::Edit& edit, const world::World& world);

  // Lists made, and pairs of nodes in the last one.
  std::uint64_t lists_made() const { return lists_made_; }
  std::size_t pairs_listed() const { return list_.pairs.size(); }
  // Pairs of the last find() that were looked at anew.
  std::size_t pairs_looked_at() const { return pairs_looked_at_; }

 private:
  using Site = SelfSurface::Site;
  using Sort = SelfSurface::Sort;
  using Place = SelfContactPlace;
  static constexpr Site kNoSite = 0xffffffffu;
  static constexpr float kNoDistance = 1e9f;

  // A node sleeps, waits for others to look, or looks for pairs in this tick.
  enum class Pace : std::uint8_t { Asleep, Waits, Looks };

  struct NodePair {
    Site node = 0, across = 0;
    auto operator<=>(const NodePair&) const = default;
  };
  // Pairs of one node, up to where the next run begins.
  struct Run {
    Site node = 0;
    std::uint32_t first = 0;
  };
  struct ClosestPoint {
    TriangleIndex triangle;
    Vec3f weights;
    Vec3f from;  // m, from the point to the node
    float squared = 0;
  };
  struct Touch {
    Vec3f normal, own;              // from the triangle's side to the node's; the node's
    Vec3f at_rest;                  // m, from the point to the node
    float shift = 0;                // m, the gap from which on it presses
    float gap = 0;                  // m, beyond that
    float aside = 0;                // m, across the normal
    float facing = 0, closing = 0;  // cosine of both normals; m/s
  };

  // The nodes across from one that are nearest to it so far: on the other side of its wound, and
  // elsewhere.
  struct Nearest {
    Site of_lips = kNoSite, other = kNoSite;
    float squared_of_lips = kNoDistance, squared_other = kNoDistance;  // m^2
  };

  // A list holds the pairs of nodes that can come near. Each node has a reference position, see
  // begin_list(), and a flag that says whether this is away from the node's rest position.
  struct List {
    std::vector<NodePair> pairs;  // ascending
    std::vector<Run> runs;        // of pairs, per node that has some; ascending
    // Per pair: it is beyond reach_of() before both nodes' travels_ together are this, m.
    std::vector<float> far_until;
    float least_distance = 1;  // m, of the references of a pair
    std::vector<Vec3f> references;
    std::vector<std::uint8_t> has_left;
  };

  void follow_motion(const world::World& world);
  void forget_travels();
  void keep_list(const world::World& world);
  void begin_list();
  void go_on_listing(double share, const world::World& world);
  void set_references(std::size_t end, const world::World& world);
  void keep_pairs();
  void order_due();
  void end_list();
  void list_around(Site site);
  void extend();
  void set_reference(Site site, const world::World& world, List& list) const;
  // The pairs that these nodes are in and that the list lacks, into found_.
  void list_pairs_of(std::span<const Site> sites, List& list);
  static void add_to_list(std::vector<NodePair>& found, List& list);
  bool looks_around(Site site, const List& list) const;
  bool may_meet(Site site, Site other, const List& list) const;
  bool has_moved(Site site, float by_m, const world::World& world) const {
    return length_squared(world.displacements[site]) > by_m * by_m;
  }
  // Returns whether the node's reference is farther than this from its rest position.
  bool was_moved(Site site, float by_m, const List& list) const {
    return length_squared(list.references[site] - surface_.rest_position(site)) > by_m * by_m;
  }
  static Vec3f position(Site site, const world::World& world) {
    return world.position(NodeIndex(site));
  }
  const Vec3f& normal(Site site, Sort sort, const world::World& world);
  const Vec3f& main_normal(Site site, const world::World& world) {
    return normal(site, surface_.is_of(site, Sort::Skin) ? Sort::Skin : Sort::Wound, world);
  }
  float measured_corner_reach(Site site) const;
  void update_corner_reaches(std::span<const Site> sites);
  static void forget_distances(Site site, List& list);
  // Returns how far apart two nodes may be, m, so that a pair of one with a triangle at the other
  // begins, with the greatest margin.
  float reach_of(Site site, Site other) const {
    return std::max(corner_reaches_[site], corner_reaches_[other]) + kSelfMaxMargin_m;
  }
  float range_of(Site site, Site other) const { return reach_of(site, other) + slack_m_; }
  Vec3f normal_towards(Site site, const Vec3f& theirs, const world::World& world);
  const Vec3f& up(TriangleIndex triangle, const world::World& world);
  // The wound of the triangle is one that the node is on a lip of.
  bool is_of_lips(Site site, TriangleIndex triangle) const {
    return surface_.sort_of(triangle) == Sort::Wound && surface_.is_on_lip(site);
  }
  bool can_meet(Site site, TriangleIndex triangle, const world::World& world);
  ClosestPoint closest_point(Site site, TriangleIndex triangle, const world::World& world) const;
  std::span<const Site> around(TriangleIndex triangle, const Vec3f& weights, bool is_there_only);
  ClosestPoint closest_point_around(Site site, std::span<const Site> around, bool is_of_lips,
                                    const world::World& world);
  Touch touch_at(Site site, const ClosestPoint& closest, const world::World& world);
  bool can_meet_lip(Site site, Site across, const world::World& world) const;
  bool can_meet_other(Site site, Site across, bool is_moved, const world::World& world);
  bool begins(Site site, Site nearest, float squared, bool is_of_lips, const world::World& world,
              ClosestPoint& closest, Touch& touch);
  bool begins(Site site, const Nearest& nearest, const world::World& world, ClosestPoint& closest,
              Touch& touch);
  std::size_t end_of_run(std::size_t run) const {
    return run + 1 < list_.runs.size() ? list_.runs[run + 1].first : list_.pairs.size();
  }
  // Returns whether no pair can begin between these two in this tick.
  bool is_far(std::size_t listed) const {
    const auto& [node, across] = list_.pairs[listed];
    return list_.far_until[listed] >
           travels_[node] + travels_[across] - (kSelfMaxMargin_m - margin_now_m_);
  }
  // Returns the squared distance, m2, of two that are listed, and remembers it if it is large.
  float squared_distance(std::size_t listed, const world::World& world);
  void consider(Site site, Site across, float squared, const world::World& world, Nearest& nearest);
  void stir(const world::World& world);
  // Searches list_.pairs from `first` to `end`.
  Nearest find_nearest(Site site, std::size_t first, std::size_t end, const world::World& world);
  bool stays(Site site, TriangleIndex triangle, const world::World& world, ClosestPoint& closest,
             Touch& touch);
  void survey(const world::World& world);
  void pass(const world::World& world, SelfContactTable& pairs, ContactList& out);
  void find_pace(const world::World& world, std::span<const NodeIndex> paired);
  bool is_asleep(Site site, TriangleIndex triangle, const world::World& world) const;
  // Returns whether it is the turn, in this pass, of what comes every so many ticks, a power of
  // two.
  bool is_turn(std::uint32_t phase, Tick interval, const world::World& world) const {
    return ((world.tick + phase) & (interval - 1)) < world.tick - pass_before_;
  }
  float margin_of(float closing) const;
  // Returns the squared speed at which a pair leaves its place, m2/s2.
  float squared_drift(Site site, TriangleIndex triangle, const Vec3f& weights,
                      const world::World& world) const;
  // Returns whether the pair is looked at in this tick.
  bool is_due(Site site, TriangleIndex triangle, const Vec3f& weights,
              const world::World& world) const;
  float eased_shift(Site site, TriangleIndex triangle, const Place& place,
                    const ClosestPoint& closest, const Touch& touch,
                    const world::World& world) const;
  void add_pair(Site site, TriangleIndex triangle, const Place& place, const world::World& world,
                SelfContactTable& pairs, ContactList& out) const;
  void add_point(const SelfContactTable& pairs, std::size_t pair, const world::World& world,
                 ContactList& out) const;

  SelfSurface surface_;
  std::vector<std::uint8_t> is_close_at_rest_;  // per node: something may face it there
  // Per node: neighbours look in the same ticks, so that in between nobody in a place looks.
  std::vector<std::uint8_t> phases_;
  float slack_m_ = 0;  // see begin_list()
  // A pair needs a node that is this far from rest, m, unless it faced something at rest.
  float moved_m_ = 0;
  // Per node: any point on a triangle at it whose nearest corner it is lies within so far, m, of
  // it, and the largest that there may be.
  std::vector<float> corner_reaches_;
  float corner_reach_m_ = 0;
  float reach_m_ = 0;  // with the greatest margin

  bool has_list_ = false;
  // Per node: where it was in the last tick, and how far it has gone, m.
  std::vector<Vec3f> places_;
  std::vector<float> travels_;
  float farthest_m_ = 0;  // of a node, from its reference
  std::uint64_t lists_made_ = 0;
  std::size_t pairs_looked_at_ = 0;
  List list_;
  // The next one, made over several ticks: first references, then the surroundings of due nodes.
  bool is_listing_ = false;
  List next_list_;                    // with the pairs that are kept
  std::vector<NodePair> next_found_;  // and these, to be added
  std::size_t sites_seen_ = 0;        // whose references are taken
  std::size_t due_count_ = 0;         // of these
  std::vector<std::uint8_t> is_due_;  // per node
  std::vector<Site> due_;             // in the order in which they look around
  std::size_t sites_listed_ = 0;      // of due_
  PointGrid grid_;                    // of references
  std::vector<Site> grid_sites_;      // what it numbers

  // Scratch.
  std::vector<Pace> paces_;                // per node, of this tick; for surface nodes
  bool is_any_awake_ = true;               // of these
  float fastest_squared_ = 0;              // of these, m2/s2
  Tick pass_interval_ = 1;                 // as fast as that
  Tick pass_before_ = 0;                   // the tick of the pass before this tick's
  bool follows_edit_ = false;              // there was an edit since that
  float margin_now_m_ = 0;                 // Pairs begin within this in this pass.
  std::vector<std::uint32_t> near_stamp_;  // per node
  // Per node: in this tick a node that looks is listed with it. If it waits and has no pair, these
  // are the nearest of those that look.
  std::vector<std::uint32_t> stirred_stamp_;
  std::vector<Nearest> stirred_nearest_;
  std::vector<std::uint8_t> has_pair_;  // per node; before the tick
  std::uint32_t near_current_ = 0;
  // These normals are of this tick where their stamp is tick_current_. normals_ has one per node
  // and sort; ups_ has one per triangle, as long as twice its area.
  std::vector<Vec3f> normals_, ups_;
  std::vector<std::uint32_t> normal_stamp_, up_stamp_;
  std::uint32_t tick_current_ = 0;
  SelfContactTable old_pairs_;
  std::vector<NodePair> found_;  // of an edit
  std::vector<Site> around_, looking_, corners_;
};

}  // namespace trocar::contact
