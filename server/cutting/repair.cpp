#include "server/cutting/repair.h"

#include <algorithm>

namespace trocar::cutting {
namespace {

constexpr std::uint32_t kRounds = 6;
constexpr std::size_t kMostBreaches = 64;
constexpr double kFloorShare = 0.5, kLengthShare = 0.75;
constexpr std::uint16_t kMiddle = 32768;

}  // namespace

bool Repair::split_pinched_edges(CutMesh& mesh, Stroke& stroke) {
  bool has_changed = false;
  for (const auto& breach : breaches_) {
    if (!breach.other.is_valid()) continue;
    ring_of(mesh.topology(), breach.node, breach.other, ring_);
    if (ring_.empty() || mesh.sine_after_split(breach.node, breach.other, kMiddle, kLengthShare) <
                             kFloorShare * mesh.floor_sine())
      continue;
    stroke.label(mesh.split(breach.node, breach.other, kMiddle));
    ++mesh.out().pinch_splits;
    has_changed = true;
  }
  return has_changed;
}

// Takes the wound off a node, to the middle of its edges on the side that is not pinched.
bool Repair::pull_back(CutMesh& mesh, Stroke& stroke, Opening& opening,
                       const Opening::Breach& breach) {
  others_.clear();
  for (const auto t : mesh.topology().tets_of(breach.node)) {
    if (opening.side(mesh, stroke, t) == breach.side) continue;
    for (const auto node : mesh.topology().tet(t))
      if (!stroke.is_labelled(node)) others_.push_back(node);
  }
  std::sort(others_.begin(), others_.end());
  others_.erase(std::unique(others_.begin(), others_.end()), others_.end());
  for (const auto other : others_)
    if (mesh.sine_after_split(breach.node, other, kMiddle, kLengthShare) <
        kFloorShare * mesh.floor_sine())
      return false;
  for (const auto other : others_) {
    if (mesh.sine_after_split(breach.node, other, kMiddle, kLengthShare) <
        kFloorShare * mesh.floor_sine())
      return true;
    stroke.label(mesh.split(breach.node, other, kMiddle));
    ++mesh.out().pinch_splits;
  }
  stroke.take_off_wound(breach.node, breach.side);
  for (const auto t : mesh.topology().tets_of(breach.node)) stroke.decide(t, 0);
  return true;
}

bool Repair::pull_back_all(CutMesh& mesh, Stroke& stroke, Opening& opening) {
  bool has_changed = false;
  for (const auto& breach : breaches_)
    if (!breach.other.is_valid() && stroke.is_labelled(breach.node))
      has_changed = pull_back(mesh, stroke, opening, breach) || has_changed;
  return has_changed;
}

// Those farther than `beyond` (m) from the last patch.
void Repair::find_breaches(CutMesh& mesh, Stroke& stroke, Opening& opening, double beyond) {
  breaches_.clear();
  for (const auto& breach : opening.breaches_of_all(mesh, stroke)) {
    const auto p = mesh.position(breach.node);
    const bool is_near = std::ranges::any_of(stroke.patch, [&](const PatchTriangle& triangle) {
      return distance_squared(triangle, p) < beyond * beyond;
    });
    if (!is_near && breaches_.size() < kMostBreaches) breaches_.push_back(breach);
  }
}

bool Repair::run(CutMesh& mesh, Stroke& stroke, Opening& opening) {
  if (!split_pinched_edges(mesh, stroke) && !pull_back_all(mesh, stroke, opening)) return false;
  opening.run(mesh, stroke);
  return true;
}

bool Repair::finish(CutMesh& mesh, Stroke& stroke, Opening& opening) {
  if (stroke.waiting.empty() || stroke.repairs++ >= kRounds) return true;
  find_breaches(mesh, stroke, opening, 0);
  return !run(mesh, stroke, opening) || stroke.waiting.empty();
}

void Repair::run_behind(CutMesh& mesh, Stroke& stroke, Opening& opening) {
  find_breaches(mesh, stroke, opening, mesh.settings().repair_h * stroke.h);
  run(mesh, stroke, opening);
}

}  // namespace trocar::cutting
