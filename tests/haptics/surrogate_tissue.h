#pragma once

// Tissue under a point contact, as one node with mass: a power law that relaxes along the normal,
// the same with friction across it, solved implicitly at 1 kHz. It stands in for the server's
// tissue in closed-loop tests; its law is one that the client's model does not have.

#include <array>

#include "common/math/vec3.h"
#include "common/wire/haptic_patch.h"

namespace trocar::haptics::testing {

inline constexpr double kDt_s = 0.001;

struct TissueFigures {
  double exponent = 1.3;
  double stiffness_n_m = 139;  // at 6.6 mm
  std::array<double, 2> share{0.5054, 0.1485}, relaxation_s{0.5784, 6.8863};
  std::array<double, 2> fast_share{3.8, 0.95}, fast_s{0.002, 0.010};
  double friction = 0.2, across_over_normal = 0.72;
  double bump_m = 0, bump_length_m = 0.03;  // waves of the surface along x
};

// Surface coordinates: z out of the tissue.
class SurrogateTissue {
 public:
  explicit SurrogateTissue(const TissueFigures& figures);

  // Events from outside.
  double scale = 1;   // of the stiffness
  double lift_m = 0;  // of the whole tissue
  bool is_refused = false;
  void set_grasped(bool grasped, const Vec3d& tip_m);

  void step(const Vec3d& tip_m);

  const Vec3d& force_n() const { return force_n_; }  // on the tool
  bool touches() const { return touches_; }
  bool is_grasped() const { return is_grasped_; }
  const Vec3d& grip_point_m() const { return grip_m_; }
  Vec3d surface_under(const Vec3d& tip_m) const;
  Vec3d normal_at(const Vec3d& tip_m) const;
  // At 50 ms, along the normal and across it.
  double stiffness_along_n_m() const;
  double stiffness_across_n_m() const;
  double elastic_stiffness_n_m(double depth_m) const;

 private:
  template <typename Value>
  struct Element {
    std::array<Value, 2> relaxing{}, fast{};
    Value elastic{}, place{}, speed{};
  };
  double elastic_force_n(double depth_m) const;
  template <typename Value>
  void commit(Element<Value>& element, const Value& place, const Value& elastic, double stiffness);
  double step_along(double depth_m);
  void step_across(const Vec3d& tip_m, const Vec3d& normal, double limit_n);
  double slow_share() const;

  TissueFigures figures_;
  double coefficient_;
  Element<double> along_;
  Element<Vec3d> across_;
  Vec3d anchor_m_, grip_m_, force_n_, across_force_n_;
  bool touches_ = false, is_grasped_ = false;
};

}  // namespace trocar::haptics::testing
