#include "client/editor/hand_press.h"

#include <algorithm>

#include "common/base/timing.h"

namespace trocar::editor {
namespace {

constexpr std::uint64_t kMostNs = 40'000'000;  // of ticks in a picture
constexpr float kDrawnShaft_m = 0.15f;
constexpr float kShareMemory = 0.9f;

}  // namespace

void HandPress::begin(const organ::Organ& organ, std::uint64_t version, double radius_m,
                      const Vec3f& place, const Vec3f& outward) {
  if (!trial_ || version_ != version || trial_->radius_m() != radius_m)
    trial_ = std::make_unique<press::PressTrial>(organ, radius_m);
  version_ = version;
  owed_ticks_ = 0;
  figures_ = {};
  trial_->begin(place, outward);
}

void HandPress::go_on(double depth_m, float seconds) {
  if (!is_pressed()) return;
  owed_ticks_ += seconds / static_cast<float>(kTickSeconds);
  const auto owed = static_cast<int>(owed_ticks_);
  const auto begin = monotonic_ns();
  int done = 0;
  for (; done < owed && monotonic_ns() - begin < kMostNs; ++done) trial_->tick(depth_m);
  // Time that is owed then is lost: it goes slower, and nothing is made up for.
  owed_ticks_ -= static_cast<float>(owed);
  if (owed > 0)
    figures_.share = figures_.share * kShareMemory +
                     (1 - kShareMemory) * static_cast<float>(done) / static_cast<float>(owed);
  figures_.forces_n.clear();
  figures_.most_n = 0;
  for (const auto& reading : trial_->readings()) {
    figures_.forces_n.push_back(static_cast<float>(reading.force_n));
    figures_.most_n = std::max(figures_.most_n, figures_.forces_n.back());
  }
  if (trial_->readings().empty()) return;
  figures_.force_n = static_cast<float>(trial_->readings().back().force_n);
  figures_.depth_mm = static_cast<float>(trial_->readings().back().depth_m * 1e3);
}

void HandPress::end() {
  if (is_pressed()) trial_->end();
}

std::span<const Vec3f> HandPress::displacements() const {
  return trial_ ? trial_->displacements() : std::span<const Vec3f>();
}

void HandPress::add_to(render::SceneView& scene) const {
  if (!is_pressed()) return;
  render::SceneTool tool;
  tool.slot = tool_slot({0}, 0);
  tool.world_from_tool = trial_->world_from_tip();
  tool.hand_position = tool.world_from_tool.position;
  tool.shape = {.radius_m = static_cast<float>(trial_->radius_m()),
                .length_m = kDrawnShaft_m,
                .form = tool::Form::Probe};
  tool.verb = tool::Verb::Push;
  tool.has_claim = true;
  tool.force_n = trial_->force_n();
  scene.tools.push_back(tool);
}

}  // namespace trocar::editor
