#include "server/lab/press/press_trial.h"

#include <algorithm>

#include "common/base/assert.h"
#include "common/tool/tool.h"
#include "server/tissue/hands/inputs.h"

namespace trocar::press {
namespace {

// From above the surface, where the tip meets it at its speed and not by appearing.
constexpr double kStart_m = 0.001;

}  // namespace

PressTrial::PressTrial(const organ::Organ& organ, double radius_m)
    : simulation_(organ), radius_m_(radius_m) {
  decisions_ = simulation_.with_sweeps_for_organ({});
  simulation_.write_snapshot(rest_);
}

void PressTrial::begin(const Vec3f& place, const Vec3f& outward) {
  if (is_pressed_) end();
  is_pressed_ = true;
  has_joined_ = false;
  place_ = place;
  outward_ = outward;
  way_m_ = -kStart_m;
  ticks_ = 0;
  force_n_ = {};
  readings_.clear();
  tip_ = {place_ + outward_ * static_cast<float>(kStart_m), rotation_from_z(outward_)};
}

void PressTrial::tick(double depth_m) {
  if (!is_pressed_) return;
  const double step = kTipSpeed_m_s * static_cast<double>(kTickSeconds);
  const double wanted = std::clamp(depth_m, 0.0, kMostDepth_m);
  way_m_ += std::clamp(wanted - way_m_, -step, step);
  hands::TickInputs inputs;
  if (!has_joined_) {
    // The shaft is as short as can be, so that nothing but the tip touches.
    const auto radius = static_cast<float>(radius_m_);
    hands::HandJoin join{.slot = {0}};
    join.shapes[0] = {.radius_m = radius, .length_m = std::max(0.01f, 2 * radius)};
    inputs.joins.push_back(join);
    has_joined_ = true;
  }
  const Vec3f at = place_ - outward_ * static_cast<float>(way_m_);
  inputs.samples.push_back(
      {tool_slot({0}, 0), {{at, rotation_from_z(outward_)}, tool::Verb::Push}});
  simulation_.tick(inputs, decisions_);
  ++ticks_;
  if (const auto frame = simulation_.pop_frame()) read(*frame);
}

void PressTrial::read(const step::PublishedFrame& frame) {
  if (frame.tools.empty()) return;
  const auto& tool = frame.tools.front();
  tip_ = tool.world_from_proxy;
  force_n_ = tool.force_n;
  if (readings_.size() >= kMostReadings) readings_.erase(readings_.begin());
  const double depth = static_cast<double>(dot(place_ - tip_.position, outward_));
  readings_.push_back({static_cast<double>(ticks_) * static_cast<double>(kTickSeconds),
                       static_cast<double>(length(force_n_)), std::max(depth, 0.0)});
}

void PressTrial::end() {
  is_pressed_ = false;
  force_n_ = {};
  const auto restored = simulation_.restore_snapshot(rest_);
  TROCAR_ASSERT(restored.ok());
}

}  // namespace trocar::press
