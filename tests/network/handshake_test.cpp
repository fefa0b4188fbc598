// Who gets in, what a newcomer is given, and how refusals read.

#include "common/base/version.h"
#include "tests/network/session_fixture.h"

namespace trocar::testing {
namespace {

using proto::Envelope;

// Sends a Hello and returns the Goodbye that must come.
proto::Goodbye refusal_of(LiveSession& session, const Envelope& hello) {
  RawClient client(session.port());
  EXPECT_TRUE(client.send(hello));
  const auto goodbye = client.read_goodbye();
  EXPECT_TRUE(goodbye.has_value());
  return goodbye.value_or(proto::Goodbye());
}

TEST(Handshake, a_newcomer_gets_welcome_participants_topology_keyframe_then_deltas) {
  LiveSession session;
  session.publish(100);
  const auto shown = session.publish(50);
  RawClient client(session.port());
  ASSERT_TRUE(client.send(make_hello("Anna", proto::ROLE_SURGEON)));

  const auto welcome = client.receive();
  ASSERT_TRUE(welcome && welcome->has_welcome());
  EXPECT_EQ(welcome->welcome().protocol_major(), kProtocolMajor);
  EXPECT_EQ(welcome->welcome().sim_version(), kSimVersion);
  EXPECT_EQ(welcome->welcome().organ_hash(), 42u);
  EXPECT_EQ(welcome->welcome().participant(), 0u);
  EXPECT_EQ(welcome->welcome().tick_us(), 1000u);
  EXPECT_EQ(welcome->welcome().ticks_per_frame(), 16u);

  const auto participants = client.receive();
  ASSERT_TRUE(participants && participants->has_participants());
  ASSERT_EQ(participants->participants().participant_size(), 1);
  EXPECT_EQ(participants->participants().participant(0).name(), "Anna");
  EXPECT_EQ(participants->participants().participant(0).tool_size(), 1) << "one default tool";

  const auto topology = client.receive();
  ASSERT_TRUE(topology && topology->has_surface_topology());
  const auto vertex_count = static_cast<int>(session.layout().vertex_count());
  EXPECT_EQ(topology->surface_topology().rest_position_quanta_size(), 3 * vertex_count);
  EXPECT_EQ(topology->surface_topology().triangle_size(),
            3 * static_cast<int>(session.layout().triangles.size()));
  EXPECT_EQ(topology->surface_topology().organ_name(), "lattice");

  client.surface.resize(session.layout().vertex_count());
  ASSERT_TRUE(client.follow());
  EXPECT_TRUE(client.last_was_keyframe);
  EXPECT_EQ(client.frame, shown->frame);
  EXPECT_EQ(client.surface, shown->surface);
  for (int i = 0; i < 20; ++i) {
    const auto next = session.publish(30);
    ASSERT_TRUE(client.follow());
    EXPECT_FALSE(client.last_was_keyframe);
    EXPECT_EQ(client.surface, next->surface);
  }
}

TEST(Handshake, a_newcomer_before_the_first_frame_gets_a_keyframe_with_it) {
  LiveSession session;
  RawClient client(session.port());
  ASSERT_TRUE(client.join("Anna", proto::ROLE_OBSERVER));
  client.surface.resize(session.layout().vertex_count());
  session.publish(10);
  ASSERT_TRUE(client.follow());
  EXPECT_TRUE(client.last_was_keyframe);
}

TEST(Handshake, another_major_version_is_refused_and_told_both) {
  LiveSession session;
  auto hello = make_hello("Anna", proto::ROLE_SURGEON);
  hello.mutable_hello()->set_protocol_major(kProtocolMajor + 1);
  const auto goodbye = refusal_of(session, hello);
  EXPECT_EQ(goodbye.reason(), proto::GOODBYE_VERSION);
  EXPECT_NE(goodbye.text().find("protocol " + std::to_string(kProtocolMajor) + "." +
                                std::to_string(kProtocolMinor)),
            std::string::npos)
      << goodbye.text();
}

TEST(Handshake, a_newer_minor_version_is_welcome_and_its_unknown_messages_ignored) {
  LiveSession session;
  session.publish(1);
  auto hello = make_hello("Anna", proto::ROLE_SURGEON);
  hello.mutable_hello()->set_protocol_minor(kProtocolMinor + 7);
  RawClient client(session.port());
  ASSERT_TRUE(client.send(hello));
  ASSERT_TRUE(client.receive(Envelope::kSurfaceTopology));
  // Field 99, length-delimited, 2 bytes: a message that does not exist yet.
  const Bytes unknown{5, 0, 0, 0, 0x9a, 0x06, 2, 1, 2};
  ASSERT_TRUE(client.send_bytes(unknown));
  Envelope ping;
  ping.mutable_ping()->set_client_time_us(77);
  ASSERT_TRUE(client.send(ping));
  const auto pong = client.receive(Envelope::kPong);
  ASSERT_TRUE(pong);
  EXPECT_EQ(pong->pong().client_time_us(), 77u);
}

TEST(Handshake, a_taken_name_is_refused_and_free_again_after_leaving) {
  LiveSession session;
  {
    RawClient first(session.port());
    ASSERT_TRUE(first.join("Anna", proto::ROLE_SURGEON));
    const auto goodbye = refusal_of(session, make_hello("Anna", proto::ROLE_OBSERVER));
    EXPECT_EQ(goodbye.reason(), proto::GOODBYE_NAME_TAKEN);
    EXPECT_NE(goodbye.text().find("Anna"), std::string::npos);
  }
  ASSERT_TRUE(session.wait_for_sessions(0));
  RawClient again(session.port());
  EXPECT_TRUE(again.join("Anna", proto::ROLE_OBSERVER));
}

TEST(Handshake, roles_outside_the_list_and_watchers_with_tools_are_refused) {
  LiveSession session;
  for (const int role : {0, 5, 99, -1}) {
    const auto goodbye = refusal_of(session, make_hello("Anna", static_cast<proto::Role>(role)));
    EXPECT_EQ(goodbye.reason(), proto::GOODBYE_ROLE) << role;
  }
  auto hello = make_hello("Anna", proto::ROLE_OBSERVER);
  hello.mutable_hello()->add_tool()->set_radius_m(0.005f);
  EXPECT_EQ(refusal_of(session, hello).reason(), proto::GOODBYE_ROLE);
}

TEST(Handshake, names_that_are_not_1_to_32_bytes_of_printable_utf8_are_refused) {
  LiveSession session;
  const std::string override_rtl = "\xe2\x80\xae";
  for (const std::string& name :
       {std::string(), std::string(33, 'a'), std::string("a\nb"), std::string("a\0b", 3),
        std::string("\x7f"), std::string("\xc2\x85"), override_rtl + "evil", std::string(" a"),
        std::string("a "), std::string("\xef\xbb\xbf"), std::string("\xf4\x8f\xbf\xbf")})
    EXPECT_EQ(refusal_of(session, make_hello(name, proto::ROLE_SURGEON)).reason(),
              proto::GOODBYE_NAME_INVALID)
        << ::testing::PrintToString(name);
  for (const std::string& name :
       {std::string(32, 'a'), std::string("\xc3\x96zlem \xe6\x9d\x8e"), std::string("x")}) {
    RawClient client(session.port());
    EXPECT_TRUE(client.join(name, proto::ROLE_OBSERVER)) << name;
  }
}

TEST(Handshake, tools_out_of_range_or_too_many_are_refused) {
  LiveSession session;
  const auto with_tool = [](float radius, float length, float reach) {
    auto hello = make_hello("Anna", proto::ROLE_SURGEON);
    auto& tool = *hello.mutable_hello()->add_tool();
    tool.set_radius_m(radius);
    tool.set_length_m(length);
    tool.set_reach_m(reach);
    return hello;
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  for (const auto& hello :
       {with_tool(0, 0.3f, 0.01f), with_tool(0.06f, 0.3f, 0.01f), with_tool(nan, 0.3f, 0.01f),
        with_tool(0.005f, inf, 0.01f), with_tool(0.005f, -1, 0.01f), with_tool(0.005f, 0.3f, nan),
        with_tool(0.005f, 0.3f, 1)})
    EXPECT_EQ(refusal_of(session, hello).reason(), proto::GOODBYE_PROTOCOL_ERROR);
  auto three = with_tool(0.005f, 0.3f, 0.01f);
  for (int i = 0; i < 2; ++i) *three.mutable_hello()->add_tool() = three.hello().tool(0);
  EXPECT_EQ(refusal_of(session, three).reason(), proto::GOODBYE_PROTOCOL_ERROR);
  RawClient client(session.port());
  ASSERT_TRUE(client.send(with_tool(0.004f, 0.25f, 0.012f)));
  EXPECT_TRUE(client.receive(Envelope::kWelcome));
}

TEST(Handshake, a_blade_longer_than_the_session_allows_is_refused_and_told_the_limit) {
  const auto with_edge = [](float edge_m) {
    auto hello = make_hello("Anna", proto::ROLE_SURGEON);
    hello.mutable_hello()->add_tool()->set_radius_m(0.001f);
    auto& tool = *hello.mutable_hello()->mutable_tool(0);
    tool.set_length_m(0.25f);
    tool.set_reach_m(0.012f);
    tool.set_edge_m(edge_m);
    return hello;
  };
  for (const auto& [longest_mm, edge_m, longer_m] :
       {std::tuple{40.0f, 0.040f, 0.0401f}, {7.5f, 0.0075f, 0.0076f}, {200.0f, 0.2f, 0.21f}}) {
    replication::ReplicatorOptions options;
    options.places.longest_edge_mm = longest_mm;
    LiveSession session({}, longest_mm == 40 ? replication::ReplicatorOptions{} : options);
    const auto refusal = refusal_of(session, with_edge(longer_m));
    EXPECT_EQ(refusal.reason(), proto::GOODBYE_PROTOCOL_ERROR) << longest_mm;
    EXPECT_NE(refusal.text().find("edge_m"), std::string::npos) << refusal.text();
    if (longest_mm < 200) {
      EXPECT_NE(refusal.text().find(longest_mm == 40 ? "the 40 mm" : "the 7.5 mm"),
                std::string::npos)
          << refusal.text();
    }
    RawClient client(session.port());
    ASSERT_TRUE(client.send(with_edge(edge_m)));
    EXPECT_TRUE(client.receive(Envelope::kWelcome)) << longest_mm;
  }
}

TEST(Handshake, the_seventeenth_hand_is_told_full_and_may_still_watch) {
  LiveSession session;
  std::vector<std::unique_ptr<RawClient>> hands;
  for (int i = 0; i < kMaxHands; ++i) {
    hands.push_back(std::make_unique<RawClient>(session.port()));
    ASSERT_TRUE(hands.back()->join("hand " + std::to_string(i),
                                   i % 2 ? proto::ROLE_ASSISTANT : proto::ROLE_SURGEON));
  }
  EXPECT_EQ(refusal_of(session, make_hello("late", proto::ROLE_SURGEON)).reason(),
            proto::GOODBYE_FULL);
  RawClient watcher(session.port());
  EXPECT_TRUE(watcher.join("late", proto::ROLE_OBSERVER));
  hands::TickInputs inputs;
  session.inbox.drain(inputs);
  EXPECT_EQ(inputs.joins.size(), static_cast<std::size_t>(kMaxHands));
  EXPECT_TRUE(inputs.leaves.empty());
}

TEST(Handshake, the_host_may_want_fewer_hands_watchers_and_tools) {
  replication::ReplicatorOptions options;
  options.places = {.hands = 1, .watchers = 1, .tools = 1};
  LiveSession session({}, options);
  auto two_tools = make_hello("two", proto::ROLE_SURGEON);
  for (int i = 0; i < 2; ++i) {
    auto& tool = *two_tools.mutable_hello()->add_tool();
    tool.set_radius_m(0.004f);
    tool.set_length_m(0.25f);
    tool.set_reach_m(0.012f);
  }
  const auto too_many = refusal_of(session, two_tools);
  EXPECT_NE(too_many.text().find("at most 1"), std::string::npos) << too_many.text();
  RawClient hand(session.port()), watcher(session.port());
  ASSERT_TRUE(hand.join("hand", proto::ROLE_SURGEON));
  ASSERT_TRUE(watcher.join("watcher", proto::ROLE_OBSERVER));
  const auto no_hand = refusal_of(session, make_hello("second", proto::ROLE_ASSISTANT));
  EXPECT_EQ(no_hand.reason(), proto::GOODBYE_FULL);
  EXPECT_NE(no_hand.text().find("all 1 seats with tools"), std::string::npos) << no_hand.text();
  const auto no_watcher = refusal_of(session, make_hello("third", proto::ROLE_INSTRUCTOR));
  EXPECT_EQ(no_watcher.reason(), proto::GOODBYE_FULL);
}

TEST(Handshake, observers_leave_room_for_who_leads) {
  replication::ReplicatorOptions options;
  options.places = {.watchers = 10};
  LiveSession session({}, options);
  std::vector<std::unique_ptr<RawClient>> observers;
  for (int i = 0; i < 9; ++i) {
    observers.push_back(std::make_unique<RawClient>(session.port()));
    ASSERT_TRUE(observers.back()->join("observer " + std::to_string(i), proto::ROLE_OBSERVER));
  }
  const auto refused = refusal_of(session, make_hello("late", proto::ROLE_OBSERVER));
  EXPECT_EQ(refused.reason(), proto::GOODBYE_FULL);
  EXPECT_NE(refused.text().find("all 9 seats for watchers"), std::string::npos) << refused.text();
  RawClient instructor(session.port());
  EXPECT_TRUE(instructor.join("Ivy", proto::ROLE_INSTRUCTOR));
}

TEST(Handshake, instructors_leave_half_of_the_places_to_who_looks_on) {
  replication::ReplicatorOptions options;
  options.places = {.watchers = 10};
  LiveSession session({}, options);
  std::vector<std::unique_ptr<RawClient>> instructors;
  for (int i = 0; i < 5; ++i) {
    instructors.push_back(std::make_unique<RawClient>(session.port()));
    ASSERT_TRUE(
        instructors.back()->join("instructor " + std::to_string(i), proto::ROLE_INSTRUCTOR));
  }
  const auto refused = refusal_of(session, make_hello("late", proto::ROLE_INSTRUCTOR));
  EXPECT_EQ(refused.reason(), proto::GOODBYE_FULL);
  EXPECT_NE(refused.text().find("all 5 seats for instructors"), std::string::npos)
      << refused.text();
  RawClient observer(session.port()), surgeon(session.port());
  EXPECT_TRUE(observer.join("Otto", proto::ROLE_OBSERVER));
  EXPECT_TRUE(surgeon.join("Ada", proto::ROLE_SURGEON));
}

TEST(Handshake, names_that_look_alike_are_not_here_at_the_same_time) {
  LiveSession session;
  RawClient first(session.port());
  ASSERT_TRUE(first.join("Anna O 1", proto::ROLE_SURGEON));
  for (const std::string& name :
       {std::string("\xd0\x90nna O 1"),       // Cyrillic A
        std::string("Ann\xce\xb1 O 1"),       // Greek alpha
        std::string("\xef\xbc\xa1nna O 1"),   // full width
        std::string("A\xef\xb8\x8fnna O 1"),  // a variation selector, which is not seen
        std::string("Anna\xc2\xa0O 1"),       // a space that does not break
        std::string("Anna  O 1"), std::string("Anna 0 1"), std::string("Anna O l")}) {
    const auto refused = refusal_of(session, make_hello(name, proto::ROLE_OBSERVER));
    EXPECT_EQ(refused.reason(), proto::GOODBYE_NAME_TAKEN) << name;
    EXPECT_NE(refused.text().find("somebody called Anna O 1, which looks like " + name),
              std::string::npos)
        << refused.text();
  }
  for (const char* name : {"anna O 1", "Anna O 2", "Ann\xc3\xa4 O 1", "AnnaO 1"}) {
    RawClient other(session.port());
    EXPECT_TRUE(other.join(name, proto::ROLE_OBSERVER)) << name;
  }
}

TEST(Handshake, when_many_come_at_once_those_who_are_here_are_told_once) {
  std::atomic<std::uint64_t> clock_ns{1'000'000'000};
  replication::ReplicatorOptions options;
  options.clock_ns = [&clock_ns] { return clock_ns.load(); };
  LiveSession session({}, options);
  RawClient watcher(session.port());
  ASSERT_TRUE(watcher.join("watcher", proto::ROLE_OBSERVER));
  std::vector<std::unique_ptr<RawClient>> others;
  for (int i = 0; i < 10; ++i) {
    others.push_back(std::make_unique<RawClient>(session.port()));
    ASSERT_TRUE(others.back()->join("other " + std::to_string(i), proto::ROLE_OBSERVER));
  }
  clock_ns += options.participants_interval_ns;
  session.publish(10);
  int told = 0, listed = 0;
  while (listed < 11) {
    const auto message = watcher.receive(Envelope::kParticipants);
    ASSERT_TRUE(message);
    listed = message->participants().participant_size();
    ++told;
  }
  EXPECT_EQ(told, 3) << "with its welcome, when it was there, and when all were";
}

TEST(Handshake, connections_beyond_the_limit_are_closed_at_once_and_counted) {
  net::TcpServerOptions tcp;
  tcp.max_connections = 2;
  LiveSession session(tcp);
  RawClient first(session.port()), second(session.port());
  ASSERT_TRUE(first.join("a", proto::ROLE_SURGEON));
  ASSERT_TRUE(second.join("b", proto::ROLE_SURGEON));
  RawClient third(session.port());
  EXPECT_TRUE(third.reads_to_end());
  EXPECT_EQ(session.on_io([&] { return session.tcp().counters().rejected_full; }), 1u);
  EXPECT_EQ(session.sessions(), 2u);
}

TEST(Handshake, silence_ends_with_timeout_before_and_after_hello) {
  net::TcpServerOptions tcp;
  tcp.hello_deadline = std::chrono::milliseconds(200);
  tcp.idle_deadline = std::chrono::milliseconds(400);
  LiveSession session(tcp);
  RawClient mute(session.port());
  const auto first = mute.read_goodbye();
  ASSERT_TRUE(first);
  EXPECT_EQ(first->reason(), proto::GOODBYE_TIMEOUT);
  RawClient sleepy(session.port());
  ASSERT_TRUE(sleepy.join("sleepy", proto::ROLE_SURGEON));
  const auto second = sleepy.read_goodbye();
  ASSERT_TRUE(second);
  EXPECT_EQ(second->reason(), proto::GOODBYE_TIMEOUT);
}

TEST(Handshake, everybody_learns_who_comes_and_goes) {
  replication::ReplicatorOptions options;
  options.participants_interval_ns = 0;
  LiveSession session({}, options);
  RawClient anna(session.port());
  ASSERT_TRUE(anna.join("Anna", proto::ROLE_SURGEON));
  {
    RawClient ben(session.port());
    ASSERT_TRUE(ben.join("Ben", proto::ROLE_ASSISTANT));
    Envelope list;
    do {
      const auto next = anna.receive(Envelope::kParticipants);
      ASSERT_TRUE(next);
      list = *next;
    } while (list.participants().participant_size() != 2);
    EXPECT_EQ(list.participants().participant(1).name(), "Ben");
    EXPECT_EQ(list.participants().participant(1).role(), proto::ROLE_ASSISTANT);
    Envelope bye;
    bye.mutable_bye()->set_reason("done");
    ASSERT_TRUE(ben.send(bye));
    EXPECT_TRUE(ben.reads_to_end());
  }
  const auto after = anna.receive(Envelope::kParticipants);
  ASSERT_TRUE(after);
  EXPECT_EQ(after->participants().participant_size(), 1);
}

}  // namespace
}  // namespace trocar::testing
