#pragma once

// The motion of some nodes as one rigid body: momentum, spin, and what carries them along.
//
// The solver's few sweeps keep neither momentum nor spin of what nothing holds. A piece's own are
// known exactly, from the tick before and from what acts on it; so whatever the sweeps have done,
// its nodes get the rigid motion in addition with which momentum and spin are right. Arithmetic is
// in double, in the order of the nodes.

#include <span>

#include "server/tissue/world/world.h"

namespace trocar::pieces {

struct RigidMotion {
  double mass = 0;          // kg
  Vec3d centre;             // m, of mass
  Vec3d velocity;           // m/s, of the centre
  Vec3d spin;               // kg m^2/s, about the centre
  SymMat3<double> inertia;  // kg m^2, about the centre
  double radius = 0;        // m, of the farthest node

  Vec3d turning() const;  // rad/s
};

RigidMotion motion_of(std::span<const NodeIndex> nodes, const world::World& world);

// Returns the fastest speed of a node against the rigid motion, m/s.
double fastest_within(std::span<const NodeIndex> nodes, const RigidMotion& motion,
                      const world::World& world);

// This is added to a motion.
struct Impulse {
  Vec3d velocity;  // m/s
  Vec3d turning;   // rad/s
};
// Changes velocities, and by dt seconds of that the places.
void add_motion(std::span<const NodeIndex> nodes, const RigidMotion& motion, const Impulse& impulse,
                double dt, world::World& world);

// Takes away this share of what velocities differ from the rigid motion.
void calm(std::span<const NodeIndex> nodes, const RigidMotion& motion, double share,
          world::World& world);

// Moves the nodes rigidly for dt seconds, from a motion at the beginning; returns how far the
// farthest moved, m.
double carry(std::span<const NodeIndex> nodes, const RigidMotion& motion, double dt,
             world::World& world);

}  // namespace trocar::pieces
