#pragma once

// A reduced model of one organ: a few modes in which it moves, the tangent stiffness among them,
// and how much farther it is after a while than at once (Dogan 2011, eq. 6 to 14). Made by
// server/papers/dogan, kept in a file of its own beside the organ's (reduction_file.h) and good for
// the mesh and elasticity whose hashes it names; density, damping and what blades meet may change.

#include <cstdint>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/papers/reduction/organ_hashes.h"

namespace trocar::reduction {

inline constexpr std::size_t kMaxReducedModes = 64;
inline constexpr std::size_t kMaxCreepTimes = 1000, kMaxCreepCurves = 4096;
// Largest deviation of the modes' products from 1 and 0.
inline constexpr double kOrthonormality = 1e-9;

struct CreepNeighbour {
  NodeIndex node;
  std::vector<double> growth;  // displacement over that at once, along it; per time

  bool operator==(const CreepNeighbour&) const = default;
};

// A curve holds the creep under a constant force around one surface node.
struct CreepCurve {
  NodeIndex node;
  std::vector<double> overall_growth;      // of nodes beyond the radius of influence; per time
  std::vector<CreepNeighbour> neighbours;  // within it; ascending nodes

  bool operator==(const CreepCurve&) const = default;
};

struct Reduction {
  std::string method = "dogan";
  std::string source;  // one line: organ and parameters
  std::uint64_t mesh_hash = 0, elasticity_hash = 0;
  std::uint32_t node_count = 0;
  std::uint32_t snapshot_count = 0;         // that the modes are of
  double force_n = 0, radius_m = 0;         // largest force of the training, and of its patch
  std::vector<double> eigenvalues_m2;       // of the correlation matrix, one per mode, descending
  double eigenvalue_sum_m2 = 0;             // of all, kept or not
  std::vector<double> modes;                // mode by mode, x, y, z per node; orthonormal
  std::vector<double> initial_tangent_n_m;  // B^T K B of the tissue at rest, modes x modes
  std::vector<double> best_tangent_n_m;     // of the state whose tangent errs least
  double influence_m = 0;                   // radius of influence of creep
  std::vector<double> creep_times_s;        // from 0, ascending; none: without creep
  std::vector<CreepCurve> creep;

  std::size_t mode_count() const { return eigenvalues_m2.size(); }

  bool operator==(const Reduction&) const = default;
};

// Error: one line that says what is wrong. O(modes^2 nodes).
Status validate(const Reduction& reduction);
// Whether it is of this organ.
Status check_organ(const Reduction& reduction, const organ::Organ& organ);

}  // namespace trocar::reduction
