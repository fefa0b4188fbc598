#pragma once

// A blade in tissue, after the server's blades (server/tissue/blades/edge_force.h). What it cuts
// holds it back against the direction of its own way across the edge, and by the length L of the
// edge that is in tissue. The direction u follows that of the way, d, over some millimetres, and
// fades where the blade stands:
//
//   M = -u G L,   h_u du/dx = d - u
//
// G stands for the energy per area of a wound; the server says by how much it is another. Friction
// at the sides is a spring from where the blade was, which gives way beyond what the server says.
//
// A hand that stops or turns feels it at once, and one that draws the blade out is free when it
// is out. Ways are those of a tip that follows the device's within some milliseconds, as the
// server's tool does: steps of an encoder, with rests between them, have no direction of their own.

#include <algorithm>

#include "client/haptics/push_element.h"
#include "common/math/vec3.h"

namespace trocar::haptics {

class BladeElement {
 public:
  static constexpr double kEnergy_j_m2 = 100;  // G
  static constexpr double kHeading_m = 0.003;  // h_u
  // A slower blade's direction fades within this time.
  static constexpr double kSlow_m_s = 0.0005, kFade_s = 0.1;
  static constexpr double kFollow_s = 0.005;
  static constexpr double kSides_n_m = 2000;  // stiffness of friction before it gives way

  void start(const Vec3d& tip_m) {
    *this = {};
    tip_m_ = smooth_tip_m_ = tip_m;
  }
  // axis: along the edge, a unit vector. length_m: of the edge in tissue. friction_n: the most that
  // the sides bear.
  Response step(const Vec3d& tip_m, const Vec3d& axis, double length_m, double friction_n,
                double dt_s) {
    const Vec3d moved_m = (tip_m - smooth_tip_m_) * (dt_s / (dt_s + kFollow_s));
    smooth_tip_m_ += moved_m;
    const Vec3d way_m = moved_m - axis * dot(moved_m, axis);
    const double far_m = length(way_m), speed_m_s = far_m / dt_s;
    if (far_m > 0) heading_ += (way_m / far_m - heading_) * std::min(1.0, far_m / kHeading_m);
    if (speed_m_s < kSlow_m_s)
      heading_ *= 1 - std::min(1.0, dt_s / kFade_s) * (1 - speed_m_s / kSlow_m_s);
    held_m_ += tip_m - tip_m_;
    tip_m_ = tip_m;
    const double most_m = std::max(0.0, friction_n) / kSides_n_m, far_held_m = length(held_m_);
    if (far_held_m > most_m) held_m_ *= most_m / far_held_m;
    Response response;
    response.elastic_n = kEnergy_j_m2 * std::max(0.0, length_m);
    response.rest_n = (heading_ - axis * dot(heading_, axis)) * -response.elastic_n;
    response.sides_n = held_m_ * -kSides_n_m;
    response.stiffness_n_m = response.elastic_n / kHeading_m;
    return response;
  }

 private:
  Vec3d tip_m_, smooth_tip_m_, heading_;
  Vec3d held_m_;  // of the spring at the sides
};

}  // namespace trocar::haptics
