#pragma once

// Finds by how much the server's tissue is stiffer than the local one: the slope of an affine least
// squares fit of the server's force over the local one at the same pose, which forgets. Affine,
// because a ratio is wrong where shape or relaxation differ. A prior stands in while the force does
// not vary.
//
// The lean is the same fit of the server's force across the normal over the local one along it:
// tissue is pressed to a side where it is curved, or where it gives way more easily.

#include <optional>

#include "common/math/vec3.h"

namespace trocar::haptics {

class SlopeFit {
 public:
  // These bound the slope: a thin wall yields far more than a solid of its material.
  static constexpr double kLeast = 0.02, kMost = 3;
  static constexpr double kMostLean = 0.3;       // over the slope
  static constexpr double kLeastForce_n = 0.01;  // of the local force: less says nothing

  SlopeFit(double forget_s, double follow_s) : forget_s_(forget_s), follow_s_(follow_s) {}

  double slope() const { return slope_; }
  void set_slope(double slope) { slope_ = slope; }
  // Across the normal, per local force along it; 0 of held tissue.
  const Vec3d& lean() const { return lean_; }
  void clear_sums();

  // `dt_s`: since the pair before. `prior`: the ratio of the stiffnesses, if it is known.
  void add(const Vec3d& server_n, const Vec3d& local_n, double dt_s, std::optional<double> prior);
  // Belongs after add() of the same pair. server_n: across the normal, less friction.
  void add_lean(const Vec3d& server_n, double local_n);
  // The ratio at once; what was before is forgotten.
  void restart(const Vec3d& server_n, const Vec3d& local_n);

 private:
  double forget_s_, follow_s_;
  double slope_ = 1;
  double weight_ = 0;
  Vec3d local_, server_;
  double local_local_ = 0, local_server_ = 0;
  double share_ = 0;  // of the newest pair in the means; 0: it was none
  Vec3d across_, local_across_, lean_;
};

}  // namespace trocar::haptics
