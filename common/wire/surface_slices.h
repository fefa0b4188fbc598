#pragma once

// A surface delta in parts that fit datagrams and decode alone, each of them the surface codec's
// delta of a run of whole blocks of 64 vertices. A surface without changes has one part.

#include <cstdint>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/wire/blood_codec.h"
#include "common/wire/quantise.h"

namespace trocar::wire {

inline constexpr std::uint32_t kMaxSlices = 64;

struct SurfaceSlice {
  std::uint32_t first_vertex = 0;  // a multiple of 64
  std::uint32_t vertices = 0;
  Bytes payload;
  Bytes blood;  // levels of these vertices (blood_codec.h), where the session bleeds
};

// The levels of the two surfaces; empty in a session that does not bleed. Vertices that the
// baseline lacks are dry in it.
struct SlicedBlood {
  std::span<const std::uint8_t> baseline, current;
};

// `baseline` and `current` of equal sizes. Payload and blood together have at most `most_bytes`,
// which is 500 or more, and with blood 600: one block always fits. Empty if there were more than
// kMaxSlices.
std::vector<SurfaceSlice> encode_slices(std::span<const QuantisedVertex> baseline,
                                        std::span<const QuantisedVertex> current,
                                        std::size_t most_bytes, const SlicedBlood& blood = {});

// Applies one to its baseline, in place; on error `surface` is unchanged. Rejects runs that are not
// of whole blocks or leave the surface, and whatever decode_delta() rejects.
// `levels`: as many as the surface, or none; blood is then left alone.
Status decode_slice(const SurfaceSlice& slice, std::span<QuantisedVertex> surface,
                    std::span<std::uint8_t> levels = {});

}  // namespace trocar::wire
