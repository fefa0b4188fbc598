#include "common/wire/quantise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numeric>

#include "common/base/assert.h"
#include "common/base/checksum.h"

namespace trocar::wire {
namespace {

static_assert(sizeof(QuantisedVertex) == 12, "the CRC covers x, y, z without padding");
static_assert(sizeof(Vec3f) == 12);

constexpr float kQuantaPerMetre = 31250.0f;  // exact; 1 / kQuantumMetres

// Without a branch, so that compilers can do eight at once. NaN keeps the old integer: no
// comparison with it holds.
std::int32_t with_hysteresis(float displacement_m, std::int32_t old) {
  constexpr float kLimit = static_cast<float>(kMaxQuanta);
  const float scaled = displacement_m * kQuantaPerMetre;
  const float above = scaled < -kLimit ? -kLimit : scaled;
  const float value = above > kLimit ? kLimit : above;
  const auto kept = static_cast<float>(old);
  const bool moved = std::fabs(value - kept) > kHysteresisQuanta;
  return static_cast<std::int32_t>(moved ? std::nearbyint(value) : kept);
}

// A fixed count is what makes this a vector loop at -O2.
template <std::size_t kVertices>
void quantise_batch(const Vec3f* displacements_m, QuantisedVertex* quantised) {
  std::array<float, 3 * kVertices> displacement;
  std::array<std::int32_t, 3 * kVertices> quanta;
  std::memcpy(displacement.data(), displacements_m, sizeof displacement);
  std::memcpy(quanta.data(), quantised, sizeof quanta);
  for (std::size_t i = 0; i < quanta.size(); ++i)
    quanta[i] = with_hysteresis(displacement[i], quanta[i]);
  std::memcpy(static_cast<void*>(quantised), quanta.data(), sizeof quanta);
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
  constexpr std::size_t kBatch = 8;
  std::size_t i = 0;
  for (; i + kBatch <= quantised.size(); i += kBatch)
    quantise_batch<kBatch>(&displacements_m[i], &quantised[i]);
  for (; i < quantised.size(); ++i) quantise_batch<1>(&displacements_m[i], &quantised[i]);
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
