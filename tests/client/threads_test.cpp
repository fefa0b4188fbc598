// A replica's surgical thread is the server's to the bit, and what is damaged is refused.

#include <gtest/gtest.h>

#include "client/replica/interpolated_surface.h"
#include "client/replica/replica.h"
#include "client/shape/thread_mesh.h"
#include "proto/wire.pb.h"
#include "tests/client/synthetic_source.h"

namespace trocar::replica {
namespace {

class ThreadsTest : public ::testing::Test {
 protected:
  ThreadsTest() {
    picture_.threads = {{.nodes = 30, .material = 1}};
    picture_.pegs = {{.from = {-500, 0, 0}, .to = {500, 0, 0}, .radius = 100}};
    picture_.places.resize(30);
    picture_.is_joined.assign(30, 1);
    picture_.is_joined[12] = picture_.is_joined[29] = 0;
    source_.tamper = [this](proto::Envelope& message) {
      if (message.has_frame_state()) add_to(*message.mutable_frame_state());
      return true;
    };
    source_.queue_start();
    advance(1);
  }

  void add_to(proto::FrameState& state) {
    for (int i = 0; i < 30; ++i)
      picture_.places[static_cast<std::size_t>(i)] = {
          31 * i, static_cast<std::int32_t>(state.frame()) * 10, 1000};
    Bytes bytes;
    wire::encode_threads(picture_, bytes);
    if (damages_) bytes.resize(bytes.size() / 2);
    state.set_threads(bytes.data(), bytes.size());
  }
  void advance(int frames) {
    for (int i = 0; i < frames; ++i) {
      source_.queue_frame();
      source_.poll(replica_);
    }
  }

  testing::SyntheticSource source_{testing::make_blob_layout(16, 24, 0.08)};
  Replica replica_{[this](const proto::Envelope& message) { return source_.send(message); }};
  wire::ThreadPicture picture_;
  bool damages_ = false;
};

TEST_F(ThreadsTest, AreTheServersToTheBit) {
  for (int i = 0; i < 20; ++i) {
    advance(1);
    ASSERT_TRUE(replica_.fault().ok());
    ASSERT_EQ(replica_.newest()->threads, picture_);
  }
}

TEST_F(ThreadsTest, DamageIsRefusedInOneLine) {
  damages_ = true;
  advance(1);
  ASSERT_FALSE(replica_.fault().ok());
  EXPECT_EQ(replica_.fault().error().message.substr(0, 51),
            "FrameState.threads: the places are cut short at nod");
}

TEST_F(ThreadsTest, AreDrawnAsTubesWithoutWhatIsParted) {
  InterpolatedSurface surface;
  surface.update(replica_, 1);
  ASSERT_EQ(surface.thread_places().size(), 30u);
  shape::MeshVertices whole, parted;
  auto joined = picture_;
  joined.is_joined[12] = 1;
  shape::add_threads(joined, surface.thread_places(), whole);
  shape::add_threads(picture_, surface.thread_places(), parted);
  EXPECT_EQ(whole.size() % 3, 0u);
  EXPECT_GT(parted.size(), 0u);
  EXPECT_NE(parted.size(), whole.size());
  for (std::size_t i = 0; i < parted.size(); ++i)
    EXPECT_NEAR(length(parted[i].normal), 1, 1e-4) << i;
  // Triangles are counter-clockwise as seen from outside.
  for (std::size_t i = 0; i + 2 < whole.size(); i += 3) {
    const auto &a = whole[i], &b = whole[i + 1], &c = whole[i + 2];
    const auto normal = cross(b.position - a.position, c.position - a.position);
    if (length(normal) > 1e-10f) {
      EXPECT_GT(dot(normal, a.normal), 0) << i;
    }
  }
  shape::MeshVertices none;
  shape::add_threads(picture_, {}, none);
  EXPECT_TRUE(none.empty());
}

}  // namespace
}  // namespace trocar::replica
