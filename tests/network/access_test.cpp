// Who gets in, over real sockets: TLS, certificates, join codes and what they refuse.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <functional>

#include "common/secure/private_files.h"
#include "tests/network/collector.h"
#include "tests/network/tls_fixture.h"

namespace trocar::testing {
namespace {

using replica::CloseKind;
using replica::SourceState;
using wire::Role;

net::NetSourceOptions options_for(std::uint16_t port, const std::string& name, Role role,
                                  std::optional<secure::JoinCode> code) {
  net::NetSourceOptions options;
  options.port = port;
  options.participant_name = name;
  options.role = static_cast<int>(role);
  options.connect_deadline = std::chrono::milliseconds(5000);
  options.tls = secure::make_client_context();
  if (code) options.join_code = [code] { return Result<secure::JoinCode>(*code); };
  return options;
}

struct Outcome {
  bool is_in = false;
  CloseKind kind = CloseKind::None;
  std::string text;
  proto::GoodbyeReason reason = proto::GOODBYE_UNSPECIFIED;
};

// Comes and leaves again, or is refused.
Outcome try_to_join(net::NetSourceOptions options) {
  net::NetSource source(std::move(options));
  Collector sink;
  Outcome outcome;
  EXPECT_TRUE(poll_until(source, sink, [&] { return source.state() != SourceState::Connecting; }));
  outcome.is_in = source.state() == SourceState::Live;
  if (outcome.is_in) return outcome;
  outcome.kind = source.close_reason().kind;
  outcome.text = source.close_reason().text;
  for (const auto& message : sink.messages)
    if (message.has_goodbye()) outcome.reason = message.goodbye().reason();
  EXPECT_EQ(outcome.text.find('\n'), std::string::npos) << outcome.text;
  return outcome;
}

Outcome try_to_join(GuardedSession& guarded, const std::string& name, Role role,
                    std::optional<secure::JoinCode> code) {
  return try_to_join(options_for(guarded.session->port(), name, role, code));
}

secure::JoinCode wrong(secure::JoinCode code, std::uint8_t change = 1) {
  code.secret[4] ^= change;
  return code;
}

TEST(Access, a_session_goes_through_tls_from_the_code_to_the_goodbye) {
  GuardedSession guarded;
  auto& session = *guarded.session;
  session.publish(10);
  auto options = options_for(session.port(), "Anna", Role::Surgeon, guarded.code(Role::Surgeon));
  options.wants_datagrams = false;  // some of these may be lost
  net::NetSource source(std::move(options));
  Collector sink;
  const auto frames = [&] { return source.statistics().frames_received; };
  ASSERT_TRUE(poll_until(source, sink, [&] { return frames() == 1; }));
  EXPECT_TRUE(sink.messages[0].has_welcome());
  for (std::uint32_t i = 1; i <= 50; ++i) ASSERT_TRUE(source.send(make_sample(i)));
  for (int i = 0; i < 30; ++i) session.publish(200);
  ASSERT_TRUE(poll_until(source, sink, [&] {
    return session.on_io([&] { return session.replicator().counters().samples; }) == 50;
  }));
  ASSERT_TRUE(poll_until(source, sink, [&] {
    return frames() == session.on_io([&] { return session.replicator().counters().frames_given; });
  }));
  session.on_io([&] {
    session.replicator().end_all(replication::EndReason::ServerClosing, "the session is over");
  });
  ASSERT_TRUE(poll_until(source, sink, [&] { return source.state() == SourceState::Closed; }));
  EXPECT_EQ(source.close_reason().kind, CloseKind::Ended);
}

// With 10 places for watchers so many come with one code, and the next is told that.
void expect_places_of_one_code(Role role, int places, const std::string& told) {
  replication::ReplicatorOptions few;
  few.places = {.watchers = 10};
  GuardedSession guarded(-1, tls_options(), few);
  guarded.session->publish(10);
  std::vector<std::unique_ptr<net::NetSource>> crowd;
  for (int i = 0; i < places; ++i) {
    Collector sink;
    auto& one = *crowd.emplace_back(std::make_unique<net::NetSource>(options_for(
        guarded.session->port(), "watcher " + std::to_string(i), role, guarded.code(role))));
    ASSERT_TRUE(poll_until(one, sink, [&] { return one.state() == SourceState::Live; }));
  }
  const auto late = try_to_join(guarded, "late", role, guarded.code(role));
  EXPECT_EQ(late.reason, proto::GOODBYE_FULL);
  EXPECT_NE(late.text.find(told), std::string::npos) << late.text;
  for (const auto other : {Role::Surgeon, Role::Instructor, Role::Observer})
    if (other != role) {
      EXPECT_TRUE(try_to_join(guarded, "Ada", other, guarded.code(other)).is_in);
    }
}

TEST(Access, one_code_does_not_take_all_places) {
  expect_places_of_one_code(Role::Observer, 5, "5 observers with this code");
  expect_places_of_one_code(Role::Instructor, 3, "3 instructors with this code");
}

TEST(Access, frames_larger_than_a_record_of_tls_arrive_whole) {
  GuardedSession guarded;
  auto tcp = tls_options();
  LiveSession session(tcp, {}, {24, 12, 24, 0.01});
  session.publish(8000);
  net::NetSource source(
      options_for(session.port(), "Anna", Role::Observer, guarded.code(Role::Observer)));
  Collector sink;
  ASSERT_TRUE(poll_until(source, sink, [&] { return source.statistics().frames_received == 1; }));
  EXPECT_GT(source.statistics().bytes_received, 2u * 16'384u);
}

TEST(Access, another_servers_certificate_is_refused_before_a_byte_of_hello) {
  GuardedSession guarded(-1, tls_options(1));
  const auto outcome = try_to_join(guarded, "Anna", Role::Surgeon, guarded.code(Role::Surgeon));
  EXPECT_FALSE(outcome.is_in);
  EXPECT_EQ(outcome.kind, CloseKind::Refused);
  EXPECT_NE(outcome.text.find("certificate"), std::string::npos) << outcome.text;
  EXPECT_TRUE(guarded.session->wait_for_sessions(0));
  const auto counters = guarded.session->on_io([&] { return guarded.session->tcp().counters(); });
  EXPECT_EQ(counters.accepted, 1u);
  EXPECT_EQ(counters.messages_in, 0u);
  EXPECT_EQ(counters.bytes_in, 0u);
}

TEST(Access, a_client_with_a_ca_takes_no_certificate_that_the_ca_did_not_sign) {
  auto elsewhere_options = tls_options();
  elsewhere_options.address = "127.0.0.2";
  GuardedSession guarded, elsewhere(-1, elsewhere_options);
  const auto ca_file = guarded.folder.path() / "ca.pem";
  const auto with_ca = [&](int number, GuardedSession& at, const std::string& host) {
    EXPECT_TRUE(secure::write_private_file(ca_file, identity(number).certificate_pem).ok());
    auto options = options_for(at.session->port(), "Anna", Role::Observer, at.code(Role::Observer));
    options.host = host;
    options.tls = *secure::make_client_context_with_ca(ca_file.string());
    options.trusts_ca = true;
    return try_to_join(options);
  };
  EXPECT_TRUE(with_ca(0, guarded, "127.0.0.1").is_in);
  EXPECT_TRUE(with_ca(0, guarded, "localhost").is_in);
  const auto other_host = with_ca(0, elsewhere, "127.0.0.2");
  EXPECT_FALSE(other_host.is_in) << "the certificate is of another host";
  EXPECT_NE(other_host.text.find("of another host"), std::string::npos) << other_host.text;
  const auto other_ca = with_ca(1, guarded, "127.0.0.1");
  EXPECT_FALSE(other_ca.is_in);
  EXPECT_NE(other_ca.text.find("--ca"), std::string::npos) << other_ca.text;
}

TEST(Access, a_plain_client_is_told_that_the_server_speaks_tls) {
  GuardedSession guarded;
  auto options = options_for(guarded.session->port(), "Anna", Role::Surgeon, std::nullopt);
  options.tls = nullptr;
  const auto outcome = try_to_join(options);
  EXPECT_EQ(outcome.reason, proto::GOODBYE_VERSION);
  EXPECT_NE(outcome.text.find("TLS"), std::string::npos) << outcome.text;
  EXPECT_EQ(guarded.session->on_io([&] { return guarded.session->tcp().counters().messages_in; }),
            0u);
}

TEST(Access, a_client_with_tls_says_that_a_plain_server_has_none) {
  LiveSession session;
  const auto outcome =
      try_to_join(options_for(session.port(), "Anna", Role::Surgeon, secure::JoinCode()));
  EXPECT_FALSE(outcome.is_in);
  EXPECT_NE(outcome.text.find("does not speak TLS"), std::string::npos) << outcome.text;
}

TEST(Access, tls_1_2_is_refused_on_either_side) {
  GuardedSession guarded;
  asio::io_context io;
  asio::ssl::context old(asio::ssl::context::tlsv12_client);
  asio::ssl::stream<asio::ip::tcp::socket> stream(io, old);
  stream.next_layer().connect({asio::ip::make_address("127.0.0.1"), guarded.session->port()});
  boost::system::error_code error;
  stream.handshake(asio::ssl::stream_base::client, error);
  EXPECT_TRUE(error.failed());
  EXPECT_EQ(guarded.session->sessions(), 0u);

  auto tcp = tls_options();
  tcp.tls = std::make_shared<asio::ssl::context>(asio::ssl::context::tlsv12_server);
  tcp.tls->use_certificate_chain(asio::buffer(identity().certificate_pem));
  tcp.tls->use_private_key(asio::buffer(identity().key_pem), asio::ssl::context::pem);
  LiveSession downgraded(tcp);
  const auto outcome = try_to_join(
      options_for(downgraded.port(), "Anna", Role::Surgeon, guarded.code(Role::Surgeon)));
  EXPECT_FALSE(outcome.is_in);
  EXPECT_NE(outcome.text.find("TLS 1.3"), std::string::npos) << outcome.text;
}

TEST(Access, each_refusal_has_a_reason_of_its_own) {
  GuardedSession guarded(1);
  const auto surgeon = guarded.code(Role::Surgeon), observer = guarded.code(Role::Observer);
  const auto reason = [&](const std::string& name, Role role, auto code) {
    const auto outcome = try_to_join(guarded, name, role, code);
    EXPECT_EQ(outcome.kind, CloseKind::Refused) << outcome.text;
    return outcome.reason;
  };
  EXPECT_EQ(reason("Anna", Role::Surgeon, std::optional<secure::JoinCode>()),
            proto::GOODBYE_CODE_WRONG);
  EXPECT_EQ(reason("Anna", Role::Surgeon, wrong(surgeon)), proto::GOODBYE_CODE_WRONG);
  EXPECT_EQ(reason("Anna", Role::Surgeon, observer), proto::GOODBYE_CODE_ROLE);
  EXPECT_EQ(reason("Anna", Role::Instructor, surgeon), proto::GOODBYE_CODE_ROLE);
  EXPECT_EQ(reason("a\x1b[2J", Role::Surgeon, surgeon), proto::GOODBYE_NAME_INVALID);
  EXPECT_EQ(reason(std::string(33, 'a'), Role::Surgeon, surgeon), proto::GOODBYE_NAME_INVALID);

  net::NetSource anna(options_for(guarded.session->port(), "Anna", Role::Surgeon, surgeon));
  Collector sink;
  ASSERT_TRUE(poll_until(anna, sink, [&] { return anna.state() == SourceState::Live; }))
      << "a refusal takes no use";
  EXPECT_EQ(reason("Anna", Role::Observer, observer), proto::GOODBYE_NAME_TAKEN);
  EXPECT_EQ(reason("Ben", Role::Surgeon, surgeon), proto::GOODBYE_CODE_USED_UP);

  auto book = *access::CodeBook::open_running(guarded.folder.path(), GuardedSession::kBookPort);
  ASSERT_TRUE(book.revoke(secure::to_text(observer), false).ok());
  guarded.clock_ns += 1'000'000'000;
  EXPECT_EQ(reason("Ben", Role::Observer, observer), proto::GOODBYE_CODE_REVOKED);
  guarded.unix_seconds += GuardedSession::kLifetime;
  EXPECT_EQ(reason("Ben", Role::Instructor, guarded.code(Role::Instructor)),
            proto::GOODBYE_CODE_EXPIRED);
}

TEST(Access, who_came_with_a_code_that_puts_out_has_to_go_and_may_not_come_back) {
  GuardedSession guarded;
  auto& session = *guarded.session;
  session.publish(10);
  const auto here = [&](const std::string& name, Role role) {
    auto options = options_for(session.port(), name, role, guarded.code(role));
    options.can_return = true;
    return std::make_unique<net::NetSource>(options);
  };
  const auto anna = here("Anna", Role::Surgeon), ben = here("Ben", Role::Observer);
  Collector of_anna, of_ben;
  ASSERT_TRUE(poll_until(*anna, of_anna, [&] { return anna->state() == SourceState::Live; }));
  ASSERT_TRUE(poll_until(*ben, of_ben, [&] { return ben->state() == SourceState::Live; }));
  auto book = *access::CodeBook::open_running(guarded.folder.path(), GuardedSession::kBookPort);
  ASSERT_TRUE(book.revoke("observer", false).ok());
  guarded.clock_ns += 1'000'000'000;
  session.publish(10);
  EXPECT_EQ(session.sessions(), 2u) << "who is in stays in";
  ASSERT_TRUE(book.revoke("surgeon", true).ok());
  guarded.clock_ns += 1'000'000'000;
  session.publish(10);
  ASSERT_TRUE(poll_until(*anna, of_anna, [&] { return anna->state() == SourceState::Closed; }));
  EXPECT_NE(anna->close_reason().text.find("revoked"), std::string::npos)
      << anna->close_reason().text;
  ASSERT_TRUE(session.wait_for_sessions(1));
  EXPECT_EQ(session.on_io([&] { return session.replicator().roster().list().size(); }), 1u);
}

TEST(Access, a_code_lets_in_roles_that_may_do_no_more) {
  GuardedSession guarded;
  const std::map<Role, std::set<Role>> expected{
      {Role::Surgeon, {Role::Surgeon, Role::Assistant, Role::Observer}},
      {Role::Assistant, {Role::Assistant, Role::Observer}},
      {Role::Instructor, {Role::Instructor, Role::Observer}},
      {Role::Observer, {Role::Observer}}};
  for (const auto& [of, admitted] : expected)
    for (const auto& known : wire::kRoles) {
      const auto name = std::string(wire::name_of(of)) + " as " + known.name;
      EXPECT_EQ(try_to_join(guarded, name, known.role, guarded.code(of)).is_in,
                admitted.contains(known.role))
          << name;
    }
}

TEST(Access, wrong_codes_make_their_address_wait_even_with_a_right_one) {
  GuardedSession guarded;
  const auto code = guarded.code(Role::Surgeon);
  for (std::uint8_t i = 1; i <= 5; ++i)
    EXPECT_EQ(try_to_join(guarded, "Eve", Role::Surgeon, wrong(code, i)).reason,
              proto::GOODBYE_CODE_WRONG);
  const auto waiting = try_to_join(guarded, "Anna", Role::Surgeon, code);
  EXPECT_EQ(waiting.reason, proto::GOODBYE_TOO_MANY_TRIES);
  EXPECT_NE(waiting.text.find("1 second"), std::string::npos) << waiting.text;
  guarded.clock_ns += 1'000'000'000;
  EXPECT_TRUE(try_to_join(guarded, "Anna", Role::Surgeon, code).is_in);
  EXPECT_EQ(guarded.counters().wrong_tries, 5u);
}

TEST(Access, a_watcher_who_sends_tool_samples_or_marks_is_put_out) {
  GuardedSession guarded;
  proto::Envelope mark;
  mark.mutable_mark_request()->set_action(proto::MARK_SET);
  for (const auto& message : {make_sample(1), mark}) {
    net::NetSource source(
        options_for(guarded.session->port(), "Olga", Role::Observer, guarded.code(Role::Observer)));
    Collector sink;
    ASSERT_TRUE(poll_until(source, sink, [&] { return source.state() == SourceState::Live; }));
    ASSERT_TRUE(source.send(message));
    ASSERT_TRUE(poll_until(source, sink, [&] { return source.state() == SourceState::Closed; }));
    EXPECT_EQ(sink.messages.back().goodbye().reason(), proto::GOODBYE_ROLE);
  }
  hands::TickInputs inputs;
  guarded.session->inbox.drain(inputs);
  EXPECT_TRUE(inputs.samples.empty());
  EXPECT_EQ(inputs.mark, hands::MarkAction::None);
}

TEST(Access, half_open_handshakes_are_bounded_and_cut_by_the_deadline) {
  auto tcp = tls_options();
  tcp.max_newcomers = 3;
  tcp.hello_deadline = std::chrono::milliseconds(1500);
  GuardedSession guarded(-1, tcp);
  auto& session = *guarded.session;
  {
    RawClient mute(session.port()), dripping(session.port()), greeting(session.port());
    // A record of TLS that announces 512 bytes and brings them one by one.
    ASSERT_TRUE(dripping.send_bytes(Bytes{0x16, 0x03, 0x01, 0x02, 0x00, 0x01}));
    ASSERT_TRUE(greeting.send_bytes(Bytes{0x16}));
    while (session.on_io([&] { return session.tcp().counters().accepted; }) < 3)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    RawClient fourth(session.port());
    EXPECT_TRUE(mute.reads_to_end()) << "the oldest makes room";
    EXPECT_EQ(session.on_io([&] { return session.tcp().counters().newcomers_dropped; }), 1u);
    EXPECT_TRUE(fourth.reads_to_end());
    while (dripping.send_bytes(Bytes{0}))
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    EXPECT_TRUE(greeting.reads_to_end());
  }
  EXPECT_EQ(session.sessions(), 0u) << "nobody above heard of them";
  EXPECT_EQ(session.on_io([&] { return session.tcp().counters().handshakes_failed; }), 4u);
  EXPECT_TRUE(try_to_join(guarded, "Anna", Role::Surgeon, guarded.code(Role::Surgeon)).is_in);
}

TEST(Access, a_class_that_joins_at_once_from_one_address_gets_in) {
  auto tcp = tls_options();
  tcp.max_newcomers_per_address = 2;
  GuardedSession guarded(-1, tcp);
  std::vector<std::unique_ptr<net::NetSource>> trainees;
  for (int i = 0; i < 24; ++i) {
    auto options = options_for(guarded.session->port(), "Trainee " + std::to_string(i),
                               Role::Observer, guarded.code(Role::Observer));
    options.connect_deadline = std::chrono::milliseconds(60'000);
    options.connect_retry = std::chrono::milliseconds(50);
    trainees.push_back(std::make_unique<net::NetSource>(options));
  }
  Collector sink;
  for (const auto& trainee : trainees) {
    EXPECT_TRUE(poll_until(*trainee, sink, [&] {
      for (const auto& other : trainees) other->poll(sink);
      return trainee->state() != SourceState::Connecting;
    }));
    EXPECT_EQ(trainee->state(), SourceState::Live) << trainee->close_reason().text;
  }
}

TEST(Access, sockets_that_say_nothing_keep_nobody_out) {
  GuardedSession guarded;
  std::atomic<bool> is_over{false};
  std::vector<std::thread> threads;
  // Each comes back whenever the server closes it.
  for (int i = 0; i < 128; ++i)
    threads.emplace_back([&] {
      while (!is_over) {
        RawClient mute(guarded.session->port());
        while (!is_over && !mute.is_closed()) std::this_thread::sleep_for(std::chrono::seconds(1));
      }
    });
  for (int i = 0; i < 20; ++i)
    EXPECT_TRUE(try_to_join(guarded, "Anna", Role::Surgeon, guarded.code(Role::Surgeon)).is_in);
  is_over = true;
  for (auto& thread : threads) thread.join();
  EXPECT_GT(
      guarded.session->on_io([&] { return guarded.session->tcp().counters().newcomers_dropped; }),
      0u);
}

TEST(Access, the_audit_log_has_a_line_for_each_event_and_no_secret) {
  GuardedSession guarded;
  const auto code = guarded.code(Role::Instructor);
  try_to_join(guarded, "Eve\x1b]0;x", Role::Instructor, wrong(code));
  {
    net::NetSource source(options_for(guarded.session->port(), "Ines", Role::Instructor, code));
    Collector sink;
    ASSERT_TRUE(poll_until(source, sink, [&] { return source.state() == SourceState::Live; }));
    proto::Envelope mark;
    mark.mutable_mark_request()->set_action(proto::MARK_SET);
    ASSERT_TRUE(source.send(mark));
    ASSERT_TRUE(poll_until(source, sink, [&] { return guarded.audit().size() == 3; }));
  }
  ASSERT_TRUE(guarded.session->wait_for_sessions(0));
  const auto lines = guarded.audit();
  ASSERT_EQ(lines.size(), 4u);
  const std::array<const char*, 4> events{"refusal", "join", "mark", "leave"};
  for (std::size_t i = 0; i < lines.size(); ++i) {
    EXPECT_NE(lines[i].find(std::string("\"event\":\"") + events[i] + "\""), std::string::npos)
        << lines[i];
    EXPECT_NE(lines[i].find("\"address\":\"127.0.0.1\""), std::string::npos) << lines[i];
    EXPECT_EQ(lines[i].find('\x1b'), std::string::npos);
    EXPECT_EQ(lines[i].find(secure::to_text(code).substr(10)), std::string::npos);
  }
  EXPECT_NE(lines[0].find("no such code"), std::string::npos) << lines[0];
}

TEST(Access, a_hostile_server_does_not_reach_the_terminal) {
  GuardedSession guarded;
  net::NetSource source(
      options_for(guarded.session->port(), "Anna", Role::Observer, guarded.code(Role::Observer)));
  Collector sink;
  ASSERT_TRUE(poll_until(source, sink, [&] { return source.state() == SourceState::Live; }));
  guarded.session->on_io([&] {
    guarded.session->replicator().end_all(replication::EndReason::Full, "full\x1b[2J\r\nowned");
  });
  ASSERT_TRUE(poll_until(source, sink, [&] { return source.state() == SourceState::Closed; }));
  EXPECT_EQ(source.close_reason().text, "server: full?[2J??owned");
}

}  // namespace
}  // namespace trocar::testing
