#include "server/tissue/bleeding/bleeding.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace trocar::bleeding {
namespace {

// A wound that gives less than this part of its first flow has clotted.
constexpr std::uint32_t kClotted = kFreshlyCut / 1000;
// A level stays until the film is this many levels away from it: still pools do not flicker.
constexpr double kLevelHysteresis = 0.75;
// Suction takes this part of what is in reach in a frame, and the rest of what is hardly there.
constexpr std::int64_t kSuctionPart = 4, kSuctionRestPl = 2'000'000;

std::uint8_t level_of(double depth, std::uint8_t before) {
  const double exact = std::min(depth / wire::kBloodLevelMetres, double{wire::kMostBloodLevel});
  if (depth > 0 && std::abs(exact - before) <= kLevelHysteresis) return before;
  return static_cast<std::uint8_t>(std::floor(exact + 0.5));
}

}  // namespace

wire::BloodFigures Bleeding::run(const FrameSurface& surface, std::span<const ToolAtWork> tools,
                                 Blood& blood) {
  follow(surface, blood);
  const auto shed_before_pl = blood.shed_pl;
  instruments_.read(tools);
  const SurfacePlaces places(surface.layout, surface.displacements);
  vessels_.set_clips(instruments_, graph_, places, blood);
  ooze(places, blood);
  wetted_.clear();
  const auto open_vessels = vessels_.bleed(rules_, instruments_, graph_, places, blood, wetted_);
  for (const auto vertex : wetted_) wet(vertex);
  film_.run(graph_, places, blood, wet_, is_wet_);
  suck(places, blood);
  set_levels(blood);
  blood.update_hash(hasher_);
  const auto nl = [](std::int64_t pl) { return static_cast<std::uint64_t>(pl / 1000); };
  const auto shed_now = static_cast<double>(blood.shed_pl - shed_before_pl);
  return {.shed_nl = nl(blood.shed_pl),
          .on_surface_nl = nl(blood.shed_pl - blood.dripped_pl - blood.sucked_pl),
          .dripped_nl = nl(blood.dripped_pl),
          .sucked_nl = nl(blood.sucked_pl),
          .rate_nl_s = static_cast<std::uint64_t>(shed_now * 1e-3 / kFrameSeconds),
          .sources = oozing_,
          .open_vessels = open_vessels};
}

void Bleeding::follow(const FrameSurface& surface, Blood& blood) {
  const auto& layout = surface.layout;
  const auto* change = surface.change;
  const bool is_same = epoch_ == layout.epoch && triangles_ == layout.triangles.size() &&
                       change == nullptr && !surface.is_another;
  if (is_same) return;
  const bool follows = epoch_ && change != nullptr && !surface.is_another &&
                       change->from_epoch == *epoch_ &&
                       triangles_ + change->added.size() == layout.triangles.size();
  if (!follows) {
    graph_.rebuild(layout);
    vessels_.clear();
    triangles_ = 0;
    sources_.clear(), wet_.clear();
    is_source_.clear(), is_wet_.clear();
  } else {
    graph_.apply(*change, layout);
    vessels_.remove_gone(layout);
  }
  vessels_.add(rules_, layout, triangles_);
  triangles_ = layout.triangles.size();
  epoch_ = layout.epoch;
  blood.resize(layout.vertex_count());
  is_source_.resize(layout.vertex_count(), 0);
  is_wet_.resize(layout.vertex_count(), 0);
  for (const auto vertex : graph_.changed()) refresh_vertex(vertex, blood);
}

void Bleeding::refresh_vertex(std::uint32_t vertex, Blood& blood) {
  auto& volume = blood.volume_pl[vertex];
  if (!(graph_.area_m2(vertex) > 0)) blood.dripped_pl += std::exchange(volume, 0);
  if (volume > 0 || blood.levels[vertex] != 0) wet(vertex);
  if (graph_.wound_m2(vertex) > 0 && blood.was_wound[vertex] == 0) {
    blood.was_wound[vertex] = 1;
    blood.open[vertex] = kFreshlyCut;
  }
  if (blood.open[vertex] == 0 || is_source_[vertex] != 0) return;
  is_source_[vertex] = 1;
  sources_.push_back(vertex);
}

void Bleeding::wet(std::uint32_t vertex) {
  if (is_wet_[vertex] != 0) return;
  is_wet_[vertex] = 1;
  wet_.push_back(vertex);
}

void Bleeding::ooze(const SurfacePlaces& places, Blood& blood) {
  const double kept = 1 - kFrameSeconds / rules_.clotting_time_s;
  const double per_area_pl = rules_.ooze_m_s * kFrameSeconds * kPicolitresPerCubicMetre;
  oozing_ = 0;
  std::erase_if(sources_, [&](std::uint32_t vertex) {
    auto& open = blood.open[vertex];
    const Vec3d place = places[vertex];
    if (instruments_.is_coagulated(place)) open = 0;
    if (open != 0 && !instruments_.is_pressed(place, rules_.ooze_pressure_pa)) {
      const auto pl =
          static_cast<std::int64_t>(per_area_pl * graph_.wound_m2(vertex) * open / kFreshlyCut);
      blood.volume_pl[vertex] += pl;
      blood.shed_pl += pl;
      if (pl > 0) wet(vertex), ++oozing_;
    }
    open = static_cast<std::uint32_t>(open * kept);
    if (open < kClotted) open = 0;
    if (open != 0) return false;
    is_source_[vertex] = 0;
    return true;
  });
}

void Bleeding::suck(const SurfacePlaces& places, Blood& blood) {
  for (const auto& suction : instruments_.suctions)
    for (const auto vertex : wet_) {
      auto& volume = blood.volume_pl[vertex];
      const double apart = length_squared(places[vertex] - suction.tip_m);
      if (volume == 0 || apart > suction.reach_m * suction.reach_m) continue;
      const auto taken = std::min(volume, volume / kSuctionPart + kSuctionRestPl);
      volume -= taken;
      blood.sucked_pl += taken;
    }
}

void Bleeding::set_levels(Blood& blood) {
  std::erase_if(wet_, [&](std::uint32_t vertex) {
    auto& level = blood.levels[vertex];
    level = level_of(depth_m(blood, graph_, vertex), level);
    if (blood.volume_pl[vertex] > 0) return false;
    is_wet_[vertex] = 0;
    return true;
  });
}

}  // namespace trocar::bleeding
