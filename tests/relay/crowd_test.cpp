// Those who watch through a relay get what the server tells, and ask the server for nothing. The
// server is a real one without a simulation; what it says to its one observer is given to the
// crowd.

#include "server/watch/crowd/crowd.h"

#include <gtest/gtest.h>

#include <deque>
#include <mutex>

#include "server/watch/crowd/guest_connections.h"
#include "tests/network/session_fixture.h"

namespace trocar::testing {
namespace {

using proto::Envelope;

constexpr secure::HalfCode kSecret{1, 2, 3, 4, 5};

Envelope hello_of(const std::string& name, proto::Role role = proto::ROLE_OBSERVER,
                  secure::HalfCode secret = kSecret) {
  auto hello = make_hello(name, role);
  hello.mutable_hello()->set_join_secret(secret.data(), secret.size());
  return hello;
}

class RelayedSession : public ::testing::Test {
 protected:
  static constexpr std::size_t kMostWatchers = 3;

  RelayedSession() {
    auto listening = net::TcpServer::listen(io_, {.port = 0});
    EXPECT_TRUE(listening.ok());
    tcp_ = std::move(*listening);
    connections_ = std::make_unique<crowd::GuestConnections>(*tcp_);
    crowd::CrowdOptions options;
    options.secret = kSecret;
    options.most_watchers = kMostWatchers;
    options.limits.clock_ns = [this] { return clock_ns_.load(); };
    options.say_up = [this](const Envelope& message) {
      const std::lock_guard lock(said_lock_);
      said_.push_back(message);
    };
    options.server_time_us = [](std::uint64_t now_us) { return now_us + 7; };
    crowd_ = std::make_unique<crowd::Crowd>(*connections_, std::move(options));
    connections_->set_handler(crowd_->handler());
    thread_ = std::thread([this] { io_.run(); });
    session_.publish(10);
    join_server(session_);
    on_io([this] { tcp_->start(*connections_); });
  }
  ~RelayedSession() override {
    on_io([this] { tcp_.reset(); });
    work_.reset();
    io_.stop();
    thread_.join();
  }

  template <typename Call>
  std::invoke_result_t<Call> on_io(Call call) {
    using Value = std::invoke_result_t<Call>;
    std::packaged_task<Value()> task(std::move(call));
    auto result = task.get_future();
    asio::post(io_, [&task] { task(); });
    return result.get();
  }
  // The relay's own connection, up to the first picture.
  void join_server(LiveSession& session) {
    uplink_ = std::make_unique<RawClient>(session.port());
    ASSERT_TRUE(uplink_->send(make_hello("Relay", proto::ROLE_OBSERVER)));
    const auto welcome = uplink_->receive(Envelope::kWelcome);
    ASSERT_TRUE(welcome);
    on_io([&] { crowd_->begin(welcome->welcome()); });
    pass_on();
  }
  // Hands on what the server says, up to the next FrameState.
  void pass_on() {
    while (const auto message = uplink_->receive()) {
      const bool is_taken =
          on_io([&] { return crowd_->take(*message, wire::encode_envelope(*message)).ok(); });
      ASSERT_TRUE(is_taken);
      if (message->has_frame_state()) return;
    }
    FAIL() << "the server has closed";
  }
  // Publishes the next frame, at the server and at the relay.
  void publish(std::size_t changes, bool is_cut = false) {
    session_.publish_all({session_.make_frame(changes, is_cut)});
    pass_on();
  }
  std::unique_ptr<RawClient> watcher(const std::string& name) {
    auto client = std::make_unique<RawClient>(tcp_->port());
    EXPECT_TRUE(client->send(hello_of(name)));
    return client;
  }
  proto::GoodbyeReason refusal_of(const Envelope& hello) {
    RawClient client(tcp_->port());
    EXPECT_TRUE(client.send(hello));
    const auto goodbye = client.read_goodbye();
    return goodbye ? goodbye->reason() : proto::GOODBYE_UNSPECIFIED;
  }
  std::optional<Envelope> said(Envelope::MessageCase kind) {
    const std::lock_guard lock(said_lock_);
    for (auto next = said_.rbegin(); next != said_.rend(); ++next)
      if (next->message_case() == kind) return *next;
    return std::nullopt;
  }

  static replication::ReplicatorOptions server_options() {
    replication::ReplicatorOptions options;
    options.participants_interval_ns = 0;
    return options;
  }

