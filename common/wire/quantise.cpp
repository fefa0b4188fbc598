#include "common/wire/quantise.h"

#include <array>
#include <cmath>
#include <cstring>

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

}  // namespace trocar::wire
