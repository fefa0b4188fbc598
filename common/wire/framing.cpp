#include "common/wire/framing.h"

#include "common/base/assert.h"
#include "proto/wire.pb.h"

namespace trocar::wire {

SharedBytes encode_envelope(const proto::Envelope& envelope) {
  const std::size_t size = envelope.ByteSizeLong();
  TROCAR_ASSERT(size > 0 && size <= kMaxDownstreamBytes);
  Bytes frame(kHeaderBytes + size);
  const auto length = static_cast<std::uint32_t>(size);
  std::memcpy(frame.data(), &length, sizeof length);
  envelope.SerializeWithCachedSizesToArray(frame.data() + kHeaderBytes);
  return std::make_shared<const Bytes>(std::move(frame));
}

SharedBytes frame_body(BytesView body) {
  TROCAR_ASSERT(!body.empty() && body.size() <= kMaxDownstreamBytes);
  Bytes frame(kHeaderBytes + body.size());
  const auto length = static_cast<std::uint32_t>(body.size());
  std::memcpy(frame.data(), &length, sizeof length);
  std::memcpy(frame.data() + kHeaderBytes, body.data(), body.size());
  return std::make_shared<const Bytes>(std::move(frame));
}

Result<std::uint32_t> decode_length(std::span<const std::uint8_t, kHeaderBytes> header,
                                    std::uint32_t limit) {
  std::uint32_t length = 0;
  std::memcpy(&length, header.data(), sizeof length);
  if (length == 0)
    return Error{ErrorCode::BadMessage, "frame: length 0, expected one Envelope; close the stream"};
  if (length > limit)
    return Error{ErrorCode::BadMessage, "frame: length " + std::to_string(length) +
                                            " is over the limit of " + std::to_string(limit) +
                                            " bytes; close the stream"};
  return length;
}

Status decode_envelope(BytesView body, proto::Envelope& envelope) {
  if (body.size() > kMaxDownstreamBytes ||
      !envelope.ParseFromArray(body.data(), static_cast<int>(body.size())))
    return Error{ErrorCode::BadMessage, "frame: " + std::to_string(body.size()) +
                                            " bytes that are not an Envelope; close the stream"};
  // A newer minor version may send messages that we do not know: they leave unknown fields.
  const bool is_unknown = envelope.ByteSizeLong() > 0;
  if (envelope.message_case() == proto::Envelope::MESSAGE_NOT_SET && !is_unknown)
    return Error{ErrorCode::BadMessage, "frame: Envelope without a message; close the stream"};
  return {};
}

}  // namespace trocar::wire
