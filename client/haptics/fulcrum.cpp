#include "client/haptics/fulcrum.h"

#include <algorithm>

namespace trocar::haptics {
namespace {

// Below, the device's axis is nearly opposite to the shaft's, and the shortest turn between them is
// any.
constexpr double kLeastAgreement = 0.1;

// The shortest turn that takes unit vector a to b.
Quatf turn_between(const Vec3d& a, const Vec3d& b) {
  const double w = 1 + dot(a, b);
  if (w < 1e-6) return rotation_from_z(to_float(b)) * conjugate(rotation_from_z(to_float(a)));
  const Vec3f axis = to_float(cross(a, b));
  return normalized(Quatf{axis.x, axis.y, axis.z, static_cast<float>(w)});
}

}  // namespace

Fulcrum::Fulcrum(const Vec3d& port_m, const Vec3d& tip_m, double length_m)
    : port_m_(port_m), length_m_(length_m) {
  const double inside_m = length(tip_m - port_m);
  is_in_reach_ = inside_m >= kLeastInside_m && inside_m <= length_m - kLeastOutside_m;
  if (inside_m > 0) back_ = (port_m - tip_m) / inside_m;
  handle_m_ = port_m + back_ * (length_m - inside_m);
  move(handle_m_, {});
}

Fulcrum::Tip Fulcrum::move(const Vec3d& handle_m, const Quatf& handle_orientation) {
  handle_m_ = handle_m;
  const Vec3d out = handle_m - port_m_;
  const double distance_m = length(out);
  if (distance_m > 0) back_ = out / distance_m;
  outside_m_ = std::clamp(distance_m, kLeastOutside_m, length_m_ - kLeastInside_m);
  slides_ = outside_m_ == distance_m;
  inside_m_ = length_m_ - outside_m_;
  grip_ = to_double(rotate(handle_orientation, {0, 0, 1}));
  return {port_m_ - back_ * inside_m_, normalized(turn_between(grip_, back_) * handle_orientation)};
}

Fulcrum::Load Fulcrum::at_handle(const Vec3d& tip_force_n, const Vec3d& tip_torque_nm) const {
  const double along_n = dot(tip_force_n, back_);
  const Vec3d across_n = tip_force_n - back_ * along_n;
  const double distance_m = std::max(length(handle_m_ - port_m_), kLeastOutside_m);
  Load load;
  // d tip = J dh; the shaft turns by back x d(back), d(back) = (I - back back^T) dh / r.
  load.force_n = across_n * (-inside_m_ / distance_m) + cross(tip_torque_nm, back_) / distance_m;
  if (slides_) load.force_n += back_ * along_n;
  // The shortest turn from the device's axis to the shaft's spins the tool about its axis, too,
  // when either of them moves.
  const double roll_nm = dot(tip_torque_nm, back_);
  const double agreement = 1 + dot(grip_, back_);
  if (agreement > kLeastAgreement) {
    load.force_n -= cross(grip_, back_) * (roll_nm / (agreement * distance_m));
    load.torque_nm = (grip_ + back_) * (roll_nm / agreement);
  }
  return load;
}

double Fulcrum::stiffening() const {
  const double lever = inside_m_ / outside_m_;
  return std::max(1.0, lever * lever);
}

}  // namespace trocar::haptics
