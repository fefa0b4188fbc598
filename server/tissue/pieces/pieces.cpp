#include "server/tissue/pieces/pieces.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/tissue/contact/contact_law.h"

namespace trocar::pieces {
namespace {

using world::NodeClass;

constexpr double kDt_s = 1e-3;
// A piece flies when it is so far from all other tissue, and as far as it gets in some ticks; it
// wakes nearer than that.
constexpr double kClear_m = 0.006, kNear_m = 0.004, kTicksClear = 8, kTicksNear = 2;
// In pieces of so few nodes, what differs from the motion as a whole is calmed by this share a
// tick: sweeps that are meant for a large organ leave them trembling.
constexpr std::size_t kSmallPiece = 64;
constexpr double kCalm = 0.05;
// From one pose of the far field to the next, that is a hundredth of a radian.
constexpr double kTurns_rad_s = 0.15;

float squared_speed(NodeIndex node, const world::World& world) {
  return length_squared(world.velocities[node.value]);
}

}  // namespace

Pieces::Pieces(const organ::Organ& organ) : gravity_(organ.gravity_m_s2) {
  if (!(length_squared(gravity_) > 0)) return;
  up_ = gravity_ * (-1 / length(gravity_));
  double lowest = 1e9;
  for (const auto& p : organ.mesh.rest_positions) lowest = std::min(lowest, dot(up_, p));
  floor_m_ = lowest - kFloor_m;
}

void Pieces::read_state(const topology::Topology& topology, world::World& world) {
  list_.find(topology, world);
  world.still_ticks.resize(list_.size() + 1);
  world.calm_ticks.resize(list_.size() + 1);
  find_manners(world);
}

void Pieces::find_manners(const world::World& world) {
  const auto count = list_.size() + 1;
  manners_.assign(count, Manner::Awake);
  motions_.resize(count);
  loads_.resize(count);
  boxes_.resize(count);
  for (std::size_t place = 0; place < count; ++place) {
    const auto nodes = nodes_at(place);
    if (nodes.empty() || world.node_classes[nodes.front().value] == NodeClass::Asleep)
      manners_[place] = Manner::Asleep;
    if (manners_[place] == Manner::Asleep && place > 0 &&
        std::ranges::any_of(nodes, [&](NodeIndex n) { return squared_speed(n, world) > 0; }))
      manners_[place] = Manner::Flying;
  }
  note_sleepers();
}

void Pieces::note_sleepers() {
  is_all_asleep_ =
      std::ranges::none_of(manners_, [](Manner manner) { return manner == Manner::Awake; });
}

void Pieces::update(const topology::Edit& edit, world::World& world) {
  // Pieces that stay keep their lowest node.
  struct Kept {
    NodeIndex lowest;
    std::uint16_t still = 0, calm = 0;
  };
  std::vector<Kept> kept;
  for (const auto node : edit.topology.changed())
    if (node.value < list_.node_count()) touch(place_at(node), world);
  for (std::size_t i = 0; i < list_.size(); ++i)
    kept.push_back({list_[i].nodes.front(), world.still_ticks[i + 1], world.calm_ticks[i + 1]});
  list_.update(edit, world);
  world.still_ticks.resize(list_.size() + 1);
  world.calm_ticks.resize(list_.size() + 1);
  for (std::size_t i = 0; i < list_.size(); ++i) {
    const auto lowest = list_[i].nodes.front();
    const auto same = std::ranges::lower_bound(kept, lowest, {}, &Kept::lowest);
    const bool is_kept = same != kept.end() && same->lowest == lowest;
    world.still_ticks[i + 1] = is_kept ? same->still : std::uint16_t{0};
    world.calm_ticks[i + 1] = is_kept ? same->calm : std::uint16_t{0};
  }
  find_manners(world);
}

void Pieces::wake(std::size_t place, world::World& world) {
  world.still_ticks[place] = 0;
  if (manners_[place] == Manner::Awake) return;
  const auto nodes = nodes_at(place);
  if (nodes.empty()) return;
  for (const auto node : nodes)
    if (world.node_classes[node.value] == NodeClass::Asleep)
      world.node_classes[node.value] = NodeClass::Far;
  changed_.insert(changed_.end(), nodes.begin(), nodes.end());
  manners_[place] = Manner::Awake;
  is_all_asleep_ = false;
}

void Pieces::touch(std::size_t place, world::World& world) {
  wake(place, world);
  world.calm_ticks[place] = 0;
}

void Pieces::wake(world::World& world) {
  for (std::size_t place = 0; place < manners_.size(); ++place) wake(place, world);
}

void Pieces::wake_touched(const contact::ContactList& contacts, world::World& world) {
  const auto wake_at = [&](const contact::ContactPoint& point) {
    for (std::size_t k = 0; k < point.node_count; ++k)
      if (manners_[place_at(point.nodes[k])] != Manner::Awake)
        wake(place_at(point.nodes[k]), world);
  };
  for (std::size_t i = 0; i < contacts.self_begin; ++i) wake_at(contacts.points[i]);
  constexpr float kMoves = kWakes_m_s * kWakes_m_s;
  for (const auto& point : contacts.self_points()) {
    const bool moves = std::ranges::any_of(point.nodes, [&](NodeIndex node) {
      return manners_[place_at(node)] == Manner::Awake && squared_speed(node, world) >= kMoves;
    });
    if (moves) wake_at(point);
  }
}

void Pieces::begin_step(const world::World& world) {
  free_.clear();
  turning_.clear();
  for (std::size_t place = 1; place < manners_.size(); ++place) {
    if (manners_[place] != Manner::Awake) continue;
    const auto nodes = nodes_at(place);
    free_.insert(free_.end(), nodes.begin(), nodes.end());
    motions_[place] = motion_of(nodes, world);
    if (length(motions_[place].turning()) > kTurns_rad_s)
      turning_.insert(turning_.end(), nodes.begin(), nodes.end());
  }
}

void Pieces::add_load(const contact::ContactPoint& point, bool is_tool, const world::World& world) {
  const auto first = place_at(point.nodes[0]);
  const bool is_within =
      !is_tool && std::all_of(point.nodes.begin(), point.nodes.begin() + point.node_count,
                              [&](NodeIndex n) { return place_at(n) == first; });
  if (is_within) return;
  const auto load = contact::load_at(point, contact::displacement_of(point, world));
  for (std::size_t k = 0; k < point.node_count; ++k) {
    const auto place = place_at(point.nodes[k]);
    auto& own = loads_[place];
    own.is_touched |= is_tool;
    own.is_pressed |= load.pressed_n > 0;
    if (place == 0 || manners_[place] != Manner::Awake || (point.moved >> k & 1) == 0) continue;
    const auto weight = static_cast<double>(point.weights[k]);
    const Vec3d force = to_double(load.gradient) * -weight;
    const Vec3d arm = to_double(world.position(point.nodes[k])) - motions_[place].centre;
    own.force += force;
    own.torque += cross(arm, force);
    const double stiffness =
        weight * weight * static_cast<double>(load.normal_secant + load.tangential_secant);
    own.stiffness += stiffness;
    own.turning_stiffness += stiffness * length_squared(arm);
  }
}

void Pieces::add_loads(const contact::ContactList& contacts, const world::World& world) {
  std::ranges::fill(loads_, Load{});
  for (std::size_t i = 0; i < contacts.points.size(); ++i)
    add_load(contacts.points[i], i < contacts.self_begin, world);
}

// Gives the piece the motion as a whole that it has to have; returns how far that moves a node.
float Pieces::keep_momenta(std::size_t place, world::World& world) {
  const auto nodes = nodes_at(place);
  const auto& before = motions_[place];
  const auto& load = loads_[place];
  const double kept =
      length_squared(gravity_) > 0 ? 1 : 1 / (1 + kDt_s * list_[place - 1].damping_per_s);
  const Vec3d velocity = (before.velocity + (gravity_ + load.force / before.mass) * kDt_s) * kept;
  const Vec3d spin = (before.spin + load.torque * kDt_s) * kept;
  // Contacts resist what is added, as they do in a node's own step.
  const auto share = [](double inertia, double stiffness) {
    return inertia > 0 ? inertia / (inertia + kDt_s * kDt_s * stiffness) : 0;
  };
  double farthest = 0;
  for (const double dt : {kDt_s, 0.0}) {
    const auto now = motion_of(nodes, world);
    const double turning_share =
        share(0.5 * (now.inertia.xx + now.inertia.yy + now.inertia.zz), load.turning_stiffness);
    const Impulse impulse{(velocity - now.velocity) * share(now.mass, load.stiffness),
                          solve_positive_definite(now.inertia, spin - now.spin) * turning_share};
    add_motion(nodes, now, impulse, dt, world);
    farthest += dt * (length(impulse.velocity) + length(impulse.turning) * now.radius);
  }
  if (nodes.size() <= kSmallPiece) calm(nodes, motion_of(nodes, world), kCalm, world);
  changed_.insert(changed_.end(), nodes.begin(), nodes.end());
  return static_cast<float>(farthest);
}

void Pieces::lay_down(std::size_t place, world::World& world) {
  const auto nodes = nodes_at(place);
  for (const auto node : nodes) {
    world.node_classes[node.value] = NodeClass::Asleep;
    world.quiet_ticks[node.value] = 0;
    world.velocities[node.value] = {};
  }
  changed_.insert(changed_.end(), nodes.begin(), nodes.end());
  manners_[place] = Manner::Asleep;
  world.still_ticks[place] = 0;
}

bool Pieces::is_beyond(std::size_t place, const world::World& world) const {
  const auto nodes = nodes_at(place);
  const auto first = nodes.front().value;
  if (length_squared(to_double(world.displacements[first])) > kFarthest_m * kFarthest_m)
    return true;
  if (!(length_squared(gravity_) > 0)) return false;
  return std::ranges::any_of(
      nodes, [&](NodeIndex node) { return dot(up_, to_double(world.position(node))) <= floor_m_; });
}

void Pieces::find_boxes(const world::World& world) {
  if (std::exchange(has_boxes_, true)) return;
  std::ranges::fill(boxes_, Box<float>{});
  for (const auto node : world.surface_nodes) boxes_[place_at(node)].include(world.position(node));
}

bool Pieces::is_alone(std::size_t place, double slack_m) const {
  for (std::size_t other = 0; other < boxes_.size(); ++other)
    if (other != place && boxes_[place].overlaps(boxes_[other], static_cast<float>(slack_m)))
      return false;
  return true;
}

namespace {
// Squares of the speeds of a body's nodes, (m/s)^2.
struct SquaredSpeeds {
  double mean = 0;
  float most = 0;
};
SquaredSpeeds squared_speeds(std::span<const NodeIndex> nodes, const world::World& world) {
  SquaredSpeeds speeds;
  for (const auto node : nodes) {
    const float squared = squared_speed(node, world);
    speeds.mean += static_cast<double>(squared);
    speeds.most = std::max(speeds.most, squared);
  }
  speeds.mean /= static_cast<double>(std::max<std::size_t>(nodes.size(), 1));
  return speeds;
}
// A mean alone would let a small flap stop while it moves, and the fastest node alone would wait
// for one that trembles.
bool is_still(const SquaredSpeeds& speeds) {
  return static_cast<double>(speeds.most) < kShape_m_s * kShape_m_s &&
         speeds.mean < kRest_m_s * kRest_m_s;
}
}  // namespace

namespace {
// Nodes that tremble about their places have speeds, but go nowhere: that is seen in the last two
// poses of the far field. What creeps goes the same way from the first to the second and from the
// second to now.
bool goes_nowhere(std::span<const NodeIndex> nodes, const world::World& world) {
  const auto& poses = world.far_poses;
  if (poses.age() + 1 < world::FarPoses::kInterval) return false;
  constexpr double kInterval_s = kDt_s * world::FarPoses::kInterval;
  constexpr double kMost_m = kShape_m_s * kInterval_s, kCreep_m = kRest_m_s * kInterval_s;
  const auto newest = poses.pose(poses.newest()), before = poses.pose(poses.newest() - 1);
  double creep = 0, first_sum = 0, second_sum = 0;
  for (const auto node : nodes) {
    const Vec3d middle = to_double(world::displacement_of(newest[node.value]));
    const Vec3d first = middle - to_double(world::displacement_of(before[node.value])),
                second = to_double(world.displacements[node.value]) - middle;
    const double first_squared = length_squared(first), second_squared = length_squared(second),
                 same_way = dot(first, second);
    if (!(std::max(first_squared, second_squared) < kFlutter_m * kFlutter_m &&
          same_way < kMost_m * kMost_m))
      return false;
    first_sum += first_squared;
    second_sum += second_squared;
    creep += same_way;
  }
  const auto count = static_cast<double>(nodes.size());
  return std::max(first_sum, second_sum) < kTremble_m * kTremble_m * count &&
         creep < kCreep_m * kCreep_m * count;
}
}  // namespace

void Pieces::look_for_rest(std::size_t place, world::World& world) {
  const auto nodes = nodes_at(place);
  const auto& load = loads_[place];
  auto& ticks = world.still_ticks[place];
  auto& calm = world.calm_ticks[place];
  if (load.is_touched) {
    ticks = calm = 0;
    return;
  }
  const auto speeds = squared_speeds(nodes, world);
  const bool is_carried_by = place == 0 || load.is_pressed || !(length_squared(gravity_) > 0);
  calm = speeds.mean < kCalm_m_s * kCalm_m_s
             ? static_cast<std::uint16_t>(std::min(calm + 1, int{kCalmTicks}))
             : std::uint16_t{0};
  const bool has_wounds = !world.origins.empty();
  if (calm == kCalmTicks && has_wounds && is_carried_by && goes_nowhere(nodes, world)) {
    lay_down(place, world);
    return;
  }
  if (place == 0) {
    ticks = is_still(speeds) ? static_cast<std::uint16_t>(ticks + 1) : std::uint16_t{0};
    if (ticks >= kRestTicks) lay_down(place, world);
    return;
  }
  const auto motion = motion_of(nodes, world);
  ticks = fastest_within(nodes, motion, world) < kShape_m_s
              ? static_cast<std::uint16_t>(std::min(ticks + 1, int{kRestTicks}))
              : std::uint16_t{0};
  if (ticks < kRestTicks) return;
  const double speed = length(motion.velocity) + length(motion.turning()) * motion.radius;
  if (is_carried_by && speed < kShape_m_s) {
    lay_down(place, world);
    return;
  }
  find_boxes(world);
  if (load.is_pressed || !is_alone(place, kClear_m + kTicksClear * kDt_s * speed)) return;
  for (const auto node : nodes) world.node_classes[node.value] = NodeClass::Asleep;
  changed_.insert(changed_.end(), nodes.begin(), nodes.end());
  manners_[place] = Manner::Flying;
}

float Pieces::carry(std::size_t place, world::World& world) {
  const auto nodes = nodes_at(place);
  auto motion = motion_of(nodes, world);
  const bool is_weightless = !(length_squared(gravity_) > 0);
  const double kept = is_weightless ? 1 / (1 + kDt_s * list_[place - 1].damping_per_s) : 1;
  motion.velocity = (motion.velocity + gravity_ * kDt_s) * kept;
  motion.spin *= kept;
  const double moved = pieces::carry(nodes, motion, kDt_s, world);
  const double speed = moved / kDt_s;
  if (is_beyond(place, world) || (is_weightless && speed < kShape_m_s)) {
    lay_down(place, world);
    return static_cast<float>(moved);
  }
  find_boxes(world);
  if (!is_alone(place, kNear_m + kTicksNear * kDt_s * speed)) wake(place, world);
  return static_cast<float>(moved);
}

Pieces::Motion Pieces::end_step(const contact::ContactList& contacts, world::World& world) {
  Motion motion;
  has_boxes_ = false;
  if (!is_all_asleep_) add_loads(contacts, world);
  for (std::size_t place = 0; place < manners_.size(); ++place) {
    if (manners_[place] == Manner::Asleep) continue;
    if (manners_[place] == Manner::Flying) {
      motion.carried_m = std::max(motion.carried_m, carry(place, world));
      continue;
    }
    if (place > 0) {
      motion.awake_m = std::max(motion.awake_m, keep_momenta(place, world));
      if (!loads_[place].is_touched && is_beyond(place, world)) {
        lay_down(place, world);
        continue;
      }
    }
    look_for_rest(place, world);
  }
  note_sleepers();
  return motion;
}

}  // namespace trocar::pieces
