// Many who watch over one connection: rights, lists and refusals are each one's, frames are not.

#include "tests/network/session_fixture.h"

namespace trocar::testing {
namespace {

using proto::Envelope;

Envelope wrap(std::uint32_t guest, const Envelope& inner, bool is_last = false) {
  Envelope envelope;
  envelope.mutable_guest_message()->set_guest(guest);
  envelope.mutable_guest_message()->set_envelope(inner.SerializeAsString());
  envelope.mutable_guest_message()->set_is_last(is_last);
  return envelope;
}

Envelope lost(std::uint32_t guest) {
  Envelope envelope;
  envelope.mutable_guest_message()->set_guest(guest);
  envelope.mutable_guest_message()->set_is_last(true);
  return envelope;
}

class Guests : public ::testing::Test {
 protected:
  static replication::ReplicatorOptions options() {
    replication::ReplicatorOptions options;
    options.participants_interval_ns = 0;
    return options;
  }
  // Next message for that guest, whatever else comes.
  std::optional<Envelope> receive(std::uint32_t guest) {
    while (const auto message = carrier_.receive(Envelope::kGuestMessage)) {
      if (message->guest_message().guest() != guest) continue;
      was_last_ = message->guest_message().is_last();
      Envelope inner;
      EXPECT_TRUE(inner.ParseFromString(message->guest_message().envelope()));
      return inner;
    }
    return std::nullopt;
  }
  std::optional<proto::Welcome> join(std::uint32_t guest, const std::string& name,
                                     proto::Role role = proto::ROLE_OBSERVER) {
    EXPECT_TRUE(carrier_.send(wrap(guest, make_hello(name, role))));
    const auto answer = receive(guest);
    if (!answer || !answer->has_welcome()) return std::nullopt;
    return answer->welcome();
  }
  std::vector<std::string> names_of(const Envelope& list) {
    std::vector<std::string> names;
    for (const auto& entry : list.participants().participant()) names.push_back(entry.name());
    return names;
  }
  bool sees_list(RawClient& client, const std::vector<std::string>& names) {
    while (const auto message = client.receive(Envelope::kParticipants))
      if (names_of(*message) == names) return true;
    return false;
  }

