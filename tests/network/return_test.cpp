// A client whose connection breaks comes back by itself, over real sockets, with TLS and without.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/buffer.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <functional>

#include "client/net/comeback.h"
#include "common/secure/digest.h"
#include "common/secure/stream.h"
#include "tests/network/collector.h"
#include "tests/network/tls_fixture.h"

namespace trocar::testing {
namespace {

using replica::CloseKind;
using replica::SourceState;
using std::chrono::milliseconds;
using wire::Role;

bool becomes(net::NetSource& source, Collector& sink, SourceState state) {
  return poll_until(source, sink, [&] { return source.state() == state; });
}

// Until it has come back so many times; on a busy machine nobody may see that it was away.
bool comes_back(net::NetSource& source, Collector& sink, std::uint64_t times) {
  return poll_until(source, sink, [&] {
    return source.statistics().returns == times && source.state() == SourceState::Live;
  });
}

net::NetSourceOptions options_for(std::uint16_t port, const std::string& name) {
  net::NetSourceOptions options;
  options.port = port;
  options.participant_name = name;
  options.connect_deadline = milliseconds(5000);
  options.ping_interval = milliseconds(20);
  return options;
}

net::NetSourceOptions guarded_options(GuardedSession& guarded, Role role) {
  auto options = options_for(guarded.session->port(), "Anna");
  options.role = static_cast<int>(role);
  options.tls = secure::make_client_context();
  options.join_code = [code = guarded.code(role)] { return Result<secure::JoinCode>(code); };
  return options;
}

// Breaks all connections, as a network does.
void break_connections(LiveSession& session) {
  session.on_io([&] {
    for (net::ConnectionId id = 1; id < 100; ++id) session.tcp().close(id);
  });
}

TEST(Return, a_broken_connection_comes_back_to_the_same_place_with_a_new_keyframe) {
  LiveSession session;
  session.publish(10);
  net::NetSource source(options_for(session.port(), "Anna"));
  Collector sink;
  ASSERT_TRUE(poll_until(source, sink, [&] { return source.statistics().frames_received == 1; }));
  for (std::uint64_t round = 1; round <= 3; ++round) {
    break_connections(session);
    ASSERT_TRUE(comes_back(source, sink, round));
    ASSERT_TRUE(
        poll_until(source, sink, [&] { return source.statistics().frames_received == 1 + round; }));
    EXPECT_EQ(source.statistics().away_seconds, 0);
    EXPECT_GE(source.statistics().longest_away_seconds, 0.2);
    ASSERT_TRUE(source.send(make_sample(1)));
    ASSERT_TRUE(poll_until(source, sink, [&] {
      return session.on_io([&] { return session.replicator().counters().samples; }) == round;
    }));
  }
  EXPECT_EQ(sink.count(proto::Envelope::kWelcome), 4u);
  for (const auto& message : sink.messages) {
    if (!message.has_welcome()) continue;
    EXPECT_EQ(message.welcome().participant(), 0u);
  }
  source.close("done");
  ASSERT_TRUE(becomes(source, sink, SourceState::Closed));
  EXPECT_EQ(source.close_reason().kind, CloseKind::Ended);
  EXPECT_TRUE(session.wait_for_sessions(0));
}

// A client does not wait for as long as the server is busy. What it writes then is reset, and the
// Bye that came before is still to be read.
TEST(Return, who_leaves_a_busy_server_leaves_no_place_behind) {
  GuardedSession guarded;
  auto& session = *guarded.session;
  session.publish(10);
  std::thread busy;
  {
    net::NetSource source(guarded_options(guarded, Role::Surgeon));
    Collector sink;
    ASSERT_TRUE(poll_until(source, sink, [&] { return source.statistics().frames_received == 1; }));
    const std::vector frames{session.make_frame(10), session.make_frame(10)};
    busy = std::thread([&session, frames] {
      session.on_io([&] {
        std::this_thread::sleep_for(milliseconds(2600));
        session.replicator().publish(frames);
      });
    });
    std::this_thread::sleep_for(milliseconds(50));
    source.close("done");
    EXPECT_TRUE(becomes(source, sink, SourceState::Closed));
  }
  busy.join();
  ASSERT_TRUE(session.wait_for_sessions(0));
  EXPECT_TRUE(session.on_io([&] { return session.replicator().roster().list().empty(); }));
}

TEST(Return, a_silent_server_counts_as_broken_and_its_hanging_connection_is_replaced) {
  LiveSession session;
  session.publish(10);
  auto options = options_for(session.port(), "Anna");
  options.return_silence = milliseconds(300);
  net::NetSource source(options);
  Collector sink;
  ASSERT_TRUE(becomes(source, sink, SourceState::Live));
  auto held = std::async(std::launch::async, [&] {
    session.on_io([] { std::this_thread::sleep_for(milliseconds(1500)); });
  });
  ASSERT_TRUE(becomes(source, sink, SourceState::Away));
  held.get();
  ASSERT_TRUE(becomes(source, sink, SourceState::Live));
  EXPECT_GE(source.statistics().longest_away_seconds, 0.2);
  EXPECT_EQ(session.on_io([&] { return session.replicator().roster().list().size(); }), 1u);
  ASSERT_TRUE(session.wait_for_sessions(1));
}

TEST(Return, a_server_that_is_gone_for_good_is_lost_after_the_time) {
  replication::ReplicatorOptions replication;
  replication.return_seconds = 1;
  auto session = std::make_unique<LiveSession>(net::TcpServerOptions(), replication);
  session->publish(10);
  net::NetSource source(options_for(session->port(), "Anna"));
  Collector sink;
  ASSERT_TRUE(becomes(source, sink, SourceState::Live));
  const auto began = std::chrono::steady_clock::now();
  session.reset();
  ASSERT_TRUE(becomes(source, sink, SourceState::Away));
  EXPECT_FALSE(source.send(make_sample(1)));
  EXPECT_LE(source.statistics().away_left_seconds, 1);
  ASSERT_TRUE(becomes(source, sink, SourceState::Closed));
  EXPECT_GT(std::chrono::steady_clock::now() - began, milliseconds(1000));
  EXPECT_EQ(source.close_reason().kind, CloseKind::Lost);
  EXPECT_NE(source.close_reason().text.find("could not be made again for"), std::string::npos)
      << source.close_reason().text;
}

TEST(Return, a_client_that_leaves_while_away_does_not_wait) {
  auto session = std::make_unique<LiveSession>();
  net::NetSource source(options_for(session->port(), "Anna"));
  Collector sink;
  ASSERT_TRUE(becomes(source, sink, SourceState::Live));
  session.reset();
  ASSERT_TRUE(becomes(source, sink, SourceState::Away));
  source.close("enough");
  ASSERT_TRUE(becomes(source, sink, SourceState::Closed));
  EXPECT_EQ(source.close_reason().kind, CloseKind::Ended);
}

TEST(Return, the_token_takes_no_use_of_the_code_and_the_audit_log_tells) {
  GuardedSession guarded(1);
  guarded.session->publish(10);
  net::NetSource source(guarded_options(guarded, Role::Surgeon));
  Collector sink;
  ASSERT_TRUE(becomes(source, sink, SourceState::Live));
  for (std::uint64_t round = 1; round <= 2; ++round) {
    break_connections(*guarded.session);
    ASSERT_TRUE(comes_back(source, sink, round));
  }
  const auto lines = guarded.audit();
  ASSERT_EQ(lines.size(), 5u);
  const std::array<const char*, 5> events{"join", "lost", "back", "lost", "back"};
  const auto token = sink.messages.front().welcome().return_token();
  const BytesView bytes{reinterpret_cast<const std::uint8_t*>(token.data()), token.size()};
  for (std::size_t i = 0; i < lines.size(); ++i) {
    EXPECT_NE(lines[i].find(std::string("\"event\":\"") + events[i] + "\""), std::string::npos)
        << lines[i];
    EXPECT_EQ(lines[i].find(secure::to_hex(bytes)), std::string::npos);
  }
  EXPECT_EQ(guarded.counters().wrong_tries, 0u);
}

TEST(Return, after_the_time_the_code_is_needed_and_takes_a_use) {
  replication::ReplicatorOptions replication;
  std::atomic<std::uint64_t> clock_ns{1'000'000'000'000};
  replication.clock_ns = [&clock_ns] { return clock_ns += 31'000'000'000; };
  GuardedSession guarded(1, tls_options(), replication);
  guarded.session->publish(10);
  net::NetSource source(guarded_options(guarded, Role::Surgeon));
  Collector sink;
  ASSERT_TRUE(becomes(source, sink, SourceState::Live));
  break_connections(*guarded.session);
  ASSERT_TRUE(becomes(source, sink, SourceState::Closed));
  EXPECT_EQ(source.close_reason().kind, CloseKind::Refused);
  EXPECT_EQ(sink.messages.back().goodbye().reason(), proto::GOODBYE_CODE_USED_UP);
}

TEST(Return, another_certificate_is_refused_before_the_token_is_sent) {
  GuardedSession guarded;
  const auto port = guarded.session->port();
  net::NetSource source(guarded_options(guarded, Role::Observer));
  Collector sink;
  ASSERT_TRUE(becomes(source, sink, SourceState::Live));
  guarded.session.reset();
  LiveSession impostor(tls_options(1), {}, {8, 5, 8, 0.01}, port);
  ASSERT_TRUE(becomes(source, sink, SourceState::Closed));
  EXPECT_EQ(source.close_reason().kind, CloseKind::Refused);
  EXPECT_NE(source.close_reason().text.find("certificate"), std::string::npos)
      << source.close_reason().text;
  EXPECT_EQ(impostor.on_io([&] { return impostor.tcp().counters().messages_in; }), 0u);
}

// The first five wrong tries cost nothing; then the address waits.
TEST(Return, wrong_tokens_count_as_wrong_codes_but_late_ones_do_not) {
  GuardedSession guarded;
  net::NetSource anna(guarded_options(guarded, Role::Surgeon));
  Collector sink;
  ASSERT_TRUE(becomes(anna, sink, SourceState::Live));
  asio::io_context io;
  const auto say_hello = [&](const std::string& name, const std::string& token) {
    secure::Stream stream(asio::ip::tcp::socket(io), secure::make_client_context());
    stream.socket().connect({asio::ip::make_address("127.0.0.1"), guarded.session->port()});
    auto hello = make_hello(name, proto::ROLE_SURGEON);
    hello.mutable_hello()->set_return_token(token);
    const auto frame = wire::encode_envelope(hello);
    const std::string host = "127.0.0.1";
    const std::vector<asio::const_buffer> buffers{asio::buffer(*frame)};
    proto::Envelope answer;
    asio::co_spawn(
        io,
        [&]() -> asio::awaitable<void> {
          const auto error = co_await stream.begin_tls(host);
          if (error) co_return;
          co_await stream.write_all(buffers);
          std::array<std::uint8_t, wire::kHeaderBytes> header{};
          co_await stream.read_all(asio::buffer(header));
          const auto length = wire::decode_length(header, wire::kMaxDownstreamBytes);
          if (!length) co_return;
          Bytes body(*length);
          co_await stream.read_all(asio::buffer(body));
          const auto decoded = wire::decode_envelope(body, answer);
          EXPECT_TRUE(decoded.ok());
        },
        asio::detached);
    io.restart();
    io.run();
    return answer.goodbye().reason();
  };
  const std::string wrong(participants::kReturnTokenBytes, 'x');
  for (int i = 0; i < 3; ++i)
    EXPECT_EQ(say_hello("Nobody", wrong), proto::GOODBYE_CODE_WRONG) << "of no place: no try";
  EXPECT_EQ(guarded.counters().wrong_tries, 0u);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(say_hello("Anna", wrong), proto::GOODBYE_CODE_WRONG);
  EXPECT_EQ(guarded.counters().wrong_tries, 5u);
  EXPECT_EQ(say_hello("Anna", wrong), proto::GOODBYE_TOO_MANY_TRIES);
  // She has the right token, and is at the same address.
  break_connections(*guarded.session);
  EXPECT_TRUE(comes_back(anna, sink, 1));
}

TEST(Comeback, pauses_grow_to_two_seconds_and_end_with_the_time) {
  net::Comeback comeback;
  EXPECT_FALSE(comeback.is_allowed());
  comeback.allow("", 30);
  EXPECT_FALSE(comeback.is_allowed());
  comeback.allow(std::string(16, 'x'), 0);
  EXPECT_FALSE(comeback.is_allowed());
  comeback.allow(std::string(16, 'x'), 30);
  ASSERT_TRUE(comeback.is_allowed());
  std::uint64_t now = 5'000'000'000;
  comeback.begin(now);
  std::uint64_t last = 0;
  int tries = 0;
  while (!comeback.is_over(now)) {
    const auto next = comeback.next_pause(now);
    const auto pause = static_cast<std::uint64_t>(next.count());
    EXPECT_LE(next, net::Comeback::kLongestPause);
    EXPECT_TRUE(pause >= last || now + pause == comeback.deadline_ns());
    EXPECT_TRUE(tries > 0 || next == net::Comeback::kFirstPause);
    last = pause;
    now += pause;
    comeback.begin(now);  // a try has failed
    ++tries;
  }
  EXPECT_EQ(now, 35'000'000'000u);
  EXPECT_GT(tries, 15);
  EXPECT_LT(tries, 25);
  EXPECT_NEAR(comeback.figures(now).away_seconds, 30, 1e-9);
  EXPECT_EQ(comeback.figures(now).left_seconds, 0);
  comeback.end(now);
  EXPECT_EQ(comeback.figures(now).returns, 1u);
  EXPECT_NEAR(comeback.figures(now).longest_seconds, 30, 1e-9);
  EXPECT_FALSE(comeback.is_away());
}

}  // namespace
}  // namespace trocar::testing
