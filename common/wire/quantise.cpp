#include "common/wire/quantise.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/base/assert.h"
#include "common/base/checksum.h"

namespace trocar::wire {
namespace {

static_assert(sizeof(QuantisedVertex) == 12, "the CRC covers x, y, z without padding");
static_assert(sizeof(Vec3f) == 12);

constexpr float kQuantaPerMetre = 31250.0f;  // exact; 1 / kQuantumMetres

// NaN keeps the old integer: the comparison is false.
std::int32_t with_hysteresis(float displacement_m, std::int32_t old) {
  const float limit = static_cast<float>(kMaxQuanta);
  const float value = std::clamp(displacement_m * kQuantaPerMetre, -limit, limit);
  const bool moved = std::fabs(value - static_cast<float>(old)) > kHysteresisQuanta;
  return moved ? static_cast<std::int32_t>(std::nearbyint(value)) : old;
}

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

void quantise(std::span<const Vec3f> displacements_m, std::span<QuantisedVertex> quantised) {
  TROCAR_ASSERT(displacements_m.size() == quantised.size());
  for (std::size_t i = 0; i < quantised.size(); ++i) {
    const Vec3f& d = displacements_m[i];
    QuantisedVertex& q = quantised[i];
    q = {with_hysteresis(d.x, q.x), with_hysteresis(d.y, q.y), with_hysteresis(d.z, q.z)};
  }
}

std::vector<QuantisedVertex> quantise_rest(std::span<const Vec3d> rest_positions_m) {
  const auto round = [](double metres) {
    return static_cast<std::int32_t>(std::nearbyint(metres * double{kQuantaPerMetre}));
  };
  std::vector<QuantisedVertex> quantised;
  quantised.reserve(rest_positions_m.size());
  for (const Vec3d& p : rest_positions_m) quantised.push_back({round(p.x), round(p.y), round(p.z)});
  return quantised;
}

std::uint32_t surface_crc(std::span<const QuantisedVertex> surface) {
  return crc32(bytes_of(surface));
}

std::vector<std::uint32_t> morton_order(std::span<const Vec3d> rest_positions_m) {
  std::vector<std::uint32_t> order(rest_positions_m.size());
  std::iota(order.begin(), order.end(), 0u);
  if (order.empty()) return order;

  Vec3d low = rest_positions_m[0], high = low;
  for (const Vec3d& p : rest_positions_m) {
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
    const Vec3d offset = rest_positions_m[i] - low;
    codes[i] = spread_bits(cell(offset.x)) | spread_bits(cell(offset.y)) << 1 |
               spread_bits(cell(offset.z)) << 2;
  }
  std::sort(order.begin(), order.end(), [&codes](std::uint32_t a, std::uint32_t b) {
    return codes[a] != codes[b] ? codes[a] < codes[b] : a < b;
  });
  return order;
}

}  // namespace trocar::wire
