#pragma once

// The surface delta codec: changed vertices of a quantised surface against a named baseline.
//
// Layout (bits little-endian within bytes):
//   varint block_count, then per block of 64 vertex slots that has a change:
//     varint ((gap << 1) | is_full), gap = blocks skipped since the last one listed;
//     unless full: two u32 masks, low slots first.
//   Then groups of up to 16 changed vertices in slot order, never across a block:
//     2-bit mode, three 5-bit widths (x, y, z), then per vertex three zig-zag integers of that width.
//     Mode 0 temporal: value - baseline. 1 temporal+spatial: minus the previous changed vertex's
//     temporal difference. 2 absolute+spatial: value minus the previous changed vertex's value.
//   The bit stream is padded to a whole byte; the payload must be consumed exactly.
// Across an epoch, and for keyframes, only mode 2 is allowed and all vertices are listed.
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
// blocks, widths and values out of range, and trailing bytes.
Status decode_delta(BytesView payload, std::span<QuantisedVertex> surface);
Status decode_keyframe(BytesView payload, std::span<QuantisedVertex> surface);

}  // namespace trocar::wire