  LiveSession session_{{}, options()};
  RawClient carrier_{session_.port()};
  bool was_last_ = false;
};

TEST_F(Guests, each_has_a_slot_and_all_share_one_picture) {
  session_.publish(10);
  const auto ann = join(1, "Ann");
  ASSERT_TRUE(ann);
  ASSERT_TRUE(carrier_.receive(Envelope::kSurfaceTopology));
  ASSERT_TRUE(carrier_.receive(Envelope::kSurfaceFrame)->surface_frame().is_keyframe());
  ASSERT_TRUE(sees_list(carrier_, {"Ann"}));
  const auto bob = join(2, "Bob");
  ASSERT_TRUE(bob);
  EXPECT_NE(ann->participant(), bob->participant());
  ASSERT_TRUE(sees_list(carrier_, {"Ann", "Bob"}));
  for (int i = 0; i < 3; ++i) session_.publish(10);
  // One of each frame comes, and nothing of the surface for one guest alone.
  for (std::uint32_t frame = 2; frame <= 4; ++frame) {
    const auto message = carrier_.receive();
    ASSERT_TRUE(message && message->has_surface_frame());
    EXPECT_EQ(message->surface_frame().frame(), frame);
    EXPECT_FALSE(message->surface_frame().is_keyframe());
    ASSERT_TRUE(carrier_.receive()->has_frame_state());
  }
}

TEST_F(Guests, what_one_says_is_answered_to_that_one_alone) {
  ASSERT_TRUE(join(1, "Ann"));
  ASSERT_TRUE(join(2, "Bob"));
  Envelope ping;
  ping.mutable_ping()->set_client_time_us(77);
  ASSERT_TRUE(carrier_.send(wrap(2, ping)));
  EXPECT_EQ(receive(2)->pong().client_time_us(), 77u);
  // A guest that does what its role may not is put out; the other stays.
  Envelope mark;
  mark.mutable_mark_request()->set_action(proto::MARK_SET);
  ASSERT_TRUE(carrier_.send(wrap(1, mark)));
  EXPECT_EQ(receive(1)->goodbye().reason(), proto::GOODBYE_ROLE);
  EXPECT_TRUE(was_last_);
  EXPECT_TRUE(sees_list(carrier_, {"Bob"}));
}

TEST_F(Guests, the_connection_ends_with_the_last_of_them) {
  ASSERT_TRUE(join(1, "Ann"));
  ASSERT_TRUE(join(2, "Bob"));
  Envelope bye;
  bye.mutable_bye();
  ASSERT_TRUE(carrier_.send(wrap(1, bye)));
  ASSERT_TRUE(sees_list(carrier_, {"Bob"}));
  ASSERT_TRUE(carrier_.send(lost(2)));
  EXPECT_TRUE(carrier_.reads_to_end());
}

TEST_F(Guests, who_is_refused_leaves_no_connection_behind) {
  EXPECT_FALSE(join(1, "", proto::ROLE_OBSERVER));
  EXPECT_TRUE(carrier_.reads_to_end());
  EXPECT_EQ(session_.on_io([&] { return session_.replicator().roster().list().size(); }), 0u);
}

TEST_F(Guests, hold_instruments) {
  ASSERT_TRUE(join(1, "Sam", proto::ROLE_SURGEON));
  Envelope sample;
  sample.mutable_tool_sample()->set_sequence(1);
  sample.mutable_tool_sample()->mutable_position_m()->set_x(0.1f);
  sample.mutable_tool_sample()->mutable_orientation()->set_w(1);
  ASSERT_TRUE(carrier_.send(wrap(1, sample)));
  Envelope ping;
  ping.mutable_ping()->set_client_time_us(7);
  ASSERT_TRUE(carrier_.send(wrap(1, ping)));
  EXPECT_EQ(receive(1)->pong().client_time_us(), 7u);
  EXPECT_EQ(session_.on_io([&] { return session_.replicator().counters().samples; }), 1u);
}

TEST_F(Guests, nothing_is_kept_for_one_who_does_not_say_hello) {
  Envelope ping;
  ping.mutable_ping();
  ASSERT_TRUE(carrier_.send(wrap(9, ping)));
  EXPECT_EQ(receive(9)->goodbye().reason(), proto::GOODBYE_PROTOCOL_ERROR);
  EXPECT_TRUE(carrier_.reads_to_end());
}

TEST_F(Guests, a_carrier_speaks_for_itself_of_frames_alone) {
  ASSERT_TRUE(join(1, "Ann"));
  Envelope mark;
  mark.mutable_mark_request()->set_action(proto::MARK_SET);
  ASSERT_TRUE(carrier_.send(mark));
  const auto goodbye = carrier_.read_goodbye();
  ASSERT_TRUE(goodbye);
  EXPECT_EQ(goodbye->reason(), proto::GOODBYE_PROTOCOL_ERROR);
}

TEST_F(Guests, who_takes_part_carries_nobody) {
  RawClient sam(session_.port());
  ASSERT_TRUE(sam.join("Sam", proto::ROLE_SURGEON));
  ASSERT_TRUE(sam.send(wrap(1, make_hello("Eve", proto::ROLE_OBSERVER))));
  const auto answer = sam.receive(Envelope::kGuestMessage);
  ASSERT_TRUE(answer);
  Envelope inner;
  ASSERT_TRUE(inner.ParseFromString(answer->guest_message().envelope()));
  EXPECT_EQ(inner.goodbye().reason(), proto::GOODBYE_PROTOCOL_ERROR);
}

TEST_F(Guests, an_instructor_puts_one_out_and_the_others_stay) {
  RawClient ivy(session_.port());
  ASSERT_TRUE(ivy.join("Ivy", proto::ROLE_INSTRUCTOR));
  const auto ann = join(1, "Ann");
  ASSERT_TRUE(ann);
  ASSERT_TRUE(join(2, "Bob"));
  Envelope expel;
  expel.mutable_teach_request()->set_action(proto::TEACH_EXPEL);
  expel.mutable_teach_request()->set_participant(ann->participant());
  expel.mutable_teach_request()->set_name("Ann");
  expel.mutable_teach_request()->set_text("noise");
  ASSERT_TRUE(ivy.send(expel));
  EXPECT_EQ(receive(1)->goodbye().reason(), proto::GOODBYE_PUT_OUT);
  EXPECT_TRUE(was_last_);
  EXPECT_TRUE(sees_list(carrier_, {"Ivy", "Bob"}));
}

TEST_F(Guests, a_lost_connection_keeps_the_places_of_all) {
  auto hello = make_hello("Ann", proto::ROLE_OBSERVER);
  hello.mutable_hello()->set_can_return(true);
  ASSERT_TRUE(carrier_.send(wrap(1, hello)));
  const auto token = receive(1)->welcome().return_token();
  ASSERT_EQ(token.size(), 16u);
  RawClient ivy(session_.port());
  ASSERT_TRUE(ivy.join("Ivy", proto::ROLE_INSTRUCTOR));
  carrier_.shut_down_sending();
  bool is_away = false;
  while (!is_away) {
    const auto list = ivy.receive(Envelope::kParticipants);
    ASSERT_TRUE(list);
    for (const auto& entry : list->participants().participant())
      is_away = is_away || (entry.name() == "Ann" && entry.is_away());
  }
  // She comes back by her token, over another connection.
  RawClient other(session_.port());
  hello.mutable_hello()->set_return_token(token);
  ASSERT_TRUE(other.send(wrap(5, hello)));
  const auto answer = other.receive(Envelope::kGuestMessage);
  ASSERT_TRUE(answer);
  Envelope inner;
  ASSERT_TRUE(inner.ParseFromString(answer->guest_message().envelope()));
  EXPECT_TRUE(inner.has_welcome());
}

TEST_F(Guests, too_many_in_a_second_end_the_connection) {
  ASSERT_TRUE(join(1, "Ann"));
  Envelope ping;
  ping.mutable_ping();
  for (std::uint32_t guest = 2; guest < 3000; ++guest)
    if (!carrier_.send(wrap(guest, ping))) break;
  EXPECT_TRUE(carrier_.reads_to_end());
}

// Takes what is sent, and remembers the last.
struct Carriers final : net::Connections {
  bool send(net::ConnectionId, wire::SharedBytes frame) override {
    last = std::move(frame);
    return true;
  }
  bool has_datagrams(net::ConnectionId) const override { return false; }
  bool send_datagram(net::ConnectionId, BytesView) override { return false; }
  std::size_t outstanding_bytes(net::ConnectionId) const override { return 0; }
  std::string peer_address(net::ConnectionId) const override { return {}; }
  void close_after_flush(net::ConnectionId, wire::SharedBytes) override {}
  void close(net::ConnectionId) override {}

