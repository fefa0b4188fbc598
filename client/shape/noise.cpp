#include "client/shape/noise.h"

#include <algorithm>
#include <cmath>

namespace trocar::shape {
namespace {

float lattice(int x, int y, int z, int period, std::uint32_t seed) {
  const auto wrap = [&](int v) {
    return static_cast<std::uint32_t>((v % period + period) % period);
  };
  std::uint32_t h =
      seed ^ (wrap(x) * 0x8da6b343u) ^ (wrap(y) * 0xd8163841u) ^ (wrap(z) * 0xcb1ab31fu);
  h = (h ^ (h >> 15)) * 0x2c1b3c6du;
  h = (h ^ (h >> 12)) * 0x297a2d39u;
  return static_cast<float>((h ^ (h >> 15)) & 0xffffu) / 65535.0f;
}

// Smoothly interpolated lattice values with `period` cells per tile.
float value_noise(float x, float y, float z, int period, std::uint32_t seed) {
  const auto cell = [](float v) { return static_cast<int>(std::floor(v)); };
  const int i = cell(x), j = cell(y), k = cell(z);
  const auto fade = [](float t) { return t * t * t * (t * (t * 6 - 15) + 10); };
  const float u = fade(x - static_cast<float>(i)), v = fade(y - static_cast<float>(j)),
              w = fade(z - static_cast<float>(k));
  float sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const int a = corner & 1, b = (corner >> 1) & 1, c = corner >> 2;
    sum += (a ? u : 1 - u) * (b ? v : 1 - v) * (c ? w : 1 - w) *
           lattice(i + a, j + b, k + c, period, seed);
  }
  return sum;
}

}  // namespace

std::vector<std::uint8_t> make_tissue_noise(int size) {
  const auto n = static_cast<std::size_t>(size);
  std::vector<float> height(n * n * n);
  for (int z = 0; z < size; ++z)
    for (int y = 0; y < size; ++y)
      for (int x = 0; x < size; ++x) {
        float sum = 0, weight = 0.5f;
        for (int period = 4; period <= 16; period *= 2, weight *= 0.5f) {
          const float scale = static_cast<float>(period) / static_cast<float>(size);
          sum += weight * value_noise(static_cast<float>(x) * scale, static_cast<float>(y) * scale,
                                      static_cast<float>(z) * scale, period,
                                      0x9e3779b9u * static_cast<std::uint32_t>(period));
        }
        height[(static_cast<std::size_t>(z) * n + static_cast<std::size_t>(y)) * n +
               static_cast<std::size_t>(x)] =
            std::clamp((sum / 0.875f - 0.5f) * 1.7f + 0.5f, 0.0f, 1.0f);
      }
  const auto at = [&](std::size_t x, std::size_t y, std::size_t z) {
    return height[((z % n) * n + y % n) * n + x % n];
  };
  const auto texel = [](float v) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(v, 0.0f, 1.0f) * 255));
  };
  std::vector<std::uint8_t> texels;
  texels.reserve(n * n * n * 4);
  constexpr float kSlope = 2.2f;
  for (std::size_t z = 0; z < n; ++z)
    for (std::size_t y = 0; y < n; ++y)
      for (std::size_t x = 0; x < n; ++x) {
        texels.push_back(texel(0.5f + kSlope * (at(x + n - 1, y, z) - at(x + 1, y, z))));
        texels.push_back(texel(0.5f + kSlope * (at(x, y + n - 1, z) - at(x, y + 1, z))));
        texels.push_back(texel(0.5f + kSlope * (at(x, y, z + n - 1) - at(x, y, z + 1))));
        texels.push_back(texel(at(x, y, z)));
      }
  return texels;
}

}  // namespace trocar::shape
