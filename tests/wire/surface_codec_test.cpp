#include "common/wire/surface_codec.h"

#include <gtest/gtest.h>

#include "tests/wire/surface_states.h"

namespace trocar::wire {
namespace {

using testing::clamp_quanta;
using testing::moved;
using testing::Random;
using testing::random_surface;

Bytes delta_of(const QuantisedSurface& baseline, const QuantisedSurface& current) {
  Bytes out;
  encode_delta(baseline, current, out);
  return out;
}
Bytes keyframe_of(const QuantisedSurface& current) {
  Bytes out;
  encode_keyframe(current, out);
  return out;
}
void expect_round_trip(const QuantisedSurface& baseline, const QuantisedSurface& current) {
  QuantisedSurface surface = baseline;
  const Status status = decode_delta(delta_of(baseline, current), surface);
  ASSERT_TRUE(status.ok()) << status.error().message;
  ASSERT_EQ(surface, current);
}

// Exact bytes. Other decoders and old journals depend on them; the figures come from a second
// encoder, written from the layout in the header.

TEST(surface_codec_bytes, nothing_changed) {
  const QuantisedSurface rest(100);
  EXPECT_EQ(delta_of(rest, rest), (Bytes{0x00}));
}

TEST(surface_codec_bytes, one_vertex_in_the_second_block) {
  const QuantisedSurface rest(200);
  QuantisedSurface current = rest;
  current[64 + 33] = {1, -1, 2};
  // One block; gap 1, not full; masks; then mode 0, widths 2 1 3, zig-zag 2 1 4.
  EXPECT_EQ(delta_of(rest, current),
            (Bytes{0x01, 0x02, 0x00, 0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x88, 0x30, 0x4c}));
}

TEST(surface_codec_bytes, whole_partial_block_is_full) {
  const QuantisedSurface rest(70, {5, -5, 100});
  QuantisedSurface current = rest;
  for (std::int32_t i = 64; i < 70; ++i) current[i] = {45 + i, -5 - i, 100 + 2 * i};
  EXPECT_EQ(delta_of(rest, current),
            (Bytes{0x01, 0x03, 0xa1, 0x93, 0xa0, 0xff, 0x00, 0x05, 0x02, 0x04, 0x04, 0x02,
                   0x04, 0x04, 0x02, 0x04, 0x04, 0x02, 0x04, 0x04, 0x02, 0x04, 0x00}));
}

TEST(surface_codec_bytes, each_mode_once) {
  QuantisedSurface baseline(130), current(130);
  for (std::int32_t i = 0; i < 4; ++i) {
    baseline[i] = {1000 * i, 31250, -31250 * (i % 2)};
    current[i] = {1000 * i + 1, 31249, -31250 * (i % 2)};
  }
  baseline[64] = {1816, 2344, 1088}, baseline[65] = {4735, 2615, 1105};
  baseline[66] = {2654, 2886, 1122}, baseline[67] = {573, 3157, 1139};
  for (std::size_t i = 64; i < 68; ++i) current[i] = baseline[i] + QuantisedVertex{300, 300, 300};
  baseline[128] = {31250, -31250, 31250}, baseline[129] = {31250, -31250, -31250};
  current[128] = current[129] = {-31250, 31250, 0};
  EXPECT_EQ(
      delta_of(baseline, current),
      (Bytes{0x03, 0x00, 0x0f, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x0f, 0x00, 0x00,
             0x00, 0x00, 0x00, 0x00, 0x00, 0x01, 0x88, 0x00, 0x6c, 0x1b, 0xa5, 0x14, 0x96, 0x58,
             0x62, 0x89, 0x25, 0x96, 0x58, 0x62, 0x89, 0x25, 0x96, 0x58, 0x62, 0x89, 0xa5, 0x10,
             0xb2, 0x7a, 0x7d, 0x91, 0xec, 0x9e, 0x05, 0x00, 0x00, 0x00, 0x00, 0x00}));
  expect_round_trip(baseline, current);
}

TEST(surface_codec_bytes, keyframe) {
  QuantisedSurface current;
  for (std::int32_t i = 0; i < 20; ++i) current.push_back({i, -i, 1000 + 3 * i});
  EXPECT_EQ(keyframe_of(current),
            (Bytes{0x01, 0x01, 0x8a, 0xb0, 0x00, 0x7d, 0x1b, 0xc0, 0x06, 0xb0, 0x01, 0x6c, 0x00,
                   0x1b, 0xc0, 0x06, 0xb0, 0x01, 0x6c, 0x00, 0x1b, 0xc0, 0x06, 0xb0, 0x01, 0x6c,
                   0x00, 0x1b, 0xc0, 0x06, 0xb0, 0x01, 0x14, 0x61, 0xd8, 0xb6, 0x6d, 0x03}));
}

// Round trips.

TEST(surface_codec, every_size_sparse_and_dense) {
  Random random(1);
  for (std::size_t vertices = 1; vertices <= 400; ++vertices) {
    const auto baseline = random_surface(random, vertices, 2000);
    for (const std::size_t one_in : {1u, 2u, 7u, 100u})
      expect_round_trip(baseline, moved(random, baseline, one_in, 9));
  }
  expect_round_trip({}, {});
}

TEST(surface_codec, random_sizes_steps_and_masks) {
  Random random(2);
  for (int round = 0; round < 600; ++round) {
    const std::size_t vertices = 1 + random.below(5000);
    const auto baseline = random_surface(random, vertices, 1 + random.within(31000) / 2 + 15600);
    const auto step = static_cast<std::int32_t>(1) << random.below(16);
    const auto current = moved(random, baseline, 1 + random.below(50), step);
    expect_round_trip(baseline, current);
    if (::testing::Test::HasFatalFailure()) FAIL() << "round " << round;
  }
}

TEST(surface_codec, largest_differences_in_every_mode) {
  // Alternating corners of the range: 18-bit residuals where they are ever needed.
  QuantisedSurface low, high;
  for (std::int32_t i = 0; i < 200; ++i) {
    const std::int32_t s = i % 2 == 0 ? kMaxQuanta : -kMaxQuanta;
    low.push_back({s, -s, i % 3 == 0 ? s : 0});
    high.push_back({-s, s, i % 3 == 0 ? -s : 1});
  }
  expect_round_trip(low, high);
  expect_round_trip(high, low);
  QuantisedSurface surface(low.size());
  ASSERT_TRUE(decode_keyframe(keyframe_of(low), surface).ok());
  EXPECT_EQ(surface, low);
}

TEST(surface_codec, keyframe_needs_no_baseline) {
  Random random(3);
  for (const std::size_t vertices : {1u, 15u, 16u, 17u, 63u, 64u, 65u, 128u, 1000u, 5000u}) {
    const auto current = random_surface(random, vertices, kMaxQuanta);
    auto surface = random_surface(random, vertices, kMaxQuanta);
    const Status status = decode_keyframe(keyframe_of(current), surface);
    ASSERT_TRUE(status.ok()) << status.error().message;
    EXPECT_EQ(surface, current);
  }
}

TEST(surface_codec, stream_of_deltas_does_not_drift) {
  Random random(4);
  auto server = random_surface(random, 1234, 100);
  auto client = server;
  for (int frame = 0; frame < 300; ++frame) {
    const auto next = moved(random, server, 5, 4);
    Bytes out{0xaa};  // appends
    const EncodeReport report = encode_delta(server, next, out);
    std::size_t changed = 0;
    for (std::size_t i = 0; i < next.size(); ++i) changed += !(next[i] == server[i]);
    EXPECT_EQ(report.changed_vertices, changed);
    ASSERT_TRUE(decode_delta(BytesView(out).subspan(1), client).ok());
    server = next;
    ASSERT_EQ(surface_crc(client), surface_crc(server));
  }
  EXPECT_EQ(client, server);
}

TEST(surface_codec, equal_input_gives_equal_bytes) {
  Random random(5);
  const auto baseline = random_surface(random, 3000, 500);
  const auto current = moved(random, baseline, 3, 40);
  EXPECT_EQ(delta_of(baseline, current), delta_of(baseline, current));
  EXPECT_EQ(keyframe_of(current), keyframe_of(current));
}

TEST(surface_codec, smooth_motion_takes_little_more_than_a_byte_per_vertex) {
  QuantisedSurface baseline, current;
  for (std::int32_t i = 0; i < 4096; ++i) {
    baseline.push_back({i / 16, -i / 8, i / 4});
    current.push_back({i / 16 + 1, -i / 8 - 1, i / 4 + 1 + (i & 1)});
  }
  const Bytes out = delta_of(baseline, current);
  EXPECT_LT(out.size(), 4096u * 5 / 4);
  expect_round_trip(baseline, current);
}

TEST(surface_codec, smooth_keyframe_is_smaller_than_temporal_would_be) {
  QuantisedSurface ramp;
  for (std::int32_t i = 0; i < 4096; ++i) ramp.push_back({20000 + i, i, -i});
  EXPECT_LT(keyframe_of(ramp).size(), 4096u * 3 / 2);
}

// Each case is malformed for one reason; a decoder must reject it and leave the surface as it was.

struct Malformed {
  const char* what;
  std::size_t vertices;
  Bytes payload;
};

TEST(surface_codec, rejects_what_is_out_of_range) {
  const Bytes group{0x88, 0x30, 0x4c};  // one vertex {1, -1, 2}, mode 0
  const auto with = [](Bytes front, const Bytes& back) {
    front.insert(front.end(), back.begin(), back.end());
    return front;
  };
  const Malformed cases[] = {
      {"empty", 10, {}},
      {"more blocks than there are", 64, {0x02, 0x01, 0x01}},
      {"block count without end", 64, {0x80, 0x80, 0x80, 0x80, 0x80, 0x00}},
      {"block count over 32 bits", 64, {0xff, 0xff, 0xff, 0xff, 0x7f}},
      {"gap beyond the last block", 128, with({0x01, 0x04, 1, 0, 0, 0, 0, 0, 0, 0}, group)},
      {"huge gap", 128, with({0x01, 0xfe, 0xff, 0xff, 0xff, 0x0f, 1, 0, 0, 0, 0, 0, 0, 0}, group)},
      {"empty mask", 64, {0x01, 0x00, 0, 0, 0, 0, 0, 0, 0, 0}},
      {"mask beyond the last vertex", 9, with({0x01, 0x00, 0, 2, 0, 0, 0, 0, 0, 0}, group)},
      {"mode 3", 64, {0x01, 0x00, 1, 0, 0, 0, 0, 0, 0, 0, 0x8b, 0x30, 0x4c}},
      {"width 19", 64, {0x01, 0x00, 1, 0, 0, 0, 0, 0, 0, 0, 0x4c, 0, 0, 0, 0, 0}},
      {"group cut short", 64, {0x01, 0x00, 1, 0, 0, 0, 0, 0, 0, 0, 0x88, 0x30}},
      {"padding not zero", 64, {0x01, 0x00, 1, 0, 0, 0, 0, 0, 0, 0, 0x88, 0x30, 0xcc}},
      {"trailing byte", 64, with({0x01, 0x00, 1, 0, 0, 0, 0, 0, 0, 0}, {0x88, 0x30, 0x4c, 0})},
      {"trailing byte after no change", 64, {0x00, 0x00}},
      {"block for an empty surface", 0, {0x01, 0x01}},
  };
  for (const Malformed& c : cases) {
    const QuantisedSurface before(c.vertices, {7, 8, 9});
    QuantisedSurface surface = before;
    EXPECT_FALSE(decode_delta(c.payload, surface).ok()) << c.what;
    EXPECT_EQ(surface, before) << c.what;
  }
  QuantisedSurface surface(64);
  EXPECT_TRUE(decode_delta(with({0x01, 0x00, 1, 0, 0, 0, 0, 0, 0, 0}, group), surface).ok());
  EXPECT_EQ(surface[0], (QuantisedVertex{1, -1, 2}));
}

TEST(surface_codec, rejects_values_beyond_one_metre) {
  const QuantisedSurface baseline(16), current(16, {1, 0, 0});
  const Bytes step = delta_of(baseline, current);
  QuantisedSurface surface(16, {kMaxQuanta - 1, 0, 0});
  EXPECT_TRUE(decode_delta(step, surface).ok());
  const QuantisedSurface before = surface;
  const Status status = decode_delta(step, surface);
  ASSERT_FALSE(status.ok());
  EXPECT_NE(status.error().message.find("keyframe"), std::string::npos);
  EXPECT_EQ(surface, before);
}

TEST(surface_codec, keyframe_must_be_absolute_and_whole) {
  Random random(6);
  const QuantisedSurface zero(130);
  const auto current = random_surface(random, 130, 50);
  QuantisedSurface surface = zero;
  Bytes delta = delta_of(zero, current);
  EXPECT_FALSE(decode_keyframe(delta, surface).ok());  // temporal groups
  EXPECT_FALSE(decode_keyframe(delta_of(zero, zero), surface).ok());
  EXPECT_EQ(surface, zero);
  EXPECT_TRUE(decode_delta(keyframe_of(current), surface).ok());  // a keyframe is a valid delta
  EXPECT_EQ(surface, current);
}

}  // namespace
}  // namespace trocar::wire
