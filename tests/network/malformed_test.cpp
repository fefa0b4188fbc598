// Whatever arrives, the server stays up, says why it ends that session, and a second client gets
// every frame with the right CRC.

#include <cmath>
#include <functional>
#include <limits>

#include "tests/network/session_fixture.h"

namespace trocar::testing {
namespace {

using proto::Envelope;

// A session with one healthy watcher, who is asked to follow a frame after each attack.
class Malformed : public ::testing::Test {
 protected:
  Malformed() : watcher_(session_.port()) {
    session_.publish(40);
    EXPECT_TRUE(watcher_.join("watcher", proto::ROLE_OBSERVER));
    watcher_.surface.resize(session_.layout().vertex_count());
    EXPECT_TRUE(watcher_.follow());
  }

  void expect_watcher_undisturbed() {
    const auto before = watcher_.frame;
    const auto shown = session_.publish(20);
    ASSERT_TRUE(watcher_.follow());
    EXPECT_EQ(watcher_.frame, before + 1) << "no frame may be missing";
    EXPECT_EQ(watcher_.surface, shown->surface);
  }

  // Joins, sends `envelope`, and returns the Goodbye that must follow.
  proto::Goodbye answer_to(const Envelope& envelope, proto::Role role = proto::ROLE_SURGEON) {
    RawClient client(session_.port());
    EXPECT_TRUE(client.join("attacker " + std::to_string(attacker_++), role));
    EXPECT_TRUE(client.send(envelope));
    const auto goodbye = client.read_goodbye();
    EXPECT_TRUE(goodbye.has_value()) << envelope.ShortDebugString();
    return goodbye.value_or(proto::Goodbye());
  }

