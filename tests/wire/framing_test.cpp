#include "common/wire/framing.h"

#include <gtest/gtest.h>

#include "proto/wire.pb.h"

namespace trocar::wire {
namespace {

proto::Envelope ping(std::uint64_t time) {
  proto::Envelope envelope;
  envelope.mutable_ping()->set_client_time_us(time);
  return envelope;
}
Result<std::uint32_t> length_of(const Bytes& frame, std::uint32_t limit) {
  return decode_length(std::span<const std::uint8_t, kHeaderBytes>(frame.data(), kHeaderBytes),
                       limit);
}

TEST(framing, exact_bytes) {
  // The message is field 5 (ping) of length 2; in it field 1 is the varint 7.
  EXPECT_EQ(*encode_envelope(ping(7)), (Bytes{4, 0, 0, 0, 0x2a, 2, 0x08, 7}));
}

TEST(framing, round_trip) {
  const SharedBytes frame = encode_envelope(ping(123456789));
  const auto length = length_of(*frame, kMaxUpstreamBytes);
  ASSERT_TRUE(length.ok());
  ASSERT_EQ(*length, frame->size() - kHeaderBytes);
  proto::Envelope back;
  ASSERT_TRUE(decode_envelope(BytesView(*frame).subspan(kHeaderBytes), back).ok());
  EXPECT_EQ(back.ping().client_time_us(), 123456789u);
}

TEST(framing, caps_are_inclusive) {
  const auto header = [](std::uint32_t length) {
    Bytes bytes;
    ByteWriter(bytes).put(length);
    return bytes;
  };
  EXPECT_TRUE(length_of(header(1), kMaxUpstreamBytes).ok());
  EXPECT_TRUE(length_of(header(65536), kMaxUpstreamBytes).ok());
  EXPECT_FALSE(length_of(header(0), kMaxUpstreamBytes).ok());
  EXPECT_FALSE(length_of(header(0xffffffff), kMaxDownstreamBytes).ok());
  const auto over = length_of(header(65537), kMaxUpstreamBytes);
  ASSERT_FALSE(over.ok());
  EXPECT_EQ(over.error().code, ErrorCode::BadMessage);
  EXPECT_NE(over.error().message.find("65537"), std::string::npos);
  EXPECT_NE(over.error().message.find("65536"), std::string::npos);
}

TEST(framing, rejects_an_envelope_over_the_cap) {
  // Field 1000, which nobody knows, fills it: a newer minor version may send such.
  const auto body_of = [](std::uint32_t size) {
    const std::uint32_t length = size - 6;
    Bytes body{0xc2, 0x3e};
    for (int i = 0; i < 4; ++i)
      body.push_back(static_cast<std::uint8_t>((length >> (7 * i) & 0x7f) | (i < 3 ? 0x80 : 0)));
    body.resize(size);
    return body;
  };
  proto::Envelope envelope;
  EXPECT_TRUE(decode_envelope(body_of(kMaxDownstreamBytes), envelope).ok());
  EXPECT_FALSE(decode_envelope(body_of(kMaxDownstreamBytes + 1), envelope).ok());
}

TEST(framing, rejects_what_is_no_envelope) {
  proto::Envelope envelope;
  EXPECT_FALSE(decode_envelope({}, envelope).ok());
  EXPECT_FALSE(decode_envelope(Bytes{0xff, 0xff, 0xff}, envelope).ok());
  EXPECT_FALSE(decode_envelope(Bytes{0x2a, 9, 0x08, 7}, envelope).ok());  // shorter than it says
}

TEST(framing, truncated_at_every_length) {
  proto::Envelope envelope;
  auto& hello = *envelope.mutable_hello();
  hello.set_name("Mira");
  hello.set_protocol_major(1);
  hello.add_tool()->set_radius_m(0.003f);
  const SharedBytes frame = encode_envelope(envelope);
  const auto body = BytesView(*frame).subspan(kHeaderBytes);
  for (std::size_t length = 0; length < body.size(); ++length)
    EXPECT_FALSE(decode_envelope(body.first(length), envelope).ok()) << length;
  EXPECT_TRUE(decode_envelope(body, envelope).ok());
}

TEST(framing, message_of_a_newer_minor_version_is_ignored_not_refused) {
  proto::Envelope envelope;
  const Bytes body{0xba, 0x06, 0x01, 0x00};  // field 103, one byte
  ASSERT_TRUE(decode_envelope(body, envelope).ok());
  EXPECT_EQ(envelope.message_case(), proto::Envelope::MESSAGE_NOT_SET);
}

}  // namespace
}  // namespace trocar::wire
