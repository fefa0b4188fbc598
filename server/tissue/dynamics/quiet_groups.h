#pragma once

// Which groups of the far field pause. Tissue that creeps, away from tools and from all that moves,
// is all but in equilibrium from step to step, so that it needs few steps: in between it stands
// still and keeps its velocities. Time passes more slowly there. That changes how tissue gathers
// way, but not where it comes to rest, and no step gives it energy.
//
// A group pauses where its nodes, and those of every group with a neighbour of them, are slower
// than a limit, and none of its own is near or in use. That follows from velocities and classes.
//
// What is computed from displacements is as in the step before where neither a group nor any with a
// neighbour of it has moved since: keeps().

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "server/tissue/dynamics/groups.h"
#include "server/tissue/dynamics/linearisation.h"

namespace trocar::dynamics {

class QuietGroups {
 public:
  // The group's neighbours anew; it counts as moved.
  void index(Group group, const Linearisation& linear);

  // Before a step: nothing pauses in it.
  void begin_step();
  // Then finds what pauses, nodes being slower than limit_m_s. Per group: lanes of free and of near
  // nodes, and whether it is in use; velocities: per slot.
  void find(float limit_m_s, std::span<const std::uint8_t> free, std::span<const std::uint8_t> near,
            std::span<const std::uint8_t> in_use, const Float4* velocities);

  bool pauses(Group group) const { return pauses_[group] != 0; }
  // Whether it pauses, and has done so in the step before.
  bool stands(Group group) const { return pauses_[group] != 0 && has_paused_[group] != 0; }
  // Whether the group and all groups beside it stand.
  bool keeps(Group group) const { return keeps_[group] != 0; }

  // Between steps somebody else has moved the group's nodes, or all.
  void moved(Group group) { pauses_[group] = 0; }
  void moved_all() { std::ranges::fill(pauses_, std::uint8_t{0}); }

 private:
  // Whether neither the group nor any beside it is busy.
  bool is_undisturbed(Group group) const;

  std::vector<std::vector<Group>> neighbours_;             // of each group, without itself
  std::vector<std::uint8_t> is_busy_;                      // per group, while a step begins
  std::vector<std::uint8_t> pauses_, has_paused_, keeps_;  // per group
};

}  // namespace trocar::dynamics
