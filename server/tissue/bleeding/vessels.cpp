#include "server/tissue/bleeding/vessels.h"

#include <algorithm>
#include <cmath>

namespace trocar::bleeding {
namespace {

// A triangle is looked at in so many rows of small equal ones.
constexpr int kRows = 8;
// A clip closes what is open this much farther away than it reached itself.
constexpr double kClipBesideM = 0.002;

bool is_clipped(const Mouth& mouth, const Blood& blood) {
  for (std::size_t i = 0; i < blood.clip_vessel.size(); ++i)
    if (blood.clip_vessel[i] == mouth.vessel &&
        length(mouth.rest_m - blood.clip_place_m[i]) <= blood.clip_reach_m[i])
      return true;
  return false;
}

// The part of a triangle, at rest, that lies within.
Mouth mouth_of(const Vessel& vessel, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  int inside = 0;
  Vec3d sum;
  const Vec3d u = (b - a) / kRows, v = (c - a) / kRows;
  const auto look_at = [&](double i, double j) {
    const Vec3d place = a + u * i + v * j;
    if (vessel.distance_m(place) > 0) return;
    ++inside;
    sum += place;
  };
  for (int i = 0; i < kRows; ++i)
    for (int j = 0; i + j < kRows; ++j) {
      look_at(i + 1.0 / 3, j + 1.0 / 3);
      if (i + j + 1 < kRows) look_at(i + 2.0 / 3, j + 2.0 / 3);
    }
  Mouth mouth;
  if (inside == 0) return mouth;
  mouth.area_m2 = length(cross(b - a, c - a)) / 2 * inside / (kRows * kRows);
  mouth.rest_m = sum / inside;
  return mouth;
}

}  // namespace

double outflow_m3_s(const Vessel& vessel, double area_m2) {
  if (!(area_m2 > 0)) return 0;
  const double resistance = vessel.pressure_pa / vessel.most_flow_m3_s;
  const double through = kOrificeCoefficient * area_m2;
  const double loss = kBloodDensity / (2 * through * through);
  const double root = std::sqrt(resistance * resistance + 4 * loss * vessel.pressure_pa);
  return 2 * vessel.pressure_pa / (resistance + root);
}

void OpenVessels::add(const Rules& rules, const wire::SurfaceLayout& layout, std::size_t first) {
  for (std::size_t triangle = first; triangle < layout.triangles.size(); ++triangle) {
    if (layout.is_wound[triangle] == 0 || !layout.has_triangle(TriangleIndex(triangle))) continue;
    const auto& corners = layout.triangles[triangle];
    const Vec3d a = layout.rest_m(corners[0]), b = layout.rest_m(corners[1]),
                c = layout.rest_m(corners[2]);
    const Vec3d middle = (a + b + c) / 3;
    const double around = std::max({length(a - middle), length(b - middle), length(c - middle)});
    for (std::uint32_t vessel = 0; vessel < rules.vessels.size(); ++vessel) {
      if (rules.vessels[vessel].distance_m(middle) > around) continue;
      auto mouth = mouth_of(rules.vessels[vessel], a, b, c);
      if (!(mouth.area_m2 > 0)) continue;
      mouth.triangle = static_cast<std::uint32_t>(triangle);
      mouth.vessel = vessel;
      mouths_.push_back(mouth);
    }
  }
}

void OpenVessels::remove_gone(const wire::SurfaceLayout& layout) {
  std::erase_if(mouths_, [&](const Mouth& mouth) {
    return !layout.has_triangle(TriangleIndex(mouth.triangle));
  });
}

Vec3d OpenVessels::middle_of(const Mouth& mouth, const SurfaceGraph& graph,
                             const SurfacePlaces& places) const {
  const auto& corners = graph.corners(mouth.triangle);
  return (places[corners[0].value] + places[corners[1].value] + places[corners[2].value]) / 3;
}

void OpenVessels::set_clips(const Instruments& instruments, const SurfaceGraph& graph,
                            const SurfacePlaces& places, Blood& blood) const {
  for (const auto& clipper : instruments.clippers) {
    if (blood.was_closed[clipper.tool] != 0 || blood.clip_vessel.size() >= kMostClips) continue;
    const Mouth* nearest = nullptr;
    double nearest_m = clipper.reach_m;
    for (const auto& mouth : mouths_) {
      const double apart = length(middle_of(mouth, graph, places) - clipper.tip_m);
      if (apart < nearest_m && !is_clipped(mouth, blood)) nearest = &mouth, nearest_m = apart;
    }
    if (nearest == nullptr) continue;
    blood.clip_vessel.push_back(nearest->vessel);
    blood.clip_place_m.push_back(nearest->rest_m);
    blood.clip_reach_m.push_back(clipper.reach_m + kClipBesideM);
  }
  std::ranges::fill(blood.was_closed, std::uint8_t{0});
  for (const auto& clipper : instruments.clippers) blood.was_closed[clipper.tool] = 1;
}

std::uint32_t OpenVessels::bleed(const Rules& rules, const Instruments& instruments,
                                 const SurfaceGraph& graph, const SurfacePlaces& places,
                                 Blood& blood, std::vector<std::uint32_t>& wetted) {
  open_m2_.assign(mouths_.size(), 0);
  for (std::size_t i = 0; i < mouths_.size(); ++i) {
    const auto& mouth = mouths_[i];
    const double pressure = rules.vessels[mouth.vessel].pressure_pa;
    const bool is_shut = is_clipped(mouth, blood) ||
                         instruments.is_pressed(middle_of(mouth, graph, places), pressure);
    open_m2_[i] = is_shut ? 0 : mouth.area_m2;
  }
  std::uint32_t bleeding = 0;
  for (std::uint32_t vessel = 0; vessel < rules.vessels.size(); ++vessel) {
    double area = 0;
    for (std::size_t i = 0; i < mouths_.size(); ++i)
      if (mouths_[i].vessel == vessel) area += open_m2_[i];
    const double out_pl =
        outflow_m3_s(rules.vessels[vessel], area) * kFrameSeconds * kPicolitresPerCubicMetre;
    bleeding += area > 0;
    for (std::size_t i = 0; i < mouths_.size() && area > 0; ++i) {
      if (mouths_[i].vessel != vessel) continue;
      const auto third = static_cast<std::int64_t>(out_pl * open_m2_[i] / area / 3);
      for (const auto corner : graph.corners(mouths_[i].triangle)) {
        blood.volume_pl[corner.value] += third;
        blood.shed_pl += third;
        wetted.push_back(corner.value);
      }
    }
  }
  return bleeding;
}

}  // namespace trocar::bleeding
