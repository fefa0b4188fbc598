// Damaged payloads: never a crash, a read outside the payload or a changed surface. Payloads lie at
// the end of their own allocation, so that the address sanitizer sees a read beyond them.

#include <gtest/gtest.h>

#include <memory>

#include "common/wire/surface_codec.h"
#include "tests/wire/surface_states.h"

namespace trocar::wire {
namespace {

using testing::moved;
using testing::Random;
using testing::random_surface;

struct Outcome {
  int accepted = 0, rejected = 0;
};

void decode_checked(BytesView payload, bool is_keyframe, const QuantisedSurface& before,
                    Outcome& outcome) {
  const auto exact = std::make_unique<std::uint8_t[]>(payload.size());
  std::copy(payload.begin(), payload.end(), exact.get());
  QuantisedSurface surface = before;
  const BytesView view(exact.get(), payload.size());
  const Status status = is_keyframe ? decode_keyframe(view, surface) : decode_delta(view, surface);
  if (!status.ok()) {
    ++outcome.rejected;
    ASSERT_EQ(surface, before);
    return;
  }
  ++outcome.accepted;
  for (const QuantisedVertex& v : surface)
    ASSERT_TRUE(std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}) <= kMaxQuanta);
}

TEST(surface_codec_fuzz, truncated_at_every_length) {
  Random random(11);
  for (const std::size_t vertices : {1u, 64u, 70u, 333u, 1500u}) {
    const auto baseline = random_surface(random, vertices, 300);
    const auto current = moved(random, baseline, 3, 20);
    for (const bool is_keyframe : {false, true}) {
      Bytes payload;
      if (is_keyframe)
        encode_keyframe(current, payload);
      else
        encode_delta(baseline, current, payload);
      Outcome outcome;
      for (std::size_t length = 0; length < payload.size(); ++length)
        decode_checked(BytesView(payload).first(length), is_keyframe, baseline, outcome);
      EXPECT_EQ(outcome.accepted, 0);
    }
  }
}

TEST(surface_codec_fuzz, mutated) {
  Random random(12);
  Outcome outcome;
  for (int round = 0; round < 1000; ++round) {
    const auto baseline = random_surface(random, 1 + random.below(400), kMaxQuanta);
    const auto current = moved(random, baseline, 1 + random.below(8), 30);
    const bool is_keyframe = random.below(4) == 0;
    Bytes original;
    if (is_keyframe)
      encode_keyframe(current, original);
    else
      encode_delta(baseline, current, original);
    for (int mutation = 0; mutation < 100; ++mutation) {
      Bytes payload = original;
      // Front bytes name blocks and masks: half of the changes go there.
      const std::size_t reach =
          random.below(2) ? std::min<std::size_t>(payload.size(), 24) : payload.size();
      for (std::size_t change = 1 + random.below(3); change > 0; --change)
        payload[random.below(reach)] ^= static_cast<std::uint8_t>(1 + random.below(255));
      if (random.below(4) == 0) payload.resize(random.below(payload.size() + 8));
      decode_checked(payload, is_keyframe, baseline, outcome);
      if (::testing::Test::HasFatalFailure()) FAIL() << "round " << round;
    }
  }
  // Both happen often, or this test would look at one side only.
  EXPECT_GT(outcome.accepted, 5000);
  EXPECT_GT(outcome.rejected, 5000);
}

TEST(surface_codec_fuzz, noise) {
  Random random(13);
  const auto baseline = random_surface(random, 200, 1000);
  Outcome outcome;
  for (int round = 0; round < 20000; ++round) {
    Bytes payload(random.below(64));
    for (auto& byte : payload) byte = static_cast<std::uint8_t>(random.next());
    if (payload.size() > 2 && random.below(2)) payload[0] = 1, payload[1] &= 7;
    decode_checked(payload, random.below(2) == 0, baseline, outcome);
  }
  EXPECT_GT(outcome.rejected, 10000);
}

}  // namespace
}  // namespace trocar::wire
