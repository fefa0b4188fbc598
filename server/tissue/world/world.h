#pragma once

// The authoritative tissue state as arrays over nodes, in the organ's own numbering.
//
// Displacements are float32 relative to rest (the rest pose stays in double in the organ), so a
// micrometre is still exact a metre from the origin. Invariants: fixed nodes have zero displacement
// and velocity, except those that a scenario moves; everything is finite. Owned by the simulation
// thread; nobody else sees it.

#include <vector>

#include "common/base/tick.h"
#include "common/math/vec3.h"
#include "server/organs/organ/organ.h"
#include "server/tissue/topology/edit.h"
#include "server/tissue/world/far_poses.h"
#include "server/tissue/world/relaxation_state.h"
#include "server/tissue/world/state_archive.h"

namespace trocar::world {

enum class NodeClass : std::uint8_t {
  Fixed = 0,   // held by ligaments: never moves
  Far = 1,     // away from all contacts: at rest (Frozen), or swept less (Graded)
  Active = 2,  // in the queue, or not long ago
  Asleep = 3,  // of tissue that rests, or flies as a rigid body (server/tissue/pieces)
};

// Nodes outside the queue do one of these.
enum class Boundary : std::uint8_t {
  Frozen = 0,  // They stand still (Choi 2002, Nakao 2003).
  Graded = 1,  // They move every tick, with fewer sweeps.
  Whole = 2,   // They are swept like the queue. Sessions never choose it: it takes too long.
};

// A cut made this node at t/65536 of the way from a to b, which were there before it.
struct NodeOrigin {
  NodeIndex a, b;
  std::uint16_t t = 0;
};

struct World {
  explicit World(const organ::Organ& organ);

  std::size_t node_count() const { return displacements.size(); }
  Vec3f position(NodeIndex node) const {
    return rest_positions[node.value] + displacements[node.value];
  }

  // The members below are constant in a session.
  std::vector<Vec3f> rest_positions;  // m, world frame
  std::vector<float> masses;          // kg
  std::vector<float> surface_areas;   // m^2 of boundary triangles per node, 0 inside
  std::vector<NodeIndex> surface_nodes;
  std::vector<NodeOrigin> origins;  // of the nodes beyond the organ's own

  // These are state, in snapshot and hash.
  Tick tick = 0;                         // ticks done
  Boundary boundary = Boundary::Frozen;  // of the last tick
  std::vector<Vec3f> displacements;      // m, from rest
  std::vector<Vec3f> velocities;         // m/s
  std::vector<NodeClass> node_classes;
  std::vector<std::uint16_t> quiet_ticks;  // ticks in a row below the freezing thresholds
  FarPoses far_poses;                      // about which the far field is linear
  RelaxationState relaxation;              // of stresses, per tet
  // Ticks in a row in which the body, and each free piece, hardly moved (server/tissue/pieces).
  std::vector<std::uint16_t> still_ticks;
  std::vector<std::uint16_t> calm_ticks;  // likewise: those of calm, at most 128
  std::vector<float> tie_extensions;      // m, per tie: the largest so far

  // Brings all arrays up to date with an edit of the topology. Nodes whose elements have changed
  // are active: what a wound sets free is swept like what is touched, for a while.
  void apply(const topology::Edit& edit);

  // A node between a and b, t/65536 of the way from a; a copy of a where b is a. Moves with them,
  // fixed where both are, with no mass and no surface yet.
  void add_node(const Vec3d& rest_position, NodeIndex a, NodeIndex b, std::uint16_t t);
  // Moves a node t/65536 of the way toward another, with the displacement and velocity that the
  // edge between them has there.
  void move_node(const Vec3d& rest_position, NodeIndex node, NodeIndex toward, std::uint16_t t);

  void visit_state(StateArchive& archive);
};

}  // namespace trocar::world