  LiveSession session_;
  RawClient watcher_;
  int attacker_ = 0;
};

TEST_F(Malformed, every_field_of_a_tool_sample_out_of_range_ends_the_session_with_a_reason) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  using Change = std::function<void(proto::ToolSample&)>;
  const std::vector<Change> changes = {
      [=](auto& s) { s.mutable_position_m()->set_x(nan); },
      [=](auto& s) { s.mutable_position_m()->set_y(inf); },
      [=](auto& s) { s.mutable_position_m()->set_z(-inf); },
      [](auto& s) { s.mutable_position_m()->set_x(3.0f); },
      [](auto& s) { s.mutable_position_m()->set_z(-2.01f); },
      [](auto& s) { s.mutable_position_m()->set_y(std::numeric_limits<float>::max()); },
      [](auto& s) { s.clear_position_m(); },
      [](auto& s) { s.clear_orientation(); },
      [](auto& s) { s.mutable_orientation()->set_w(0); },
      [](auto& s) { s.mutable_orientation()->set_w(1.01f); },
      [](auto& s) { s.mutable_orientation()->set_w(0.99f); },
      [=](auto& s) { s.mutable_orientation()->set_x(nan); },
      [=](auto& s) { s.mutable_orientation()->set_z(inf); },
      [](auto& s) { s.mutable_orientation()->set_y(std::numeric_limits<float>::max()); },
      [](auto& s) { s.set_tool(1); },  // has one tool only
      [](auto& s) { s.set_tool(7); },
      [](auto& s) { s.set_tool(0xffffffffu); },
      [](auto& s) { s.set_verb(static_cast<proto::Verb>(4)); },
      [](auto& s) { s.set_verb(static_cast<proto::Verb>(99)); },
      [](auto& s) { s.set_verb(static_cast<proto::Verb>(-1)); },
  };
  for (const auto& change : changes) {
    auto sample = make_sample(1);
    change(*sample.mutable_tool_sample());
    const auto goodbye = answer_to(sample);
    EXPECT_EQ(goodbye.reason(), proto::GOODBYE_PROTOCOL_ERROR) << sample.ShortDebugString();
    EXPECT_TRUE(goodbye.text().starts_with("ToolSample")) << goodbye.text();
    expect_watcher_undisturbed();
  }
  hands::TickInputs inputs;
  session_.inbox.drain(inputs);
  EXPECT_TRUE(inputs.samples.empty()) << "none of them may reach the simulation";
}

TEST_F(Malformed, samples_at_the_edge_of_the_ranges_are_taken_and_renormalised) {
  RawClient client(session_.port());
  ASSERT_TRUE(client.join("edge", proto::ROLE_SURGEON));
  auto sample = make_sample(5);
  sample.mutable_tool_sample()->mutable_position_m()->set_y(2.0f);
  sample.mutable_tool_sample()->mutable_orientation()->set_w(1.0009f);
  sample.mutable_tool_sample()->set_verb(proto::VERB_GRASP);
  ASSERT_TRUE(client.send(sample));
  Envelope ping;
  ping.mutable_ping()->set_client_time_us(1);
  ASSERT_TRUE(client.send(ping));
  ASSERT_TRUE(client.receive(Envelope::kPong)) << "the sample was refused";
  hands::TickInputs inputs;
  session_.inbox.drain(inputs);
  ASSERT_EQ(inputs.samples.size(), 1u);
  EXPECT_EQ(norm(inputs.samples[0].sample.world_from_tool.orientation), 1.0f);
  EXPECT_EQ(inputs.samples[0].sample.world_from_tool.position.y, 2.0f);
  EXPECT_EQ(inputs.samples[0].sample.verb, tool::Verb::Grasp);
}

TEST_F(Malformed, a_sequence_that_does_not_grow_ends_the_session) {
  for (const std::uint32_t second : {5u, 4u, 0u}) {
    RawClient client(session_.port());
    ASSERT_TRUE(client.join("seq " + std::to_string(second), proto::ROLE_SURGEON));
    ASSERT_TRUE(client.send(make_sample(5)));
    ASSERT_TRUE(client.send(make_sample(second)));
    const auto goodbye = client.read_goodbye();
    ASSERT_TRUE(goodbye);
    EXPECT_EQ(goodbye->reason(), proto::GOODBYE_PROTOCOL_ERROR);
  }
  expect_watcher_undisturbed();
}

TEST_F(Malformed, messages_of_another_role_or_direction_end_the_session) {
  EXPECT_EQ(answer_to(make_sample(1), proto::ROLE_OBSERVER).reason(), proto::GOODBYE_ROLE);
  EXPECT_EQ(answer_to(make_sample(1), proto::ROLE_INSTRUCTOR).reason(), proto::GOODBYE_ROLE);
  Envelope mark;
  mark.mutable_mark_request()->set_action(proto::MARK_SET);
  EXPECT_EQ(answer_to(mark, proto::ROLE_SURGEON).reason(), proto::GOODBYE_ROLE);
  mark.mutable_mark_request()->set_action(static_cast<proto::MarkAction>(3));
  EXPECT_EQ(answer_to(mark, proto::ROLE_INSTRUCTOR).reason(), proto::GOODBYE_PROTOCOL_ERROR);
  std::vector<Envelope> wrong(9);
  wrong[0].mutable_welcome();
  wrong[1].mutable_surface_topology();
  wrong[2].mutable_surface_frame();
  wrong[3].mutable_frame_state();
  wrong[4].mutable_participants();
  wrong[5].mutable_barrier();
  wrong[6].mutable_goodbye()->set_text("you go");
  wrong[7] = make_hello("again", proto::ROLE_SURGEON);
  wrong[8].mutable_frame_ack()->set_frame(1'000'000);  // not given yet
  for (const auto& envelope : wrong)
    EXPECT_EQ(answer_to(envelope).reason(), proto::GOODBYE_PROTOCOL_ERROR)
        << envelope.ShortDebugString();
  expect_watcher_undisturbed();
}

TEST_F(Malformed, anything_but_hello_first_ends_the_session) {
  Envelope ping;
  ping.mutable_ping();
  for (const auto& envelope : {ping, make_sample(1)}) {
    RawClient client(session_.port());
    ASSERT_TRUE(client.send(envelope));
    const auto goodbye = client.read_goodbye();
    ASSERT_TRUE(goodbye);
    EXPECT_EQ(goodbye->reason(), proto::GOODBYE_PROTOCOL_ERROR);
  }
  expect_watcher_undisturbed();
}

TEST_F(Malformed, zero_and_oversized_lengths_end_the_session_before_a_byte_of_body_is_read) {
  for (const std::uint32_t length : {0u, wire::kMaxUpstreamBytes + 1, 0x7fffffffu, 0xffffffffu})
    for (const bool has_joined : {false, true}) {
      RawClient client(session_.port());
      ASSERT_TRUE(!has_joined || client.join("big", proto::ROLE_SURGEON));
      Bytes header;
      ByteWriter(header).put(length);
      ASSERT_TRUE(client.send_bytes(header));
      const auto goodbye = client.read_goodbye();
      ASSERT_TRUE(goodbye) << length;
      EXPECT_EQ(goodbye->reason(), proto::GOODBYE_PROTOCOL_ERROR);
      ASSERT_TRUE(session_.wait_for_sessions(1));
    }
  expect_watcher_undisturbed();
}

TEST_F(Malformed, a_message_of_exactly_64_KiB_is_read) {
  auto hello = make_hello("Anna", proto::ROLE_OBSERVER);
  Bytes body(hello.ByteSizeLong());
  hello.SerializeWithCachedSizesToArray(body.data());
  // Field 99, length-delimited: 2 bytes of tag and 3 of length fill up to the limit.
  const auto filler = wire::kMaxUpstreamBytes - body.size() - 5;
  Bytes frame;
  ByteWriter writer(frame);
  writer.put(wire::kMaxUpstreamBytes);
  writer.put_bytes(body);
  const Bytes head{0x9a, 0x06, static_cast<std::uint8_t>(0x80u | (filler & 0x7fu)),
                   static_cast<std::uint8_t>(0x80u | (filler >> 7 & 0x7fu)),
                   static_cast<std::uint8_t>(filler >> 14)};
  writer.put_bytes(head);
  frame.resize(wire::kHeaderBytes + wire::kMaxUpstreamBytes);
  RawClient client(session_.port());
  ASSERT_TRUE(client.send_bytes(frame));
  EXPECT_TRUE(client.receive(Envelope::kWelcome));
}

TEST_F(Malformed, truncation_at_every_length_then_close) {
  const auto hello = wire::encode_envelope(make_hello("cut", proto::ROLE_SURGEON));
  for (std::size_t length = 0; length < hello->size(); ++length) {
    RawClient client(session_.port());
    ASSERT_TRUE(client.send_bytes(BytesView(*hello).first(length)));
    client.shut_down_sending();
    EXPECT_TRUE(client.reads_to_end()) << length;
  }
  const auto sample = wire::encode_envelope(make_sample(1));
  for (std::size_t length = 0; length < sample->size(); ++length) {
    RawClient client(session_.port());
    ASSERT_TRUE(client.join("cut " + std::to_string(length), proto::ROLE_SURGEON));
    ASSERT_TRUE(client.send_bytes(BytesView(*sample).first(length)));
    client.shut_down_sending();
    EXPECT_TRUE(client.reads_to_end()) << length;
  }
  ASSERT_TRUE(session_.wait_for_sessions(1));
  expect_watcher_undisturbed();
}

TEST_F(Malformed, bodies_cut_short_inside_a_whole_frame) {
  const auto whole = wire::encode_envelope(make_hello("cut", proto::ROLE_SURGEON));
  const BytesView body = BytesView(*whole).subspan(wire::kHeaderBytes);
  for (std::size_t length = 1; length < body.size(); ++length) {
    Bytes frame;
    ByteWriter writer(frame);
    writer.put(static_cast<std::uint32_t>(length));
    writer.put_bytes(body.first(length));
    RawClient client(session_.port());
    ASSERT_TRUE(client.send_bytes(frame));
    client.shut_down_sending();
    EXPECT_TRUE(client.reads_to_end()) << length;
  }
  ASSERT_TRUE(session_.wait_for_sessions(1));
  expect_watcher_undisturbed();
}

TEST_F(Malformed, random_bytes_and_random_changes_to_valid_messages) {
  for (unsigned seed = 0; seed < 400; ++seed) {
    std::mt19937 random(seed);
    RawClient client(session_.port());
    ASSERT_TRUE(seed % 4 == 0 || client.join("fuzz", proto::ROLE_SURGEON));
    Bytes bytes;
    if (seed % 2 == 0) {  // plain noise, often with a plausible length in front
      bytes.resize(1 + random() % 3000);
      for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
      const auto length = static_cast<std::uint32_t>(bytes.size());
      if (seed % 8 == 0 && bytes.size() > 4) std::memcpy(bytes.data(), &length, sizeof length);
    } else {
      for (std::uint32_t i = 1; i <= 5; ++i) {
        auto frame = *wire::encode_envelope(make_sample(i));
        for (unsigned flips = random() % 4; flips > 0; --flips)
          frame[random() % frame.size()] ^= static_cast<std::uint8_t>(1u << random() % 8);
        bytes.insert(bytes.end(), frame.begin(), frame.end());
      }
    }
    client.send_bytes(bytes);
    client.shut_down_sending();
    EXPECT_TRUE(client.reads_to_end()) << seed;
    ASSERT_TRUE(session_.wait_for_sessions(1)) << seed;
    if (seed % 20 == 0) expect_watcher_undisturbed();
  }
  expect_watcher_undisturbed();
  hands::TickInputs inputs;
  session_.inbox.drain(inputs);
  for (const auto& input : inputs.samples) {
    EXPECT_TRUE(is_finite(input.sample.world_from_tool.position));
    EXPECT_NEAR(norm(input.sample.world_from_tool.orientation), 1.0f, 1e-6f);
  }
}

TEST_F(Malformed, a_flood_of_messages_ends_the_session) {
  RawClient client(session_.port());
  ASSERT_TRUE(client.join("flood", proto::ROLE_SURGEON));
  Envelope ping;
  ping.mutable_ping();
  const auto frame = wire::encode_envelope(ping);
  Bytes flood;
  for (int i = 0; i < 9000; ++i) flood.insert(flood.end(), frame->begin(), frame->end());
  client.send_bytes(flood);
  const auto goodbye = client.read_goodbye();
  ASSERT_TRUE(goodbye);
  EXPECT_EQ(goodbye->reason(), proto::GOODBYE_PROTOCOL_ERROR);
  EXPECT_NE(goodbye->text().find("2000 messages"), std::string::npos) << goodbye->text();
  expect_watcher_undisturbed();
}

TEST(Flood, few_messages_may_be_too_many_bytes) {
  replication::ReplicatorOptions options;
  options.max_bytes_per_second = 5000;
  LiveSession session({}, options);
  RawClient client(session.port());
  ASSERT_TRUE(client.join("flood", proto::ROLE_SURGEON));
  auto hello = make_hello(std::string(30'000, 'x'), proto::ROLE_SURGEON);
  for (int i = 0; i < 4; ++i) client.send(hello);
  const auto goodbye = client.read_goodbye();
  ASSERT_TRUE(goodbye);
  EXPECT_NE(goodbye->text().find("5000 bytes in a second"), std::string::npos) << goodbye->text();
  EXPECT_EQ(session.on_io([&] { return session.replicator().counters().floods; }), 1u);
}

}  // namespace
}  // namespace trocar::testing
