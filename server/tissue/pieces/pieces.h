#pragma once

// Tissue that nobody touches costs nothing, and a piece that nothing holds moves as a free body.
//
// Rest. The body, and each piece that cuts have set free (piece_list.h), rests when it has hardly
// moved for kRestTicks and no tool touches it: its nodes are Asleep, with no velocity, and neither
// swept nor looked at. It wakes as a whole, at the beginning of the tick in which a tool comes to
// it, or awake tissue that moves has a pair with it; and with an edit of it. Tissue in contact
// wakes one another, one after another, a tick each.
//
// Free pieces. Whatever the sweeps have done, an awake piece's momentum and spin are what they were
// before, with gravity and contacts in addition. Damping of nodes acts on its motion as a whole
// only where there is no gravity: under gravity it falls. A piece whose shape rests, and that is
// clear of all boxes around other tissue, flies: it is carried as a rigid body, its nodes are
// Asleep, and its velocities say how. It lies down at a floor kFloor_m below the organ, and stops
// where it has gone kFarthest_m.
//
// Work per tick: O(nodes of what is awake or flies), and O(surface) while something flies.
// Everything follows from the state: classes, velocities, poses of the far field,
// World::still_ticks and World::calm_ticks.

#include <span>
#include <vector>

#include "common/math/box.h"
#include "server/tissue/contact/contact_list.h"
#include "server/tissue/pieces/piece_list.h"
#include "server/tissue/pieces/rigid_motion.h"

namespace trocar::pieces {

inline constexpr std::uint16_t kRestTicks = 64;
// A body is at rest when the mean square of its speeds is below that of kRest_m_s and no node is
// faster than kShape_m_s; one that creeps is then some hundredths of a millimetre from where it
// would stop. Awake tissue faster than kWakes_m_s wakes what it touches.
inline constexpr double kRest_m_s = 1e-5;
inline constexpr float kWakes_m_s = 1e-4f;
// The shape of a free piece is at rest when its nodes move slower than this against the whole.
inline constexpr double kShape_m_s = 5e-4;
// Calm tissue is untouched, with a mean square of speeds below that of kCalm_m_s. What was cut, and
// was calm for so long, is at rest, too, while it trembles about its place: from one pose of the
// far field to the next by kTremble_m (root mean square) and nowhere by kFlutter_m. It must not
// creep: on the whole by kRest_m_s, and no node by kShape_m_s.
inline constexpr std::uint16_t kCalmTicks = 2 * world::FarPoses::kInterval;
inline constexpr double kCalm_m_s = 1e-3, kTremble_m = 1e-5, kFlutter_m = 2e-4;
inline constexpr double kFloor_m = 0.3, kFarthest_m = 0.9;

class Pieces {
 public:
  explicit Pieces(const organ::Organ& organ);

  // The state is new.
  void read_state(const topology::Topology& topology, world::World& world);
  // The world has the edit's nodes. What has changed wakes.
  void update(const topology::Edit& edit, world::World& world);

  // Wakes what is touched in this tick.
  void wake_touched(const contact::ContactList& contacts, world::World& world);
  // Wakes everything.
  void wake(world::World& world);
  bool is_all_asleep() const { return is_all_asleep_; }

  // Before and after the solver's step. free(): nodes of awake pieces; turning(): those of them
  // that turn so quickly that nothing is linear about a pose of not long ago.
  void begin_step(const world::World& world);
  std::span<const NodeIndex> free() const { return free_; }
  std::span<const NodeIndex> turning() const { return turning_; }
  struct Motion {
    float awake_m = 0, carried_m = 0;  // of a node, at most, besides what the solver has moved it
  };
  Motion end_step(const contact::ContactList& contacts, world::World& world);

  // Nodes whose class or motion has changed here since clear_changes().
  std::span<const NodeIndex> changed() const { return changed_; }
  void clear_changes() { changed_.clear(); }

  const PieceList& list() const { return list_; }

 private:
  enum class Manner : std::uint8_t { Awake, Asleep, Flying };
  // This acts on a piece from outside.
  struct Load {
    Vec3d force, torque;           // N, N m about the centre
    double stiffness = 0;          // N/m
    double turning_stiffness = 0;  // N m
    bool is_touched = false;       // by a tool
    bool is_pressed = false;
  };

  static std::size_t place_of(std::uint32_t piece) {
    return piece == PieceList::kBody ? 0 : piece + std::size_t{1};
  }
  std::span<const NodeIndex> nodes_at(std::size_t place) const {
    return place == 0 ? list_.body() : std::span<const NodeIndex>(list_[place - 1].nodes);
  }
  std::size_t place_at(NodeIndex node) const { return place_of(list_.piece_of(node)); }
  void find_manners(const world::World& world);
  void note_sleepers();
  void wake(std::size_t place, world::World& world);
  // Wakes, for a tool or an edit.
  void touch(std::size_t place, world::World& world);
  void lay_down(std::size_t place, world::World& world);
  void add_loads(const contact::ContactList& contacts, const world::World& world);
  void add_load(const contact::ContactPoint& point, bool is_tool, const world::World& world);
  float keep_momenta(std::size_t place, world::World& world);
  void look_for_rest(std::size_t place, world::World& world);
  bool is_beyond(std::size_t place, const world::World& world) const;
  void find_boxes(const world::World& world);
  bool is_alone(std::size_t place, double slack_m) const;
  float carry(std::size_t place, world::World& world);

  const Vec3d gravity_;
  Vec3d up_;
  double floor_m_ = 0;  // height along up_
  PieceList list_;
  std::vector<Manner> manners_;       // of the body, then per piece
  std::vector<RigidMotion> motions_;  // likewise; of awake pieces, at the beginning of the step
  std::vector<Load> loads_;
  std::vector<Box<float>> boxes_;
  bool has_boxes_ = false;
  bool is_all_asleep_ = false;
  std::vector<NodeIndex> changed_, free_, turning_;
};

}  // namespace trocar::pieces
