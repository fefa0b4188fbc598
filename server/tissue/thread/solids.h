#pragma once

// Nodes of thread meet what is rigid: pegs, tools and a floor. All are rigid capsules, but the
// floor. A node is held out where it is nearest to a capsule's axis; if it would pass to the other
// side within a step, by the plane between it and the axis at the beginning, however thin the
// capsule is and however fast. Friction's memory is of the solid that a node presses hardest.

#include <optional>
#include <span>
#include <vector>

#include "server/tissue/thread/elasticity.h"
#include "server/tissue/thread/friction.h"

namespace trocar::thread {

inline constexpr double kThreadFriction = 0.15;  // of thread on tools and on the floor; our choice

struct Capsule {
  Vec3d from_m, to_m;
};
// A solid in one step of time, from where it was to where it is.
struct Solid {
  Capsule before, now;
  double radius_m = 0;
  double friction = 0;
  std::uint8_t number = 0;  // which of the scene it is, for Threads::touched
  ToolSlot tool;            // invalid: it stands still
};

class Solids {
 public:
  explicit Solids(const Rules& rules);

  // tools: those that thread meets. Jaws do not meet what they hold.
  void find(std::span<const Solid> tools, const Elasticity& elasticity, const Threads& threads);
  void add(const Elasticity& elasticity, const Threads& threads, ChainSolver& solver) const;
  // Ends a step: friction's memory, and forces on tools.
  void end(const Elasticity& elasticity, Threads& threads);

  std::size_t contact_count() const { return contacts_.size(); }
  // Sum over contacts of the last step: of all thread on this tool.
  struct Push {
    ToolSlot tool;
    Vec3d force_n, at_m;
  };
  std::span<const Push> pushes() const { return pushes_; }
  // Returns the force of all thread on a peg, in the last step.
  Vec3d force_on_peg_n(std::size_t peg) const { return peg_forces_n_[peg]; }

 private:
  struct Contact {
    std::uint32_t node, solid;
    Vec3d normal;    // at the beginning
    Vec3d motion_m;  // of the solid there, within the step
    Vec3d creep_m;
  };
  struct Gap {
    Vec3d normal;
    double gap_m;
  };
  struct Touch {
    Vec3d normal, slip_m;
    double friction = 0;
    Rub rub;
  };
  Gap gap_of(const Contact& contact, const Vec3d& place_m) const;
  // At the present places; nothing: the node is outside.
  std::optional<Touch> touch_of(const Contact& contact, const Elasticity& elasticity,
                                const Threads& threads) const;
  void find_near(std::uint32_t solid, const Elasticity& elasticity, const Threads& threads);
  void find_on_floor(const Elasticity& elasticity, const Threads& threads);

  std::vector<Solid> pegs_, solids_;
  std::optional<double> floor_y_m_;
  std::vector<Contact> contacts_;
  std::vector<Push> pushes_;
  std::vector<Vec3d> peg_forces_n_;
  std::vector<double> hardest_n_;  // per node, in end()
};

}  // namespace trocar::thread
