#include "client/shape/blood_film.h"

#include <algorithm>
#include <cmath>

namespace trocar::shape {
namespace {

constexpr int kEvenings = 8;  // each reaches as far as a drawn triangle

float area_of(const Vec3f& a, const Vec3f& b, const Vec3f& c) {
  return 0.5f * length(cross(b - a, c - a));
}

}  // namespace

void BloodFilm::build(const SmoothSurface& surface, std::span<const Vec3f> rest) {
  const auto coarse = surface.coarse_triangles();
  const auto rim = surface.rim();
  const auto place = [&](std::uint32_t v) {
    return rest[v < rest.size() ? v : rim[v - rest.size()]];
  };
  const auto& triangles = surface.triangles();
  parts_ = coarse.empty() ? 1 : triangles.size() / coarse.size();
  triangle_areas_.clear();
  coarse_areas_.assign(rest.size() + rim.size(), 0);
  areas_.assign(surface.vertex_count(), 0);
  for (std::size_t i = 0; i < coarse.size(); ++i) {
    const auto& t = coarse[i];
    const float area = area_of(place(t[0]), place(t[1]), place(t[2]));
    triangle_areas_.push_back(area);
    for (const std::uint32_t v : t) coarse_areas_[v] += area / 3;
    const float part = area / static_cast<float>(parts_);
    for (std::size_t k = i * parts_; k < (i + 1) * parts_; ++k)
      for (const std::uint32_t v : triangles[k]) areas_[v] += part / 3;
  }
  depths_.assign(surface.vertex_count(), 0);
  is_dry_ = true;
}

void BloodFilm::share_out(const SmoothSurface& surface, std::span<const float> levels,
                          float level_m) {
  const std::size_t coarse = surface.coarse_vertex_count();
  const auto rim = surface.rim();
  for (std::size_t i = 0; i < coarse; ++i) depths_[i] = levels[i] * level_m;
  // Around each vertex of the rim, so much stands on the outside.
  around_.assign(coarse, 0);
  counts_.assign(coarse, 0);
  for (const auto& t : surface.coarse_triangles().first(surface.coarse_outer_count()))
    for (const std::uint32_t at : t)
      for (const std::uint32_t beside : t)
        if (surface.is_rim()[beside] == 0) around_[at] += depths_[beside], ++counts_[at];
  for (std::size_t i = 0; i < rim.size(); ++i) {
    const std::uint32_t outside = rim[i];
    const std::size_t inside = coarse + i;
    const float level = depths_[outside];
    const float volume = level * (coarse_areas_[outside] + coarse_areas_[inside]);
    const float mean =
        counts_[outside] == 0 ? 0 : around_[outside] / static_cast<float>(counts_[outside]);
    float& out = depths_[outside];
    out = std::min(mean, level);
    if (coarse_areas_[inside] > 0)
      depths_[inside] = (volume - out * coarse_areas_[outside]) / coarse_areas_[inside];
    else
      out = level, depths_[inside] = 0;
  }
}

void BloodFilm::even_out(const SmoothSurface& surface) {
  const auto& triangles = surface.triangles();
  volumes_.assign(depths_.size(), 0);
  for (std::size_t k = 0; k < triangles.size(); ++k) {
    const auto& [a, b, c] = triangles[k];
    const float sum = depths_[a] + depths_[b] + depths_[c];
    if (sum <= 0) continue;
    const float part = triangle_areas_[k / parts_] / static_cast<float>(parts_) * sum / 9;
    volumes_[a] += part, volumes_[b] += part, volumes_[c] += part;
  }
  for (std::size_t v = 0; v < depths_.size(); ++v)
    depths_[v] = areas_[v] > 0 ? volumes_[v] / areas_[v] : 0;
}

void BloodFilm::spread(const SmoothSurface& surface, std::span<const float> levels, float level_m) {
  const bool was_dry = is_dry_;
  is_dry_ = levels.size() != surface.coarse_vertex_count() ||
            std::ranges::none_of(levels, [](float level) { return level > 0; });
  if (is_dry_) {
    if (!was_dry) std::ranges::fill(depths_, 0.0f);
    return;
  }
  share_out(surface, levels, level_m);
  surface.extend_midpoints(depths_);
  for (int i = 0; i < kEvenings; ++i) even_out(surface);
}

double BloodFilm::volume_m3() const {
  double sum = 0;
  for (std::size_t v = 0; v < depths_.size(); ++v)
    sum += static_cast<double>(depths_[v]) * static_cast<double>(areas_[v]);
  return sum;
}

std::array<std::int8_t, 4> lip_bytes(const Vec3f& lip, float depth_m) {
  const auto byte = [](float value) { return static_cast<std::int8_t>(value * 127); };
  const float share = std::cbrt(std::clamp(depth_m / kDeepestFilmMetres, 0.0f, 1.0f));
  return {byte(lip.x), byte(lip.y), byte(lip.z), static_cast<std::int8_t>(share * 127 + 0.5f)};
}

}  // namespace trocar::shape
