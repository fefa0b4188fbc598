#include "common/wire/thread_codec.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/random.h"

namespace trocar::wire {
namespace {

// A coil of 8 mm about a peg, and a straight thread that was cut.
ThreadPicture two_threads() {
  ThreadPicture picture;
  picture.threads = {{.nodes = 200, .material = 2}, {.nodes = 50, .material = 0}};
  picture.pegs = {{.from = {-1000, 0, 0}, .to = {1000, 0, 0}, .radius = 120}};
  for (int i = 0; i < 200; ++i) {
    const double angle = 0.125 * i;
    picture.places.push_back(
        quantised_place({1e-4 * i, 8e-3 * std::sin(angle), 8e-3 * std::cos(angle)}));
  }
  for (int i = 0; i < 50; ++i) picture.places.push_back(quantised_place({0.1, 1e-3 * i, -0.2}));
  picture.is_joined.assign(250, 1);
  picture.is_joined[199] = picture.is_joined[249] = 0;
  picture.is_joined[220] = picture.is_joined[230] = 0;
  return picture;
}

Bytes bytes_of_two() {
  Bytes bytes;
  encode_threads(two_threads(), bytes);
  return bytes;
}

TEST(ThreadCodec, BringsBackWhatWasPutIn) {
  const auto bytes = bytes_of_two();
  const auto read = decode_threads(bytes);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(*read, two_threads());
  EXPECT_LT(bytes.size(), 250u * 3 / 2);
}

TEST(ThreadCodec, TakesTwoBytesANodeWhereItIsNoLine) {
  auto picture = two_threads();
  testing::Random random(7);
  for (auto& place : picture.places) place.x += static_cast<std::int32_t>(random.below(9)) - 4;
  Bytes bytes;
  encode_threads(picture, bytes);
  EXPECT_EQ(*decode_threads(bytes), picture);
  EXPECT_LT(bytes.size(), 250u * 2);
}

TEST(ThreadCodec, APlaceFarAwayIsKeptAtTheLimit) {
  auto picture = two_threads();
  picture.places[7] = quantised_place({1e9, -1e9, 0});
  EXPECT_EQ(picture.places[7], (QuantisedVertex{kMostThreadQuanta, -kMostThreadQuanta, 0}));
  Bytes bytes;
  encode_threads(picture, bytes);
  EXPECT_EQ(*decode_threads(bytes), picture);
}

TEST(ThreadCodec, WhatIsCutShortOrTooLongIsRefused) {
  auto bytes = bytes_of_two();
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_FALSE(decode_threads(BytesView(bytes).first(size)).ok()) << size;
  bytes.push_back(0);
  const auto read = decode_threads(bytes);
  ASSERT_FALSE(read.ok());
  EXPECT_EQ(read.error().message, "threads: there are bytes after the last place");
}

TEST(ThreadCodec, EachLimitIsKept) {
  const auto refused = [](const Bytes& bytes) {
    const auto read = decode_threads(bytes);
    return read.ok() ? std::string() : read.error().message;
  };
  EXPECT_EQ(refused({0}), "threads: there are not 1 to 8");
  EXPECT_EQ(refused({9}), "threads: there are not 1 to 8");
  EXPECT_EQ(refused({1, 3, 0, 0, 0}), "threads: the nodes of thread 0 are not 4 to 1200 in all");
  EXPECT_EQ(refused({2, 0xb0, 0x09, 0, 4, 0}),
            "threads: the nodes of thread 1 are not 4 to 1200 in all");
  EXPECT_EQ(refused({1, 4, 4, 0, 0}), "threads: the material of thread 0 is not 0 to 3");
  EXPECT_EQ(refused({1, 4, 0, 33}), "threads: there are more than 32 pegs");
  EXPECT_EQ(refused({1, 4, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0}),
            "threads: the radius of peg 0 is less than 32 um");
  EXPECT_EQ(refused({1, 4, 0, 0, 1, 4}), "threads: a parted segment is beyond the last node");
  EXPECT_EQ(refused({1, 4, 0, 0, 5}), "threads: more segments are parted than there are");
  // Parameter 15: the first place is 8 << 15 in zig-zag, a little more than the limit.
  EXPECT_EQ(refused({1, 4, 0, 0, 0, 0xff, 0x0f, 0, 0, 0, 0, 0, 0, 0, 0,
                     0, 0, 0, 0, 0, 0,    0,    0, 0, 0, 0, 0, 0, 0}),
            "threads: node 0 is more than 4.2 m away");
}

TEST(ThreadCodec, DamageGivesAnErrorOrAPictureWithinTheLimits) {
  const auto sound = bytes_of_two();
  testing::Random random(11);
  for (int round = 0; round < 3000; ++round) {
    auto bytes = sound;
    for (int k = 0; k < 3; ++k)
      bytes[random.below(static_cast<std::uint32_t>(bytes.size()))] =
          static_cast<std::uint8_t>(random.below(256));
    const auto read = decode_threads(bytes);
    if (!read.ok()) continue;
    ASSERT_EQ(read->places.size(), read->is_joined.size());
    ASSERT_EQ(read->is_joined.back(), 0);
    for (const auto& place : read->places) ASSERT_LE(std::abs(place.x), kMostThreadQuanta);
  }
}

}  // namespace
}  // namespace trocar::wire
