// A session over a bus: what a publisher has received reaches those who take it, whenever they
// come, whatever is lost on the way, and whoever else publishes. The session is a real server
// without a simulation; the bus is one in memory, and so is the clock.

#include "server/watch/bus/bus_channel.h"
#include "tests/broadcast/session_on_bus.h"

namespace trocar::bus {
namespace {

TEST(BusChannel, small_messages_that_wait_cost_more_than_their_content) {
  EXPECT_EQ(BusChannel::cost("", 0, ""), 256u);
  EXPECT_EQ(BusChannel::cost("abc", 1000, "de"), 1261u);
}

TEST_F(Broadcast, who_comes_late_has_the_picture_and_follows_it) {
  publish(20);
  publish(20, true);
  auto& ann = come();
  ASSERT_EQ(ann.welcomes.size(), 1u);
  EXPECT_EQ(ann.welcomes[0].organ_hash(), 42u);
  EXPECT_EQ(ann.crc(), newest_crc_);
  publish(20);
  publish(20, true);
  publish(20);
  auto& ben = come();
  publish(20);
  EXPECT_EQ(ann.crc(), newest_crc_);
  EXPECT_EQ(ben.crc(), newest_crc_);
  EXPECT_EQ(ann.tap.counters().asks, 1u);
  EXPECT_EQ(ben.tap.counters().asks, 1u);
  EXPECT_EQ(first_.welcomes, 1);
  EXPECT_GT(first_.messages, 10) << "the relay that publishes has everything as well";
}

TEST_F(Broadcast, the_secrets_of_the_relay_that_publishes_do_not_go_out) {
  auto& ann = come();
  ASSERT_EQ(ann.welcomes.size(), 1u);
  EXPECT_TRUE(ann.welcomes[0].return_token().empty());
  EXPECT_EQ(ann.welcomes[0].further_address_size(), 0);
  EXPECT_EQ(ann.welcomes[0].participant(), 0u);
}

TEST_F(Broadcast, a_frame_goes_out_once_for_all_and_as_a_difference) {
  for (int i = 0; i < 3; ++i) come();
  bus_.sent_bytes = 0;
  publish(300);
  const auto large = std::exchange(bus_.sent_bytes, 0);
  publish(5);
  const auto first = std::exchange(bus_.sent_bytes, 0);
  EXPECT_LT(first, large / 2);
  for (int i = 0; i < 5; ++i) come();
  bus_.sent_bytes = 0;
  publish(5);
  EXPECT_NEAR(static_cast<double>(bus_.sent_bytes), static_cast<double>(first), 100);
}

TEST_F(Broadcast, frames_are_left_out_while_the_bus_is_busy_and_the_rest_is_not) {
  auto& ann = come();
  const auto before = ann.crc();
  bus_.waiting_bytes = Publisher::kBusyBytes + 1;
  publish(5);
  publish(5, true);
  EXPECT_FALSE(ann.copy->has_frame()) << "of the surface as it is told now";
  EXPECT_NE(before, newest_crc_);
  bus_.waiting_bytes = 0;
  publish(5);
  EXPECT_EQ(ann.crc(), newest_crc_);
  EXPECT_EQ(ann.tap.counters().asks, 1u);
}

TEST_F(Broadcast, pieces_are_as_small_as_the_bus_wants_them) {
  bus_.most_bytes = 1024;
  publish(50);
  auto& ann = come();
  publish(50, true);
  EXPECT_EQ(ann.crc(), newest_crc_);
  EXPECT_EQ(ann.tap.counters().asks, 1u);
}

TEST_F(Broadcast, a_bus_that_takes_less_than_1_kib_is_told_nothing) {
  bus_.most_bytes = 1023;
  pass(1);
  bus_.sent_bytes = 0;
  publish(5);
  pass(5);
  EXPECT_EQ(bus_.sent_bytes, 0u);
  bus_.most_bytes = 1024;
  pass(3);
  EXPECT_GT(bus_.sent_bytes, 0u);
}

TEST_F(Broadcast, something_left_out_is_noticed_and_asked_for) {
  auto& ann = come();
  bus_.lost_subjects = {Subjects(kName).stream};
  publish(5);
  publish(5, true);
  bus_.lost_subjects.clear();
  pass(0.6);
  EXPECT_EQ(ann.crc(), newest_crc_) << "by a sign of life";
  EXPECT_EQ(ann.tap.counters().gaps, 1u);
  EXPECT_EQ(ann.welcomes.size(), 2u);
  EXPECT_EQ(ann.losses, 0) << "nobody is told of that";
  publish(5);
  EXPECT_EQ(ann.crc(), newest_crc_);
}

TEST_F(Broadcast, what_is_told_while_an_answer_is_on_its_way_is_not_missed) {
  auto& ann = come();
  pass(1);
  Envelope question;
  question.mutable_keyframe_request();
  for (const auto& listener : bus_.listeners)
    if (Subjects(kName).is_for_answers(listener.subject)) bus_.late_subjects = {listener.subject};
  ann.tap.say(question);  // as a relay does whose frames do not fit
  EXPECT_EQ(ann.tap.counters().asks, 2u);
  const auto asked = std::move(bus_.letters.front());
  bus_.letters.pop_front();
  for (const auto& listener : bus_.listeners)
    if (listener.subject == asked.subject) listener.take(asked.bytes, asked.answer_to);
  make(5, true);
  first_.pass_on();  // the answer was made before, and comes after
  bus_.deliver();
  EXPECT_EQ(ann.crc(), newest_crc_);
  EXPECT_EQ(ann.welcomes.size(), 2u);
  publish(5);
  EXPECT_EQ(ann.crc(), newest_crc_);
  EXPECT_EQ(ann.tap.counters().asks, 2u);
}

TEST_F(Broadcast, a_publisher_that_has_lost_its_server_is_silent_and_goes_on_later) {
  auto& ann = come();
  first_.upstream.is_welcome = false;
  pass(2.9);
  EXPECT_EQ(ann.losses, 0);
  pass(0.5);
  EXPECT_EQ(ann.losses, 1) << "the picture stands still";
  EXPECT_FALSE(ann.tap.is_welcome());
  pass(60);
  EXPECT_TRUE(ann.over.empty());
  EXPECT_LT(ann.tap.counters().asks, 25u) << "it asks less often with time";
  make(5);
  first_.join("Relay 2");
  pass(5);
  EXPECT_EQ(ann.crc(), newest_crc_);
  EXPECT_EQ(ann.tap.returns(), 1u);
  EXPECT_TRUE(ann.tap.is_welcome());
}

TEST_F(Broadcast, what_was_told_in_a_short_silence_is_asked_for) {
  auto& ann = come();
  first_.upstream.is_welcome = false;
  pass(0.2);
  make(5);
  first_.pass_on();
  first_.upstream.is_welcome = true;
  pass(0.6);
  EXPECT_EQ(ann.tap.counters().gaps, 1u);
  publish(5);
  EXPECT_EQ(ann.crc(), newest_crc_);
  EXPECT_EQ(ann.losses, 0);
}

TEST_F(Broadcast, of_several_publishers_one_publishes_and_the_next_takes_over) {
  auto& ann = come();
  others_.push_back(make_source(50));
  make(5);
  first_.pass_on();
  others_[0]->join("Second");
  bus_.sent_bytes = 0;
  pass(5);
  EXPECT_EQ(ann.losses, 0);
  const auto heard = ann.tap.counters();
  EXPECT_EQ(heard.asks, 1u) << "the first one goes on";
  first_.upstream.is_welcome = false;  // it dies
  pass(4);
  EXPECT_EQ(ann.losses, 1);
  pass(4);
  make(5);
  others_[0]->pass_on();
  bus_.deliver();
  EXPECT_EQ(ann.crc(), newest_crc_);
  EXPECT_TRUE(ann.tap.is_welcome());
}

TEST_F(Broadcast, of_two_publishers_that_began_at_once_the_smaller_number_goes_on) {
  others_.push_back(make_source(50));
  make(5);
  first_.pass_on();
  others_[0]->join("Second");
  bus_.lost_subjects = {Subjects(kName).stream};  // neither hears the other
  pass(3);
  bus_.lost_subjects.clear();
  pass(1);
  auto& ann = come();
  make(5);
  others_[0]->pass_on();
  bus_.deliver();
  EXPECT_EQ(ann.crc(), newest_crc_) << "without what the first one hears";
}

TEST_F(Broadcast, after_the_bus_was_away_one_of_several_publishes) {
  auto& ann = come();
  others_.push_back(make_source(50));
  make(5);
  first_.pass_on();
  others_[0]->join("Second");
  pass(1);
  bus_.most_bytes = 0;
  pass(10);
  EXPECT_EQ(ann.losses, 1);
  bus_.most_bytes = 1024;
  bus_.sent_bytes = 0;
  pass(1.8);
  EXPECT_LT(bus_.sent_bytes, 500u) << "questions alone, while they listen";
  pass(8);
  EXPECT_TRUE(ann.tap.is_welcome());
  EXPECT_EQ(ann.crc(), newest_crc_);
  EXPECT_EQ(ann.losses, 1);
}

TEST_F(Broadcast, another_publisher_changes_nothing_for_who_follows_one) {
  auto& ann = come();
  FakeChannel eve(bus_);
  const Subjects subjects(kName);
  Envelope goodbye;
  goodbye.mutable_goodbye()->set_text("over");
  const auto framed = wire::encode_envelope(goodbye);
  for (const std::uint64_t number : {0u, 1u, 2u, 50u})
    for (const auto& piece : cut(700, number, *framed, 1000)) eve.send(subjects.stream, piece, "");
  bus_.deliver();
  EXPECT_TRUE(ann.over.empty());
  publish(5);
  EXPECT_EQ(ann.crc(), newest_crc_);
  EXPECT_EQ(ann.tap.counters().asks, 1u);
}

TEST_F(Broadcast, nonsense_with_the_publishers_number_is_got_over) {
  auto& ann = come();
  FakeChannel eve(bus_);
  const Subjects subjects(kName);
  testing::Random random(3);
  for (int i = 0; i < 200; ++i) {
    Bytes content(1 + random.below(60));
    for (auto& byte : content) byte = static_cast<std::uint8_t>(random.below(256));
    const Piece piece{.publisher = 100,
                      .number = random.below(40),
                      .piece = static_cast<std::uint32_t>(random.below(2)),
                      .pieces = static_cast<std::uint32_t>(random.below(3)),
                      .bytes = content};
    auto bytes = write_piece(piece);
    if (random.below(4) == 0) bytes.resize(random.below(static_cast<std::uint32_t>(bytes.size())));
    for (const auto& listener : bus_.listeners)
      if (random.below(3) == 0) eve.send(listener.subject, bytes, subjects.answers_to("abc"));
    pass(0.1);
  }
  pass(10);
  publish(5);
  pass(5);
  EXPECT_EQ(ann.crc(), newest_crc_);
  EXPECT_GT(ann.tap.counters().wrong + ann.tap.counters().gaps, 0u);
}

TEST_F(Broadcast, answers_go_nowhere_else) {
  FakeChannel eve(bus_);
  bool is_heard = false;
  ASSERT_TRUE(
      eve.listen("trocar.hall.a.request", [&](auto, const auto&) { is_heard = true; }).ok());
  FakeChannel mallory(bus_);
  Envelope question;
  question.mutable_keyframe_request();
  const auto asked = *wire::encode_envelope(question);
  mallory.send(Subjects(kName).ask, asked, "trocar.hall.a.request");
  mallory.send(Subjects(kName).ask, asked, "");
  bus_.deliver();
  EXPECT_FALSE(is_heard);
}

TEST_F(Broadcast, a_flood_of_questions_is_answered_in_part_and_others_are_answered_soon) {
  Askers askers(bus_, 1000);
  for (int i = 0; i < 1000; ++i) askers.ask(0);
  bus_.deliver();
  EXPECT_EQ(askers.answers(), 1u) << "one asker is not answered twice in 0.25 s";
  for (std::size_t i = 0; i < 1000; ++i) askers.ask(i);
  bus_.deliver();
  EXPECT_GT(askers.answers(), 20u);
  EXPECT_LE(askers.answers(), 300u) << "so many are answered at once, and no more";
  pass(1);
  const auto& ann = come();
  EXPECT_EQ(ann.crc(), newest_crc_) << "a second later there are answers again";
}

TEST_F(Broadcast, pings_are_answered_within_limits) {
  pass(20);
  Askers askers(bus_, 1);
  Envelope ping;
  ping.mutable_ping()->set_client_time_us(1);
  const auto one = *wire::encode_envelope(ping);
  Bytes many;
  for (int i = 0; i < 100; ++i) many.insert(many.end(), one.begin(), one.end());
  const auto flood = [&](std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
      askers.mouth.send(Subjects(kName).ask, many, askers.subject(0));
    bus_.deliver();
    return std::exchange(askers.answered[0], 0);
  };
  EXPECT_EQ(flood(5), 5u) << "one for each question";
  EXPECT_LE(flood(20'000), 15'000u);
  pass(1);
  EXPECT_GE(flood(2000), 1000u) << "a second later there are answers again";
  pass(1);
  bus_.waiting_bytes = Publisher::kBusyBytes / 2 + 1;
  EXPECT_EQ(flood(5), 0u) << "frames come first";
}

TEST_F(Broadcast, of_many_who_go_on_asking_each_is_answered) {
  Askers askers(bus_, 450);
  std::size_t rounds = 0;
  while (askers.answered.size() < 450 && rounds++ < 30) {
    for (std::size_t i = 0; i < 450; ++i)
      if (!askers.answered.contains(i)) askers.ask(i);
    bus_.deliver();
    pass(1);
  }
  EXPECT_EQ(askers.answered.size(), 450u);
}

TEST_F(Broadcast, the_server_knows_how_many_watch_everywhere) {
  Envelope own;
  own.mutable_relay_report()->set_watchers(3);
  first_.publisher.say(own);
  ASSERT_FALSE(first_.upstream.said.empty());
  EXPECT_EQ(first_.upstream.said.back().relay_report().watchers(), 3u);
  auto& ann = come();
  auto& ben = come();
  for (auto* taker : {&ann, &ben}) {
    Envelope report;
    report.mutable_relay_report()->set_watchers(20);
    taker->tap.say(report);
  }
  pass(2);
  EXPECT_EQ(first_.upstream.said.back().relay_report().watchers(), 43u);
  takers_.pop_back();
  pass(12);
  EXPECT_EQ(first_.upstream.said.back().relay_report().watchers(), 23u);
  EXPECT_LE(first_.upstream.said.size(), 4u) << "it is said when it changes";
}

TEST_F(Broadcast, more_than_the_server_takes_are_never_reported) {
  Envelope report;
  report.mutable_relay_report()->set_watchers(3);
  first_.publisher.say(report);
  for (const std::uint32_t watchers : {90'000u, 90'000u, 4'294'967'295u}) {
    report.mutable_relay_report()->set_watchers(watchers);
    come().tap.say(report);
    pass(2);
  }
  ASSERT_GT(first_.upstream.said.size(), 2u);
  for (const auto& said : first_.upstream.said)
    EXPECT_LE(said.relay_report().watchers(), wire::kMostRelayed);
  EXPECT_EQ(first_.upstream.said.back().relay_report().watchers(), wire::kMostRelayed);
}

TEST_F(Broadcast, the_servers_clock_is_known_over_the_bus) {
  auto& ann = come();
  EXPECT_EQ(ann.tap.server_time_us(now_ns_ / 1000), 0u) << "not yet";
  pass(1);
  EXPECT_EQ(ann.tap.server_time_us(now_ns_ / 1000), now_ns_ / 1000 + 5000);
}

TEST_F(Broadcast, the_clock_is_learned_anew_when_the_publishers_server_has_another) {
  auto& ann = come();
  pass(3);
  first_.upstream.ahead_us = 9'000'000;
  first_.upstream.events.welcome(ann.welcomes[0]);
  pass(1);
  EXPECT_EQ(ann.tap.server_time_us(now_ns_ / 1000), now_ns_ / 1000 + 9'000'000);
}

TEST_F(Broadcast, the_end_of_the_session_is_the_end_for_all) {
  auto& ann = come();
  const auto last = session_.make_frame(10);
  session_.on_io([&] { session_.replicator().begin_barrier(last); });
  first_.pass_on();
  const auto barrier = first_.client->receive(Envelope::kBarrier);
  ASSERT_TRUE(barrier);
  first_.say(*barrier);
  bus_.deliver();
  EXPECT_EQ(ann.copy->last_frame(), last->frame);
  EXPECT_EQ(ann.crc(), barrier->barrier().surface_crc());
  first_.upstream.events.over(wire::EndReason::ServerClosing, "it is over");
  bus_.deliver();
  EXPECT_EQ(ann.over, "it is over");
}

TEST_F(Broadcast, the_end_reaches_also_who_was_asking) {
  auto& ann = come();
  Envelope question;
  question.mutable_keyframe_request();
  bus_.lost_subjects = {Subjects(kName).ask};
  pass(1);
  ann.tap.say(question);
  bus_.deliver();
  ASSERT_EQ(ann.tap.counters().asks, 2u);
  first_.upstream.events.over(wire::EndReason::ServerClosing, "it is over");
  bus_.deliver();
  EXPECT_TRUE(ann.over.empty()) << "the answer may come";
  pass(1.1);
  EXPECT_EQ(ann.over, "it is over") << "who had followed this publisher believes it";
}

TEST_F(Broadcast, who_asks_after_the_end_has_the_last_picture_and_the_end) {
  const auto last = session_.make_frame(10);
  session_.on_io([&] { session_.replicator().begin_barrier(last); });
  first_.pass_on();
  const auto barrier = first_.client->receive(Envelope::kBarrier);
  ASSERT_TRUE(barrier);
  first_.say(*barrier);
  auto& ann = come();
  EXPECT_EQ(ann.copy->last_frame(), last->frame) << "the answer says which frame is the last";
  EXPECT_TRUE(ann.over.empty());
  first_.upstream.events.over(wire::EndReason::ServerClosing, "it is over");
  auto& ben = come();
  EXPECT_EQ(ben.crc(), barrier->barrier().surface_crc());
  EXPECT_EQ(ben.over, "it is over");
}

TEST_F(Broadcast, a_relay_that_is_put_out_ends_nothing_for_others) {
  auto& ann = come();
  first_.upstream.events.over(wire::EndReason::PutOut, "an instructor has put you out");
  bus_.deliver();
  EXPECT_TRUE(ann.over.empty());
}

TEST_F(Broadcast, a_reason_that_nobody_knows_ends_nothing_for_others) {
  auto& ann = come();
  first_.upstream.events.over(wire::EndReason::Unspecified, "something new");
  bus_.deliver();
  EXPECT_TRUE(ann.over.empty());
}

TEST_F(Broadcast, who_finds_nobody_says_so) {
  first_.upstream.is_welcome = false;
  pass(1);
  auto& ann = come();
  pass(14);
  EXPECT_TRUE(ann.over.empty());
  pass(2);
  EXPECT_NE(ann.over.find("nobody publishes the session monday"), std::string::npos) << ann.over;
}

}  // namespace
}  // namespace trocar::bus
