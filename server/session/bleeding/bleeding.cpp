#include "server/session/bleeding/bleeding.h"

#include <algorithm>
#include <cmath>
#include <string>
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

void Bleeding::observe(step::PublishedFrame& frame, const wire::SurfaceLayout& layout,
                       const hands::ToolTable& tools) {
  use_marks(frame);
  follow_surface(frame, layout);
  const auto shed_before = blood_.shed_pl;
  instruments_.read(frame.tools, tools);
  const SurfacePlaces places(layout, frame.surface);
  vessels_.set_clips(instruments_, graph_, places, blood_);
  ooze(places);
  wetted_.clear();
  const auto open_vessels = vessels_.bleed(rules_, instruments_, graph_, places, blood_, wetted_);
  for (const auto vertex : wetted_) wet(vertex);
  film_.run(graph_, places, blood_, wet_, is_wet_);
  suck(places);
  publish(frame, shed_before, open_vessels);
}

void Bleeding::use_marks(const step::PublishedFrame& frame) {
  for (const auto& event : frame.mark_events) {
    if (!event.is_done) continue;
    auto& marked = marked_[event.number];
    if (event.action == hands::MarkAction::Set) marked = blood_;
    if (event.action != hands::MarkAction::Return) continue;
    blood_ = marked.value_or(Blood{});
    epoch_.reset();
  }
}

void Bleeding::follow_surface(const step::PublishedFrame& frame,
                              const wire::SurfaceLayout& layout) {
  const bool is_same = epoch_ == layout.epoch && triangles_ == layout.triangles.size() &&
                       !frame.change && !frame.new_layout;
  if (is_same) return;
  const bool follows = epoch_ && frame.change && !frame.new_layout &&
                       frame.change->from_epoch == *epoch_ &&
                       triangles_ + frame.change->added.size() == layout.triangles.size();
  if (!follows) {
    graph_.rebuild(layout);
    vessels_.clear();
    triangles_ = 0;
    sources_.clear(), wet_.clear();
    is_source_.clear(), is_wet_.clear();
  } else {
    graph_.apply(*frame.change, layout);
    vessels_.remove_gone(layout);
  }
  vessels_.add(rules_, layout, triangles_);
  triangles_ = layout.triangles.size();
  epoch_ = layout.epoch;
  blood_.resize(layout.vertex_count());
  is_source_.resize(layout.vertex_count(), 0);
  is_wet_.resize(layout.vertex_count(), 0);
  for (const auto vertex : graph_.changed()) refresh_vertex(vertex);
}

void Bleeding::refresh_vertex(std::uint32_t vertex) {
  auto& volume = blood_.volume_pl[vertex];
  if (!(graph_.area_m2(vertex) > 0)) blood_.dripped_pl += std::exchange(volume, 0);
  if (volume > 0 || blood_.levels[vertex] != 0) wet(vertex);
  if (graph_.wound_m2(vertex) > 0 && blood_.was_wound[vertex] == 0) {
    blood_.was_wound[vertex] = 1;
    blood_.open[vertex] = kFreshlyCut;
  }
  if (blood_.open[vertex] == 0 || is_source_[vertex] != 0) return;
  is_source_[vertex] = 1;
  sources_.push_back(vertex);
}

void Bleeding::wet(std::uint32_t vertex) {
  if (is_wet_[vertex] != 0) return;
  is_wet_[vertex] = 1;
  wet_.push_back(vertex);
}

void Bleeding::ooze(const SurfacePlaces& places) {
  const double kept = 1 - kFrameSeconds / rules_.clotting_time_s;
  const double per_area_pl = rules_.ooze_m_s * kFrameSeconds * kPicolitresPerCubicMetre;
  oozing_ = 0;
  std::erase_if(sources_, [&](std::uint32_t vertex) {
    auto& open = blood_.open[vertex];
    const Vec3d place = places[vertex];
    if (instruments_.is_coagulated(place)) open = 0;
    if (open != 0 && !instruments_.is_pressed(place, rules_.ooze_pressure_pa)) {
      const auto pl =
          static_cast<std::int64_t>(per_area_pl * graph_.wound_m2(vertex) * open / kFreshlyCut);
      blood_.volume_pl[vertex] += pl;
      blood_.shed_pl += pl;
      if (pl > 0) wet(vertex), ++oozing_;
    }
    open = static_cast<std::uint32_t>(open * kept);
    if (open < kClotted) open = 0;
    if (open != 0) return false;
    is_source_[vertex] = 0;
    return true;
  });
}

void Bleeding::suck(const SurfacePlaces& places) {
  for (const auto& suction : instruments_.suctions)
    for (const auto vertex : wet_) {
      auto& volume = blood_.volume_pl[vertex];
      const double apart = length_squared(places[vertex] - suction.tip_m);
      if (volume == 0 || apart > suction.reach_m * suction.reach_m) continue;
      const auto taken = std::min(volume, volume / kSuctionPart + kSuctionRestPl);
      volume -= taken;
      blood_.sucked_pl += taken;
    }
}

void Bleeding::publish(step::PublishedFrame& frame, std::int64_t shed_before_pl,
                       std::uint32_t open_vessels) {
  std::erase_if(wet_, [&](std::uint32_t vertex) {
    auto& level = blood_.levels[vertex];
    level = level_of(depth_m(blood_, graph_, vertex), level);
    if (blood_.volume_pl[vertex] > 0) return false;
    is_wet_[vertex] = 0;
    return true;
  });
  frame.blood = blood_.levels;
  frame.blood_crc = wire::blood_crc(frame.blood);
  const auto nl = [](std::int64_t pl) { return static_cast<std::uint64_t>(pl / 1000); };
  const auto on_surface = blood_.shed_pl - blood_.dripped_pl - blood_.sucked_pl;
  const auto shed_now = static_cast<double>(blood_.shed_pl - shed_before_pl);
  frame.figures.blood = {.shed_nl = nl(blood_.shed_pl),
                         .on_surface_nl = nl(on_surface),
                         .dripped_nl = nl(blood_.dripped_pl),
                         .sucked_nl = nl(blood_.sucked_pl),
                         .rate_nl_s = static_cast<std::uint64_t>(shed_now * 1e-3 / kFrameSeconds),
                         .sources = oozing_,
                         .open_vessels = open_vessels};
}

void Bleeding::visit_state(world::StateArchive& archive) {
  blood_.visit_state(archive);
  for (auto& marked : marked_) {
    bool has_mark = marked.has_value();
    archive.flag(has_mark);
    if (!has_mark) marked.reset();
    if (has_mark && !marked) marked.emplace();
    if (marked) marked->visit_state(archive);
  }
}

void Bleeding::write_state(Bytes& out) {
  auto archive = world::StateArchive::writing(out);
  visit_state(archive);
}

Status Bleeding::restore_state(BytesView bytes) {
  Bleeding read(rules_);
  auto archive = world::StateArchive::reading(bytes);
  read.visit_state(archive);
  if (!archive.ok() || !archive.at_end())
    return Error{ErrorCode::BadFile,
                 "bleeding: " + std::to_string(bytes.size()) + " bytes do not hold a state of it"};
  blood_ = std::move(read.blood_);
  marked_ = std::move(read.marked_);
  epoch_.reset();
  return {};
}

}  // namespace trocar::bleeding
