#include "server/tissue/cutting/repair.h"

#include <algorithm>

namespace trocar::cutting {
namespace {

constexpr std::uint32_t kRounds = 12;
constexpr std::size_t kMostBreaches = 64;
constexpr double kFloorShare = 0.5, kLengthShare = 0.4;
constexpr std::uint16_t kMiddle = 32768;
// Repair tries to turn tets to the other side, at most kMostTurned in a trial. A call has
// kTrialsAndWaiting / (waiting tets) trials, but at least one and at most kTrials.
constexpr std::uint32_t kTrials = 48, kTrialsAndWaiting = 2048;
constexpr std::size_t kMostTurned = 32;
constexpr double kLeastGain = 1e-4;  // h^2

}  // namespace

bool Repair::split_pinched_edges(CutMesh& mesh, Stroke& stroke) {
  const double least_h = kLengthShare * mesh.settings().length_floor_h;
  bool has_changed = false;
  for (const auto& breach : breaches_) {
    if (!breach.other.is_valid()) continue;
    ring_of(mesh.topology(), breach.node, breach.other, ring_);
    if (ring_.empty() || mesh.sine_after_split(breach.node, breach.other, kMiddle, least_h) <
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
  const double least_h = kLengthShare * mesh.settings().length_floor_h;
  for (const auto other : others_)
    if (mesh.sine_after_split(breach.node, other, kMiddle, least_h) <
        kFloorShare * mesh.floor_sine())
      return false;
  for (const auto other : others_) {
    if (mesh.sine_after_split(breach.node, other, kMiddle, least_h) <
        kFloorShare * mesh.floor_sine())
      return true;
    stroke.label(mesh.split(breach.node, other, kMiddle));
    ++mesh.out().pinch_splits;
  }
  stroke.remove_from_wound(breach.node, breach.side);
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

// Tets at the breach, by side, as far as they hang together there over faces.
void Repair::find_parts(CutMesh& mesh, Stroke& stroke, Opening& opening,
                        const Opening::Breach& breach) {
  const auto& topology = mesh.topology();
  if (breach.other.is_valid()) {
    ring_of(topology, breach.node, breach.other, ring_);
  } else {
    const auto tets = topology.tets_of(breach.node);
    ring_.assign(tets.begin(), tets.end());
  }
  parts_.clear();
  part_ends_.clear();
  for (const auto start : ring_) {
    if (std::ranges::find(parts_, start) != parts_.end()) continue;
    const int side = opening.side(mesh, stroke, start);
    parts_.push_back(start);
    for (auto i = parts_.size() - 1; i < parts_.size(); ++i)
      for (std::uint8_t corner = 0; corner < 4; ++corner) {
        const auto other = across(topology, {parts_[i], corner});
        if (!other || !std::ranges::binary_search(ring_, other->tet) ||
            opening.side(mesh, stroke, other->tet) != side ||
            std::ranges::find(parts_, other->tet) != parts_.end())
          continue;
        parts_.push_back(other->tet);
      }
    part_ends_.push_back(parts_.size());
  }
}

// Their nodes are labelled, and all tets at these keep their sides but those of the part.
void Repair::turn(CutMesh& mesh, Stroke& stroke, Opening& opening, std::span<const TetIndex> part) {
  const auto& topology = mesh.topology();
  turned_nodes_.clear();
  old_sides_.clear();
  around_.assign(part.begin(), part.end());
  for (const auto t : part)
    for (const auto node : topology.tet(t)) {
      if (stroke.is_labelled(node) || std::ranges::find(turned_nodes_, node) != turned_nodes_.end())
        continue;
      turned_nodes_.push_back(node);
      const auto tets = topology.tets_of(node);
      around_.insert(around_.end(), tets.begin(), tets.end());
    }
  std::sort(around_.begin(), around_.end());
  around_.erase(std::unique(around_.begin(), around_.end()), around_.end());
  for (const auto t : around_) {
    const int old = stroke.side(t), side = opening.side(mesh, stroke, t);
    const bool is_turned = std::ranges::find(part, t) != part.end();
    old_sides_.push_back({t, old});
    stroke.decide(t, is_turned ? -side : side);
  }
  for (const auto node : turned_nodes_) stroke.label(node);
}

void Repair::turn_back(Stroke& stroke) {
  for (const auto& [tet, side] : old_sides_) stroke.decide(tet, side);
  for (const auto node : turned_nodes_) stroke.remove_label(node);
}

// The part after which least stays closed, if less does than now.
bool Repair::turn_best(CutMesh& mesh, Stroke& stroke, Opening& opening,
                       const Opening::Breach& breach) {
  find_parts(mesh, stroke, opening, breach);
  const auto part = [&](std::size_t i) {
    const auto first = i == 0 ? 0 : part_ends_[i - 1];
    return std::span<const TetIndex>(parts_).subspan(first, part_ends_[i] - first);
  };
  std::size_t best = part_ends_.size();
  double most_gained = kLeastGain * mesh.h(breach.node) * mesh.h(breach.node);
  for (std::size_t i = 0; i < part_ends_.size() && trials_ > 0; ++i) {
    if (part(i).size() > kMostTurned) continue;
    --trials_;
    turn(mesh, stroke, opening, part(i));
    const double after = opening.closed_area(mesh, stroke, around_);
    turn_back(stroke);
    const double gained = opening.closed_area(mesh, stroke, around_) - after;
    if (!(gained > most_gained)) continue;
    most_gained = gained;
    best = i;
  }
  if (best == part_ends_.size()) return false;
  turn(mesh, stroke, opening, part(best));
  for (const auto t : around_)
    for (const auto node : mesh.topology().tet(t)) stroke.fresh.push_back(node);
  return true;
}

bool Repair::turn_any(CutMesh& mesh, Stroke& stroke, Opening& opening) {
  const auto waiting = static_cast<std::uint32_t>(stroke.waiting.size());
  trials_ = std::clamp(kTrialsAndWaiting / std::max(1u, waiting), 1u, kTrials);
  bool has_changed = false;
  for (const auto& breach : breaches_)
    has_changed = turn_best(mesh, stroke, opening, breach) || has_changed;
  return has_changed;
}

// Finds breaches that are farther than `beyond` (m) from the last patch.
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
  if (run(mesh, stroke, opening)) return stroke.waiting.empty();
  if (!turn_any(mesh, stroke, opening)) return true;
  opening.run(mesh, stroke);
  return stroke.waiting.empty();
}

void Repair::run_behind(CutMesh& mesh, Stroke& stroke, Opening& opening) {
  find_breaches(mesh, stroke, opening, mesh.settings().repair_h * stroke.h);
  run(mesh, stroke, opening);
}

}  // namespace trocar::cutting
