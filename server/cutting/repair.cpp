#include "server/cutting/repair.h"

#include <algorithm>

namespace trocar::cutting {
namespace {

constexpr int kRounds = 6;
constexpr std::size_t kMostBreaches = 64;
constexpr std::size_t kMostTurns = 48;
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

// Takes a tet to the other side, to which it must be attached. All its nodes come to lie on the
// wound for that; tets at them stay where they are.
void Repair::turn(CutMesh& mesh, Stroke& stroke, Opening& opening, TetIndex t) {
  const auto decide = [&](TetIndex tet, int side) {
    decided_.emplace_back(tet, stroke.side(tet));
    stroke.decide(tet, side);
  };
  const int side = opening.side(mesh, stroke, t);
  for (const auto node : mesh.topology().tet(t)) {
    if (stroke.is_labelled(node)) continue;
    for (const auto other : mesh.topology().tets_of(node))
      if (stroke.side(other) == 0) decide(other, opening.side(mesh, stroke, other));
  }
  decide(t, -side);
  for (const auto node : mesh.topology().tet(t)) {
    if (stroke.is_labelled(node)) continue;
    stroke.label(node);
    labelled_.push_back(node);
  }
}

void Repair::undo(Stroke& stroke) {
  for (auto i = decided_.size(); i-- > 0;) stroke.decide(decided_[i].first, decided_[i].second);
  for (auto i = labelled_.size(); i-- > 0;) stroke.unlabel_last(labelled_[i]);
}

bool Repair::is_attached(CutMesh& mesh, Stroke& stroke, Opening& opening, TetIndex t) {
  const int side = opening.side(mesh, stroke, t);
  for (std::uint8_t corner = 0; corner < 4; ++corner)
    if (const auto other = across(mesh.topology(), {t, corner});
        other && opening.side(mesh, stroke, other->tet) != side)
      return true;
  return false;
}

bool Repair::turn_pinched_nodes(CutMesh& mesh, Stroke& stroke, Opening& opening) {
  bool has_changed = false;
  std::size_t turns = 0, before = breaches_.size();
  for (const auto& breach : breaches_) {
    if (breach.other.is_valid()) continue;
    const auto tets = mesh.topology().tets_of(breach.node);
    for (const auto t : tets) {
      if (turns >= kMostTurns) return has_changed;
      if (!is_attached(mesh, stroke, opening, t)) continue;
      ++turns;
      decided_.clear();
      labelled_.clear();
      waiting_ = stroke.waiting;
      turn(mesh, stroke, opening, t);
      if (!std::ranges::binary_search(stroke.waiting, t))
        stroke.waiting.insert(std::ranges::lower_bound(stroke.waiting, t), t);
      const auto after = opening.breaches_of_all(mesh, stroke).size();
      if (after < before) {
        before = after;
        has_changed = true;
        break;
      }
      undo(stroke);
      stroke.waiting = waiting_;
    }
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
    if (mesh.sine_after_split(breach.node, other, kMiddle, kFloorShare) <
        kFloorShare * mesh.floor_sine())
      return false;
  for (const auto other : others_) {
    if (mesh.sine_after_split(breach.node, other, kMiddle, kFloorShare) <
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

void Repair::run(CutMesh& mesh, Stroke& stroke, Opening& opening) {
  for (int round = 0; round < kRounds && !stroke.waiting.empty(); ++round) {
    const auto breaches = opening.breaches_of_all(mesh, stroke);
    breaches_.assign(breaches.begin(), breaches.begin() + static_cast<std::ptrdiff_t>(std::min(
                                                              breaches.size(), kMostBreaches)));
    const bool has_split = split_pinched_edges(mesh, stroke);
    if (!has_split && !turn_pinched_nodes(mesh, stroke, opening) &&
        !pull_back_all(mesh, stroke, opening))
      return;
    opening.run(mesh, stroke);
  }
}

}  // namespace trocar::cutting
