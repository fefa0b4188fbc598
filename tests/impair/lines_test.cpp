// Tests what a bad network decides, without sockets or clocks: time is handed in.

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "common/impair/datagram_line.h"
#include "common/impair/stream_line.h"
#include "tests/impair/pattern.h"

namespace trocar::impair {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::uint64_t kSeed = 7;

// A datagram that carries its number.
Bytes numbered(std::uint32_t number, std::size_t size = 100) {
  Bytes bytes(size);
  std::memcpy(bytes.data(), &number, sizeof number);
  return bytes;
}
std::uint32_t number_of(const Bytes& bytes) {
  std::uint32_t number = 0;
  std::memcpy(&number, bytes.data(), sizeof number);
  return number;
}

struct Arrival {
  Time time;
  std::uint32_t number;
  bool operator==(const Arrival&) const = default;
};

// Pushes `count` datagrams, one each `period`, and takes out what departs meanwhile and after.
std::vector<Arrival> send(DatagramLine& line, std::uint32_t count, Time period,
                          std::size_t size = 100) {
  std::vector<Arrival> arrivals;
  const auto take_until = [&](Time now) {
    while (line.next() != kNever && line.next() <= now) {
      const Time at = line.next();
      arrivals.push_back({at, number_of(line.pop(at))});
    }
  };
  for (std::uint32_t i = 0; i < count; ++i) {
    take_until(i * period);
    line.push(i * period, numbered(i, size));
  }
  take_until(kNever - Time(1));
  return arrivals;
}

// Lengths of the gaps in ascending numbers.
std::vector<double> runs_of_losses(const std::vector<Arrival>& arrivals) {
  std::vector<double> runs;
  for (std::size_t i = 1; i < arrivals.size(); ++i)
    if (const auto gap = arrivals[i].number - arrivals[i - 1].number; gap > 1)
      runs.push_back(gap - 1);
  return runs;
}
double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

TEST(DatagramLine, WithoutImpairmentAllPassAtOnce) {
  Direction direction{{}};
  DatagramLine line(direction, {}, kSeed);
  const auto arrivals = send(line, 100, milliseconds(1));
  ASSERT_EQ(arrivals.size(), 100u);
  for (std::uint32_t i = 0; i < 100; ++i) EXPECT_EQ(arrivals[i], (Arrival{i * milliseconds(1), i}));
  EXPECT_EQ(direction.datagrams.passed.packets, 100u);
  EXPECT_EQ(direction.datagrams.passed.bytes, 10'000u);
  EXPECT_EQ(line.waiting_bytes(), 0u);
  EXPECT_EQ(line.next(), kNever);
}

TEST(DatagramLine, DelayAndJitterStayInTheirBoundsAndKeepTheOrder) {
  Direction direction{{.delay = milliseconds(30), .jitter = milliseconds(5)}};
  DatagramLine line(direction, {}, kSeed);
  const auto arrivals = send(line, 2000, milliseconds(1));
  ASSERT_EQ(arrivals.size(), 2000u);
  for (std::uint32_t i = 0; i < arrivals.size(); ++i) {
    EXPECT_EQ(arrivals[i].number, i);
    const Time delay = arrivals[i].time - i * milliseconds(1);
    EXPECT_GE(delay, milliseconds(30));
    EXPECT_LE(delay, milliseconds(35));
  }
  const auto& delays = direction.datagrams.delays;
  EXPECT_GT(delays.mean_ms(), 32.5);  // in order, so later than the mean of the jitter
  EXPECT_LT(delays.mean_ms(), 35);
  EXPECT_LE(delays.share_ms(0.5), delays.share_ms(0.99));
  EXPECT_NEAR(delays.share_ms(0.99), 35, 1.5);
}

TEST(DatagramLine, TheShareIsLostThatWasAskedFor) {
  for (const double loss : {0.01, 0.05, 0.3}) {
    Direction direction{{.loss = loss}};
    DatagramLine line(direction, {}, kSeed);
    const auto arrivals = send(line, 40'000, milliseconds(1));
    const double lost = 1 - static_cast<double>(arrivals.size()) / 40'000;
    EXPECT_NEAR(lost, loss, 0.05 * loss + 0.001);
    EXPECT_NEAR(mean(runs_of_losses(arrivals)), 1 / (1 - loss), 0.05);
    EXPECT_EQ(direction.datagrams.lost.packets + arrivals.size(), 40'000u);
  }
}

TEST(DatagramLine, RunsOfLossesHaveTheirMeanLengthAndLoseNoMore) {
  for (const double burst : {2.0, 10.0}) {
    Direction direction{{.loss = 0.05, .burst = burst}};
    DatagramLine line(direction, {}, kSeed);
    const auto arrivals = send(line, 200'000, milliseconds(1));
    EXPECT_NEAR(1 - static_cast<double>(arrivals.size()) / 200'000, 0.05, 0.005);
    EXPECT_NEAR(mean(runs_of_losses(arrivals)), burst, 0.1 * burst);
  }
}

TEST(DatagramLine, TheSameSeedDecidesTheSameWhateverElseIsSet) {
  const auto passed = [](const Impairment& impairment, std::uint64_t seed) {
    Direction direction{impairment};
    DatagramLine line(direction, {}, seed);
    std::vector<std::uint32_t> numbers;
    for (const auto& arrival : send(line, 1000, milliseconds(2))) numbers.push_back(arrival.number);
    return numbers;
  };
  const Impairment plain{.loss = 0.1};
  EXPECT_EQ(passed(plain, 1), passed(plain, 1));
  EXPECT_NE(passed(plain, 1), passed(plain, 2));
  EXPECT_EQ(passed(plain, 1),
            passed({.delay = milliseconds(50), .jitter = milliseconds(20), .loss = 0.1}, 1));
  EXPECT_NE(seed_of(1, Flow::DatagramsUp, 0), seed_of(1, Flow::DatagramsDown, 0));
  EXPECT_NE(seed_of(1, Flow::DatagramsUp, 0), seed_of(1, Flow::DatagramsUp, 1));
  EXPECT_NE(seed_of(1, Flow::DatagramsUp, 0), seed_of(2, Flow::DatagramsUp, 0));
}

TEST(DatagramLine, TheNextOvertakesTheShareThatIsReordered) {
  for (const double share : {0.05, 0.25, 0.5}) {
    Direction direction{{.delay = milliseconds(10), .reorder = share}};
    DatagramLine line(direction, {}, kSeed);
    const auto arrivals = send(line, 20'000, milliseconds(16));
    ASSERT_EQ(arrivals.size(), 20'000u);
    std::size_t overtaken = 0;
    for (std::size_t i = 1; i < arrivals.size(); ++i)
      overtaken += arrivals[i].number < arrivals[i - 1].number;
    EXPECT_EQ(overtaken, direction.datagrams.reordered.packets);
    EXPECT_NEAR(static_cast<double>(overtaken) / 20'000, share, 0.05 * share + 0.002);
  }
}

TEST(DatagramLine, OneThatWaitsToBeOvertakenDoesNotWaitForEver) {
  Direction direction{{.reorder = 0.5}};
  DatagramLine line(direction, {}, kSeed);
  line.push(Time(0), numbered(0));
  EXPECT_EQ(line.next(), milliseconds(100));
  EXPECT_EQ(number_of(line.pop(milliseconds(100))), 0u);
  EXPECT_EQ(direction.datagrams.reordered.packets, 0u);
  line.push(milliseconds(200), numbered(1));
  line.push(milliseconds(210), numbered(2));
  EXPECT_EQ(number_of(line.pop(milliseconds(210))), 2u);
  EXPECT_EQ(number_of(line.pop(milliseconds(210))), 1u);
}

TEST(DatagramLine, CopiesFollowWhatTheyAreCopiesOf) {
  Direction direction{{.delay = milliseconds(10), .jitter = milliseconds(9), .duplicate = 0.2}};
  DatagramLine line(direction, {}, kSeed);
  const auto arrivals = send(line, 10'000, milliseconds(1));
  EXPECT_TRUE(std::ranges::is_sorted(arrivals, {}, &Arrival::number));
  EXPECT_EQ(arrivals.size(), 10'000 + direction.datagrams.duplicated.packets);
  EXPECT_NEAR(static_cast<double>(direction.datagrams.duplicated.packets) / 10'000, 0.2, 0.01);
}

TEST(DatagramLine, AnOutageBlocksAndTheRestPassesAsIfItHadNotBeen) {
  Direction blocked{{.loss = 0.1}}, open{{.loss = 0.1}};
  DatagramLine line(blocked, {.begin = seconds(1), .end = seconds(2)}, kSeed);
  DatagramLine other(open, {}, kSeed);
  auto expected = send(other, 3000, milliseconds(1));
  std::erase_if(expected, [](const Arrival& a) { return a.number >= 1000 && a.number < 2000; });
  EXPECT_EQ(send(line, 3000, milliseconds(1)), expected);
  EXPECT_EQ(blocked.datagrams.blocked.packets, 1000u);
}

TEST(DatagramLine, TheRateBoundsBytesInEveryIntervalAndTheQueueDropsTheRest) {
  // 100,000 B/s are asked to carry 200,000.
  Direction direction{{.rate = 100'000, .queue = milliseconds(50)}};
  DatagramLine line(direction, {}, kSeed);
  const auto arrivals = send(line, 20'000, milliseconds(1), 200);
  for (std::size_t i = 500; i < arrivals.size(); ++i)
    EXPECT_GE(arrivals[i].time - arrivals[i - 500].time, milliseconds(999));  // 100,000 bytes
  for (const auto& arrival : arrivals)
    EXPECT_LE(arrival.time - arrival.number * milliseconds(1), milliseconds(53));
  EXPECT_NEAR(static_cast<double>(arrivals.size()), 10'000, 60);
  EXPECT_EQ(direction.datagrams.dropped.packets + arrivals.size(), 20'000u);
}

TEST(DatagramLine, BytesThatWaitAreBounded) {
  Direction direction{{.delay = seconds(10)}};
  DatagramLine line(direction, {}, kSeed);
  for (std::uint32_t i = 0; i < 10'000; ++i) line.push(Time(i), numbered(i, 4));
  EXPECT_LE(line.waiting_bytes(), DatagramLine::kMostBytes);
  EXPECT_GT(direction.datagrams.dropped.packets, 7'000u);
}

// Holds what departs of a stream, with the time of its last byte.
struct Read {
  Bytes bytes;
  Time last{0};
  StreamEnd end = StreamEnd::None;
};
Read read_all(StreamLine& line) {
  Read read;
  while (line.next() != kNever) {
    EXPECT_GE(line.next(), read.last);
    read.last = line.next();
    const auto departure = line.pop(read.last);
    read.bytes.insert(read.bytes.end(), departure.bytes.begin(), departure.bytes.end());
    read.end = departure.end;
  }
  return read;
}
// A seed whose first segments are lost (or not) as asked.
std::uint64_t seed_with(const std::vector<bool>& losses, double loss) {
  for (std::uint64_t seed = 0;; ++seed) {
    const Draws draws(seed);
    bool fits = true;
    for (std::size_t i = 0; i < losses.size(); ++i)
      fits = fits && (draws.draw(i, Purpose::Loss) < loss) == losses[i] &&
             draws.draw(i, Purpose::Again, 1) >= loss;
    if (fits) return seed;
  }
}

TEST(StreamLine, BytesArriveWholeAndInOrderUnderLossAndJitter) {
  Direction direction{{.delay = milliseconds(30), .jitter = milliseconds(20), .loss = 0.2}};
  StreamLine line(direction, {}, milliseconds(80), kSeed);
  const auto sent = pattern(700'000);
  line.push(Time(0), sent);
  line.end(milliseconds(1), StreamEnd::Finished);
  const auto read = read_all(line);
  EXPECT_EQ(read.bytes, sent);
  EXPECT_EQ(read.end, StreamEnd::Finished);
  EXPECT_EQ(direction.stream.passed.packets, 500u);
  // A fifth of the transmissions is lost, so 500 need 625.
  EXPECT_NEAR(static_cast<double>(direction.stream.lost.packets), 125, 45);
  EXPECT_EQ(line.waiting_bytes(), 0u);
}

TEST(StreamLine, ALostSegmentWithoutFollowersWaitsForTheTimeout) {
  Direction direction{{.delay = milliseconds(30), .loss = 0.2}};
  StreamLine line(direction, {}, milliseconds(60), seed_with({true, false, false}, 0.2));
  line.push(Time(0), pattern(100));
  EXPECT_EQ(line.next(), milliseconds(230));
  line.push(milliseconds(10), pattern(100));
  line.push(milliseconds(20), pattern(100));
  EXPECT_EQ(line.next(), milliseconds(230));  // two followers are too few
  EXPECT_EQ(read_all(line).last, milliseconds(230));
}

TEST(StreamLine, ThreeFollowersInARoundTripBringALostSegmentForward) {
  const std::vector<bool> first_lost{true, false, false, false};
  Direction direction{{.delay = milliseconds(30), .loss = 0.2}};
  StreamLine line(direction, {}, milliseconds(60), seed_with(first_lost, 0.2));
  for (int i = 0; i < 4; ++i) line.push(i * milliseconds(10), pattern(100));
  EXPECT_EQ(line.next(), milliseconds(90));  // a round trip and the delay
  EXPECT_EQ(read_all(line).last, milliseconds(90));

  StreamLine slow(direction, {}, milliseconds(60), seed_with(first_lost, 0.2));
  for (int i = 0; i < 4; ++i) slow.push(i * milliseconds(25), pattern(100));
  EXPECT_EQ(slow.next(), milliseconds(230));  // the third comes too late
}

TEST(StreamLine, TimeoutsDouble) {
  const double loss = 0.5;
  std::uint64_t seed = 0;  // lost, lost again and once more
  for (;; ++seed) {
    const Draws draws(seed);
    if (draws.draw(0, Purpose::Loss) < loss && draws.draw(0, Purpose::Again, 1) < loss &&
        draws.draw(0, Purpose::Again, 2) < loss && draws.draw(0, Purpose::Again, 3) >= loss)
      break;
  }
  Direction direction{{.delay = milliseconds(30), .loss = loss}};
  StreamLine line(direction, {}, milliseconds(60), seed);
  line.push(Time(0), pattern(100));
  EXPECT_EQ(line.next(), milliseconds(200 + 400 + 800 + 30));
  EXPECT_EQ(direction.stream.lost.packets, 3u);
}

TEST(StreamLine, AfterACutItGoesOnWithTheFirstTry) {
  Direction direction{{.delay = milliseconds(30)}};
  StreamLine line(direction, {.begin = seconds(1), .end = seconds(2)}, milliseconds(60), kSeed);
  line.push(milliseconds(900), pattern(100));
  EXPECT_EQ(line.next(), milliseconds(930));
  line.pop(milliseconds(930));
  line.push(milliseconds(1100), pattern(100));  // tries at 1.1, 1.3, 1.7 and 2.5 s
  EXPECT_EQ(line.next(), milliseconds(2530));
  line.push(milliseconds(1900), pattern(100));
  line.push(milliseconds(2100), pattern(100));
  EXPECT_EQ(read_all(line).last, milliseconds(2530));
  line.push(milliseconds(3000), pattern(100));
  EXPECT_EQ(line.next(), milliseconds(3030));
}

TEST(StreamLine, ACutForGoodLetsNothingPass) {
  Direction direction{{.loss = 0.5}};
  StreamLine line(direction, {.begin = seconds(1), .end = kNever}, milliseconds(60), kSeed);
  line.push(milliseconds(1000), pattern(100'000));
  line.end(milliseconds(1001), StreamEnd::Reset);
  EXPECT_EQ(line.next(), kNever);
}

TEST(StreamLine, TheRateAsksTheStreamToWait) {
  Direction direction{{.rate = 100'000, .queue = milliseconds(100)}};
  StreamLine line(direction, {}, Time(0), kSeed);
  EXPECT_EQ(line.chunk_bytes(), 10'000u);
  Time now{0};
  std::size_t pushed = 0;
  while (now < seconds(10)) {
    while (line.has_room(now)) {
      line.push(now, pattern(line.chunk_bytes()));
      pushed += line.chunk_bytes();
    }
    EXPECT_LE(line.waiting_bytes(), 25'000u);
    now = line.room_at();
    while (line.next() <= now) line.pop(line.next());
  }
  EXPECT_GE(pushed, 1'000'000u);
  EXPECT_LE(pushed, 1'030'000u);
  EXPECT_LE(direction.stream.passed.bytes, 1'010'000u);
}

TEST(StreamLine, BytesThatWaitAreBoundedByWhoeverAsks) {
  Direction direction{{.delay = seconds(10)}};
  StreamLine line(direction, {}, seconds(20), kSeed);
  while (line.has_room(Time(0))) line.push(Time(0), pattern(line.chunk_bytes()));
  EXPECT_LE(line.waiting_bytes(), StreamLine::kMostBytes + 80'000);
}

TEST(Link, StreamAndDatagramsOfADirectionShareTheRate) {
  Direction direction{{.rate = 100'000, .queue = milliseconds(100)}};
  StreamLine stream(direction, {}, Time(0), kSeed);
  DatagramLine datagrams(direction, {}, kSeed);
  stream.push(Time(0), pattern(9'000));
  datagrams.push(Time(0), numbered(0, 1000));
  EXPECT_EQ(datagrams.next(), milliseconds(100));
  stream.push(Time(0), pattern(1'000));
  datagrams.push(Time(0), numbered(1));
  EXPECT_EQ(direction.datagrams.dropped.packets, 1u);
}

}  // namespace
}  // namespace trocar::impair
