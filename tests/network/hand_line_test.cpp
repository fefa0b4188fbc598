// Readings of hands and the answers to them, beside the session's other messages: nobody polls the
// source here once it is live, as beside a picture that takes for ever.

#include "client/replica/hand_line.h"

#include <functional>
#include <mutex>

#include "client/net/net_source.h"
#include "client/replica/replica.h"
#include "tests/network/tls_fixture.h"

namespace trocar::testing {
namespace {

using namespace std::chrono_literals;

// A hand that always has a new reading, and a report now and then.
class RestlessHand final : public replica::HandLine {
 public:
  void take(const wire::HapticLaw&) override { ++laws; }
  void take(const wire::HapticPatch& patch) override {
    last_echo_us = patch.echo_time_us;
    ++patches;
  }
  std::optional<replica::HandLineReading> pop_reading(std::uint64_t now_ns) override {
    const auto thread = std::this_thread::get_id();
    if (first_thread == std::thread::id()) first_thread = thread;
    is_one_thread = is_one_thread && thread == first_thread;
    if (now_ns == last_ns) return std::nullopt;  // once each time that it is asked
    last_ns = now_ns;
    const auto number = ++readings;
    tool::ToolSample sample;
    sample.verb = tool::Verb::Push;
    return replica::HandLineReading{0, sample, number};
  }
  std::optional<wire::HandReport> pop_report() override {
    if (readings % 32 != 0 || reported == readings) return std::nullopt;
    reported = readings;
    wire::HandReport report;
    report.moments.push_back({.time_us = reported});
    return report;
  }

  std::atomic<std::uint64_t> laws{0}, patches{0}, readings{0}, last_echo_us{0};
  std::uint64_t last_ns = 0, reported = 0;
  std::thread::id first_thread;
  std::atomic<bool> is_one_thread{true};
};

bool wait_until(const std::function<bool()>& is_true) {
  for (int k = 0; k < 10'000; ++k) {
    if (is_true()) return true;
    std::this_thread::sleep_for(1ms);
  }
  return false;
}

wire::HapticLaw law() {
  wire::HapticLaw law;
  law.number = 1;
  return law;
}

replication::ReplicatorOptions with_a_law() {
  replication::ReplicatorOptions options;
  options.haptic_laws = {law()};
  return options;
}

// A frame in which the first participant's tool was felt.
step::SharedFrame felt_frame(LiveSession& session, std::uint64_t echo_us) {
  auto frame = std::make_shared<step::PublishedFrame>(*session.make_frame(5));
  frame->tools.push_back({.tool = tool_slot({0}, 0)});
  frame->tools.back().touch.echo_time_us = echo_us;
  return frame;
}

net::NetSourceOptions options_for(LiveSession& session, RestlessHand& hand) {
  net::NetSourceOptions options;
  options.port = session.port();
  options.participant_name = "Anna";
  options.hands = &hand;
  return options;
}

std::uint64_t samples_at(LiveSession& session) {
  return session.on_io([&] { return session.replicator().counters().samples; });
}

TEST(HandLine, goes_on_over_the_stream_while_nobody_polls) {
  LiveSession session({}, with_a_law());
  session.publish(10);
  RestlessHand hand;
  net::NetSource source(options_for(session, hand));
  replica::Replica replica([&](const proto::Envelope& message) { return source.send(message); });
  ASSERT_TRUE(wait_until([&] {
    source.poll(replica);
    return replica.newest() != nullptr;
  }));
  EXPECT_EQ(hand.laws, 1u);
  // From here on the render thread is busy.
  const auto before = samples_at(session);
  ASSERT_TRUE(wait_until([&] { return samples_at(session) >= before + 100; }));
  session.publish_all({felt_frame(session, 1234)});
  ASSERT_TRUE(wait_until([&] { return hand.patches == 1; }));
  EXPECT_EQ(hand.last_echo_us, 1234u);
  ASSERT_TRUE(wait_until([&] {
    return session.on_io([&] { return session.replicator().counters().hand_reports; }) >= 3;
  }));
  EXPECT_TRUE(hand.is_one_thread);
  source.poll(replica);
  EXPECT_TRUE(replica.fault().ok()) << "the replica leaves what hands feel alone";
}

TEST(HandLine, goes_on_in_datagrams_while_the_queue_of_the_picture_is_full) {
  GuardedSession guarded(-1, tls_options(), with_a_law());
  auto& session = *guarded.session;
  session.publish(10);
  RestlessHand hand;
  net::NetSourceOptions options;
  options.port = session.port();
  options.participant_name = "Anna";
  options.hands = &hand;
  options.inbound_capacity = 8;
  options.connect_deadline = 8s;
  options.tls = secure::make_client_context();
  options.join_code = [code = guarded.code(wire::Role::Surgeon)] {
    return Result<secure::JoinCode>(code);
  };
  net::NetSource source(options);
  replica::Replica replica([&](const proto::Envelope& message) { return source.send(message); });
  ASSERT_TRUE(wait_until([&] {
    session.publish_all({felt_frame(session, 1)});
    std::this_thread::sleep_for(4ms);
    source.poll(replica);
    return replica.counters().by_datagram >= 20;
  })) << "datagrams have begun";
  // From here on the render thread is busy, and the queue to it fills.
  const auto before = samples_at(session);
  const auto patches = hand.patches.load();
  std::uint64_t echo_us = 100;
  ASSERT_TRUE(wait_until([&] {
    session.publish_all({felt_frame(session, ++echo_us)});
    std::this_thread::sleep_for(4ms);
    return hand.patches >= patches + 100 && samples_at(session) >= before + 100;
  }));
  EXPECT_GT(hand.last_echo_us, 150u) << "the newest, not what waits in a queue";
  EXPECT_TRUE(hand.is_one_thread);
}

TEST(HandLine, comes_back_with_the_connection) {
  LiveSession session({}, with_a_law());
  session.publish(10);
  RestlessHand hand;
  net::NetSource source(options_for(session, hand));
  ASSERT_TRUE(wait_until([&] { return samples_at(session) >= 20; }));
  session.on_io([&] { session.tcp().close(1); });
  ASSERT_TRUE(wait_until([&] {
    return session.on_io([&] { return session.replicator().counters().returned; }) == 1;
  }));
  const auto before = samples_at(session);
  ASSERT_TRUE(wait_until([&] { return samples_at(session) >= before + 20; }));
  EXPECT_EQ(hand.laws, 2u) << "told anew";
}

}  // namespace
}  // namespace trocar::testing