  LiveSession session_{{}, server_options()};
  std::unique_ptr<RawClient> uplink_;
  std::atomic<std::uint64_t> clock_ns_{1'000'000'000'000};
  std::mutex said_lock_;
  std::deque<Envelope> said_;
  asio::io_context io_{1};
  asio::executor_work_guard<asio::io_context::executor_type> work_{io_.get_executor()};
  std::unique_ptr<net::TcpServer> tcp_;
  std::unique_ptr<crowd::GuestConnections> connections_;
  std::unique_ptr<crowd::Crowd> crowd_;
  std::thread thread_;
};

TEST_F(RelayedSession, who_comes_is_shown_everything_and_the_server_is_asked_nothing) {
  publish(20);
  auto ann = watcher("Ann");
  const auto welcome = ann->receive();
  ASSERT_TRUE(welcome && welcome->has_welcome());
  EXPECT_EQ(welcome->welcome().organ_hash(), 42u);
  EXPECT_EQ(welcome->welcome().return_token().size(), 16u);
  EXPECT_GE(welcome->welcome().participant(), static_cast<std::uint32_t>(kMaxParticipants));
  const auto people = ann->receive();
  ASSERT_TRUE(people && people->has_participants());
  EXPECT_EQ(people->participants().participant(0).name(), "Relay");
  ASSERT_TRUE(ann->follow());
  EXPECT_TRUE(ann->last_was_keyframe);
  EXPECT_EQ(ann->frame, 2u);
  EXPECT_FALSE(said(Envelope::kKeyframeRequest));
  EXPECT_EQ(said(Envelope::kFrameAck)->frame_ack().frame(), 2u);
}

TEST_F(RelayedSession, the_fine_surface_reaches_who_comes_a_part_after_each_frame) {
  wire::FineSurface fine;
  for (std::int32_t v = 0; v < 20'000; ++v) fine.quanta.push_back({v * 7919 % 100'003, v, 0});
  for (std::uint32_t t = 0; t + 2 < 20'000; ++t) fine.triangles.push_back({t, t + 1, t + 2});
  for (auto& part : wire::parts_of(fine)) {
    Envelope envelope;
    envelope.mutable_fine_surface_part()->Swap(&part);
    EXPECT_TRUE(
        on_io([&] { return crowd_->take(envelope, wire::encode_envelope(envelope)).ok(); }));
  }
  auto ann = watcher("Ann");
  wire::FineSurfaceAssembler assembler;
  bool is_whole = false;
  int since_frame = 0, parts = 0;
  while (!is_whole && parts < 100) {
    const auto message = ann->receive();
    ASSERT_TRUE(message);
    if (message->has_fine_surface_part()) {
      ++parts;
      EXPECT_EQ(++since_frame, 1) << "two parts between two frames";
      const auto added = assembler.add(message->fine_surface_part());
      ASSERT_TRUE(added.ok()) << added.error().message;
      is_whole = *added;
      publish(5);
    } else if (message->has_surface_frame()) {
      since_frame = 0;
      Envelope ack;
      ack.mutable_frame_ack()->set_frame(message->surface_frame().frame());
      ASSERT_TRUE(ann->send(ack));
      publish(5);
    }
  }
  ASSERT_TRUE(is_whole);
  EXPECT_GT(parts, 3);
  EXPECT_EQ(assembler.take(), fine);
}

TEST_F(RelayedSession, frames_and_cuts_reach_everybody_whole) {
  auto ann = watcher("Ann");
  ASSERT_TRUE(ann->follow());
  for (int i = 0; i < 10; ++i) {
    publish(15, i % 3 == 2);
    ASSERT_TRUE(ann->follow());
  }
  EXPECT_EQ(ann->changes, 3);
  EXPECT_FALSE(ann->last_was_keyframe);
  auto ben = watcher("Ben");  // comes late, to another surface
  ASSERT_TRUE(ben->follow());
  EXPECT_EQ(ben->layout->epoch, 3u);
  publish(15, true);
  ASSERT_TRUE(ann->follow());
  ASSERT_TRUE(ben->follow());
  EXPECT_EQ(wire::surface_crc(ann->surface), wire::surface_crc(ben->surface));
}

TEST_F(RelayedSession, a_keyframe_comes_from_the_relay) {
  auto ann = watcher("Ann");
  ASSERT_TRUE(ann->follow());
  publish(5, true);
  ASSERT_TRUE(ann->follow());
  Envelope request;
  request.mutable_keyframe_request()->set_frame(2);
  ASSERT_TRUE(ann->send(request));
  ASSERT_TRUE(ann->follow());
  EXPECT_TRUE(ann->last_was_keyframe);
  EXPECT_EQ(ann->topologies, 2);
  EXPECT_FALSE(said(Envelope::kKeyframeRequest));
}

TEST_F(RelayedSession, only_observers_with_the_code_are_let_in) {
  EXPECT_EQ(refusal_of(make_hello("Eve", proto::ROLE_OBSERVER)), proto::GOODBYE_CODE_WRONG);
  EXPECT_EQ(refusal_of(hello_of("Eve", proto::ROLE_OBSERVER, {1, 2, 3, 4, 6})),
            proto::GOODBYE_CODE_WRONG);
  EXPECT_EQ(refusal_of(hello_of("Sam", proto::ROLE_SURGEON)), proto::GOODBYE_ROLE);
  EXPECT_EQ(refusal_of(hello_of("Ina", proto::ROLE_INSTRUCTOR)), proto::GOODBYE_ROLE);
  EXPECT_EQ(refusal_of(hello_of(" ", proto::ROLE_OBSERVER)), proto::GOODBYE_NAME_INVALID);
  for (int i = 0; i < access::TryLimiter::kFreeTries; ++i)
    refusal_of(hello_of("Eve", proto::ROLE_OBSERVER, {9, 9, 9, 9, 9}));
  EXPECT_EQ(refusal_of(hello_of("Ann")), proto::GOODBYE_TOO_MANY_TRIES);
  EXPECT_EQ(on_io([this] { return crowd_->watcher_count(); }), 0u);
}

TEST_F(RelayedSession, one_too_many_is_told_so_and_the_server_knows_the_number) {
  std::vector<std::unique_ptr<RawClient>> all;
  for (std::size_t i = 0; i < kMostWatchers; ++i) {
    all.push_back(watcher("Ann"));  // names need not differ
    ASSERT_TRUE(all.back()->follow());
  }
  EXPECT_EQ(refusal_of(hello_of("Ben")), proto::GOODBYE_FULL);
  const auto attend = [this] { crowd_->attend(); };
  on_io(attend);
  ASSERT_TRUE(said(Envelope::kRelayReport));
  EXPECT_EQ(said(Envelope::kRelayReport)->relay_report().watchers(), kMostWatchers);
  ASSERT_TRUE(uplink_->send(*said(Envelope::kRelayReport)));
  std::optional<Envelope> people;
  do people = uplink_->receive(Envelope::kParticipants);
  while (people && people->participants().participant(0).relayed_watchers() != kMostWatchers);
  ASSERT_TRUE(people);
  // The next report waits for a second to pass.
  all.pop_back();
  for (int i = 0; i < 5000 && on_io([this] { return crowd_->watcher_count(); }) > 2; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  on_io(attend);
  EXPECT_EQ(said(Envelope::kRelayReport)->relay_report().watchers(), kMostWatchers);
  clock_ns_ += 2'000'000'000;
  on_io(attend);
  EXPECT_EQ(said(Envelope::kRelayReport)->relay_report().watchers(), kMostWatchers - 1);
}

TEST_F(RelayedSession, the_server_hears_that_all_have_left_while_it_was_away) {
  auto ann = watcher("Ann");
  ASSERT_TRUE(ann->follow());
  const auto attend = [this] { crowd_->attend(); };
  on_io(attend);
  ASSERT_TRUE(said(Envelope::kRelayReport));
  EXPECT_EQ(said(Envelope::kRelayReport)->relay_report().watchers(), 1u);
  uplink_.reset();
  ASSERT_TRUE(session_.wait_for_sessions(0));
  ann.reset();
  for (int i = 0; i < 5000 && on_io([this] { return crowd_->watcher_count(); }) > 0; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  session_.publish(10);
  join_server(session_);
  clock_ns_ += 2'000'000'000;
  on_io(attend);
  EXPECT_EQ(said(Envelope::kRelayReport)->relay_report().watchers(), 0u);
}

TEST_F(RelayedSession, who_asks_for_more_than_pictures_is_told_why_not) {
  auto ann = watcher("Ann");
  ASSERT_TRUE(ann->follow());
  Envelope talk;
  talk.mutable_teach_request()->set_action(proto::TEACH_CHAT);
  talk.mutable_teach_request()->set_text("hello");
  ASSERT_TRUE(ann->send(talk));
  const auto answer = ann->receive(Envelope::kTeachEvent);
  ASSERT_TRUE(answer);
  EXPECT_FALSE(answer->teach_event().is_done());
  Envelope ping;
  ping.mutable_ping()->set_client_time_us(77);
  ASSERT_TRUE(ann->send(ping));
  const auto pong = ann->receive(Envelope::kPong);
  ASSERT_TRUE(pong);
  EXPECT_EQ(pong->pong().client_time_us(), 77u);
  EXPECT_EQ(pong->pong().server_time_us(), clock_ns_ / 1000 + 7) << "the server's clock";
  ASSERT_TRUE(ann->send(make_sample(1)));
  const auto goodbye = ann->read_goodbye();
  ASSERT_TRUE(goodbye);
  EXPECT_EQ(goodbye->reason(), proto::GOODBYE_ROLE);
}

TEST_F(RelayedSession, many_who_share_a_connection_share_a_picture) {
  RawClient carrier(tcp_->port());
  for (std::uint32_t guest = 1; guest <= 2; ++guest) {
    Envelope envelope;
    envelope.mutable_guest_message()->set_guest(guest);
    envelope.mutable_guest_message()->set_envelope(hello_of("Ann").SerializeAsString());
    ASSERT_TRUE(carrier.send(envelope));
    const auto answer = carrier.receive(Envelope::kGuestMessage);
    ASSERT_TRUE(answer);
    Envelope inner;
    ASSERT_TRUE(inner.ParseFromString(answer->guest_message().envelope()));
    EXPECT_TRUE(inner.has_welcome());
    if (guest == 1) {
      ASSERT_TRUE(carrier.follow());
    }
  }
  publish(10);
  ASSERT_TRUE(carrier.follow());
  EXPECT_FALSE(carrier.last_was_keyframe);
  EXPECT_EQ(on_io([this] { return crowd_->watcher_count(); }), 2u);
}

TEST_F(RelayedSession, a_session_from_an_earlier_frame_cuts_those_who_have_later_ones) {
  auto ann = watcher("Ann");
  ASSERT_TRUE(ann->follow());
  publish(10);
  publish(10);
  LiveSession other;
  other.publish(3);
  join_server(other);
  EXPECT_TRUE(ann->reads_to_end());
  auto back = watcher("Ann");
  ASSERT_TRUE(back->follow());
  EXPECT_EQ(back->frame, 1u);
}

TEST_F(RelayedSession, the_same_session_goes_on_for_everybody) {
  auto ann = watcher("Ann");
  ASSERT_TRUE(ann->follow());
  uplink_.reset();
  ASSERT_TRUE(session_.wait_for_sessions(0));
  on_io([this] { crowd_->note_lost(); });
  const auto told = ann->receive(Envelope::kTeachEvent);
  ASSERT_TRUE(told);
  EXPECT_TRUE(told->teach_event().is_trouble());
  session_.publish(10);
  join_server(session_);
  ASSERT_TRUE(ann->follow());
  EXPECT_EQ(ann->frame, 2u);
  publish(10, true);
  ASSERT_TRUE(ann->follow());
}

TEST_F(RelayedSession, the_last_picture_is_shown_and_answered) {
  auto ann = watcher("Ann");
  ASSERT_TRUE(ann->follow());
  const auto last = session_.make_frame(10);
  session_.on_io([&] { session_.replicator().begin_barrier(last); });
  pass_on();
  const auto barrier = uplink_->receive(Envelope::kBarrier);
  ASSERT_TRUE(barrier);
  on_io([&] { return crowd_->take(*barrier, wire::encode_envelope(*barrier)).ok(); });
  ASSERT_TRUE(ann->follow());
  const auto asked = ann->receive(Envelope::kBarrier);
  ASSERT_TRUE(asked);
  EXPECT_EQ(asked->barrier().surface_crc(), wire::surface_crc(ann->surface));
  EXPECT_EQ(said(Envelope::kFrameAck)->frame_ack().frame(), last->frame);
}

}  // namespace
}  // namespace trocar::testing
