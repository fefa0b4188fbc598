#include "server/tissue/bleeding/film.h"

#include <algorithm>

#include "server/tissue/bleeding/rules.h"

namespace trocar::bleeding {
namespace {

constexpr double kShortestM = 1e-4;     // vertices are as good as apart by so much
constexpr double kMostShare = 0.5;      // of what can move, in one frame: stability
constexpr double kLevelShare = 0.0625;  // of the drop to a neighbour, on each of its triangles

}  // namespace

double depth_m(const Blood& blood, const SurfaceGraph& graph, std::uint32_t vertex) {
  const double area = graph.area_m2(vertex);
  if (!(area > 0)) return 0;
  return static_cast<double>(blood.volume_pl[vertex]) / (kPicolitresPerCubicMetre * area);
}

double film_speed_m_s(double depth_m, double slope) {
  return kBloodDensity * kGravity * depth_m * depth_m * std::min(slope, 1.0) /
         (3 * kBloodViscosity);
}

// Blood that the surface bears runs towards all places that are lower with the film on them, and so
// becomes level; blood that hangs, towards all places that are lower.
void Film::find_ways(const SurfaceGraph& graph, const SurfacePlaces& places, const Blood& blood,
                     std::uint32_t vertex) {
  ways_.clear();
  sum_of_slopes_ = steepest_ = steepest_length_m_ = 0;
  const Vec3d here = places[vertex];
  Vec3d normal;
  graph.each_triangle(vertex, [&](std::uint32_t a, std::uint32_t b) {
    normal += cross(places[a] - here, places[b] - here);
  });
  hangs_ = normal.y < 0;
  const auto film = [&](std::uint32_t of) { return hangs_ ? 0 : depth_m(blood, graph, of); };
  const double head = here.y + film(vertex);
  const auto look_at = [&](std::uint32_t to) {
    const Vec3d there = places[to];
    const double drop = head - (there.y + film(to));
    if (!(drop > 0)) return;
    const double way = std::max(length(there - here), kShortestM);
    const double slope = drop / way;
    ways_.push_back({to, drop, slope});
    sum_of_slopes_ += slope;
    if (slope > steepest_) steepest_ = slope, steepest_length_m_ = way;
  };
  graph.each_triangle(vertex, [&](std::uint32_t a, std::uint32_t b) {
    look_at(a);
    look_at(b);
  });
}

void Film::run(const SurfaceGraph& graph, const SurfacePlaces& places, Blood& blood,
               std::vector<std::uint32_t>& wet, std::vector<std::uint8_t>& is_wet) {
  moves_.clear();
  for (const auto vertex : wet) {
    const double area = graph.area_m2(vertex);
    const double free_m = depth_m(blood, graph, vertex) - kStayingFilmM;
    if (!(free_m > 0)) continue;
    const double free_pl = free_m * area * kPicolitresPerCubicMetre;
    find_ways(graph, places, blood, vertex);
    if (ways_.empty()) {
      if (free_m <= kHangingFilmM || !hangs_) continue;
      moves_.push_back({vertex, vertex, static_cast<std::int64_t>(free_pl)});
      continue;
    }
    const double speed = film_speed_m_s(free_m, steepest_);
    const double share = std::min(kMostShare, speed * kFrameSeconds / steepest_length_m_);
    for (const Way& way : ways_) {
      const double smaller = std::min(area, graph.area_m2(way.to));
      const double levelling = kLevelShare * way.drop_m * smaller * kPicolitresPerCubicMetre;
      const double out = free_pl * share * way.slope / sum_of_slopes_;
      const auto pl = static_cast<std::int64_t>(std::min(out, levelling));
      if (pl > 0) moves_.push_back({vertex, way.to, pl});
    }
  }
  // All of it follows from the heads before, in whichever order.
  for (const Move& move : moves_) {
    blood.volume_pl[move.from] -= move.pl;
    if (move.from == move.to) {
      blood.dripped_pl += move.pl;
      continue;
    }
    blood.volume_pl[move.to] += move.pl;
    if (is_wet[move.to] != 0) continue;
    is_wet[move.to] = 1;
    wet.push_back(move.to);
  }
}

}  // namespace trocar::bleeding
