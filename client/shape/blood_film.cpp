#include "client/shape/blood_film.h"

#include <cmath>

namespace trocar::shape {

float cover_of(float depth_m) {
  return 1 - std::exp(-depth_m / kCoveringMetres);
}

void cover_with_blood(const SmoothSurface& surface, std::span<const float> levels, float level_m,
                      std::vector<float>& covers) {
  covers.assign(surface.vertex_count(), 0);
  if (levels.size() != surface.coarse_vertex_count()) return;
  for (std::size_t i = 0; i < levels.size(); ++i)
    if (levels[i] > 0) covers[i] = cover_of(levels[i] * level_m);
  surface.extend_values(covers);
}

std::array<std::int8_t, 4> lip_bytes(const Vec3f& lip, float cover) {
  const auto byte = [](float value) { return static_cast<std::int8_t>(value * 127); };
  return {byte(lip.x), byte(lip.y), byte(lip.z), byte(cover)};
}

}  // namespace trocar::shape
