#include "server/tissue/bleeding/blood.h"

#include <algorithm>
#include <numeric>

#include "common/wire/surface_change.h"

namespace trocar::bleeding {
namespace {

constexpr std::int64_t kMostPl = std::int64_t{1} << 60;  // over a million litres

bool is_volume(std::int64_t pl) {
  return pl >= 0 && pl < kMostPl;
}

}  // namespace

void Blood::resize(std::size_t vertices) {
  for (std::size_t gone = vertices; gone < volume_pl.size(); ++gone) dripped_pl += volume_pl[gone];
  volume_pl.resize(vertices, 0);
  open.resize(vertices, 0);
  was_wound.resize(vertices, 0);
  levels.resize(vertices, 0);
}

std::int64_t Blood::on_surface_pl() const {
  return std::accumulate(volume_pl.begin(), volume_pl.end(), std::int64_t{0});
}

void Blood::update_hash(StateHasher& hasher) {
  hash_ = computed_hash(hasher);
}

std::uint64_t Blood::computed_hash(StateHasher& hasher) {
  if (volume_pl.empty()) return 0;
  hasher.reset();
  auto archive = world::StateArchive::hashing(hasher);
  visit_arrays(archive);
  return hasher.digest();
}

void Blood::visit_arrays(world::StateArchive& archive) {
  archive.sized_array(volume_pl, wire::kMaxSurfaceVertices);
  archive.sized_array(open, wire::kMaxSurfaceVertices);
  archive.sized_array(was_wound, wire::kMaxSurfaceVertices);
  archive.sized_array(levels, wire::kMaxSurfaceVertices);
  archive.sized_array(clip_vessel, kMostClips);
  archive.sized_array(clip_place_m, kMostClips);
  archive.sized_array(clip_reach_m, kMostClips);
  archive.sized_array(was_closed, kMaxTools);
  archive.value(shed_pl);
  archive.value(dripped_pl);
  archive.value(sucked_pl);
}

void Blood::visit_state(world::StateArchive& archive) {
  archive.value(hash_);
  if (archive.is_hashing()) return;
  visit_arrays(archive);
  if (!archive.is_reading() || !archive.ok()) return;
  StateHasher hasher;
  if (!is_whole() || hash_ != computed_hash(hasher)) archive.fail();
}

bool Blood::is_whole() const {
  const auto vertices = volume_pl.size();
  const bool has_sizes = open.size() == vertices && was_wound.size() == vertices &&
                         levels.size() == vertices && clip_place_m.size() == clip_vessel.size() &&
                         clip_reach_m.size() == clip_vessel.size() &&
                         was_closed.size() == static_cast<std::size_t>(kMaxTools);
  // Volumes are bounded one by one before they are added.
  const bool has_volumes = std::ranges::all_of(volume_pl, [](auto pl) {
    return is_volume(pl) && pl < kMostPl / std::int64_t{wire::kMaxSurfaceVertices};
  });
  return has_sizes && has_volumes && is_volume(shed_pl) && is_volume(dripped_pl) &&
         is_volume(sucked_pl) && shed_pl == on_surface_pl() + dripped_pl + sucked_pl &&
         std::ranges::all_of(open, [](auto o) { return o <= kFreshlyCut; }) &&
         std::ranges::all_of(clip_place_m, [](auto& p) { return is_finite(p); });
}

}  // namespace trocar::bleeding
