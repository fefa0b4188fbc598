#pragma once

// The force on a hand at 1 kHz between the server's answers. A local viscoelastic model per tool is
// driven by the device alone, so nothing that the hand feels waits for the network. Each answer
// (HapticPatch) corrects it at the pose that the answer belongs to, not at the pose of its arrival
// (a Smith predictor):
//
//   F = s M + c gate        M: what local tissue answers (push_, grip_, blade_element.h)
//   c -> F_server - s M(echo)    gate: falls to 0 with the last 40 % of M, so that no force is left
//   s -> slope of F_server over M(echo) (slope_fit.h)              in free space
//
// where s M stands for s M + r M_n of pushed tissue, r its lean to a side (slope_fit.h).
//
// c and s go to their targets within 15 ms, the height of the surface likewise, its slope at once.
// A surface that moved is in F_server too: M(echo) is moved along, else it would count twice.
// Where the tool may not go, a local stop takes over (local_events.h).
//
// Metres, newtons, seconds, world frame. No step or take allocates; one thread.

#include <optional>

#include "client/haptics/believed_surface.h"
#include "client/haptics/blade_element.h"
#include "client/haptics/correction.h"
#include "client/haptics/grip_element.h"
#include "client/haptics/jaws.h"
#include "client/haptics/local_events.h"
#include "client/haptics/met_materials.h"
#include "client/haptics/past_states.h"
#include "client/haptics/power_law.h"
#include "client/haptics/push_element.h"
#include "client/haptics/slope_fit.h"
#include "client/haptics/visco_element.h"
#include "common/math/frame.h"
#include "common/tool/tool.h"
#include "common/wire/haptic_patch.h"

namespace trocar::haptics {

struct TouchSettings {
  double blend_s = 0.015;
  double forget_s = 0.5;    // of the fit of the slope
  double follow_s = 0.010;  // of the slope behind its fit
  double gate = 0.4;        // share of the force at the echo over which the correction fades in
  double moved_share = 1;   // of a surface's motion that moves M(echo) along
  double stop_n_m = 1000;   // stiffness of the local stop; at most what the device renders
};

struct TouchInput {
  Vec3d tip_m;
  Quatf orientation;
  tool::Verb verb = tool::Verb::Push;
  std::uint64_t time_us = 0;  // the client's clock that readings carry to the server; it grows
};

struct TouchOutput {
  Vec3d force_n, torque_nm;  // of the tissue on the tool, the torque about the tip
  double stiffness_n_m = 0;  // of what touches, at once
  bool touches = false;      // or holds
};

struct TouchCounts {
  std::uint64_t patches = 0;
  std::uint64_t old_patches = 0;        // came after a newer one
  std::uint64_t unmatched_patches = 0;  // of a pose that is not known, or no more
};

class TouchModel {
 public:
  explicit TouchModel(const tool::ToolShape& shape, const TouchSettings& settings = {});

  // Patches may refer to the law from now on (met_materials.h).
  void take(const wire::HapticLaw& law);
  // Belongs between two steps.
  void take(const wire::HapticPatch& patch);
  TouchOutput step(const TouchInput& input);

  const TouchCounts& counts() const { return counts_; }
  double slope() const { return correction_.slope; }
  // From a pose to the answer that belongs to it, smoothed.
  double answer_s() const { return answer_s_; }
  const wire::HapticPatch& newest_patch() const { return patch_; }

 private:
  static bool touches(wire::TouchKind kind) {
    return kind == wire::TouchKind::Push || kind == wire::TouchKind::Grip ||
           kind == wire::TouchKind::Cut;
  }
  bool has_surface() const { return has_patch_ && patch_.kind != wire::TouchKind::Free; }
  bool grips() const { return has_patch_ && patch_.kind == wire::TouchKind::Grip; }
  bool cuts() const { return has_patch_ && patch_.kind == wire::TouchKind::Cut; }
  enum class Element { Push, Grip, Blade };
  Element element() const {
    return grips() ? Element::Grip : cuts() ? Element::Blade : Element::Push;
  }

  // The local model.
  PastState state_of(const TouchInput& input) const;
  void answer(PastState& state, double dt_s);
  Vec3d model_force(const Response& response) const;
  // s M, in use, or as the fit has it.
  Vec3d scaled_force(const Response& response, double slope, const Vec3d& lean) const;
  void use_material();

  // A step makes a force of it.
  void blend(double dt_s);
  Vec3d corrected_force(const Response& response) const;
  Vec3d limited_force(const Vec3d& force_n, const Response& response) const;
  Vec3d stopped_force(const Vec3d& force_n, const Vec3d& core_m, double dt_s);

  // A patch changes it.
  bool is_old(const wire::HapticPatch& patch) const;
  void take_surface(bool had_surface, bool gripped);
  void take_stop();
  void restart(std::size_t first);
  void correct(const PastState& then, bool is_new_structure);
  void expect();
  double blade_slope(const Response& response) const;
  void take_side_friction(const Response& then);
  void correct_blade(const PastState& then);
  void take_lever();
  Response with_moved_reference(const PastState& then) const;
  std::optional<double> stiffness_ratio(const Response& response) const;
  SymMat3<double> grip_stiffness() const;
  void keep_force(const Response& response);

  tool::ToolShape shape_;
  TouchSettings settings_;
  MetMaterials materials_;
  PowerLaw power_law_;
  ViscoSteps steps_;
  double slow_share_ = 1;  // stiffness of 50 ms over the elastic one

  wire::HapticPatch patch_;
  bool has_patch_ = false;
  BelievedSurface surface_;

  PushElement push_;
  GripElement grip_;
  BladeElement blade_;
  PastStates past_;
  Vec3d velocity_m_s_;  // smoothed

  SlopeFit fit_;
  std::uint64_t last_echo_us_ = 0;
  Correction correction_;
  double side_friction_n_m_ = 0;  // of a blade, per length of its edge in tissue
  double answer_s_ = 0;

  LocalStop stop_;
  Jaws jaws_;
  TouchOutput output_;
  TouchCounts counts_;
};

}  // namespace trocar::haptics
