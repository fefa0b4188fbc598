#include "server/tissue/cutting/side_cut.h"

#include <algorithm>

namespace trocar::cutting {
namespace {

constexpr std::uint32_t kAbove = 0, kBelow = 1, kNone = 0xffffffffu;
// Capacities: of a face of one h^2; how much more one costs that an old wound has to be led to, and
// one that cannot be opened; of a tet.
constexpr double kPerArea = 1000, kPerOldWound = 3, kPerClosed = 1000;
constexpr std::int64_t kPerTet = 20, kWithoutEnd = std::int64_t{1} << 50;
constexpr double kClear_h = 0.65;  // so far above or below the path a node is clearly there

}  // namespace

// Whether the path may be led to a node: it is near, and on a wound.
bool SideCut::can_label(const CutMesh& mesh, const Stroke& stroke, NodeIndex node) const {
  const auto height = stroke.height(node);
  if (height.nearest_squared < 0 || !(std::abs(height.height) < kClear_h * mesh.h(node)))
    return false;
  const auto& topology = mesh.topology();
  return std::ranges::any_of(topology.tets_of(node), [&](TetIndex t) {
    for (unsigned corner = 0; corner < 4; ++corner)
      if (topology.tet(t)[corner] != node && (topology.wound_faces(t) >> corner & 1) != 0)
        return true;
    return false;
  });
}

// Returns what it costs to open a face, per area.
double SideCut::cost_of(const CutMesh& mesh, const Stroke& stroke,
                        const mesh::Triangle& nodes) const {
  double cost = 1;
  for (const auto node : nodes) {
    if (stroke.is_labelled(node)) continue;
    if (!can_label(mesh, stroke, node)) return kPerClosed;
    cost = kPerOldWound;
  }
  return cost;
}

void SideCut::gather(const CutMesh& mesh, const Stroke& stroke) {
  tets_.clear();
  for (const auto node : stroke.labelled()) {
    const auto tets = mesh.topology().tets_of(node);
    tets_.insert(tets_.end(), tets.begin(), tets.end());
  }
  std::sort(tets_.begin(), tets_.end());
  tets_.erase(std::unique(tets_.begin(), tets_.end()), tets_.end());
}

void SideCut::add_arc(std::uint32_t a, std::uint32_t b, Capacity there, Capacity back) {
  const auto first = static_cast<std::uint32_t>(arcs_.size());
  arcs_.push_back({b, first + 1, there});
  arcs_.push_back({a, first, back});
  arcs_of_[a].push_back(first);
  arcs_of_[b].push_back(first + 1);
}

// Its place in tets_, or kNone.
std::uint32_t SideCut::place_of(TetIndex t) const {
  const auto at = std::lower_bound(tets_.begin(), tets_.end(), t);
  return at != tets_.end() && *at == t ? static_cast<std::uint32_t>(at - tets_.begin()) : kNone;
}

bool SideCut::is_clear(const CutMesh& mesh, const Stroke& stroke, TetIndex t) {
  bool is_above = true, is_below = true, is_flat = true;
  for (const auto node : mesh.topology().tet(t)) {
    if (stroke.is_labelled(node)) continue;
    is_flat = false;
    const double height = stroke.height(node).height, clear = kClear_h * mesh.h(node);
    is_above &= height > clear;
    is_below &= height < -clear;
  }
  return !is_flat && (is_above || is_below);
}

void SideCut::connect(const CutMesh& mesh, Stroke& stroke, Opening& opening) {
  const auto& topology = mesh.topology();
  arcs_.clear();
  led_.clear();
  for (auto& arcs : arcs_of_) arcs.clear();
  if (arcs_of_.size() < tets_.size() + 2) arcs_of_.resize(tets_.size() + 2);
  sides_.resize(tets_.size());
  for (std::uint32_t i = 0; i < tets_.size(); ++i) {
    const auto t = tets_[i];
    sides_[i] = static_cast<std::int8_t>(opening.side(mesh, stroke, t));
    const auto weight = is_clear(mesh, stroke, t) ? kWithoutEnd : kPerTet;
    if (sides_[i] > 0)
      add_arc(kAbove, i + 2, weight, 0);
    else
      add_arc(i + 2, kBelow, weight, 0);
    for (std::uint8_t corner = 0; corner < 4; ++corner) {
      const auto other = across(topology, {t, corner});
      if (!other || other->tet < t) continue;
      const auto k = place_of(other->tet);
      if (k == kNone) continue;
      const auto nodes = face_nodes(topology.tet(t), corner);
      const double per_area = cost_of(mesh, stroke, nodes);
      const double area = face_area(topology, {t, corner}) / (stroke.h * stroke.h);
      const auto cost = 1 + static_cast<Capacity>(area * kPerArea * per_area);
      add_arc(i + 2, k + 2, cost, cost);
      if (per_area == kPerOldWound) led_.push_back({i, k, nodes});
    }
  }
}

// Distances from what is above, over arcs with something left; whether they reach what is below.
bool SideCut::find_distances() {
  distances_.assign(tets_.size() + 2, kNone);
  distances_[kAbove] = 0;
  queue_.assign(1, kAbove);
  for (std::size_t i = 0; i < queue_.size(); ++i)
    for (const auto a : arcs_of_[queue_[i]]) {
      const auto to = arcs_[a].to;
      if (arcs_[a].left == 0 || distances_[to] != kNone) continue;
      distances_[to] = distances_[queue_[i]] + 1;
      queue_.push_back(to);
    }
  return distances_[kBelow] != kNone;
}

// Fills one shortest way; false: none is left.
bool SideCut::fill_way() {
  way_.clear();
  for (auto n = kAbove; n != kBelow;) {
    auto& next = next_arc_[n];
    const auto& arcs = arcs_of_[n];
    while (next < arcs.size() &&
           (arcs_[arcs[next]].left == 0 || distances_[arcs_[arcs[next]].to] != distances_[n] + 1))
      ++next;
    if (next < arcs.size()) {
      way_.push_back(arcs[next]);
      n = arcs_[way_.back()].to;
    } else if (way_.empty()) {
      return false;
    } else {  // a dead end
      n = arcs_[arcs_[way_.back()].back].to;
      ++next_arc_[n];
      way_.pop_back();
    }
  }
  auto least = kWithoutEnd;
  for (const auto a : way_) least = std::min(least, arcs_[a].left);
  for (const auto a : way_) {
    arcs_[a].left -= least;
    arcs_[arcs_[a].back].left += least;
  }
  return true;
}

// Labels what the cut goes through. Tets there keep the sides that they have.
void SideCut::label(const CutMesh& mesh, Stroke& stroke, Opening& opening) {
  nodes_.clear();
  for (const auto& [a, b, nodes] : led_)
    for (const auto node : nodes)
      if (sides_[a] != sides_[b] && !stroke.is_labelled(node)) nodes_.push_back(node);
  std::sort(nodes_.begin(), nodes_.end());
  nodes_.erase(std::unique(nodes_.begin(), nodes_.end()), nodes_.end());
  for (const auto node : nodes_)
    for (const auto t : mesh.topology().tets_of(node)) {
      const auto i = place_of(t);
      stroke.decide(t, i != kNone ? sides_[i] : opening.side(mesh, stroke, t));
    }
  for (const auto node : nodes_) stroke.label(node);
}

bool SideCut::run(CutMesh& mesh, Stroke& stroke, Opening& opening) {
  gather(mesh, stroke);
  connect(mesh, stroke, opening);
  while (find_distances()) {
    next_arc_.assign(tets_.size() + 2, 0);
    while (fill_way()) {
    }
  }
  bool has_changed = false;
  for (std::uint32_t i = 0; i < tets_.size(); ++i) {
    const std::int8_t side = distances_[i + 2] != kNone ? 1 : -1;
    if (side == sides_[i]) continue;
    has_changed = true;
    sides_[i] = side;
    stroke.decide(tets_[i], side);
    for (const auto node : mesh.topology().tet(tets_[i])) stroke.fresh.push_back(node);
  }
  label(mesh, stroke, opening);
  return has_changed || !nodes_.empty();
}

}  // namespace trocar::cutting
