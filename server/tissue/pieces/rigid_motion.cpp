#include "server/tissue/pieces/rigid_motion.h"

#include <algorithm>
#include <cmath>

namespace trocar::pieces {
namespace {

Vec3d place_of(NodeIndex node, const world::World& world) {
  return to_double(world.rest_positions[node.value]) + to_double(world.displacements[node.value]);
}
Vec3d velocity_of(NodeIndex node, const world::World& world) {
  return to_double(world.velocities[node.value]);
}
double mass_of(NodeIndex node, const world::World& world) {
  return static_cast<double>(world.masses[node.value]);
}

// A rotation as a unit quaternion, scalar part w. The Cayley transform needs no sine.
struct Turn {
  double w = 1;
  Vec3d v;

  // Turns about the axis of `angle` by 2 atan(|angle| / 2).
  explicit Turn(const Vec3d& angle) {
    const double scale = 1 / std::sqrt(1 + 0.25 * length_squared(angle));
    w = scale;
    v = angle * (0.5 * scale);
  }
  Vec3d operator()(const Vec3d& p) const {
    const Vec3d t = 2.0 * cross(v, p);
    return p + t * w + cross(v, t);
  }
  Vec3d back(const Vec3d& p) const {
    const Vec3d t = 2.0 * cross(v, p);
    return p - t * w + cross(v, t);
  }
};

}  // namespace

Vec3d RigidMotion::turning() const {
  return solve_positive_definite(inertia, spin);
}

RigidMotion motion_of(std::span<const NodeIndex> nodes, const world::World& world) {
  RigidMotion motion;
  Vec3d first, momentum;
  for (const auto node : nodes) {
    const double mass = mass_of(node, world);
    motion.mass += mass;
    first += place_of(node, world) * mass;
    momentum += velocity_of(node, world) * mass;
  }
  if (!(motion.mass > 0)) return motion;
  motion.centre = first / motion.mass;
  motion.velocity = momentum / motion.mass;
  double squared = 0;
  for (const auto node : nodes) {
    const double mass = mass_of(node, world);
    const Vec3d arm = place_of(node, world) - motion.centre;
    motion.spin += cross(arm, velocity_of(node, world) - motion.velocity) * mass;
    motion.inertia.add_identity(mass * length_squared(arm));
    motion.inertia.add_outer(arm, -mass);
    squared = std::max(squared, length_squared(arm));
  }
  motion.radius = std::sqrt(squared);
  return motion;
}

double fastest_within(std::span<const NodeIndex> nodes, const RigidMotion& motion,
                      const world::World& world) {
  const Vec3d turning = motion.turning();
  double squared = 0;
  for (const auto node : nodes)
    squared =
        std::max(squared, length_squared(velocity_of(node, world) - motion.velocity -
                                         cross(turning, place_of(node, world) - motion.centre)));
  return std::sqrt(squared);
}

void add_motion(std::span<const NodeIndex> nodes, const RigidMotion& motion, const Impulse& impulse,
                double dt, world::World& world) {
  for (const auto node : nodes) {
    const Vec3d added =
        impulse.velocity + cross(impulse.turning, place_of(node, world) - motion.centre);
    world.velocities[node.value] = to_float(velocity_of(node, world) + added);
    if (dt > 0) world.displacements[node.value] += to_float(added * dt);
  }
}

void calm(std::span<const NodeIndex> nodes, const RigidMotion& motion, double share,
          world::World& world) {
  const Vec3d turning = motion.turning();
  for (const auto node : nodes) {
    const Vec3d rigid = motion.velocity + cross(turning, place_of(node, world) - motion.centre);
    const Vec3d now = velocity_of(node, world);
    world.velocities[node.value] = to_float(now + (rigid - now) * share);
  }
}

double carry(std::span<const NodeIndex> nodes, const RigidMotion& motion, double dt,
             world::World& world) {
  // The midpoint's turning keeps the energy of what tumbles to second order.
  const Turn half(motion.turning() * (0.5 * dt));
  const Vec3d middle = half(solve_positive_definite(motion.inertia, half.back(motion.spin)));
  const Turn whole(middle * dt);
  const Vec3d end = whole(solve_positive_definite(motion.inertia, whole.back(motion.spin)));
  const Vec3d way = motion.velocity * dt;
  double squared = 0;
  for (const auto node : nodes) {
    const Vec3d place = place_of(node, world);
    const Vec3d arm = whole(place - motion.centre);
    const Vec3d moved = (motion.centre - place) + arm + way;
    squared = std::max(squared, length_squared(moved));
    world.displacements[node.value] = to_float(to_double(world.displacements[node.value]) + moved);
    world.velocities[node.value] = to_float(motion.velocity + cross(end, arm));
  }
  return std::sqrt(squared);
}

}  // namespace trocar::pieces
