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

#include <span>
#include <vector>

#include "common/base/stamps.h"
#include "server/tissue/contact/contact_list.h"
#include "server/tissue/contact/self_contact_list.h"
#include "server/tissue/contact/self_contact_pace.h"
#include "server/tissue/contact/self_contact_table.h"
#include "server/tissue/contact/self_surface_now.h"

namespace trocar::contact {

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
  std::uint64_t lists_made() const { return list_.lists_made(); }
  std::size_t pairs_listed() const { return list_.now().pairs.size(); }
  // Pairs of the last find() that were looked at anew.
  std::size_t pairs_looked_at() const { return pairs_looked_at_; }

 private:
  using Site = SelfSurface::Site;
  using Sort = SelfSurface::Sort;
  using Place = SelfContactPlace;
  using Now = SelfSurfaceNow;
  static constexpr Site kNoSite = 0xffffffffu;
  static constexpr float kNoDistance = 1e9f;

  // The nodes across from one that are nearest to it so far: on the other side of its wound, and
  // elsewhere.
  struct Nearest {
    Site of_lips = kNoSite, other = kNoSite;
    float squared_of_lips = kNoDistance, squared_other = kNoDistance;  // m^2
  };
  // Says where a pair is now.
  struct Look {
    Now::ClosestPoint closest;
    Now::Touch touch;
  };

  // Makes room for all nodes and triangles.
  void extend();
  void pass(const world::World& world, SelfContactTable& pairs, ContactList& out);
  void stir(Now& now);
  bool can_meet_lip(Site site, Site across, const Now& now) const;
  bool can_meet_other(Site site, Site across, Now& now) const;
  void consider(Site site, Site across, float squared, Now& now, Nearest& nearest) const;
  // Searches the list's run of pairs of one node.
  Nearest find_nearest(std::size_t run, Now& now);
  bool begins(Site site, Site nearest, float squared, bool is_of_lips, Now& now, Look& look) const;
  bool begins(Site site, const Nearest& nearest, Now& now, Look& look) const;
  std::span<const Site> around(TriangleIndex triangle, const Vec3f& weights, bool is_there_only);
  bool stays(Site site, TriangleIndex triangle, Now& now, Look& look);
  // Returns whether the pair is looked at in this pass.
  bool is_due(Site site, TriangleIndex triangle, const Vec3f& weights, const Now& now) const;
  static float eased_shift(Site site, TriangleIndex triangle, const Place& place, const Look& look,
                           const Now& now);

  SelfContactList list_;
  SelfContactPace pace_;
  float margin_m_ = 0;  // Pairs begin within this in this pass.
  std::size_t pairs_looked_at_ = 0;

  // Scratch.
  SelfNormals normals_;
  // Per node: in this pass a node that looks is listed with it. If it waits and has no pair, these
  // are the nearest of those that look.
  Stamps is_stirred_;
  std::vector<Nearest> stirred_nearest_;
  SelfContactTable old_pairs_;
  std::vector<Site> corners_;
};

}  // namespace trocar::contact
