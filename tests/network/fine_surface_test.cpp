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

class FineSurfaceOnTheWay : public ::testing::Test {
 protected:
  static replication::ReplicatorOptions options() {
    replication::ReplicatorOptions options;
    options.fine_surface = replication::encode_fine_surface(strip());
    return options;
  }
  static bool acknowledge(RawClient& client, const proto::Envelope& message) {
    proto::Envelope ack;
    ack.mutable_frame_ack()->set_frame(message.surface_frame().frame());
    return client.send(ack);
  }
  // Acknowledges each frame until the surface is whole.
  void expect_whole(RawClient& client);

  const std::size_t parts = options().fine_surface.size();
  LiveSession session{{}, options()};
};

void FineSurfaceOnTheWay::expect_whole(RawClient& client) {
  ASSERT_GT(parts, 3u);
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
      ASSERT_TRUE(acknowledge(client, *message));
      session.publish(10);
    }
  }
  ASSERT_TRUE(is_whole);
  EXPECT_EQ(received, parts);
  EXPECT_EQ(assembler.take(), strip());
}

TEST_F(FineSurfaceOnTheWay, EachPartComesAfterTheOneBeforeHasArrived) {
  session.publish(10);
  RawClient client(session.port());
  ASSERT_TRUE(client.join("Anna", proto::ROLE_SURGEON));
  expect_whole(client);
}

TEST_F(FineSurfaceOnTheWay, WhoHasNotJoinedIsSentNothingOfIt) {
  RawClient client(session.port());
  for (int i = 0; i < 3; ++i) session.publish(10);
  ASSERT_TRUE(client.join("Anna", proto::ROLE_SURGEON));
  expect_whole(client);
}

TEST_F(FineSurfaceOnTheWay, AConnectionThatCarriesGuestsIsSentItOnce) {
  session.publish(10);
  RawClient carrier(session.port());
  for (std::uint32_t guest : {1u, 2u}) {
    proto::Envelope hello;
    auto& message = *hello.mutable_guest_message();
    message.set_guest(guest);
    message.set_envelope(
        make_hello("Guest " + std::to_string(guest), proto::ROLE_OBSERVER).SerializeAsString());
    ASSERT_TRUE(carrier.send(hello));
  }
  const auto first = carrier.receive(proto::Envelope::kSurfaceFrame);
  ASSERT_TRUE(first && acknowledge(carrier, *first));
  session.publish(10);
  expect_whole(carrier);
  for (int i = 0; i < 3; ++i) {
    session.publish(10);
    while (const auto message = carrier.receive()) {
      ASSERT_FALSE(message->has_fine_surface_part());
      if (!message->has_surface_frame()) continue;
      ASSERT_TRUE(acknowledge(carrier, *message));
      break;
    }
  }
}

}  // namespace
}  // namespace trocar::testing
