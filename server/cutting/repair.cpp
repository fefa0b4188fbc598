#include "server/cutting/repair.h"

#include <algorithm>

namespace trocar::cutting {
namespace {

constexpr int kRounds = 6;
constexpr std::size_t kMostBreaches = 64;
constexpr std::size_t kMostTurns = 16;
constexpr double kFloorShare = 0.5;
constexpr std::uint16_t kMiddle = 32768;

}  // namespace

bool Repair::split_pinched_edges(CutMesh& mesh, Stroke& stroke) {
  bool has_changed = false;
  for (const auto& breach : breaches_) {
    if (!breach.other.is_valid()) continue;
    ring_of(mesh.topology(), breach.node, breach.other, ring_);
    if (ring_.empty() || mesh.sine_after_split(breach.node, breach.other, kMiddle, kFloorShare) <
                             kFloorShare * mesh.floor_sine())
      continue;
    stroke.label(mesh.split(breach.node, breach.other, kMiddle));
    ++mesh.out().pinch_splits;
    has_changed = true;
  }
  return has_changed;
}

bool Repair::turn_pinched_nodes(CutMesh& mesh, Stroke& stroke, Opening& opening) {
  bool has_changed = false;
  std::size_t turns = 0;
  std::size_t before = breaches_.size();
  for (const auto& breach : breaches_) {
    if (breach.other.is_valid()) continue;
    const auto tets = mesh.topology().tets_of(breach.node);
    for (const auto t : tets) {
      if (turns >= kMostTurns) return has_changed;
      const int side = stroke.side(t);
      if (side == 0) continue;  // decided ones are flat: they lie along the wound
      ++turns;
      stroke.decide(t, -side);
      const auto own = stroke.waiting;
      stroke.waiting.insert(stroke.waiting.end(), t);
      std::sort(stroke.waiting.begin(), stroke.waiting.end());
      const auto after = opening.breaches_of_all(mesh, stroke).size();
      if (after < before) {
        before = after;
        has_changed = true;
        break;
      }
      stroke.decide(t, side);
      stroke.waiting = own;
    }
  }
  return has_changed;
}

void Repair::run(CutMesh& mesh, Stroke& stroke, Opening& opening) {
  for (int round = 0; round < kRounds && !stroke.waiting.empty(); ++round) {
    const auto breaches = opening.breaches_of_all(mesh, stroke);
    breaches_.assign(breaches.begin(), breaches.begin() + static_cast<std::ptrdiff_t>(std::min(
                                                              breaches.size(), kMostBreaches)));
    const bool has_split = split_pinched_edges(mesh, stroke);
    if (!has_split && !turn_pinched_nodes(mesh, stroke, opening)) return;
    opening.run(mesh, stroke);
  }
}

}  // namespace trocar::cutting
