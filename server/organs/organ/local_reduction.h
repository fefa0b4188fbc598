#pragma once

// A reduced model that stays close to a contact, wherever it is: around every patch of the surface
// that tools reach, the fields in which the organ answers to forces there. Made by
// server/lab/reduce and good for the mesh and elasticity whose hashes it names.
//
// Unknowns are the organ's slowest vibrations, which all patches share, a patch's modes, the
// Green's functions of the nodes that are touched (their displacement fields under unit forces, at
// rest), and the nodes around these, free one by one. Tets near the patch are nonlinear as they
// are; of the others the linear response is exact and what is nonlinear in it is summed over a few
// weighted tets (cubature).

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/organs/organ/reduced_organ.h"

namespace trocar::organ {

// kMaxReducedModes (reduced_organ.h) is the most modes of a patch, and the most vibrations.
inline constexpr std::size_t kMaxLocalPatches = 4096;
inline constexpr std::size_t kMaxLocalFields = 400;  // of a patch, see field_count()
inline constexpr std::size_t kMaxGreensFunctions = 100000;
inline constexpr std::uint32_t kMaxFreeLayers = 3;
inline constexpr double kMaxLocalForce_n = 100;
inline constexpr float kMaxCubatureWeight = 1e6f;
inline constexpr double kMostForceError = 1e6;
// A reduction is true when contact forces err by no more than this part.
inline constexpr double kTrueForceError = 0.03;
// A field's step is at most this: with it, displacements per force reach 33 km/N.
inline constexpr float kMaxFieldStep = 1;
// Largest deviation of a patch's modes' products from 1 and 0. Packing makes up to 3e-5 of exactly
// orthonormal fields, smooth or with a peak of a few nodes, on meshes of 18 to 100,000 nodes.
inline constexpr double kLocalOrthonormality = 1e-3;

// A field over all nodes: x, y, z per node, in steps of `step`.
struct PackedField {
  float step = 0;
  std::vector<std::int16_t> values;

  bool operator==(const PackedField&) const = default;
};

// Displacements per force along x, y and z at a node, m/N.
struct GreensFunction {
  NodeIndex node;
  std::array<PackedField, 3> fields;

  bool operator==(const GreensFunction&) const = default;
};

struct CubatureTet {
  TetIndex tet;
  float weight = 0;  // of what is nonlinear in its response

  bool operator==(const CubatureTet&) const = default;
};

struct LocalPatch {
  NodeIndex centre;
  std::vector<NodeIndex> members;     // surface nodes that belong to it; ascending
  std::vector<NodeIndex> reach;       // whose Green's functions it may use: its members and their
                                      // neighbours on the surface; ascending
  std::vector<PackedField> modes;     // with the vibrations orthonormal but for packing
  std::vector<TetIndex> inner_tets;   // ascending
  std::vector<CubatureTet> cubature;  // none of them inner; ascending
  // Among vibrations, modes and the Green's functions of `reach`, x, y, z: of all tets but the
  // inner ones at rest, and of the nodes' masses. Rows of a lower triangle.
  std::vector<double> outer_stiffness, mass;

  bool operator==(const LocalPatch&) const = default;
};

struct LocalReduction {
  std::string source;  // one line: organ and parameters
  std::uint64_t mesh_hash = 0, elasticity_hash = 0;
  std::uint32_t node_count = 0;
  double force_n = 0;             // largest of the training, at a node
  std::uint32_t free_layers = 0;  // of nodes around those that are touched
  // This part of a contact force is the error in all but 5 of 100 presses of the check at its
  // making; none: it was not checked.
  std::optional<double> force_error;
  std::vector<PackedField> vibrations;
  std::vector<GreensFunction> greens;  // ascending nodes
  std::vector<LocalPatch> patches;

  std::size_t field_count(const LocalPatch& patch) const {
    return vibrations.size() + patch.modes.size() + 3 * patch.reach.size();
  }
  bool operator==(const LocalReduction&) const = default;
};

PackedField pack_field(std::span<const double> field);

// Error: one line that says what is wrong. O(modes^2 nodes + fields^3) per patch.
Status validate(const LocalReduction& reduction);
// Whether a valid one is of this organ, and its nodes and tets are where they must be in it.
Status check_organ(const LocalReduction& reduction, const Organ& organ);

// Whether sessions of an organ can have a local reduction at all: of tets of hyperelastic laws,
// free of stress at rest, its strain not averaged. That last one no hash knows.
Status check_reducible(const Organ& organ);
// Whether its tissue is as heavy as that of the organ that it was made of; check_organ() is kept.
// Densities are in no hash, but masses among its fields move what a session does not sweep.
Status check_masses(const LocalReduction& reduction, const Organ& organ);

// XXH3-64 over all that makes a difference to a session, in the order of LocalReduction's members,
// each array preceded by its length (u64): names a reduction for recordings. Its source and its
// check are left out.
std::uint64_t reduction_hash(const LocalReduction& reduction);

}  // namespace trocar::organ
