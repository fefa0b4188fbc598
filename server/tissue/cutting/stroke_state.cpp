// The state of strokes: what later cuts depend on, in bytes.

#include <algorithm>
#include <cmath>

#include "server/tissue/cutting/stroke.h"

namespace trocar::cutting {
namespace {

constexpr std::uint32_t kMostStrips = 512;
constexpr std::uint32_t kMostTriangles = 2 * (kMaxEdgePoints - 1);
// m; a patch goes a little farther than the blade.
constexpr double kFarthestCorner = 2 * kMaxFromOrigin;
constexpr double kMost_m = 1e6;

// m, or m^2.
bool is_size(double value) {
  return value >= 0 && value < kMost_m;
}
bool is_place(const Vec3d& p) {
  return is_finite(p) && length_squared(p) < kFarthestCorner * kFarthestCorner;
}

void visit_points(world::StateArchive& archive, BladeEdge& edge, std::uint32_t count) {
  edge.count = count;
  for (std::uint32_t i = 0; i < count; ++i) {
    archive.value(edge.points[i]);
    if (archive.is_reading() && !is_place(edge.points[i])) archive.fail();
  }
}

// Items that take() accepts: each fits, and none is there twice.
template <typename Index, typename Take>
void visit_list(world::StateArchive& archive, std::vector<Index>& items, std::size_t places,
                Take&& take) {
  archive.sized_array(items, static_cast<std::uint32_t>(places));
  if (!archive.is_reading()) return;
  const auto bad = std::find_if_not(items.begin(), items.end(), take);
  if (bad == items.end()) return;
  items.erase(bad, items.end());
  archive.fail();
}

template <typename Index>
bool is_ascending(const std::vector<Index>& items) {
  return std::adjacent_find(items.begin(), items.end(), std::greater_equal<>()) == items.end();
}

}  // namespace

void BladeMotion::visit_strips(world::StateArchive& archive) {
  auto count = static_cast<std::uint32_t>(strips_.size() - next_);
  archive.value(count);
  if (archive.is_reading()) {
    if (count > kMostStrips) archive.fail();
    strips_.resize(archive.ok() ? count : 0);
    next_ = 0;
  }
  for (auto s = next_; s < strips_.size(); ++s) {
    visit_points(archive, strips_[s].from, now_.count);
    visit_points(archive, strips_[s].to, now_.count);
    archive.flag(strips_[s].is_first);
  }
}

void BladeMotion::visit_state(world::StateArchive& archive, bool has_left) {
  auto count = static_cast<std::uint8_t>(now_.count);
  archive.value(count);
  if (archive.is_reading() && (count < 2 || count > kMaxEdgePoints)) archive.fail();
  if (!archive.ok()) return;
  anchor_.count = now_.count = count;
  visit_strips(archive);
  if (has_left) return;
  visit_points(archive, anchor_, count);
  visit_points(archive, now_, count);
  archive.value(heading_);
  if (archive.is_reading() && !is_place(heading_)) archive.fail();
  archive.value(ticks_);
  archive.flag(is_first_);
  if (archive.is_reading() && (!is_blade(anchor_.span()) || !is_blade(now_.span()))) archive.fail();
}

void Stroke::visit_patch(world::StateArchive& archive) {
  auto count = static_cast<std::uint8_t>(patch.size());
  archive.value(count);
  if (archive.is_reading()) {
    if (count > kMostTriangles) archive.fail();
    patch.resize(archive.ok() ? count : 0);
  }
  for (auto& triangle : patch) {
    for (auto& corner : triangle.corners) archive.value(corner);
    if (!archive.is_reading()) continue;
    const auto read = std::ranges::all_of(triangle.corners, is_place)
                          ? make_triangle(triangle.corners)
                          : std::nullopt;
    if (!read) return archive.fail();
    triangle = *read;
  }
}

void Stroke::visit_nodes(world::StateArchive& archive, const topology::Topology& topology) {
  const auto has = [&](NodeIndex n) {
    return n.value < topology.node_count() && topology.has_node(n);
  };
  visit_list(archive, labelled_, topology.node_count(), [&](NodeIndex n) {
    if (!has(n) || is_labelled(n)) return false;
    if (n.value >= labels_.size()) labels_.resize(topology.node_count());
    labels_[n.value] = 1;
    return true;
  });
  visit_list(archive, measured_, topology.node_count(), [&](NodeIndex n) {
    if (!has(n) || height(n).nearest_squared >= 0) return false;
    if (n.value >= heights_.size()) heights_.resize(topology.node_count());
    heights_[n.value].nearest_squared = 0;
    return true;
  });
  for (const auto node : measured_) {
    auto& own = heights_[node.value];
    archive.value(own.nearest_squared);
    archive.value(own.height);
    if (archive.is_reading() && (!is_size(own.nearest_squared) || !is_size(std::abs(own.height))))
      archive.fail();
  }
  if (!archive.is_reading()) {
    std::sort(fresh.begin(), fresh.end());
    fresh.erase(std::unique(fresh.begin(), fresh.end()), fresh.end());
  }
  visit_list(archive, fresh, topology.node_count(), has);
  if (!is_ascending(fresh)) archive.fail();
}

void Stroke::visit_tets(world::StateArchive& archive, const topology::Topology& topology) {
  const auto has = [&](TetIndex t) {
    return t.value < topology.tet_count() && topology.has_tet(t);
  };
  visit_list(archive, sided_, topology.tet_count(), [&](TetIndex t) {
    if (!has(t) || side(t) != 0) return false;
    if (t.value >= sides_.size()) sides_.resize(topology.tet_count());
    sides_[t.value] = 1;
    return true;
  });
  for (const auto tet : sided_) {
    auto& own = sides_[tet.value];
    archive.value(own);
    if (archive.is_reading() && own != 1 && own != -1) archive.fail();
  }
  visit_list(archive, waiting, topology.tet_count(), has);
  if (!is_ascending(waiting)) archive.fail();
}

void Stroke::visit_state(world::StateArchive& archive, const topology::Topology& topology) {
  motion.visit_state(archive, has_ended);
  if (!archive.ok()) return;
  for (auto* const value : {&h, &way}) {
    archive.value(*value);
    if (archive.is_reading() && !is_size(*value)) archive.fail();
  }
  archive.value(repairs);
  for (std::uint32_t i = 0; i + 1 < motion.points(); ++i) {
    archive.value(sides_before[i].normal);
    archive.flag(sides_before[i].is_on_other_hand);
    if (archive.is_reading() && !is_place(sides_before[i].normal)) archive.fail();
  }
  visit_patch(archive);
  visit_nodes(archive, topology);
  visit_tets(archive, topology);
}

}  // namespace trocar::cutting
