#pragma once

// A frame on a stream is a u32 little-endian length, then one Envelope.

#include <cstdint>
#include <memory>
#include <span>

#include "common/base/bytes.h"
#include "common/base/result.h"

namespace trocar::proto {
class Envelope;
}

namespace trocar::wire {

inline constexpr std::uint32_t kMaxUpstreamBytes = 64 * 1024;           // client to server
inline constexpr std::uint32_t kMaxDownstreamBytes = 16 * 1024 * 1024;  // server to client
inline constexpr std::size_t kHeaderBytes = 4;

using SharedBytes = std::shared_ptr<const Bytes>;  // one immutable buffer may go to many receivers

// Returns header and encoding in one buffer.
SharedBytes encode_envelope(const proto::Envelope& envelope);

// Returns header and body in one buffer. `body`: an encoded Envelope, as decode_envelope() takes
// it.
SharedBytes frame_body(BytesView body);

// Reads the length from a header; it is an error if it is zero or over `limit`.
Result<std::uint32_t> decode_length(std::span<const std::uint8_t, kHeaderBytes> header,
                                    std::uint32_t limit);
// Parses the body of one frame; error if it is not an Envelope or an empty one. A message of a
// newer minor version is ok with message_case() == MESSAGE_NOT_SET: ignore it.
Status decode_envelope(BytesView body, proto::Envelope& envelope);

}  // namespace trocar::wire
