#pragma once

// Tissue that jaws hold: it answers along all three axes, pulled or pressed, around the place where
// it would be without the tool.

#include "client/haptics/push_element.h"

namespace trocar::haptics {

class GripElement {
 public:
  // `stiffness`: elastic, before anything relaxes; it stays for the whole grip, and what it lacks
  // the slope makes up for.
  void start(const SymMat3<double>& stiffness) {
    *this = {};
    stiffness_ = stiffness;
  }
  const SymMat3<double>& stiffness() const { return stiffness_; }

  Response step(const ViscoSteps& steps, const Vec3d& tip_m, const Vec3d& grip_point_m) {
    const Vec3d pull = stiffness_ * (tip_m - grip_point_m);
    const Vec3d motion = has_pull_ ? pull - pull_ : Vec3d{};
    pull_ = pull;
    has_pull_ = true;
    const double mean = (stiffness_.xx + stiffness_.yy + stiffness_.zz) / 3;
    return {0, -element_.step(steps, pull, motion), mean};
  }

 private:
  SymMat3<double> stiffness_;
  ViscoElement<Vec3d> element_;
  Vec3d pull_;
  bool has_pull_ = false;
};

}  // namespace trocar::haptics
