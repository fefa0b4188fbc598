#pragma once

// A local reduction at work: where some surface nodes are touched, the displacements of the whole
// organ as those of a few unknowns, u = Phi q + E a: q of vibrations, the patch's modes and the
// Green's functions of the touched nodes, a of the nodes around them, each free on its own.
// Newton's method with a tangent that is kept for as long as it is good.
//
// Time per iteration: the patch's tets and fields, whatever the mesh. Displacements of all nodes
// are computed when they are asked for. One caller; deterministic.

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "server/lab/reduce/presses.h"
#include "server/organs/organ/local_reduction.h"
#include "server/organs/organ/organ.h"
#include "server/tissue/reduction/block_matrix.h"

namespace trocar::reduce {

// Holds a node where something is: force = stiffness (target - displacement).
struct NodeSpring {
  NodeIndex node;
  Vec3d target_m;
  double stiffness_n_m = 0;
};

class LocalSolver {
 public:
  static constexpr std::size_t kMaxPatches = 4;

  // A reduction of this organ; both must outlive the solver.
  LocalSolver(const organ::LocalReduction& reduction, const organ::Organ& organ);
  ~LocalSolver();

  // From now on these nodes are touched; the displacements are 0. What one patch does not reach is
  // done by several together, each with its own weighted tets where it is the nearest; that costs a
  // product over the whole mesh. False, and nothing has changed, if a node is in no patch, or they
  // are of more than kMaxPatches.
  bool touch(std::span<const NodeIndex> nodes);

  struct Sizes {
    std::size_t modes = 0, greens = 0, free_nodes = 0, inner_tets = 0, cubature_tets = 0;
    std::size_t unknowns() const { return modes + greens + 3 * free_nodes; }
  };
  Sizes sizes() const;

  struct Report {
    bool is_converged = false;
    int iterations = 0, factors = 0;
    double residual_n = 0;  // norm over the unknowns' forces
  };
  // Equilibrium with forces on touched or free nodes and springs there, from where it is.
  Report solve(std::span<const NodeForce> forces, std::span<const NodeSpring> springs = {});

  // Returns the displacement of a node near the contact.
  Vec3d displacement(NodeIndex node) const;
  // Returns the displacements of all nodes.
  std::vector<Vec3d> displacements() const;

 private:
  struct Place;
  struct Contact;
  const organ::LocalPatch* patch_of(std::span<const NodeIndex> nodes) const;
  const reduction::BlockMatrix& rest_tangent();

  const organ::LocalReduction& reduction_;
  const organ::Organ& organ_;
  std::unique_ptr<Contact> contact_;
  reduction::BlockMatrix rest_tangent_;  // made when it is needed
};

}  // namespace trocar::reduce
