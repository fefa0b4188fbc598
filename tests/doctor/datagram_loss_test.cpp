// Lost datagrams are counted by the numbers of their records.

#include "client/net/datagram_loss.h"

#include <gtest/gtest.h>

namespace trocar::net {
namespace {

// A record's header: epoch 1, and its number.
Bytes record(std::uint64_t number) {
  Bytes bytes(13, 0);
  bytes[4] = 1;
  for (int i = 0; i < 6; ++i)
    bytes[static_cast<std::size_t>(10 - i)] = static_cast<std::uint8_t>(number >> (8 * i));
  return bytes;
}

TEST(DatagramLoss, GapsAreLostWhateverTheOrder) {
  DatagramLoss loss;
  EXPECT_EQ(loss.lost(), 0u);
  for (const std::uint64_t number : {256u, 254u, 255u, 258u, 261u}) loss.note(record(number));
  EXPECT_EQ(loss.received(), 5u);
  EXPECT_EQ(loss.lost(), 3u);  // 257, 259 and 260
}

TEST(DatagramLoss, AnotherConnectionNumbersAnewAndWhatWasLostStays) {
  DatagramLoss loss;
  for (const std::uint64_t number : {1u, 3u}) loss.note(record(number));
  loss.restart();
  EXPECT_EQ(loss.lost(), 1u);
  for (const std::uint64_t number : {1u, 2u, 5u}) loss.note(record(number));
  EXPECT_EQ(loss.received(), 5u);
  EXPECT_EQ(loss.lost(), 3u);
}

TEST(DatagramLoss, TwoRecordsInOneDatagramAndShortOnesDoNoHarm) {
  DatagramLoss loss;
  loss.note(record(7));
  loss.note(record(7));
  loss.note(Bytes(12, 0xff));
  EXPECT_EQ(loss.received(), 2u);
  EXPECT_EQ(loss.lost(), 0u);
}

}  // namespace
}  // namespace trocar::net