  wire::SharedBytes last;
};

struct Above final : net::ConnectionHandler {
  void on_open(net::ConnectionId) override { ++opened; }
  void on_message(net::ConnectionId, BytesView) override {}
  void on_datagram(net::ConnectionId, BytesView) override {}
  void on_fault(net::ConnectionId, net::ConnectionFault) override {}
  void on_close(net::ConnectionId) override { ++closed; }

  std::size_t opened = 0, closed = 0;
};

TEST(GuestConnections, carry_256_and_refuse_one_more) {
  Carriers carriers;
  Above above;
  crowd::GuestConnections connections(carriers);
  connections.set_handler(above);
  for (std::uint32_t guest = 1; guest <= crowd::GuestConnections::kMostGuests + 1; ++guest) {
    const auto text = wrap(guest, make_hello("Ann", proto::ROLE_OBSERVER)).SerializeAsString();
    connections.on_message(7, bytes_of(std::string_view(text)));
  }
  EXPECT_EQ(above.opened, crowd::GuestConnections::kMostGuests);
  ASSERT_TRUE(carriers.last);
  Envelope answer, inner;
  ASSERT_TRUE(
      wire::decode_envelope(BytesView(*carriers.last).subspan(wire::kHeaderBytes), answer).ok());
  ASSERT_TRUE(inner.ParseFromString(answer.guest_message().envelope()));
  EXPECT_EQ(inner.goodbye().reason(), proto::GOODBYE_FULL);
  connections.on_close(7);
  EXPECT_EQ(above.closed, crowd::GuestConnections::kMostGuests + 1) << "the carrier's, too";
}

TEST_F(Guests, each_answers_for_the_last_frame) {
  session_.publish(10);
  ASSERT_TRUE(join(1, "Ann"));
  const auto last = session_.make_frame(5);
  session_.on_io([&] { session_.replicator().begin_barrier(last); });
  ASSERT_TRUE(carrier_.receive(Envelope::kBarrier));
  Envelope ack;
  ack.mutable_frame_ack()->set_frame(last->frame);
  ack.mutable_frame_ack()->set_surface_crc(last->surface_crc);
  EXPECT_FALSE(session_.on_io([&] { return session_.replicator().is_barrier_complete(); }));
  ASSERT_TRUE(carrier_.send(wrap(1, ack)));
  bool is_complete = false;
  for (int i = 0; i < 5000 && !is_complete; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    is_complete = session_.on_io([&] { return session_.replicator().is_barrier_complete(); });
  }
  EXPECT_TRUE(is_complete);
}

Envelope report_of(std::uint32_t watchers) {
  Envelope envelope;
  envelope.mutable_relay_report()->set_watchers(watchers);
  return envelope;
}

TEST_F(Guests, an_observer_may_say_how_many_watch_through_it) {
  RawClient relay(session_.port());
  ASSERT_TRUE(relay.join("Relay", proto::ROLE_OBSERVER));
  ASSERT_TRUE(relay.send(report_of(250)));
  std::uint32_t shown = 0;
  while (shown != 250) {
    const auto people = relay.receive(Envelope::kParticipants);
    ASSERT_TRUE(people);
    shown = people->participants().participant(0).relayed_watchers();
  }
  ASSERT_TRUE(relay.send(report_of(100'001)));
  const auto goodbye = relay.read_goodbye();
  ASSERT_TRUE(goodbye);
  EXPECT_EQ(goodbye->reason(), proto::GOODBYE_PROTOCOL_ERROR);
  RawClient surgeon(session_.port());
  ASSERT_TRUE(surgeon.join("Sam", proto::ROLE_SURGEON));
  ASSERT_TRUE(surgeon.send(report_of(1)));
  EXPECT_EQ(surgeon.read_goodbye()->reason(), proto::GOODBYE_ROLE);
}

}  // namespace
}  // namespace trocar::testing
