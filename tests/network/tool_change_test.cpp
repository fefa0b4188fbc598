// A hand takes another instrument: all see it, the simulation gets it, and who may not is told what
// the tool still is.

#include "tests/network/session_fixture.h"

namespace trocar::testing {
namespace {

proto::Envelope change(std::uint32_t tool, float radius_m, float edge_m = 0.015f) {
  proto::Envelope envelope;
  auto& message = *envelope.mutable_tool_change();
  message.set_tool(tool);
  auto& shape = *message.mutable_shape();
  shape.set_radius_m(radius_m);
  shape.set_length_m(0.3f);
  shape.set_reach_m(0.01f);
  shape.set_grip_n(0);
  shape.set_edge_m(edge_m);
  shape.set_form(proto::TOOL_FORM_SCISSORS);
  return envelope;
}

// Returns the tool of the only participant with one, once a list says that it is as wanted.
bool is_listed(RawClient& client, float radius_m) {
  for (int lists = 0; lists < 20; ++lists) {
    const auto message = client.receive(proto::Envelope::kParticipants);
    if (!message) return false;
    for (const auto& participant : message->participants().participant())
      if (participant.tool_size() > 0 && participant.tool(0).radius_m() == radius_m)
        return participant.tool(0).form() == proto::TOOL_FORM_SCISSORS;
  }
  return false;
}

// Each list is told at once.
replication::ReplicatorOptions at_once() {
  replication::ReplicatorOptions options;
  options.participants_interval_ns = 0;
  return options;
}

TEST(ToolChange, IsSeenByAllAndReachesTheSimulation) {
  LiveSession session({}, at_once());
  RawClient surgeon(session.port()), observer(session.port());
  ASSERT_TRUE(surgeon.join("Sam", proto::ROLE_SURGEON));
  ASSERT_TRUE(observer.join("Olga", proto::ROLE_OBSERVER));
  ASSERT_TRUE(surgeon.send(change(0, 0.002f)));
  EXPECT_TRUE(is_listed(surgeon, 0.002f));
  EXPECT_TRUE(is_listed(observer, 0.002f));
  hands::TickInputs inputs;
  session.inbox.drain(inputs);
  ASSERT_EQ(inputs.changes.size(), 1u);
  EXPECT_EQ(inputs.changes[0].shape.form, tool::Form::Scissors);
  EXPECT_EQ(inputs.changes[0].shape.grip_n, 0);
}

TEST(ToolChange, ThatMayNotBeLeavesTheToolAsItIs) {
  LiveSession session({}, at_once());
  RawClient surgeon(session.port());
  ASSERT_TRUE(surgeon.join("Sam", proto::ROLE_SURGEON));
  ASSERT_TRUE(surgeon.send(change(0, 0.002f)));
  ASSERT_TRUE(surgeon.send(change(0, 0.003f, 0.15f)));  // longer than edges may be here
  EXPECT_TRUE(is_listed(surgeon, 0.002f));
  // The server does not follow so many in a moment.
  for (int i = 0; i < 200; ++i) ASSERT_TRUE(surgeon.send(change(0, 0.004f)));
  ASSERT_TRUE(surgeon.send(change(0, 0.006f)));
  proto::Envelope ping;
  ping.mutable_ping();
  ASSERT_TRUE(surgeon.send(ping));
  ASSERT_TRUE(surgeon.receive(proto::Envelope::kPong));
  hands::TickInputs inputs;
  session.inbox.drain(inputs);
  ASSERT_EQ(inputs.changes.size(), 1u);
  EXPECT_EQ(inputs.changes[0].shape.radius_m, 0.004f);
}

TEST(ToolChange, OfNoToolEndsTheSession) {
  LiveSession session({}, at_once());
  const auto ends_with = [&](proto::Role role, const proto::Envelope& message,
                             proto::GoodbyeReason reason) {
    RawClient client(session.port());
    ASSERT_TRUE(client.join("Ann", role));
    ASSERT_TRUE(client.send(message));
    const auto goodbye = client.read_goodbye();
    ASSERT_TRUE(goodbye);
    EXPECT_EQ(goodbye->reason(), reason) << goodbye->text();
  };
  ends_with(proto::ROLE_OBSERVER, change(0, 0.002f), proto::GOODBYE_ROLE);
  ends_with(proto::ROLE_SURGEON, change(1, 0.002f), proto::GOODBYE_PROTOCOL_ERROR);
  ends_with(proto::ROLE_SURGEON, change(0, -1), proto::GOODBYE_PROTOCOL_ERROR);
  ends_with(proto::ROLE_SURGEON, change(0, std::numeric_limits<float>::quiet_NaN()),
            proto::GOODBYE_PROTOCOL_ERROR);
  auto unknown = change(0, 0.002f);
  unknown.mutable_tool_change()->mutable_shape()->set_form(static_cast<proto::ToolForm>(99));
  ends_with(proto::ROLE_SURGEON, unknown, proto::GOODBYE_PROTOCOL_ERROR);
}

}  // namespace
}  // namespace trocar::testing
