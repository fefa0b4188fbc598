// Slow readers, skipped frames, keyframes on request, claim events, the barrier.

#include "tests/network/session_fixture.h"

namespace trocar::testing {
namespace {

using proto::Envelope;

constexpr catalogue::LatticeSize kBigSurface{24, 12, 24, 0.01};  // 2,110 vertices on the surface
constexpr std::size_t kManyChanges = 6000;                       // a delta of about 10 KB

replication::ReplicatorCounters counters_of(LiveSession& session) {
  return session.on_io([&] { return session.replicator().counters(); });
}

// One client reads each frame at once, the other not at all for `unread` frames.
struct Stall {
  explicit Stall(int unread)
      : session({}, {}, kBigSurface), healthy(session.port()), slow(session.port(), 8 * 1024) {
    session.publish(kManyChanges);
    const auto vertex_count = session.layout().vertex_count();
    healthy.surface.resize(vertex_count);
    slow.surface.resize(vertex_count);
    EXPECT_TRUE(healthy.join("healthy", proto::ROLE_OBSERVER) && healthy.follow());
    EXPECT_TRUE(slow.join("slow", proto::ROLE_OBSERVER) && slow.follow());
    const std::size_t slow_connection = 2;  // ids count from 1 in the order of connecting
    for (int i = 0; i < unread; ++i) {
      const auto shown = session.publish(kManyChanges);
      EXPECT_TRUE(healthy.follow());
      EXPECT_EQ(healthy.frame, shown->frame) << "the healthy client missed a frame";
      const auto outstanding =
          session.on_io([&] { return session.tcp().outstanding_bytes(slow_connection); });
      largest_outbox = std::max(largest_outbox, outstanding);
    }
  }

