#pragma once

// The pivot of a laparoscopic instrument: its shaft passes a port in the body's wall, which stays
// where it is. The device is the handle outside; the tip inside goes the other way:
//
//            handle h                 r = |h - port|,  u = (port - h) / r,  shaft of length L
//               \   r                 tip = port + (L - r) u
//                o port
//                 \   L - r           A small motion:  d tip = J dh,  J = u u^T - k (I - u u^T),
//                  tip                                 k = (L - r) / r
//
// Sideways the tip is mirrored, and goes k times as far; along the shaft it goes with the hand.
// The shaft's direction follows from tip and port. About its own axis the tool turns as the device
// does. What the tissue does to the tip comes back by virtual work: the handle's force and torque
// do for each motion of the hand what force and torque at the tip do for the tip's.
//
// The handle stops 30 mm from the port, and the tip 5 mm inside of it: a hand that goes on turns
// the shaft, but moves it no further along. World frame, metres, newtons.

#include "common/math/frame.h"

namespace trocar::haptics {

class Fulcrum {
 public:
  static constexpr double kLeastOutside_m = 0.030, kLeastInside_m = 0.005;

  // The handle's end of a shaft of `length_m` through the port to the tip. A tip nearer to the port
  // than kLeastInside_m, or farther than the shaft reaches: is_in_reach() is false.
  Fulcrum(const Vec3d& port_m, const Vec3d& tip_m, double length_m);
  bool is_in_reach() const { return is_in_reach_; }
  const Vec3d& handle_m() const { return handle_m_; }

  struct Tip {
    Vec3d position_m;
    Quatf orientation;  // +z from the tip to the handle
  };
  Tip move(const Vec3d& handle_m, const Quatf& handle_orientation);

  struct Load {
    Vec3d force_n, torque_nm;
  };
  // At the handle of the last move, from what acts on the tip; torques about each.
  Load at_handle(const Vec3d& tip_force_n, const Vec3d& tip_torque_nm) const;
  // A contact at the tip is at most so many times as stiff at the handle.
  double stiffening() const;

 private:
  Vec3d port_m_;
  double length_m_;
  bool is_in_reach_;
  Vec3d handle_m_;
  Vec3d back_{0, 0, 1};                  // from the tip to the handle, -u above
  Vec3d grip_{0, 0, 1};                  // the device's +z
  double outside_m_ = 0, inside_m_ = 0;  // r and L - r, within their limits
  bool slides_ = true;                   // along the shaft: within its limits
};

}  // namespace trocar::haptics
