#include "common/math/morton.h"

#include <algorithm>
#include <numeric>

namespace trocar {
namespace {

// Spreads the low 21 bits of `v` to every third bit.
std::uint64_t spread_bits(std::uint64_t v) {
  v &= 0x1fffff;
  v = (v | v << 32) & 0x1f00000000ffff;
  v = (v | v << 16) & 0x1f0000ff0000ff;
  v = (v | v << 8) & 0x100f00f00f00f00f;
  v = (v | v << 4) & 0x10c30c30c30c30c3;
  v = (v | v << 2) & 0x1249249249249249;
  return v;
}

}  // namespace

std::uint64_t morton_code(std::uint64_t x, std::uint64_t y, std::uint64_t z) {
  return spread_bits(x) | spread_bits(y) << 1 | spread_bits(z) << 2;
}

std::vector<std::uint32_t> morton_order(std::span<const Vec3d> points) {
  std::vector<std::uint32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0u);
  if (order.empty()) return order;

  Vec3d low = points[0], high = low;
  for (const Vec3d& p : points) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  // One scale for all axes: cells of the curve are cubes.
  const Vec3d extent = high - low;
  const double largest = std::max({extent.x, extent.y, extent.z});
  const double scale = largest > 0 ? double{0x1fffff} / largest : 0.0;
  const auto cell = [scale](double offset) { return static_cast<std::uint64_t>(offset * scale); };

  std::vector<std::uint64_t> codes(order.size());
  for (std::size_t i = 0; i < codes.size(); ++i) {
    const Vec3d offset = points[i] - low;
    codes[i] = morton_code(cell(offset.x), cell(offset.y), cell(offset.z));
  }
  std::sort(order.begin(), order.end(), [&codes](std::uint32_t a, std::uint32_t b) {
    return codes[a] != codes[b] ? codes[a] < codes[b] : a < b;
  });
  return order;
}

}  // namespace trocar
