// An instructor hands over what one hand has to another: who may, who is told, what the simulation
// is given, and what stands against it.

#include <atomic>

#include "proto/journal.pb.h"
#include "tests/network/session_fixture.h"

namespace trocar::testing {
namespace {

using proto::Envelope;
using tool::Verb;

constexpr ToolSlot kSams{0}, kBeas{2};
constexpr float kSamsRadius_m = 0.004f;

class HandoverTest : public ::testing::Test {
 protected:
  HandoverTest() {
    EXPECT_TRUE(ivy_.join("Ivy", proto::ROLE_INSTRUCTOR));
    auto hello = make_hello("Sam", proto::ROLE_SURGEON);
    auto& shape = *hello.mutable_hello()->add_tool();
    shape.set_radius_m(kSamsRadius_m);
    shape.set_length_m(0.3f);
    shape.set_reach_m(0.01f);
    EXPECT_TRUE(sam_.send(hello));
    EXPECT_TRUE(sam_.receive(Envelope::kWelcome));
    EXPECT_TRUE(bea_.join("Bea", proto::ROLE_ASSISTANT));
  }
  replication::ReplicatorOptions options() {
    replication::ReplicatorOptions options;
    options.clock_ns = [this] { return clock_ns_.load(); };
    options.participants_interval_ns = 0;
    options.on_lesson = [this](wire::LessonEntry entry) { recorded_.push_back(std::move(entry)); };
    return options;
  }
  static Envelope wish(std::uint32_t from, const std::string& name, std::uint32_t to,
                       const std::string& receiver, std::uint32_t tool = 0) {
    Envelope envelope;
    auto& request = *envelope.mutable_teach_request();
    request.set_action(proto::TEACH_HAND_OVER);
    request.set_participant(from);
    request.set_name(name);
    request.set_tool(tool);
    request.set_receiver(to);
    request.set_receiver_name(receiver);
    return envelope;
  }
  proto::TeachEvent told(RawClient& client) {
    const auto message = client.receive(Envelope::kTeachEvent);
    EXPECT_TRUE(message);
    return message ? message->teach_event() : proto::TeachEvent();
  }
  // Both have shown their tools, which are so in the newest frame.
  void show(Verb sams, Verb beas) {
    auto frame = std::make_shared<step::PublishedFrame>(*session_.make_frame(0));
    frame->tools.push_back({.tool = kSams, .world_from_tool = {}, .verb = sams, .has_claim = true});
    frame->tools.push_back({.tool = kBeas, .world_from_tool = {}, .verb = beas, .has_claim = true});
    session_.publish_all({frame});
  }
  void send_sample(RawClient& client, std::uint32_t sequence, Verb verb, float x) {
    auto sample = make_sample(sequence);
    sample.mutable_tool_sample()->set_verb(static_cast<proto::Verb>(verb));
    sample.mutable_tool_sample()->mutable_position_m()->set_x(x);
    const auto before = session_.on_io([&] { return session_.replicator().counters().samples; });
    ASSERT_TRUE(client.send(sample));
    for (int i = 0; i < 5000; ++i) {
      if (session_.on_io([&] { return session_.replicator().counters().samples; }) > before) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    FAIL() << "no sample came";
  }
  hands::TickInputs drain() {
    hands::TickInputs inputs;
    session_.on_io([&] { session_.inbox.drain(inputs); });
    return inputs;
  }
  std::string refusal(const Envelope& request) {
    clock_ns_ += 1'000'000'000;
    EXPECT_TRUE(ivy_.send(request));
    const auto event = told(ivy_);
    EXPECT_FALSE(event.is_done());
    return event.text();
  }

  std::atomic<std::uint64_t> clock_ns_{1'000'000'000'000};
  std::vector<wire::LessonEntry> recorded_;  // I/O thread
  LiveSession session_{{}, options()};
  RawClient ivy_{session_.port()}, sam_{session_.port()}, bea_{session_.port()};
};

TEST_F(HandoverTest, IsToldToAllRecordedAndGivenToTheSimulation) {
  send_sample(sam_, 1, Verb::Grasp, 0.1f);
  send_sample(bea_, 1, Verb::None, -0.3f);
  show(Verb::Grasp, Verb::None);
  drain();
  ASSERT_TRUE(ivy_.send(wish(0, "Sam", 1, "Bea")));
  for (auto* client : {&ivy_, &sam_, &bea_}) {
    const auto event = told(*client);
    EXPECT_TRUE(event.is_done());
    EXPECT_EQ(event.action(), proto::TEACH_HAND_OVER);
    EXPECT_EQ(event.tool(), kSams.value);
    EXPECT_EQ(event.receiver_tool(), kBeas.value);
    EXPECT_TRUE(event.text().starts_with("Ivy hands an instrument of Sam to Bea: "))
        << event.text();
  }
  const auto inputs = drain();
  ASSERT_TRUE(inputs.handover);
  EXPECT_EQ(inputs.handover->from, kSams);
  EXPECT_EQ(inputs.handover->to, kBeas);
  EXPECT_TRUE(inputs.samples.empty());
  bool is_listed = false;
  while (!is_listed) {
    const auto list = sam_.receive(Envelope::kParticipants);
    ASSERT_TRUE(list);
    for (const auto& who : list->participants().participant())
      is_listed |=
          who.name() == "Bea" && who.tool(0).radius_m() == kSamsRadius_m && who.lent_tools() == 1;
  }
  const auto recorded = session_.on_io([&] { return recorded_; });
  ASSERT_EQ(recorded.size(), 1u);
  proto::LessonRecord record;
  ASSERT_TRUE(record.ParseFromArray(recorded[0].message.data(),
                                    static_cast<int>(recorded[0].message.size())));
  EXPECT_EQ(record.teach().receiver_tool(), kBeas.value);
}

TEST_F(HandoverTest, TheInstrumentGoesOnGraspingWhereItIsUntilItsNewHandOpens) {
  send_sample(sam_, 1, Verb::Grasp, 0.1f);
  send_sample(bea_, 1, Verb::None, -0.3f);
  show(Verb::Grasp, Verb::None);
  ASSERT_TRUE(ivy_.send(wish(0, "Sam", 1, "Bea")));
  told(ivy_);
  drain();
  drain();
  std::uint32_t sequence = 1;
  const auto given = [&](Verb verb, float x) {
    send_sample(bea_, ++sequence, verb, x);
    const auto inputs = drain();
    EXPECT_EQ(inputs.samples.size(), 1u);
    return inputs.samples.at(0);
  };
  auto input = given(Verb::None, -0.3f);
  EXPECT_EQ(input.tool, kBeas);
  EXPECT_FLOAT_EQ(input.sample.world_from_tool.position.x, 0.1f) << "where it was";
  EXPECT_EQ(input.sample.verb, Verb::Grasp);
  input = given(Verb::None, -0.28f);
  EXPECT_NEAR(input.sample.world_from_tool.position.x, 0.12f, 1e-6f) << "as the hand moves";
  EXPECT_EQ(input.sample.verb, Verb::Grasp);
  input = given(Verb::None, 0.4f);
  EXPECT_NEAR(input.sample.world_from_tool.position.x, 0.12f, 1e-6f) << "a jump moves nothing";
  input = given(Verb::None, 0.41f);
  EXPECT_NEAR(input.sample.world_from_tool.position.x, 0.13f, 1e-6f);
  EXPECT_EQ(given(Verb::Grasp, -0.28f).sample.verb, Verb::Grasp);
  clock_ns_ += 8'000'000;
  EXPECT_EQ(given(Verb::None, -0.28f).sample.verb, Verb::None) << "the hand has opened it";
  bool has_ended = false;
  while (!has_ended) {
    const auto list = bea_.receive(Envelope::kParticipants);
    ASSERT_TRUE(list);
    for (const auto& who : list->participants().participant())
      has_ended |=
          who.name() == "Bea" && who.tool(0).radius_m() == kSamsRadius_m && who.lent_tools() == 0;
  }
}

TEST_F(HandoverTest, AnInstructorWithInstrumentsTakesOver) {
  RawClient ida(session_.port());
  auto hello = make_hello("Ida", proto::ROLE_INSTRUCTOR);
  auto& shape = *hello.mutable_hello()->add_tool();
  shape.set_radius_m(0.005f);
  shape.set_length_m(0.3f);
  shape.set_reach_m(0.01f);
  ASSERT_TRUE(ida.send(hello));
  const auto welcome = ida.receive(Envelope::kWelcome);
  ASSERT_TRUE(welcome);
  constexpr ToolSlot kIdas{4};
  EXPECT_EQ(welcome->welcome().participant(), kIdas.owner().value) << "a place with tools";
  auto frame = std::make_shared<step::PublishedFrame>(*session_.make_frame(0));
  frame->tools.push_back({.tool = kSams, .verb = Verb::Grasp, .has_claim = true});
  frame->tools.push_back({.tool = kIdas, .verb = Verb::None});
  session_.publish_all({frame});
  send_sample(ida, 1, Verb::None, 0.2f);
  drain();
  ASSERT_TRUE(ida.send(wish(0, "Sam", kIdas.owner().value, "Ida")));
  const auto event = told(sam_);
  EXPECT_TRUE(event.is_done());
  EXPECT_TRUE(event.text().starts_with("Ida takes over an instrument of Sam: ")) << event.text();
  const auto inputs = drain();
  ASSERT_TRUE(inputs.handover);
  EXPECT_EQ(inputs.handover->from, kSams);
  EXPECT_EQ(inputs.handover->to, kIdas);
}

TEST_F(HandoverTest, SaysWhatStandsAgainstIt) {
  EXPECT_EQ(refusal(wish(0, "Sam", 1, "Bea")),
            "not done: nobody has seen that instrument of Sam yet");
  show(Verb::Grasp, Verb::Grasp);
  EXPECT_EQ(refusal(wish(0, "Sam", 1, "Bea")), "not done: Bea has no free hand");
  show(Verb::Grasp, Verb::None);
  EXPECT_EQ(refusal(wish(0, "Sam", 0, "Sam")), "not done: Sam has it already");
  EXPECT_EQ(refusal(wish(0, "Sam", kMaxHands, "Ivy")), "not done: Ivy has no tools");
  EXPECT_EQ(refusal(wish(0, "Sam", 1, "Bob")), "not done: Bob is not here any more");
  EXPECT_EQ(refusal(wish(0, "Sue", 1, "Bea")), "not done: Sue is not here any more");
  EXPECT_EQ(refusal(wish(0, "Sam", 1, "Bea", 1)), "not done: Sam has one tool only");
  Envelope bye;
  bye.mutable_bye();
  ASSERT_TRUE(bea_.send(bye));
  ASSERT_TRUE(session_.wait_for_sessions(2));
  EXPECT_EQ(refusal(wish(0, "Sam", 1, "Bea")), "not done: Bea is not here any more");
  EXPECT_FALSE(drain().handover);
  EXPECT_TRUE(session_.on_io([&] { return recorded_; }).empty());
}

TEST_F(HandoverTest, WhatIsNoToolOrNobodyEndsTheSession) {
  for (const auto& request :
       {wish(0, "Sam", 1, "Bea", 2), wish(0, "Sam", kMaxParticipants, "Bea")}) {
    RawClient client(session_.port());
    ASSERT_TRUE(client.join("Ian", proto::ROLE_INSTRUCTOR));
    ASSERT_TRUE(client.send(request));
    const auto goodbye = client.read_goodbye();
    ASSERT_TRUE(goodbye);
    EXPECT_EQ(goodbye->reason(), proto::GOODBYE_PROTOCOL_ERROR);
  }
}

TEST_F(HandoverTest, ATraineeMayNot) {
  ASSERT_TRUE(bea_.send(wish(0, "Sam", 1, "Bea")));
  const auto goodbye = bea_.read_goodbye();
  ASSERT_TRUE(goodbye);
  EXPECT_EQ(goodbye->reason(), proto::GOODBYE_ROLE);
  EXPECT_NE(goodbye->text().find("hand-over"), std::string::npos) << goodbye->text();
}

// Samples before it are of the tick before; samples after it, of the new hands.
TEST(HandoverInbox, BeginsATickOfItsOwn) {
  participants::SimulationInbox inbox;
  const auto sample = [](std::uint8_t tool, float x) {
    hands::ToolInput input{.tool = {tool}};
    input.sample.world_from_tool.position.x = x;
    return input;
  };
  inbox.push_sample(sample(0, 1));
  ASSERT_TRUE(inbox.try_push_handover({kSams, kBeas}));
  inbox.push_sample(sample(0, 2));
  hands::TickInputs inputs;
  inbox.drain(inputs);
  EXPECT_FALSE(inputs.handover);
  ASSERT_EQ(inputs.samples.size(), 1u);
  EXPECT_EQ(inputs.samples[0].sample.world_from_tool.position.x, 1);
  inbox.gather();
  inbox.drain(inputs);
  ASSERT_TRUE(inputs.handover);
  ASSERT_EQ(inputs.samples.size(), 1u);
  EXPECT_EQ(inputs.samples[0].sample.world_from_tool.position.x, 2);
  inbox.drain(inputs);
  EXPECT_TRUE(inputs.empty());
}

}  // namespace
}  // namespace trocar::testing
