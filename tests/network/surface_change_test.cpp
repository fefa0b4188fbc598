// A surface that is cut while clients watch: in step, late, slow, or out of step.

#include "tests/network/session_fixture.h"
#include "tests/support/surface_edits.h"

namespace trocar::testing {
namespace {

using proto::Envelope;

void expect_same(const RawClient& client, const LiveSession& session,
                 const step::SharedFrame& shown) {
  ASSERT_EQ(client.frame, shown->frame);
  ASSERT_EQ(client.surface, shown->surface);
  ASSERT_EQ(client.layout->epoch, shown->epoch);
  ASSERT_EQ(client.layout->triangles, session.layout().triangles);
  ASSERT_EQ(client.layout->is_wound, session.layout().is_wound);
  ASSERT_EQ(client.layout->rest_quanta, session.layout().rest_quanta);
  ASSERT_EQ(client.layout->triangle_sum, session.layout().triangle_sum);
}

// Says Hello and reads up to the first frame.
bool join(RawClient& client, const std::string& name) {
  return client.send(make_hello(name, proto::ROLE_OBSERVER)) && client.follow();
}

TEST(SurfaceChanges, come_before_their_frame_and_a_late_joiner_gets_the_topology) {
  LiveSession session;
  session.publish(10);
  RawClient early(session.port());
  ASSERT_TRUE(join(early, "early"));
  for (int i = 0; i < 50; ++i) {
    const auto frame = session.make_frame(20, i % 3 != 1);
    session.publish_all({frame});
    ASSERT_TRUE(early.follow());
    ASSERT_FALSE(early.last_was_keyframe) << "a delta does across epochs";
    ASSERT_NO_FATAL_FAILURE(expect_same(early, session, frame));
  }
  EXPECT_EQ(early.topologies, 1);
  EXPECT_EQ(early.changes, 33);
  RawClient late(session.port());
  ASSERT_TRUE(join(late, "late"));
  EXPECT_EQ(late.changes, 0);
  const auto frame = session.make_frame(20, true);
  session.publish_all({frame});
  for (auto* client : {&early, &late}) {
    ASSERT_TRUE(client->follow());
    ASSERT_NO_FATAL_FAILURE(expect_same(*client, session, frame));
  }
  const auto counters = session.on_io([&] { return session.replicator().counters(); });
  EXPECT_EQ(counters.surface_changes, 34u);
  EXPECT_GT(counters.surface_change_bytes, 34u * 20);
}

TEST(SurfaceChanges, of_frames_that_are_overtaken_are_not_lost) {
  LiveSession session;
  session.publish(10);
  RawClient client(session.port());
  ASSERT_TRUE(join(client, "Anna"));
  std::vector<step::SharedFrame> frames;
  for (int i = 0; i < 6; ++i) frames.push_back(session.make_frame(30, i != 3));
  session.publish_all(frames);
  ASSERT_TRUE(client.follow());
  EXPECT_EQ(client.changes, 5);
  EXPECT_FALSE(client.last_was_keyframe);
  expect_same(client, session, frames.back());
}

TEST(SurfaceChanges, reach_a_slow_reader_that_skips_frames_over_several_epochs) {
  LiveSession session({}, {}, {24, 12, 24, 0.01});
  session.publish(6000);
  RawClient slow(session.port(), 8 * 1024);
  ASSERT_TRUE(join(slow, "slow"));
  step::SharedFrame last;
  for (int i = 0; i < 60; ++i) {
    last = session.make_frame(6000, i % 4 == 0);
    session.publish_all({last});
  }
  const auto skipped =
      session.on_io([&] { return session.replicator().counters().frames_skipped; });
  ASSERT_GT(skipped, 10u) << "nothing was skipped: the test does not stall";
  const auto given = session.on_io([&] { return session.replicator().counters().frames_given; });
  // The stream still holds the frames up to where skipping began, and all changes after them.
  while (slow.frames_followed < static_cast<int>(given)) ASSERT_TRUE(slow.follow());
  ASSERT_LT(slow.layout->epoch, session.layout().epoch);
  last = session.make_frame(50, true);
  session.publish_all({last});
  ASSERT_TRUE(slow.follow());
  EXPECT_FALSE(slow.last_was_keyframe) << "a delta over several epochs";
  ASSERT_NO_FATAL_FAILURE(expect_same(slow, session, last));
}

TEST(SurfaceChanges, who_lost_count_gets_topology_and_keyframe_on_request) {
  LiveSession session;
  session.publish(10);
  RawClient client(session.port());
  ASSERT_TRUE(join(client, "Anna"));
  session.publish_all({session.make_frame(20, true)});
  ASSERT_TRUE(client.follow());
  client.layout.reset();  // knows nothing of it any more
  Envelope request;
  request.mutable_keyframe_request()->set_frame(client.frame);
  ASSERT_TRUE(client.send(request));
  ASSERT_TRUE(client.follow());
  EXPECT_TRUE(client.last_was_keyframe);
  EXPECT_EQ(client.topologies, 2);
  const auto frame = session.make_frame(20, true);
  session.publish_all({frame});
  ASSERT_TRUE(client.follow());
  ASSERT_NO_FATAL_FAILURE(expect_same(client, session, frame));
}

TEST(SurfaceChanges, a_missing_one_ends_the_sessions_and_not_the_server) {
  LiveSession session;
  session.publish(10);
  RawClient client(session.port());
  ASSERT_TRUE(join(client, "Anna"));
  session.make_frame(0, true);  // never published
  session.publish_all({session.make_frame(0, true)});
  const auto goodbye = client.read_goodbye();
  ASSERT_TRUE(goodbye);
  EXPECT_NE(goodbye->text().find("lost track"), std::string::npos);
}

}  // namespace
}  // namespace trocar::testing
