// Pointing: an instructor's place goes to everybody, and nothing else does.

#include "tests/network/session_fixture.h"

namespace trocar::testing {
namespace {

proto::Envelope point_at(float x) {
  proto::Envelope envelope;
  envelope.mutable_point_request()->mutable_position_m()->set_x(x);
  return envelope;
}

TEST(Pointing, OfAnInstructorIsSeenByAllAndEnds) {
  LiveSession session;
  RawClient instructor(session.port()), surgeon(session.port());
  ASSERT_TRUE(instructor.join("Ivy", proto::ROLE_INSTRUCTOR));
  ASSERT_TRUE(surgeon.join("Sam", proto::ROLE_SURGEON));
  ASSERT_TRUE(instructor.send(point_at(0.05f)));
  for (auto* client : {&instructor, &surgeon}) {
    const auto seen = client->receive(proto::Envelope::kPointEvent);
    ASSERT_TRUE(seen);
    EXPECT_FLOAT_EQ(seen->point_event().position_m().x(), 0.05f);
    EXPECT_GE(seen->point_event().participant(), static_cast<std::uint32_t>(kMaxHands));
  }
  // A place that comes too soon is left out, an end is not.
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(instructor.send(point_at(0.06f)));
  proto::Envelope end;
  end.mutable_point_request();
  ASSERT_TRUE(instructor.send(end));
  int between = 0;
  for (;; ++between) {
    const auto seen = surgeon.receive(proto::Envelope::kPointEvent);
    ASSERT_TRUE(seen);
    if (!seen->point_event().has_position_m()) break;
  }
  EXPECT_LT(between, 20);
}

TEST(Pointing, IsForInstructorsAlone) {
  LiveSession session;
  for (const auto role : {proto::ROLE_SURGEON, proto::ROLE_ASSISTANT, proto::ROLE_OBSERVER}) {
    RawClient client(session.port());
    ASSERT_TRUE(client.join("Ann", role));
    ASSERT_TRUE(client.send(point_at(0)));
    const auto goodbye = client.read_goodbye();
    ASSERT_TRUE(goodbye);
    EXPECT_EQ(goodbye->reason(), proto::GOODBYE_ROLE);
  }
}

TEST(Pointing, ToAPlaceThatIsNoneEndsTheSession) {
  LiveSession session;
  for (const float x :
       {3.0f, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    RawClient client(session.port());
    ASSERT_TRUE(client.join("Ivy", proto::ROLE_INSTRUCTOR));
    ASSERT_TRUE(client.send(point_at(x)));
    const auto goodbye = client.read_goodbye();
    ASSERT_TRUE(goodbye);
    EXPECT_EQ(goodbye->reason(), proto::GOODBYE_PROTOCOL_ERROR);
    EXPECT_NE(goodbye->text().find("PointRequest.position_m"), std::string::npos);
  }
}

}  // namespace
}  // namespace trocar::testing
