#pragma once

// When tissue looks for tissue (self_contact.h): how often there is a pass, which nodes look around
// in it, and from how far pairs begin, as fast as nodes move now.

#include <cstdint>
#include <span>
#include <vector>

#include "server/tissue/contact/self_contact_law.h"
#include "server/tissue/contact/self_contact_table.h"
#include "server/tissue/contact/self_surface.h"

namespace trocar::contact {

class SelfContactPace {
 public:
  using Site = SelfSurface::Site;

  // Makes room for all nodes.
  void resize(const SelfSurface& surface);
  // Finds what decides whether there is a pass.
  void survey(const SelfSurface& surface, const world::World& world);
  bool is_any_awake() const { return is_any_awake_; }
  bool is_due(const SelfContactTable& pairs, Tick tick) const {
    return pairs.has_edit() || tick - pairs.last_pass() >= interval_;
  }

  // Notes the pass in `pairs`; a second one in a tick follows the same one before.
  void begin_pass(SelfContactTable& pairs, Tick tick);
  void find_lookers(const SelfSurface& surface, const world::World& world,
                    std::span<const NodeIndex> paired);
  bool is_looking(Site site) const { return is_looking_[site] == 1; }
  // Returns whether the node had a pair before the pass.
  bool had_pair(Site site) const { return had_pair_[site] == 1; }
  // Returns whether it is the turn, in this pass, of what comes every so many ticks, a power of
  // two.
  bool is_turn(std::uint32_t phase, Tick interval, Tick tick) const {
    return ((tick + phase) & (interval - 1)) < tick - before_;
  }
  // Returns from how far, m, two begin a pair that come nearer at this speed; none comes faster
  // than margin() says.
  float margin_of(float closing) const;
  float margin() const;

 private:
  // Per node: it looks for pairs in this pass; others sleep, or wait for those.
  std::vector<std::uint8_t> is_looking_;
  // Per node: neighbours look in the same ticks, so that in between nobody in a place looks.
  std::vector<std::uint8_t> phases_;
  std::vector<std::uint8_t> had_pair_;  // per node
  bool is_any_awake_ = true;            // of the surface's nodes
  float fastest_squared_ = 0;           // of these, m2/s2
  Tick interval_ = 1;                   // from pass to pass, as fast as that
  Tick before_ = 0;                     // the tick of the pass before this one's
  bool follows_edit_ = false;           // there was an edit since that
};

}  // namespace trocar::contact
