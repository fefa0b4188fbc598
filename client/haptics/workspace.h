#pragma once

// Maps a place of the device to one of the tool, and a force on the tool to one at the device.
//
//   tool = anchor + view (scale (device - device anchor))      force = force scale view^-1 (force)
//
// View: turns the device's frame (x right, y up, z towards the person) into the world's as the
// camera looks. While the clutch is held the device moves without the tool, so that a small device
// reaches a large place. The tool stays where it is when clutch, scale or view change; only its
// direction follows the hand and the view at once. Metres, newtons.

#include "common/math/frame.h"

namespace trocar::haptics {

struct WorkspaceScale {
  double motion = 1;  // of the tool over the device, > 0
  double force = 1;   // of the device over the tool, >= 0
};

class Workspace {
 public:
  explicit Workspace(const Vec3d& start_m, const WorkspaceScale& scale = {})
      : tip_m_(start_m), anchor_m_(start_m), scale_(scale) {}

  void set_view(const Quatf& world_from_device);
  void set_scale(const WorkspaceScale& scale);
  const WorkspaceScale& scale() const { return scale_; }

  struct Tip {
    Vec3d position_m;  // world frame
    Quatf orientation;
  };
  // The first place of the device is where the tool starts.
  Tip move(const Vec3d& device_m, const Quatf& device_orientation, bool is_clutched);

  // The device's way that moves the tool by this.
  Vec3d device_way(const Vec3d& world_way_m) const;
  Vec3d device_force(const Vec3d& world_force_n) const;
  // The same share of the tool's work as with forces: force scale over motion scale.
  Vec3d device_torque(const Vec3d& world_torque_nm) const;
  // A vector of the device's frame, only turned.
  Vec3d in_world(const Vec3d& device) const;
  double device_stiffness(double world_n_m) const {
    return world_n_m * scale_.force * scale_.motion;
  }
  double world_stiffness(double device_n_m) const;

 private:
  void anchor_here();

  Quatf view_, view_back_;
  Vec3d tip_m_, anchor_m_;
  Vec3d device_m_, device_anchor_m_;
  bool has_place_ = false;
  WorkspaceScale scale_;
};

}  // namespace trocar::haptics
