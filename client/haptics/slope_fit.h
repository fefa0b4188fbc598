#pragma once

// Finds by how much the server's tissue is stiffer than the local one: the slope of an affine least
// squares fit of the server's force over the local one at the same pose, which forgets. Affine,
// because a ratio is wrong where shape or relaxation differ. A prior stands in while the force does
// not vary.

#include <optional>

#include "common/math/vec3.h"

namespace trocar::haptics {

class SlopeFit {
 public:
  static constexpr double kLeast = 0.2, kMost = 3;  // of the slope
  // After a change of structure, which may leave nothing to feel.
  static constexpr double kLeastAtOnce = 0.02;
  static constexpr double kLeastForce_n = 0.01;  // of the local force: less says nothing

  SlopeFit(double forget_s, double follow_s) : forget_s_(forget_s), follow_s_(follow_s) {}

  double slope() const { return slope_; }
  void set_slope(double slope) { slope_ = slope; }
  void clear_sums() { weight_ = 0, local_ = {}, server_ = {}, local_local_ = 0, local_server_ = 0; }

  // `dt_s`: since the pair before. `prior`: the ratio of the stiffnesses, if it is known.
  void add(const Vec3d& server_n, const Vec3d& local_n, double dt_s, std::optional<double> prior);
  // The ratio at once; what was before is forgotten.
  void restart(const Vec3d& server_n, const Vec3d& local_n);

 private:
  double forget_s_, follow_s_;
  double slope_ = 1;
  double weight_ = 0;
  Vec3d local_, server_;
  double local_local_ = 0, local_server_ = 0;
};

}  // namespace trocar::haptics