  LiveSession session;
  RawClient healthy, slow;
  std::size_t largest_outbox = 0;
};

TEST(SlowReader, its_outbox_stays_bounded_and_others_miss_nothing) {
  Stall stall(300);
  const auto counters = counters_of(stall.session);
  EXPECT_GT(counters.frames_skipped, 100u) << "nothing was skipped: the test does not stall";
  EXPECT_EQ(stall.healthy.frames_followed, 301);
  const auto frame_bytes = stall.session.on_io([&] {
    const auto& statistics = stall.session.replicator().encode_statistics();
    return statistics.delta_payload_bytes / statistics.deltas;
  });
  // The threshold, and the frame that crossed it.
  EXPECT_LE(stall.largest_outbox, std::max<std::size_t>(64 * 1024, 2 * frame_bytes) + 64 * 1024);
}

// Lets the slow client read all that it was given, then publishes one more frame, which must close
// the gap at once.
void catch_up(Stall& stall) {
  const auto given_to_both = static_cast<int>(counters_of(stall.session).frames_given);
  const int given = given_to_both - stall.healthy.frames_followed;
  while (stall.slow.frames_followed < given) {
    ASSERT_TRUE(stall.slow.follow());  // checks baseline and CRC
    EXPECT_EQ(stall.slow.frame, static_cast<Frame>(stall.slow.frames_followed))
        << "the first skip comes when the outbox is full, not before";
  }
  const auto last_given = stall.slow.frame;
  const auto shown = stall.session.publish(50);
  ASSERT_TRUE(stall.healthy.follow());
  ASSERT_TRUE(stall.slow.follow());
  EXPECT_GT(shown->frame, last_given + 1) << "no gap";
  EXPECT_EQ(stall.slow.frame, shown->frame);
  EXPECT_EQ(stall.slow.surface, shown->surface);
}

TEST(SlowReader, a_short_gap_is_healed_by_a_delta_against_the_last_frame_given) {
  Stall stall(60);
  ASSERT_GT(counters_of(stall.session).frames_skipped, 0u);
  catch_up(stall);
  EXPECT_FALSE(stall.slow.last_was_keyframe) << "a delta would have done";
}

TEST(SlowReader, a_gap_of_more_than_a_second_is_healed_by_a_keyframe) {
  Stall stall(300);
  catch_up(stall);
  EXPECT_TRUE(stall.slow.last_was_keyframe);
}

TEST(SlowReader, who_does_not_even_read_what_cannot_be_skipped_is_dropped) {
  LiveSession session({}, {}, kBigSurface);
  session.publish(10);
  RawClient healthy(session.port()), slow(session.port(), 8 * 1024);
  ASSERT_TRUE(healthy.join("healthy", proto::ROLE_OBSERVER));
  ASSERT_TRUE(slow.join("slow", proto::ROLE_OBSERVER));
  const hands::ClaimEvent event{1, {0}, tool::Verb::Grasp, hands::ClaimOutcome::Released, {}};
  for (int i = 0; i < 200 && session.sessions() == 2; ++i) {
    session.publish(0, std::vector<hands::ClaimEvent>(500, event));
    for (int k = 0; k < 500; ++k) ASSERT_TRUE(healthy.receive(Envelope::kClaimEvent));
  }
  EXPECT_EQ(session.sessions(), 1u);
  EXPECT_EQ(counters_of(session).ended[static_cast<int>(replication::EndReason::TooSlow)], 1u);
}

TEST(Replication, equal_lag_shares_one_buffer) {
  LiveSession session;
  session.publish(10);
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 5; ++i) {
    clients.push_back(std::make_unique<RawClient>(session.port()));
    ASSERT_TRUE(clients.back()->join("w" + std::to_string(i), proto::ROLE_OBSERVER));
  }
  const auto before =
      session.on_io([&] { return session.replicator().encode_statistics().delta_cpu.count(); });
  for (int i = 0; i < 10; ++i) session.publish(10);
  const auto after =
      session.on_io([&] { return session.replicator().encode_statistics().delta_cpu.count(); });
  EXPECT_EQ(after - before, 10u) << "one delta per frame, whoever gets it";
}

TEST(Replication, a_mark_too_soon_after_another_is_refused_with_a_reason) {
  std::atomic<std::uint64_t> now_ns{1'000'000'000'000};
  replication::ReplicatorOptions options;
  options.clock_ns = [&now_ns] { return now_ns.load(); };
  LiveSession session({}, options);
  session.publish(10);
  RawClient teacher(session.port()), other(session.port()), watcher(session.port());
  ASSERT_TRUE(teacher.join("Teacher", proto::ROLE_INSTRUCTOR));
  ASSERT_TRUE(other.join("Other", proto::ROLE_INSTRUCTOR));
  ASSERT_TRUE(watcher.join("Watcher", proto::ROLE_OBSERVER));
  // Taken, or refused to this client alone.
  const auto ask = [&](RawClient& client, proto::MarkAction action) -> std::string {
    Envelope request, ping;
    request.mutable_mark_request()->set_action(action);
    ping.mutable_ping();
    EXPECT_TRUE(client.send(request) && client.send(ping));
    std::string refusal;
    for (auto message = client.receive(); message && !message->has_pong();
         message = client.receive())
      if (message->has_mark_event()) {
        EXPECT_FALSE(message->mark_event().is_done());
        EXPECT_EQ(message->mark_event().action(), action);
        refusal = message->mark_event().text();
      }
    return refusal;
  };
  EXPECT_EQ(ask(teacher, proto::MARK_SET), "");
  now_ns += 999'000'000;
  EXPECT_NE(ask(teacher, proto::MARK_SET).find("not marked"), std::string::npos);
  EXPECT_NE(ask(other, proto::MARK_RETURN).find("less than a second"), std::string::npos);
  now_ns += 2'000'000;
  EXPECT_EQ(ask(other, proto::MARK_RETURN), "");
  Envelope ping;
  ping.mutable_ping();
  ASSERT_TRUE(watcher.send(ping));
  for (auto message = watcher.receive(); message && !message->has_pong();
       message = watcher.receive())
    EXPECT_FALSE(message->has_mark_event()) << "it is nobody else's business";
}

TEST(Replication, a_keyframe_comes_on_request_and_at_most_four_times_per_second) {
  std::atomic<std::uint64_t> now_ns{1'000'000'000'000};
  replication::ReplicatorOptions options;
  options.clock_ns = [&now_ns] { return now_ns.load(); };
  LiveSession session({}, options);
  session.publish(10);
  RawClient client(session.port());
  client.surface.resize(session.layout().vertex_count());
  ASSERT_TRUE(client.join("Anna", proto::ROLE_SURGEON) && client.follow());

  Envelope request, ping;
  request.mutable_keyframe_request()->set_frame(1);
  ping.mutable_ping();
  const auto ask = [&] {
    ASSERT_TRUE(client.send(request));
    ASSERT_TRUE(client.send(ping));
  };
  ask();
  ASSERT_TRUE(client.follow());
  EXPECT_TRUE(client.last_was_keyframe) << "asked and allowed: at once";
  ASSERT_TRUE(client.receive(Envelope::kPong));
  ask();
  ASSERT_TRUE(client.receive(Envelope::kPong));
  session.publish(10);
  ASSERT_TRUE(client.follow());
  EXPECT_FALSE(client.last_was_keyframe) << "too soon";
  now_ns += 251'000'000;
  session.publish(10);
  ASSERT_TRUE(client.follow());
  EXPECT_TRUE(client.last_was_keyframe) << "remembered, and due now";
}

TEST(Replication, a_delta_that_was_tampered_with_is_noticed_and_a_keyframe_heals) {
  LiveSession session;
  session.publish(10);
  RawClient client(session.port());
  client.surface.resize(session.layout().vertex_count());
  ASSERT_TRUE(client.join("Anna", proto::ROLE_SURGEON) && client.follow());
  client.surface[3].x += 1;  // as if one bit had flipped
  session.publish(10);
  ASSERT_TRUE(client.follow(RawClient::Expect::WrongCrc));
  Envelope request;
  request.mutable_keyframe_request()->set_frame(client.frame);
  ASSERT_TRUE(client.send(request));
  do ASSERT_TRUE(client.follow());
  while (!client.last_was_keyframe);
  const auto shown = session.publish(10);
  ASSERT_TRUE(client.follow());
  EXPECT_EQ(client.surface, shown->surface);
}

TEST(Replication, claim_events_of_skipped_frames_arrive_with_names) {
  LiveSession session;
  RawClient anna(session.port()), ben(session.port());
  ASSERT_TRUE(anna.join("Anna", proto::ROLE_SURGEON));
  ASSERT_TRUE(ben.join("Ben", proto::ROLE_ASSISTANT));
  const auto with_event = [&](hands::ClaimEvent event) {
    auto frame = std::make_shared<step::PublishedFrame>(*session.make_frame(1));
    frame->claim_events.push_back(event);
    return step::SharedFrame(frame);
  };
  const std::vector<step::SharedFrame> frames = {
      with_event({3, {0}, tool::Verb::Grasp, hands::ClaimOutcome::Granted, {}}),
      with_event({20, {2}, tool::Verb::Grasp, hands::ClaimOutcome::RefusedHeld, {0}})};
  session.on_io([&] { session.replicator().publish(frames); });
  for (auto* client : {&anna, &ben}) {
    const auto granted = client->receive(Envelope::kClaimEvent);
    ASSERT_TRUE(granted);
    EXPECT_EQ(granted->claim_event().text(), "Anna has a grasp");
    const auto refused = client->receive(Envelope::kClaimEvent);
    ASSERT_TRUE(refused);
    EXPECT_EQ(refused->claim_event().holder_name(), "Anna");
    EXPECT_EQ(refused->claim_event().text(), "held by Anna: wait, or ask Anna to let go");
    const auto surface = client->receive(Envelope::kSurfaceFrame);
    ASSERT_TRUE(surface);
    EXPECT_EQ(surface->surface_frame().frame(), frames.back()->frame) << "only the newest surface";
  }
}

TEST(Barrier, collects_each_clients_crc_and_tells_who_is_wrong_or_missing) {
  LiveSession session;
  session.publish(50);
  RawClient right(session.port()), wrong(session.port()), mute(session.port());
  ASSERT_TRUE(right.join("right", proto::ROLE_SURGEON));
  ASSERT_TRUE(wrong.join("wrong", proto::ROLE_OBSERVER));
  ASSERT_TRUE(mute.join("mute", proto::ROLE_INSTRUCTOR));
  const auto last = session.make_frame(20);
  session.on_io([&] { session.replicator().begin_barrier(last); });
  for (auto* client : {&right, &wrong}) {
    client->surface.resize(session.layout().vertex_count());
    while (client->frame != last->frame) ASSERT_TRUE(client->follow());
    const auto barrier = client->receive(Envelope::kBarrier);
    ASSERT_TRUE(barrier);
    EXPECT_EQ(barrier->barrier().frame(), last->frame);
    EXPECT_EQ(barrier->barrier().surface_crc(), wire::surface_crc(client->surface));
    Envelope ack;
    ack.mutable_frame_ack()->set_frame(last->frame);
    ack.mutable_frame_ack()->set_surface_crc(wire::surface_crc(client->surface) ^
                                             (client == &wrong ? 1u : 0u));
    Envelope ping;
    ping.mutable_ping();
    ASSERT_TRUE(client->send(ack) && client->send(ping));
    ASSERT_TRUE(client->receive(Envelope::kPong));
  }
  EXPECT_FALSE(session.on_io([&] { return session.replicator().is_barrier_complete(); }));
  RawClient late(session.port());
  ASSERT_TRUE(late.send(make_hello("late", proto::ROLE_OBSERVER)));
  const auto refused = late.read_goodbye();
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->reason(), proto::GOODBYE_SERVER_CLOSING);
  Envelope bye;
  bye.mutable_bye();
  ASSERT_TRUE(mute.send(bye));
  ASSERT_TRUE(session.wait_for_sessions(2));
  EXPECT_TRUE(session.on_io([&] { return session.replicator().is_barrier_complete(); }))
      << "who has left need not answer";
  const auto results = session.on_io([&] { return session.replicator().barrier_results(); });
  ASSERT_EQ(results.size(), 3u);
  const auto result_of = [&](const std::string& name) {
    return *std::find_if(results.begin(), results.end(),
                         [&](const auto& result) { return result.name == name; });
  };
  EXPECT_TRUE(result_of("right").has_answered && result_of("right").is_equal);
  EXPECT_TRUE(result_of("wrong").has_answered && !result_of("wrong").is_equal);
  EXPECT_FALSE(result_of("mute").has_answered || result_of("mute").is_equal);
}

}  // namespace
}  // namespace trocar::testing
