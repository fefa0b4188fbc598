#include "server/tissue/cutting/splitter.h"

#include <algorithm>
#include <limits>
#include <tuple>

namespace trocar::cutting {
namespace {

// An edge may be stretched to this many times its length at rest.
constexpr double kMostStretch = 1.5;
constexpr double kSlack_h = 1e-6;
// Tissue may have moved a little between two strips: of squares of distances.
constexpr double kJointSlack = 1.1;
// A patch costs something even where there is nothing to cut; in edits.
constexpr std::uint32_t kPatchCost = 1, kNearPerEdit = 64;

}  // namespace

// Heights of p above the patch, at the end of heights_. Returns how near it is.
Splitter::Nearness Splitter::look_at(std::span<const PatchTriangle> patch, const Vec3d& p,
                                     double reach) {
  auto nearness = Nearness::Far;
  for (const auto& triangle : patch) {
    const double height = signed_distance(triangle, p);
    heights_.push_back(height);
    if (nearness == Nearness::Close || !(std::abs(height) <= reach)) continue;
    if (std::abs(height) <= reach / 2 && is_inside(triangle, p, reach / 2))
      nearness = Nearness::Close;
    else if (nearness == Nearness::Far && is_inside(triangle, p, reach))
      nearness = Nearness::Near;
  }
  return nearness;
}

void Splitter::find_near(CutMesh& mesh, std::span<const PatchTriangle> patch) {
  mesh.collect(patch, kMostStretch, near_);
  rank_.resize(std::max(rank_.size(), mesh.topology().node_count()));
  heights_.clear();
  positions_.clear();
  is_close_.clear();
  std::erase_if(near_, [&](NodeIndex n) {
    const auto p = mesh.position(n);
    const auto nearness = look_at(patch, p, kMostStretch * mesh.reach(n));
    if (nearness == Nearness::Far) {
      heights_.resize(heights_.size() - patch.size());
      return true;
    }
    positions_.push_back(p);
    is_close_.push_back(nearness == Nearness::Close);
    rank_[n.value] = static_cast<std::uint32_t>(positions_.size());
    return false;
  });
}

// Heights above what the blade has really swept: where it turns, the patch runs on past the corner.
// A node that was nearest to the end of the last strip is now nearest to the joint.
void Splitter::measure(Stroke& stroke) const {
  for (std::size_t i = 0; i < near_.size(); ++i) {
    if (stroke.is_labelled(near_[i])) continue;
    const auto known = stroke.height(near_[i]).nearest_squared;
    const auto nearest = nearest_part(stroke.motion.strip(), stroke.path, stroke.sides_before,
                                      stroke.sides, positions_[i]);
    if (!nearest) return;
    if (nearest->is_joint && known >= 0 && nearest->distance_squared <= kJointSlack * known)
      stroke.measure_again(near_[i], {std::min(known, nearest->distance_squared), nearest->height});
    else
      stroke.measure(near_[i], {nearest->distance_squared, nearest->height});
  }
}

void Splitter::cross(const CutMesh& mesh, std::span<const PatchTriangle> patch, NodeIndex a,
                     NodeIndex b) {
  const auto *heights_a = &heights_[(rank_[a.value] - 1) * patch.size()],
             *heights_b = &heights_[(rank_[b.value] - 1) * patch.size()];
  for (std::size_t k = 0; k < patch.size(); ++k) {
    const double da = heights_a[k], db = heights_b[k];
    if (da * db > 0 || da == db) continue;
    const double t = da / (da - db);
    const auto &pa = positions_[rank_[a.value] - 1], &pb = positions_[rank_[b.value] - 1];
    if (!is_inside(patch[k], pa + (pb - pa) * t, kSlack_h * mesh.h(a))) continue;
    const auto rest = mesh.topology().rest();
    crossings_.push_back({a, b, t, da, db, length_squared(rest[a.value] - rest[b.value])});
    return;
  }
}

// A crossed edge has an end that is no farther from the patch than half its length.
bool Splitter::is_close(NodeIndex n) const {
  return is_close_[rank_[n.value] - 1] != 0;
}

// Returns whether some triangle's plane separates the two nodes or contains one of them.
bool Splitter::are_parted(NodeIndex a, NodeIndex b, std::size_t triangles) const {
  const auto *heights_a = &heights_[(rank_[a.value] - 1) * triangles],
             *heights_b = &heights_[(rank_[b.value] - 1) * triangles];
  for (std::size_t k = 0; k < triangles; ++k)
    if (!(heights_a[k] * heights_b[k] > 0)) return true;
  return false;
}

void Splitter::find_crossings(const CutMesh& mesh, const Stroke& stroke,
                              std::span<const PatchTriangle> patch) {
  crossings_.clear();
  seen_from_.assign(near_.size(), 0);
  for (const auto a : near_) {
    if (!is_close(a) || stroke.is_labelled(a)) continue;
    others_.clear();
    mesh.topology().for_each_neighbour(a, [&](NodeIndex b) {
      if (rank_[b.value] == 0 || (b < a && is_close(b))) return;
      auto& seen_from = seen_from_[rank_[b.value] - 1];
      if (seen_from == rank_[a.value]) return;
      seen_from = rank_[a.value];
      if (!stroke.is_labelled(b) && are_parted(a, b, patch.size())) others_.push_back(b);
    });
    std::sort(others_.begin(), others_.end());
    for (const auto b : others_) cross(mesh, patch, std::min(a, b), std::max(a, b));
  }
}

void Splitter::leave_out_small_pieces(const CutMesh& mesh) {
  if (!(mesh.settings().whole_volume_h3 > 0)) return;
  std::erase_if(crossings_, [&](const Crossing& crossing) {
    return small_pieces_.has(mesh, mesh.topology().tets_of(crossing.a).front());
  });
  small_pieces_.clear();
}

void Splitter::count_crossed_tets(CutMesh& mesh) {
  crossed_.clear();
  for (const auto& crossing : crossings_) {
    ring_of(mesh.topology(), crossing.a, crossing.b, ring_);
    crossed_.insert(crossed_.end(), ring_.begin(), ring_.end());
  }
  std::sort(crossed_.begin(), crossed_.end());
  crossed_.erase(std::unique(crossed_.begin(), crossed_.end()), crossed_.end());
  mesh.out().crossed_tets += static_cast<std::uint32_t>(crossed_.size());
}

bool Splitter::snap(CutMesh& mesh, Stroke& stroke, std::uint32_t& budget) {
  snaps_.clear();
  const double share = mesh.settings().snap;
  for (const auto& c : crossings_) {
    if (c.t < share) snaps_.push_back({std::abs(c.height_a), c.a, c.b});
    if (1 - c.t < share) snaps_.push_back({std::abs(c.height_b), c.b, c.a});
  }
  std::sort(snaps_.begin(), snaps_.end(), [](const Snap& x, const Snap& y) {
    return std::tie(x.height, x.node, x.other) < std::tie(y.height, y.node, y.other);
  });
  for (const auto& snap : snaps_) {
    if (stroke.is_labelled(snap.node) || stroke.is_labelled(snap.other)) continue;
    if (budget == 0) return false;
    --budget;
    stroke.label(snap.node);
    ++mesh.out().labels;
  }
  return true;
}

bool Splitter::split(CutMesh& mesh, Stroke& stroke, std::uint32_t& budget) {
  std::sort(crossings_.begin(), crossings_.end(), [](const Crossing& x, const Crossing& y) {
    return std::tuple(-x.length_squared, x.a, x.b) < std::tuple(-y.length_squared, y.a, y.b);
  });
  for (const auto& crossing : crossings_) {
    if (stroke.is_labelled(crossing.a) || stroke.is_labelled(crossing.b)) continue;
    if (budget == 0) return false;
    const auto t = quantised_share(crossing.t);
    if (mesh.sine_after_split(crossing.a, crossing.b, t, mesh.length_floor_h()) >=
        mesh.floor_sine()) {
      stroke.label(mesh.split(crossing.a, crossing.b, t));
      budget -= std::min(budget, static_cast<std::uint32_t>(mesh.last_ring()));
    } else {
      stroke.label(crossing.t <= 0.5 ? crossing.a : crossing.b);
      ++mesh.out().labels;
      ++mesh.out().refused_splits;
      --budget;
    }
  }
  return true;
}

bool Splitter::run(CutMesh& mesh, Stroke& stroke, std::span<const PatchTriangle> patch,
                   std::uint32_t& budget) {
  if (patch.empty()) return true;
  find_near(mesh, patch);
  if (!near_.empty()) {
    stroke.h = 0;
    for (const auto node : near_) stroke.h += mesh.h(node) / static_cast<double>(near_.size());
  }
  measure(stroke);
  find_crossings(mesh, stroke, patch);
  for (const auto node : near_) rank_[node.value] = 0;
  leave_out_small_pieces(mesh);
  count_crossed_tets(mesh);
  const bool is_finished = snap(mesh, stroke, budget) && split(mesh, stroke, budget);
  budget -= std::min(budget, kPatchCost + static_cast<std::uint32_t>(near_.size()) / kNearPerEdit);
  return is_finished;
}

}  // namespace trocar::cutting
