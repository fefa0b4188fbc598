// The organ's fine surface on its way to who joins: part by part, and no frame waits for it.

#include <gtest/gtest.h>

#include "proto/wire.pb.h"
#include "server/session/replication/messages.h"
#include "tests/network/session_fixture.h"

namespace trocar::testing {
namespace {

wire::FineSurface strip() {
  wire::FineSurface fine;
  for (std::int32_t v = 0; v < 20'000; ++v) fine.quanta.push_back({v * 7919 % 100'003, v, 0});
  for (std::uint32_t t = 0; t + 2 < 20'000; ++t) fine.triangles.push_back({t, t + 1, t + 2});
  return fine;
}

TEST(FineSurfaceOnTheWay, EachPartComesAfterTheOneBeforeHasArrived) {
  replication::ReplicatorOptions options;
  options.fine_surface = replication::encode_fine_surface(strip());
  const std::size_t parts = options.fine_surface.size();
  ASSERT_GT(parts, 3u);
  LiveSession session({}, std::move(options));
  session.publish(10);
  RawClient client(session.port());
  ASSERT_TRUE(client.join("Anna", proto::ROLE_SURGEON));
  wire::FineSurfaceAssembler assembler;
  bool is_whole = false;
  std::size_t since_frame = 0, frames = 0, received = 0;
  while (!is_whole && frames < 200) {
    const auto message = client.receive();
    ASSERT_TRUE(message);
    if (message->has_fine_surface_part()) {
      EXPECT_EQ(++since_frame, 1u) << "two parts between two frames";
      ++received;
      const auto added = assembler.add(message->fine_surface_part());
      ASSERT_TRUE(added.ok()) << added.error().message;
      is_whole = *added;
      session.publish(10);
    } else if (message->has_surface_frame()) {
      since_frame = 0;
      ++frames;
      proto::Envelope ack;
      ack.mutable_frame_ack()->set_frame(message->surface_frame().frame());
      ASSERT_TRUE(client.send(ack));
      session.publish(10);
    }
  }
  ASSERT_TRUE(is_whole);
  EXPECT_EQ(received, parts);
  EXPECT_EQ(assembler.take(), strip());
}

}  // namespace
}  // namespace trocar::testing
