#include "client/haptics/workspace.h"

#include <limits>

namespace trocar::haptics {
namespace {

// In double precision: a hand's motion in a step is a few micrometres.
Vec3d turned(const Quatf& q, const Vec3d& v) {
  const Vec3d u{q.x, q.y, q.z};
  const Vec3d t = cross(u, v) * 2.0;
  return v + t * static_cast<double>(q.w) + cross(u, t);
}

}  // namespace

void Workspace::anchor_here() {
  anchor_m_ = tip_m_;
  device_anchor_m_ = device_m_;
}

void Workspace::set_view(const Quatf& world_from_device) {
  anchor_here();
  view_ = normalized(world_from_device);
  view_back_ = conjugate(view_);
}

void Workspace::set_scale(const WorkspaceScale& scale) {
  anchor_here();
  scale_ = scale;
}

Workspace::Tip Workspace::move(const Vec3d& device_m, const Quatf& device_orientation,
                               bool is_clutched) {
  device_m_ = device_m;
  if (is_clutched || !has_place_) anchor_here();
  has_place_ = true;
  tip_m_ = anchor_m_ + turned(view_, (device_m_ - device_anchor_m_) * scale_.motion);
  return {tip_m_, normalized(view_ * device_orientation)};
}

Vec3d Workspace::device_way(const Vec3d& world_way_m) const {
  return turned(view_back_, world_way_m / scale_.motion);
}

Vec3d Workspace::device_force(const Vec3d& world_force_n) const {
  return turned(view_back_, world_force_n * scale_.force);
}

Vec3d Workspace::device_torque(const Vec3d& world_torque_nm) const {
  return turned(view_back_, world_torque_nm * (scale_.force / scale_.motion));
}

Vec3d Workspace::in_world(const Vec3d& device) const {
  return turned(view_, device);
}

double Workspace::world_stiffness(double device_n_m) const {
  const double product = scale_.force * scale_.motion;
  return product > 0 ? device_n_m / product : std::numeric_limits<double>::max();
}

}  // namespace trocar::haptics
