#pragma once

// Cut events as bytes, for snapshots that hold the whole history of a topology: small numbers,
// because edits of a wound are near each other, each number as a difference from the last of its
// kind, as a varint. Two to three bytes per cut tet.
//
// Reading treats the bytes as untrusted: numbers beyond their range and what is cut short fail.
// Whether the events fit a topology, apply() checks.

#include <optional>

#include "server/tissue/cutting/edits.h"
#include "server/tissue/world/state_archive.h"

namespace trocar::cutting {

inline constexpr std::uint32_t kMaxEventBytes = 64u << 20;

// Appends. Faces of events follow one another, as Cutter makes them.
void encode(const CutEvents& events, Bytes& out);
// Nothing if the bytes are not the encoding of any events.
std::optional<CutEvents> decode(BytesView bytes);

void visit_state(world::StateArchive& archive, CutEvents& events);

}  // namespace trocar::cutting
