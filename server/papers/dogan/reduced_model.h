#pragma once

// The reduced model at work (Dogan 2011 eq. 13 and 14): B^T K B xi = B^T f with a constant tangent,
// displacements U = B xi, and creep as a factor on them. Forces act on a few nodes, so that a solve
// costs O(modes x loaded nodes + modes^2), whatever the mesh. Immutable once made: any thread.

#include <Eigen/Cholesky>

#include "server/papers/dogan/karhunen_loeve.h"
#include "server/papers/dogan/presses.h"
#include "server/papers/reduction/reduction.h"

namespace trocar::dogan {

using reduction::CreepCurve;
using reduction::CreepNeighbour;
using reduction::Reduction;

// The tangent is that of the tissue at rest, or the one of all stored that erred least in the
// training.
enum class TangentChoice : std::uint8_t { Initial, Best };

class ReducedModel {
 public:
  // `mode_count`: the first so many of the modes; 0: all. The reduction is valid.
  ReducedModel(const Reduction& reduction, TangentChoice tangent, std::size_t mode_count = 0);

  std::size_t mode_count() const { return static_cast<std::size_t>(modes_.cols()); }
  // xi, m.
  Vector solve(std::span<const NodeForce> forces) const;
  // 3 per node, m.
  Vector displacements(const Vector& xi) const { return modes_ * xi; }
  Vec3d displacement(const Vector& xi, NodeIndex node) const;

 private:
  Matrix modes_;  // 3 per node x modes
  Eigen::LLT<Matrix> factors_;
};

// Creep around the nearest node whose curve is stored: there is nothing between two of them.
class CreepFactors {
 public:
  // The organ is the reduction's; both stay where they are.
  CreepFactors(const Reduction& reduction, const organ::Organ& organ)
      : reduction_(reduction), organ_(organ) {}

  bool empty() const { return reduction_.creep.empty(); }
  const CreepCurve& curve_near(NodeIndex loaded) const;
  // Returns a node's displacement after a time over that at once; it is linear between stored
  // times, the last one after them. 1 without curves.
  double growth(NodeIndex loaded, NodeIndex node, double time_s) const;
  // Scales displacements at once (3 per node) to those after a time.
  void scale(NodeIndex loaded, double time_s, Vector& displacements) const;

 private:
  double at(const std::vector<double>& growth, double time_s) const;

  const Reduction& reduction_;
  const organ::Organ& organ_;
};

// Numbers by columns or rows of a symmetric matrix.
Matrix square(const std::vector<double>& numbers, std::size_t size);

}  // namespace trocar::dogan
