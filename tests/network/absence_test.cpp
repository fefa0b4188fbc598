// A place is kept for a while when its connection breaks: who may have it back, and who may not.

#include "server/session/participants/absences.h"

#include "tests/network/session_fixture.h"

namespace trocar::testing {
namespace {

using proto::Envelope;

constexpr std::uint64_t kSecond = 1'000'000'000;

class Absence : public ::testing::Test {
 protected:
  static replication::ReplicatorOptions options(std::atomic<std::uint64_t>& clock_ns) {
    replication::ReplicatorOptions options;
    options.clock_ns = [&clock_ns] { return clock_ns.load(); };
    options.participants_interval_ns = 0;
    return options;
  }
  // Until the roster says so of this name; the test fails after 10 s.
  void wait_until_away(const std::string& name) {
    for (int i = 0; i < 5000; ++i) {
      const bool is_away = session_.on_io([&] {
        const auto* participant = session_.replicator().roster().find(name);
        return participant != nullptr && participant->is_away;
      });
      if (is_away) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    FAIL() << name << " is not away";
  }
  // Anna joins and breaks the connection; returns what Welcome said.
  proto::Welcome lose_anna() {
    RawClient anna(session_.port());
    const auto welcome = anna.join_to_return("Anna", proto::ROLE_SURGEON);
    EXPECT_TRUE(welcome);
    return welcome.value_or(proto::Welcome());
  }
  proto::GoodbyeReason refusal_of(const std::string& name, const std::string& token = {}) {
    RawClient client(session_.port());
    auto hello = make_hello(name, proto::ROLE_SURGEON);
    hello.mutable_hello()->set_return_token(token);
    EXPECT_TRUE(client.send(hello));
    const auto goodbye = client.read_goodbye();
    EXPECT_TRUE(goodbye);
    return goodbye ? goodbye->reason() : proto::GOODBYE_UNSPECIFIED;
  }
  replication::ReplicatorCounters counters() {
    return session_.on_io([&] { return session_.replicator().counters(); });
  }
  bool wait_for_samples(std::uint64_t count) {
    for (int i = 0; i < 5000 && counters().samples < count; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    return counters().samples >= count;
  }
  hands::TickInputs drain() {
    hands::TickInputs inputs;
    session_.inbox.drain(inputs);
    return inputs;
  }

  std::atomic<std::uint64_t> clock_ns_{1000 * kSecond};
  LiveSession session_{{}, options(clock_ns_)};
};

TEST_F(Absence, the_place_comes_back_with_slot_role_and_tools_and_the_simulation_sees_nothing) {
  session_.publish(10);
  RawClient first(session_.port());
  ASSERT_TRUE(first.join("First", proto::ROLE_ASSISTANT));
  std::string token;
  {
    RawClient anna(session_.port());
    auto hello = make_hello("Anna", proto::ROLE_SURGEON);
    hello.mutable_hello()->set_can_return(true);
    auto& tool = *hello.mutable_hello()->add_tool();
    tool.set_radius_m(0.004f);
    tool.set_length_m(0.25f);
    tool.set_reach_m(0.012f);
    ASSERT_TRUE(anna.send(hello));
    const auto welcome = anna.receive(Envelope::kWelcome);
    ASSERT_TRUE(welcome);
    token = welcome->welcome().return_token();
    EXPECT_EQ(token.size(), participants::kReturnTokenBytes);
    EXPECT_EQ(welcome->welcome().return_seconds(), 30u);
    for (std::uint32_t i = 1; i <= 5; ++i) ASSERT_TRUE(anna.send(make_sample(i)));
    ASSERT_TRUE(wait_for_samples(5));
  }
  wait_until_away("Anna");
  EXPECT_EQ(drain().joins.size(), 2u);
  clock_ns_ += 29 * kSecond;
  session_.publish(10);

  RawClient again(session_.port());
  // Whatever this Hello says of role and tools.
  const auto welcome = again.join_to_return("Anna", proto::ROLE_OBSERVER, token);
  ASSERT_TRUE(welcome);
  EXPECT_EQ(welcome->participant(), 1u);
  EXPECT_EQ(welcome->return_token(), token) << "it must be good if this Welcome gets lost, too";
  const auto list = again.receive(Envelope::kParticipants);
  ASSERT_TRUE(list);
  ASSERT_EQ(list->participants().participant_size(), 2);
  const auto& anna = list->participants().participant(1);
  EXPECT_EQ(anna.role(), proto::ROLE_SURGEON);
  ASSERT_EQ(anna.tool_size(), 1);
  EXPECT_EQ(anna.tool(0).radius_m(), 0.004f);
  EXPECT_FALSE(anna.is_away());
  again.surface.resize(session_.layout().vertex_count());
  ASSERT_TRUE(again.follow());
  EXPECT_TRUE(again.last_was_keyframe);
  ASSERT_TRUE(again.send(make_sample(1))) << "numbers of samples begin anew";
  ASSERT_TRUE(wait_for_samples(6));
  const auto inputs = drain();
  EXPECT_TRUE(inputs.joins.empty());
  EXPECT_TRUE(inputs.leaves.empty());
  ASSERT_EQ(inputs.samples.size(), 1u);
  EXPECT_EQ(inputs.samples[0].tool, tool_slot({1}, 0));
  EXPECT_EQ(counters().lost, 1u);
  EXPECT_EQ(counters().returned, 1u);
  EXPECT_EQ(counters().sessions, 2u);
}

TEST_F(Absence, others_see_who_is_away_and_who_is_back) {
  RawClient watcher(session_.port());
  ASSERT_TRUE(watcher.join("Watcher", proto::ROLE_OBSERVER));
  const auto wait_for = [&](int count, bool is_away) {
    while (const auto message = watcher.receive(Envelope::kParticipants)) {
      const auto& list = message->participants();
      if (list.participant_size() != count) continue;
      if (count == 1 || list.participant(0).is_away() == is_away) return true;
    }
    return false;
  };
  const auto token = lose_anna().return_token();
  EXPECT_TRUE(wait_for(2, true));
  {
    RawClient anna(session_.port());
    ASSERT_TRUE(anna.join_to_return("Anna", proto::ROLE_SURGEON, token));
    EXPECT_TRUE(wait_for(2, false));
  }
  EXPECT_TRUE(wait_for(2, true));
  clock_ns_ += 31 * kSecond;
  session_.publish(1);
  EXPECT_TRUE(wait_for(1, false));
}

TEST_F(Absence, strangers_get_neither_the_name_nor_the_place) {
  const auto token = lose_anna().return_token();
  wait_until_away("Anna");
  RawClient ben(session_.port());
  const auto bens = ben.join_to_return("Ben", proto::ROLE_SURGEON);
  ASSERT_TRUE(bens);
  EXPECT_EQ(bens->participant(), 1u) << "the place itself is taken";
  EXPECT_EQ(refusal_of("Anna"), proto::GOODBYE_NAME_TAKEN);
  EXPECT_EQ(refusal_of("Anna", bens->return_token()), proto::GOODBYE_NAME_TAKEN);
  auto wrong = token;
  wrong.back() = static_cast<char>(wrong.back() ^ 1);
  EXPECT_EQ(refusal_of("Anna", wrong), proto::GOODBYE_NAME_TAKEN);
  EXPECT_EQ(refusal_of("Anna", token.substr(1)), proto::GOODBYE_PROTOCOL_ERROR);
  // Under another name the token is none: that is a new participant.
  RawClient renamed(session_.port());
  const auto other = renamed.join_to_return("Anne", proto::ROLE_SURGEON, token);
  ASSERT_TRUE(other);
  EXPECT_EQ(other->participant(), 2u);
  RawClient anna(session_.port());
  const auto back = anna.join_to_return("Anna", proto::ROLE_SURGEON, token);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->participant(), 0u);
}

TEST_F(Absence, after_the_time_it_is_a_new_join) {
  const auto token = lose_anna().return_token();
  wait_until_away("Anna");
  clock_ns_ += 30 * kSecond;
  RawClient anna(session_.port());
  const auto welcome = anna.join_to_return("Anna", proto::ROLE_ASSISTANT, token);
  ASSERT_TRUE(welcome);
  EXPECT_NE(welcome->return_token(), token);
  const auto inputs = drain();
  EXPECT_EQ(inputs.joins.size(), 1u) << "the first tenant of this tick was never there";
  EXPECT_EQ(counters().returned, 0u);
  EXPECT_EQ(counters().sessions, 2u);
}

TEST_F(Absence, a_connection_that_hangs_is_replaced_at_once) {
  session_.publish(10);
  RawClient hanging(session_.port());
  const auto before = hanging.join_to_return("Anna", proto::ROLE_SURGEON);
  ASSERT_TRUE(before);
  RawClient anna(session_.port());
  const auto back = anna.join_to_return("Anna", proto::ROLE_SURGEON, before->return_token());
  ASSERT_TRUE(back);
  EXPECT_EQ(back->participant(), before->participant());
  EXPECT_TRUE(hanging.reads_to_end());
  EXPECT_EQ(session_.sessions(), 1u);
  EXPECT_EQ(counters().returned, 1u);
  EXPECT_EQ(counters().lost, 0u);
  ASSERT_TRUE(anna.send(make_sample(1)));
  ASSERT_TRUE(wait_for_samples(1));
  const auto inputs = drain();
  EXPECT_EQ(inputs.joins.size(), 1u);
  EXPECT_TRUE(inputs.leaves.empty());
}

TEST_F(Absence, bye_a_goodbye_and_clients_that_cannot_return_free_the_place_at_once) {
  Envelope bye, nonsense;
  bye.mutable_bye();
  nonsense.mutable_pong();
  for (const auto& last : {bye, nonsense}) {
    RawClient anna(session_.port());
    ASSERT_TRUE(anna.join_to_return("Anna", proto::ROLE_SURGEON));
    ASSERT_TRUE(anna.send(last));
    EXPECT_TRUE(anna.reads_to_end());
  }
  {
    RawClient anna(session_.port());
    ASSERT_TRUE(anna.join("Anna", proto::ROLE_SURGEON));
  }
  ASSERT_TRUE(session_.wait_for_sessions(0));
  EXPECT_TRUE(session_.on_io([&] { return session_.replicator().roster().list().empty(); }));
}

TEST_F(Absence, the_barrier_does_not_wait_for_who_is_away) {
  session_.publish(10);
  const auto token = lose_anna().return_token();
  wait_until_away("Anna");
  const auto last = session_.make_frame(5);
  session_.on_io([&] { session_.replicator().begin_barrier(last); });
  EXPECT_TRUE(session_.on_io([&] { return session_.replicator().is_barrier_complete(); }));
  EXPECT_EQ(refusal_of("Anna", token), proto::GOODBYE_SERVER_CLOSING);
}

TEST(AbsenceOptions, without_time_there_are_no_tokens) {
  replication::ReplicatorOptions options;
  options.return_seconds = 0;
  LiveSession session({}, options);
  {
    RawClient anna(session.port());
    const auto welcome = anna.join_to_return("Anna", proto::ROLE_SURGEON);
    ASSERT_TRUE(welcome);
    EXPECT_TRUE(welcome->return_token().empty());
  }
  ASSERT_TRUE(session.wait_for_sessions(0));
  EXPECT_TRUE(session.on_io([&] { return session.replicator().roster().list().empty(); }));
}

TEST(AbsenceOptions, who_was_silent_for_too_long_is_told_so_and_may_come_back) {
  net::TcpServerOptions tcp;
  tcp.idle_deadline = std::chrono::milliseconds(300);
  LiveSession session(tcp);
  RawClient sleepy(session.port());
  const auto before = sleepy.join_to_return("Sleepy", proto::ROLE_SURGEON);
  ASSERT_TRUE(before);
  const auto goodbye = sleepy.read_goodbye();
  ASSERT_TRUE(goodbye);
  EXPECT_EQ(goodbye->reason(), proto::GOODBYE_TIMEOUT);
  RawClient again(session.port());
  const auto back = again.join_to_return("Sleepy", proto::ROLE_SURGEON, before->return_token());
  ASSERT_TRUE(back);
  EXPECT_EQ(back->participant(), before->participant());
}

TEST(Absences, tokens_differ_and_end_with_their_place) {
  participants::Absences absences(30);
  const auto first = *absences.issue({3}), second = *absences.issue({4});
  EXPECT_NE(first, second);
  EXPECT_TRUE(absences.is_token_of({3}, first));
  EXPECT_FALSE(absences.is_token_of({3}, second));
  EXPECT_FALSE(absences.is_token_of({3}, {}));
  EXPECT_FALSE(absences.is_token_of({5}, first));
  EXPECT_TRUE(absences.begin({3}, 10 * kSecond));
  EXPECT_FALSE(absences.begin({5}, 10 * kSecond));
  EXPECT_TRUE(absences.expired(39 * kSecond).empty());
  EXPECT_EQ(absences.expired(40 * kSecond), std::vector<ParticipantSlot>{{3}});
  absences.end({3});
  EXPECT_TRUE(absences.expired(100 * kSecond).empty());
  absences.forget({3});
  EXPECT_FALSE(absences.is_token_of({3}, first));
}

}  // namespace
}  // namespace trocar::testing
