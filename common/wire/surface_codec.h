#pragma once

// The surface delta codec: changed vertices of a quantised surface against a named baseline.
//
// Layout (bits little-endian within bytes):
//   varint block_count, then per block of 64 vertex slots that has a change:
//     varint ((gap << 1) | is_full), gap = blocks skipped since the last one listed;
//     unless full: two u32 masks, low slots first.
//   Then groups of up to 16 changed vertices in slot order, never across a block:
//     2-bit mode, three 5-bit widths (x, y, z; at most 18), then per vertex three zig-zag integers
//     of those widths. With d = value - baseline, and prev the changed vertex before this one in
//     the payload (zero before the first, carried across groups and blocks): mode 0 temporal: d. 1
//     temporal+spatial: d - d(prev). 2 absolute+spatial: value - value(prev).
//   The bit stream is padded with zeros to a whole byte; the payload must be consumed exactly.
// The encoder takes the mode with the fewest bits per group, the lowest where they tie.
// For keyframes only mode 2 is allowed and all vertices are listed. Across an epoch both sides
// extend the baseline by zeros for the new slots: slots are append-only, so all modes stay right.
// Values lie within +-kMaxQuanta: quantise() clamps, the encoder asserts, the decoder rejects.
// Lossless; 0.95-1.25 bytes per changed vertex on smooth tissue at 62.5 Hz.

#include <span>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/wire/quantise.h"

namespace trocar::wire {

struct EncodeReport {
  std::size_t changed_vertices = 0;
};

// Appends the encoding of `current` against `baseline` (equal sizes) to `out`.
EncodeReport encode_delta(std::span<const QuantisedVertex> baseline,
                          std::span<const QuantisedVertex> current, Bytes& out);
// Appends a self-contained encoding of all vertices.
void encode_keyframe(std::span<const QuantisedVertex> current, Bytes& out);

// Applies a delta in place: `surface` holds the baseline on entry and the new frame on success. On
// error it is unchanged. Never reads outside `payload`, never writes outside `surface`, and rejects
// blocks, widths and values out of range, and trailing bytes. No allocation except for an error's
// text.
Status decode_delta(BytesView payload, std::span<QuantisedVertex> surface);
Status decode_keyframe(BytesView payload, std::span<QuantisedVertex> surface);

}  // namespace trocar::wire
