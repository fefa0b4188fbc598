#include "client/haptics/push_element.h"

#include <algorithm>

namespace trocar::haptics {
namespace {

Vec3d in_plane(const Vec3d& v, const Vec3d& normal) {
  return v - normal * dot(v, normal);
}

}  // namespace

Response PushElement::step(const PowerLaw& law, const ViscoSteps& steps, double depth_m,
                           const Vec3d& place_m, const Vec3d& normal, double friction) {
  if (!(normal == normal_)) {
    normal_ = normal;
    across_.change_states([&](const Vec3d& state) { return in_plane(state, normal); });
    slip_m_ = in_plane(slip_m_, normal);
    anchor_m_ = place_m_ - slip_m_;
  }
  place_m_ = place_m;
  const double depth = std::max(depth_m, 0.0);
  const double motion_force =
      law.stiffness_n_m(std::max(depth_m_, PowerLaw::kLinearDepth_m)) * (depth - depth_m_);
  const double force = along_.step(steps, law.force_n(depth), motion_force);
  depth_m_ = depth;

  Response response;
  response.stiffness_n_m = law.stiffness_n_m(std::max(depth, PowerLaw::kLinearDepth_m));
  if (depth_m > 0) response.normal_n = force;
  response.elastic_n = law.force_n(depth);
  const bool touched = touches_;
  touches_ = response.normal_n > 0;
  if (touches_) {
    if (!touched) anchor_m_ = place_m;
    response.rest_n = across(law, steps, place_m, friction * response.normal_n);
  } else {
    across_.reset();
    slip_m_ = {};
  }
  return response;
}

Vec3d PushElement::across(const PowerLaw& law, const ViscoSteps& steps, const Vec3d& place_m,
                          double limit_n) {
  const double stiffness =
      kAcrossOverNormal * law.stiffness_n_m(std::max(depth_m_, PowerLaw::kLinearDepth_m));
  const Vec3d slip = in_plane(place_m - anchor_m_, normal_);
  Vec3d pull = across_.step(steps, slip * stiffness, (slip - slip_m_) * stiffness);
  slip_m_ = slip;
  const double size = length(pull);
  if (size > limit_n) {
    // The part over the limit is taken off all states alike: else reversals of the motion would
    // begin with a force that is wrong by a fifth.
    const Vec3d over = pull * ((size - limit_n) / (size * stiffness * steps.at_once()));
    anchor_m_ += over;
    slip_m_ = slip_m_ - over;
    across_.take_back(steps, over * stiffness);
    pull *= limit_n / size;
  }
  return -pull;
}

}  // namespace trocar::haptics
