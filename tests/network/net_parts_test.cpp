// Parts of a client's connection, without a connection.

#include <gtest/gtest.h>

#include <deque>

#include "client/net/hand_messages.h"
#include "client/net/inbound.h"

namespace trocar::net {
namespace {

Arrival arrival(std::size_t bytes) {
  return {std::make_shared<const proto::Envelope>(), 1, bytes};
}

TEST(Inbound, takes_so_many_bytes_and_one_message_of_any_size) {
  Inbound inbound(4, 100);
  EXPECT_TRUE(inbound.try_push(arrival(500)));
  EXPECT_FALSE(inbound.try_push(arrival(1)));
  EXPECT_EQ(inbound.try_pop()->bytes, 500u);
  EXPECT_TRUE(inbound.try_push(arrival(60)));
  EXPECT_TRUE(inbound.try_push(arrival(40)));
  EXPECT_FALSE(inbound.try_push(arrival(1)));
  EXPECT_EQ(inbound.try_pop()->bytes, 60u);
  EXPECT_TRUE(inbound.try_push(arrival(1)));
}

TEST(Inbound, takes_so_many_messages) {
  Inbound inbound(2, 100);
  int taken = 0;
  while (taken < 10 && inbound.try_push(arrival(1))) ++taken;
  EXPECT_EQ(taken, 2);
  EXPECT_TRUE(inbound.try_pop());
  EXPECT_TRUE(inbound.try_push(arrival(98))) << "the bytes of those that were popped are free";
}

struct TwoHands final : replica::HandLine {
  void take(const wire::HapticLaw&) override {}
  void take(const wire::HapticPatch&) override {}
  std::optional<replica::HandLineReading> pop_reading(std::uint64_t) override {
    if (readings.empty()) return std::nullopt;
    const replica::HandLineReading next{readings.front(), {}, 7};
    readings.pop_front();
    return next;
  }
  std::optional<wire::HandReport> pop_report() override {
    if (reports == 0) return std::nullopt;
    --reports;
    return wire::HandReport{};
  }
  std::deque<std::uint32_t> readings;
  std::size_t reports = 0;
};

TEST(HandMessages, a_reading_gives_way_to_the_next_of_its_tool_and_reports_are_bounded) {
  TwoHands hands;
  NetFigures figures;
  HandMessages messages(hands, figures);
  EXPECT_FALSE(messages.ask(nullptr, 1));
  hands.readings = {0, 1, 0, 9, 0};  // there is no tool 9
  hands.reports = HandMessages::kMostReports + 3;
  EXPECT_TRUE(messages.ask(nullptr, 2));
  EXPECT_EQ(figures.sends_dropped, 3u);
  std::vector<wire::SharedBytes> frames;
  messages.move_to(frames);
  EXPECT_EQ(frames.size(), 2 + HandMessages::kMostReports);
  frames.clear();
  messages.move_to(frames);
  EXPECT_TRUE(frames.empty());
  hands.readings = {1};
  EXPECT_TRUE(messages.ask(nullptr, 3));
  messages.begin();
  messages.move_to(frames);
  EXPECT_TRUE(frames.empty()) << "they were meant for the connection before";
}

}  // namespace
}  // namespace trocar::net
