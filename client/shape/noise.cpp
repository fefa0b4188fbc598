#include "client/shape/noise.h"

#include <algorithm>
#include <cmath>

#include "common/math/vec3.h"

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

// Slopes and heights as texels.
std::vector<std::uint8_t> texels_of(const std::vector<float>& height, std::size_t n, float slope) {
  const auto at = [&](std::size_t x, std::size_t y, std::size_t z) {
    return height[((z % n) * n + y % n) * n + x % n];
  };
  const auto texel = [](float v) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(v, 0.0f, 1.0f) * 255));
  };
  std::vector<std::uint8_t> texels;
  texels.reserve(n * n * n * 4);
  for (std::size_t z = 0; z < n; ++z)
    for (std::size_t y = 0; y < n; ++y)
      for (std::size_t x = 0; x < n; ++x) {
        texels.push_back(texel(0.5f + slope * (at(x + n - 1, y, z) - at(x + 1, y, z))));
        texels.push_back(texel(0.5f + slope * (at(x, y + n - 1, z) - at(x, y + 1, z))));
        texels.push_back(texel(0.5f + slope * (at(x, y, z + n - 1) - at(x, y, z + 1))));
        texels.push_back(texel(at(x, y, z)));
      }
  return texels;
}

// Heights of size^3 texels, x first.
template <typename Height>
std::vector<float> heights(int size, const Height& height) {
  std::vector<float> all;
  all.reserve(static_cast<std::size_t>(size) * static_cast<std::size_t>(size * size));
  for (int z = 0; z < size; ++z)
    for (int y = 0; y < size; ++y)
      for (int x = 0; x < size; ++x) all.push_back(height(x, y, z));
  return all;
}

// How much nearer the nearest of scattered points is than the next one (Worley 1996), in cells of
// which each has a point; `period` cells per tile.
float crease_distance(const Vec3f& p, int period) {
  float nearest = 9, next = 9;
  const int i = static_cast<int>(p.x), j = static_cast<int>(p.y), k = static_cast<int>(p.z);
  for (int c = 0; c < 27; ++c) {
    const int x = i + c % 3 - 1, y = j + c / 3 % 3 - 1, z = k + c / 9 - 1;
    const Vec3f point{static_cast<float>(x) + lattice(x, y, z, period, 0x51ed270bu),
                      static_cast<float>(y) + lattice(x, y, z, period, 0x2545f491u),
                      static_cast<float>(z) + lattice(x, y, z, period, 0x9e3779b1u)};
    const float apart = length(point - p);
    next = std::min(next, std::max(nearest, apart));
    nearest = std::min(nearest, apart);
  }
  return next - nearest;
}

}  // namespace

std::vector<std::uint8_t> make_tissue_noise(int size) {
  const auto relief = [&](int x, int y, int z) {
    float sum = 0, weight = 0.5f;
    for (int period = 4; period <= 16; period *= 2, weight *= 0.5f) {
      const float scale = static_cast<float>(period) / static_cast<float>(size);
      sum += weight * value_noise(static_cast<float>(x) * scale, static_cast<float>(y) * scale,
                                  static_cast<float>(z) * scale, period,
                                  0x9e3779b9u * static_cast<std::uint32_t>(period));
    }
    return std::clamp((sum / 0.875f - 0.5f) * 1.7f + 0.5f, 0.0f, 1.0f);
  };
  return texels_of(heights(size, relief), static_cast<std::size_t>(size), 2.2f);
}

std::vector<std::uint8_t> make_lobule_noise(int size) {
  constexpr int kPeriod = 10;
  const float scale = static_cast<float>(kPeriod) / static_cast<float>(size);
  const auto dome = [&](int x, int y, int z) {
    const Vec3f p{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
    return std::min(crease_distance(p * scale, kPeriod) * 1.15f, 1.0f);
  };
  return texels_of(heights(size, dome), static_cast<std::size_t>(size), 1.1f);
}

}  // namespace trocar::shape
