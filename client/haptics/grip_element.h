#pragma once

// Tissue that jaws hold: it answers along all three axes, pulled or pressed, around the place where
// it would be without the tool. The pull grows with the motion, so that a stiffness which the
// server learns by and by, pressed tissue being stiffer than pulled, changes no force that is
// there.

#include "client/haptics/push_element.h"

namespace trocar::haptics {

class GripElement {
 public:
  // `stiffness`: elastic, before anything relaxes.
  void start(const SymMat3<double>& stiffness) {
    *this = {};
    stiffness_ = stiffness;
  }
  // Acts on the motion from now on: what was pulled before stays as it is.
  void set_stiffness(const SymMat3<double>& stiffness) { stiffness_ = stiffness; }
  const SymMat3<double>& stiffness() const { return stiffness_; }

  Response step(const ViscoSteps& steps, const Vec3d& tip_m, const Vec3d& grip_point_m) {
    const Vec3d stretch_m = tip_m - grip_point_m;
    const Vec3d growth = stiffness_ * (stretch_m - stretch_m_);
    pull_ += growth;
    stretch_m_ = stretch_m;
    const double mean = (stiffness_.xx + stiffness_.yy + stiffness_.zz) / 3;
    Response response;
    response.rest_n = -element_.step(steps, pull_, is_started_ ? growth : Vec3d{});
    response.stiffness_n_m = mean;
    is_started_ = true;
    return response;
  }

 private:
  SymMat3<double> stiffness_;
  ViscoElement<Vec3d> element_;
  Vec3d stretch_m_, pull_;
  bool is_started_ = false;  // the first pull is no motion
};

}  // namespace trocar::haptics
