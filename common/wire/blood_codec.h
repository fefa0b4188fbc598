#pragma once

// How much blood lies on the surface, as one level per vertex: server, clients and journal agree on
// these bit for bit, as they do on the surface. A level is a film of 20 um; the last one, 5.1 mm,
// stands for all that is deeper.
//
// Layout of a delta against a named baseline, for the vertices that changed:
//   per block of 64 vertex slots that has a change: varint gap (blocks skipped since the last one
//   listed), u64 mask, low slots first, then one byte for each bit: the new level.
// Vertices that the baseline lacks count as dry in it, so a keyframe is a delta against nothing.

#include <cstdint>
#include <span>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"

namespace trocar::wire {

using BloodLevels = std::vector<std::uint8_t>;  // one per vertex slot

inline constexpr double kBloodLevelMetres = 20e-6;
inline constexpr std::uint8_t kMostBloodLevel = 255;

// Appends the levels that differ. `baseline` has at most as many as `current`.
void encode_blood(std::span<const std::uint8_t> baseline, std::span<const std::uint8_t> current,
                  Bytes& out);

// Applies a delta in place: `levels` holds the baseline on entry and the new levels on success. On
// error it is unchanged. Rejects blocks and bits beyond the surface, empty masks and trailing
// bytes.
Status decode_blood(BytesView payload, std::span<std::uint8_t> levels);

// CRC-32 over the levels.
std::uint32_t blood_crc(std::span<const std::uint8_t> levels);

}  // namespace trocar::wire
