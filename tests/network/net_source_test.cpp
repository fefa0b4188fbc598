// NetSource against a live session: order, pings, back-pressure, ends and their reasons.

#include "client/net/net_source.h"

#include <algorithm>
#include <functional>

#include "tests/network/collector.h"
#include "tests/network/session_fixture.h"

namespace trocar::testing {
namespace {

using replica::CloseKind;
using replica::SourceState;

net::NetSourceOptions options_for(std::uint16_t port, const std::string& name) {
  net::NetSourceOptions options;
  options.port = port;
  options.participant_name = name;
  options.connect_deadline = std::chrono::milliseconds(3000);
  options.ping_interval = std::chrono::milliseconds(20);
  return options;
}

TEST(NetSource, joins_and_gets_everything_in_order_with_round_trips) {
  LiveSession session;
  session.publish(10);
  net::NetSource source(options_for(session.port(), "Anna"));
  Collector sink;
  EXPECT_FALSE(source.send(make_sample(1))) << "not live yet";
  ASSERT_TRUE(
      poll_until(source, sink, [&] { return sink.count(proto::Envelope::kSurfaceFrame) == 1; }));
  EXPECT_EQ(source.state(), SourceState::Live);
  EXPECT_TRUE(sink.messages[0].has_welcome());
  EXPECT_TRUE(sink.messages[1].has_participants());
  EXPECT_TRUE(sink.messages[2].has_surface_topology());
  const auto is_frame = [](const auto& message) { return message.has_surface_frame(); };
  EXPECT_TRUE(std::none_of(sink.messages.begin(), sink.messages.begin() + 3, is_frame));
  for (std::uint32_t i = 1; i <= 50; ++i) ASSERT_TRUE(source.send(make_sample(i)));
  ASSERT_TRUE(poll_until(source, sink, [&] {
    return session.on_io([&] { return session.replicator().counters().samples; }) == 50;
  }));
  ASSERT_TRUE(poll_until(source, sink, [&] { return source.statistics().round_trip_seconds > 0; }));
  EXPECT_EQ(sink.count(proto::Envelope::kPong), 0u) << "its own business";
  EXPECT_EQ(source.statistics().frames_received, 1u);
  source.close("done");
  ASSERT_TRUE(poll_until(source, sink, [&] { return source.state() == SourceState::Closed; }));
  EXPECT_EQ(source.close_reason().kind, CloseKind::Ended);
  EXPECT_TRUE(session.wait_for_sessions(0));
}

TEST(NetSource, a_full_queue_stops_reading_and_loses_nothing) {
  LiveSession session({}, {}, {24, 12, 24, 0.01});
  session.publish(10);
  auto options = options_for(session.port(), "Anna");
  options.inbound_capacity = 8;
  options.acks_every_frame = false;
  net::NetSource source(options);
  Collector sink;
  ASSERT_TRUE(
      poll_until(source, sink, [&] { return sink.count(proto::Envelope::kSurfaceFrame) == 1; }));
  for (int i = 0; i < 700; ++i) session.publish(6000);
  EXPECT_GT(session.on_io([&] { return session.replicator().counters().frames_skipped; }), 0u)
      << "the server was never held back";
  RawClient checker(session.port());
  const auto given = [&] {
    return session.on_io([&] { return session.replicator().counters().frames_given; });
  };
  const auto given_so_far = given();
  ASSERT_TRUE(poll_until(
      source, sink, [&] { return sink.count(proto::Envelope::kSurfaceFrame) == given_so_far; }));
  session.publish(10);
  ASSERT_TRUE(poll_until(source, sink, [&] {
    return sink.count(proto::Envelope::kSurfaceFrame) == given_so_far + 1;
  }));
  // Every delta is against the frame delivered just before it.
  std::uint32_t last = 0;
  for (const auto& message : sink.messages) {
    if (!message.has_surface_frame()) continue;
    const auto& frame = message.surface_frame();
    EXPECT_TRUE(frame.is_keyframe() || frame.base_frame() == last);
    last = frame.frame();
  }
}

TEST(NetSource, refusals_and_endings_say_why) {
  LiveSession session;
  session.publish(10);
  net::NetSource anna(options_for(session.port(), "Anna"));
  Collector sink;
  ASSERT_TRUE(poll_until(anna, sink, [&] { return anna.state() == SourceState::Live; }));
  net::NetSource twin(options_for(session.port(), "Anna"));
  Collector twin_sink;
  ASSERT_TRUE(poll_until(twin, twin_sink, [&] { return twin.state() == SourceState::Closed; }));
  EXPECT_EQ(twin.close_reason().kind, CloseKind::Refused);
  EXPECT_NE(twin.close_reason().text.find("Anna"), std::string::npos);
  ASSERT_EQ(twin_sink.count(proto::Envelope::kGoodbye), 1u) << "delivered like any message";

  session.on_io([&] {
    session.replicator().end_all(replication::EndReason::ServerClosing, "the session is over");
  });
  ASSERT_TRUE(poll_until(anna, sink, [&] { return anna.state() == SourceState::Closed; }));
  EXPECT_EQ(anna.close_reason().kind, CloseKind::Ended);
}

TEST(NetSource, no_server_is_unreachable_and_a_broken_connection_is_lost) {
  std::uint16_t port = 0;
  {
    LiveSession session;
    port = session.port();
    auto options = options_for(port, "Anna");
    options.can_return = false;
    net::NetSource source(options);
    Collector sink;
    ASSERT_TRUE(poll_until(source, sink, [&] { return source.state() == SourceState::Live; }));
    session.on_io([&] { session.tcp().close(1); });
    ASSERT_TRUE(poll_until(source, sink, [&] { return source.state() == SourceState::Closed; }));
    EXPECT_EQ(source.close_reason().kind, CloseKind::Lost);
  }
  auto options = options_for(port, "Anna");
  options.connect_deadline = std::chrono::milliseconds(300);
  options.connect_retry = std::chrono::milliseconds(50);
  net::NetSource source(options);
  Collector sink;
  ASSERT_TRUE(poll_until(source, sink, [&] { return source.state() == SourceState::Closed; }));
  EXPECT_EQ(source.close_reason().kind, CloseKind::Unreachable);
  EXPECT_TRUE(sink.messages.empty());
}

TEST(NetSource, an_exception_on_its_thread_ends_it_with_a_reason) {
  LiveSession session;
  session.publish(10);
  auto options = options_for(session.port(), "Anna");
  int messages = 0;
  options.before_message = [&messages] {
    if (++messages == 3) throw std::runtime_error("no room for a message");
  };
  net::NetSource source(options);
  Collector sink;
  ASSERT_TRUE(poll_until(source, sink, [&] { return source.state() == SourceState::Closed; }));
  EXPECT_EQ(source.close_reason().kind, CloseKind::Lost);
  EXPECT_NE(source.close_reason().text.find("this client failed (no room for a message)"),
            std::string::npos)
      << source.close_reason().text;
  EXPECT_EQ(sink.messages.size(), 2u) << "what came before is not lost";
}

TEST(NetSource, goes_away_in_any_state) {
  LiveSession session;
  for (int i = 0; i < 20; ++i) {
    net::NetSource source(options_for(session.port(), "Anna " + std::to_string(i)));
    Collector sink;
    // At once, once it is welcome, or in the middle of what comes then.
    const auto has_come_far = [&] {
      return i % 3 == 0 ||
             (i % 3 == 1 ? source.state() == SourceState::Live : !sink.messages.empty());
    };
    EXPECT_TRUE(poll_until(source, sink, has_come_far));
  }
  EXPECT_TRUE(session.wait_for_sessions(0));
}

TEST(ServerAddress, forms_and_errors) {
  net::NetSourceOptions options;
  ASSERT_TRUE(net::parse_server_address("example.org:80", options).ok());
  EXPECT_EQ(options.host, "example.org");
  EXPECT_EQ(options.port, 80);
  ASSERT_TRUE(net::parse_server_address("[::1]:7691", options).ok());
  EXPECT_EQ(options.host, "::1");
  EXPECT_EQ(options.port, 7691);
  ASSERT_TRUE(net::parse_server_address("fe80::1", options).ok());
  EXPECT_EQ(options.host, "fe80::1");
  for (const char* text : {"", ":1", "a:", "a:0", "a:70000", "a:x", "[::1", "[::1]7", "[::1]:"})
    EXPECT_FALSE(net::parse_server_address(text, options).ok()) << text;
}

}  // namespace
}  // namespace trocar::testing
