// Teaching: what an instructor does with people and their tools, and what people say and draw. Who
// may, what everybody is told, and what is recorded.

#include <limits>

#include "common/wire/lesson.h"
#include "proto/journal.pb.h"
#include "server/session/access/door.h"
#include "tests/network/session_fixture.h"

namespace trocar::testing {
namespace {

using proto::Envelope;

proto::Envelope teach(proto::TeachAction action, const std::string& text = {}) {
  Envelope envelope;
  envelope.mutable_teach_request()->set_action(action);
  envelope.mutable_teach_request()->set_text(text);
  return envelope;
}
proto::Envelope teach(proto::TeachAction action, std::uint32_t slot, const std::string& name,
                      const std::string& text = {}) {
  auto envelope = teach(action, text);
  envelope.mutable_teach_request()->set_participant(slot);
  envelope.mutable_teach_request()->set_name(name);
  return envelope;
}

proto::Envelope stroke(std::initializer_list<std::uint32_t> triangles) {
  Envelope envelope;
  for (const auto triangle : triangles) {
    envelope.mutable_stroke_request()->add_triangle(triangle);
    for (const float weight : {0.25f, 0.5f}) envelope.mutable_stroke_request()->add_weight(weight);
  }
  return envelope;
}

class Teaching : public ::testing::Test {
 protected:
  Teaching() {
    EXPECT_TRUE(ivy_.join("Ivy", proto::ROLE_INSTRUCTOR));
    EXPECT_TRUE(sam_.join("Sam", proto::ROLE_SURGEON));
  }
  replication::ReplicatorOptions options() {
    replication::ReplicatorOptions options;
    options.clock_ns = [this] { return clock_ns_.load(); };
    options.participants_interval_ns = 0;
    options.on_lesson = [this](wire::LessonEntry entry) { recorded_.push_back(std::move(entry)); };
    options.on_pace = [this](float rate) { rates_.push_back(rate); };
    options.on_end_wanted = [this](const std::string& words) { end_words_ = words; };
    return options;
  }
  proto::TeachEvent told(RawClient& client) {
    const auto message = client.receive(Envelope::kTeachEvent);
    EXPECT_TRUE(message);
    return message ? message->teach_event() : proto::TeachEvent();
  }
  // Next list in which that participant is as wanted; fails after a while without one.
  template <typename Is>
  bool sees_participant(RawClient& client, std::uint32_t slot, Is is) {
    while (const auto message = client.receive(Envelope::kParticipants))
      for (const auto& participant : message->participants().participant())
        if (participant.slot() == slot && is(participant)) return true;
    return false;
  }
  // Returns what the simulation is given once `count` samples have been seen.
  hands::TickInputs drain_after(std::uint64_t count) {
    for (int i = 0; i < 5000; ++i) {
      const auto seen = session_.on_io([&] { return session_.replicator().counters().samples; });
      if (seen >= count) break;
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    hands::TickInputs inputs;
    session_.on_io([&] { session_.inbox.drain(inputs); });
    return inputs;
  }
  std::vector<wire::LessonEntry> recorded() {
    return session_.on_io([&] { return recorded_; });
  }
  void pass_seconds(std::uint64_t seconds) { clock_ns_ += seconds * 1'000'000'000; }

  std::atomic<std::uint64_t> clock_ns_{1'000'000'000'000};
  std::vector<wire::LessonEntry> recorded_;  // I/O thread
  std::string end_words_;                    // I/O thread
  std::vector<float> rates_;                 // I/O thread
  LiveSession session_{{}, options()};
  RawClient ivy_{session_.port()}, sam_{session_.port()};
};

TEST_F(Teaching, IsForInstructorsAlone) {
  for (const auto role : {proto::ROLE_SURGEON, proto::ROLE_ASSISTANT, proto::ROLE_OBSERVER})
    for (int action = proto::TEACH_FREEZE; action < proto::TeachAction_ARRAYSIZE; ++action) {
      if (action == proto::TEACH_CHAT) continue;
      RawClient client(session_.port());
      ASSERT_TRUE(client.join("Eve", role));
      const bool has_text = action >= proto::TEACH_EXPEL && action <= proto::TEACH_ADMIT;
      const bool is_note = action == proto::TEACH_NOTE;
      auto request = teach(static_cast<proto::TeachAction>(action), 0, "Sam",
                           has_text || is_note ? "because" : "");
      if (action == proto::TEACH_SLOW) request.mutable_teach_request()->set_rate(0.5f);
      ASSERT_TRUE(client.send(request));
      const auto goodbye = client.read_goodbye();
      ASSERT_TRUE(goodbye) << action;
      EXPECT_EQ(goodbye->reason(), proto::GOODBYE_ROLE) << goodbye->text();
      pass_seconds(1);
    }
  RawClient client(session_.port());
  ASSERT_TRUE(client.join("Eve", proto::ROLE_OBSERVER));
  ASSERT_TRUE(client.send(stroke({0})));
  EXPECT_EQ(client.read_goodbye()->reason(), proto::GOODBYE_ROLE);
  EXPECT_TRUE(recorded().empty());
  EXPECT_TRUE(session_.on_io([&] { return end_words_; }).empty());
}

TEST_F(Teaching, WhatIsNotAsItMayBeEndsTheSession) {
  const std::string long_text(501, 'x'), long_reason(201, 'x');
  for (const auto& request :
       {teach(proto::TEACH_NONE), teach(static_cast<proto::TeachAction>(19)),
        teach(proto::TEACH_NOTE), teach(proto::TEACH_NOTE, long_text),
        teach(proto::TEACH_NOTE, "two\nlines"), teach(proto::TEACH_NOTE, "\x1b[2J"),
        teach(proto::TEACH_END, "text"), teach(proto::TEACH_EXPEL, 0, "Sam", long_reason),
        teach(proto::TEACH_FREEZE, kMaxParticipants, "Sam")}) {
    RawClient client(session_.port());
    ASSERT_TRUE(client.join("Ian", proto::ROLE_INSTRUCTOR));
    ASSERT_TRUE(client.send(request));
    const auto goodbye = client.read_goodbye();
    ASSERT_TRUE(goodbye) << request.ShortDebugString();
    EXPECT_EQ(goodbye->reason(), proto::GOODBYE_PROTOCOL_ERROR);
    EXPECT_NE(goodbye->text().find("TeachRequest."), std::string::npos) << goodbye->text();
  }
}

TEST_F(Teaching, AFrozenToolStaysUntilItIsReleased) {
  ASSERT_TRUE(sam_.send(make_sample(1)));
  drain_after(1);
  ASSERT_TRUE(ivy_.send(teach(proto::TEACH_FREEZE, 0, "Sam")));
  for (auto* client : {&ivy_, &sam_}) {
    const auto event = told(*client);
    EXPECT_TRUE(event.is_done());
    EXPECT_EQ(event.action(), proto::TEACH_FREEZE);
    EXPECT_EQ(event.participant(), 0u);
    EXPECT_EQ(event.text(), "Ivy keeps the tools of Sam where they are");
  }
  EXPECT_TRUE(sees_participant(sam_, 0, [](const auto& who) { return who.frozen_by() == "Ivy"; }));
  auto moved = make_sample(2);
  moved.mutable_tool_sample()->mutable_position_m()->set_x(0.3f);
  moved.mutable_tool_sample()->set_client_time_us(77);
  ASSERT_TRUE(sam_.send(moved));
  auto inputs = drain_after(2);
  ASSERT_EQ(inputs.samples.size(), 1u);
  EXPECT_EQ(inputs.samples[0].sample.world_from_tool.position, (Vec3f{0, 0.1f, 0}));
  EXPECT_EQ(inputs.samples[0].client_time_us, 0u);
  // Who joins late is told, too.
  RawClient late(session_.port());
  ASSERT_TRUE(late.join("Late", proto::ROLE_OBSERVER));
  EXPECT_TRUE(sees_participant(late, 0, [](const auto& who) { return who.frozen_by() == "Ivy"; }));
  ASSERT_TRUE(ivy_.send(teach(proto::TEACH_RELEASE, 0, "Sam")));
  EXPECT_TRUE(sees_participant(sam_, 0, [](const auto& who) { return who.frozen_by().empty(); }));
  pass_seconds(1);
  moved.mutable_tool_sample()->set_sequence(3);
  ASSERT_TRUE(sam_.send(moved));
  inputs = drain_after(3);
  ASSERT_EQ(inputs.samples.size(), 1u);
  const float x = inputs.samples[0].sample.world_from_tool.position.x;
  EXPECT_GT(x, 0.0f);
  EXPECT_LE(x, 0.05f * participants::kReturnSpeed * 1.001f);
  EXPECT_EQ(recorded().size(), 2u);
}

TEST_F(Teaching, NoToolStaysFrozenWithoutAnInstructor) {
  RawClient ian(session_.port());
  ASSERT_TRUE(ian.join("Ian", proto::ROLE_INSTRUCTOR));
  ASSERT_TRUE(sam_.send(make_sample(1)));
  drain_after(1);
  ASSERT_TRUE(ivy_.send(teach(proto::TEACH_FREEZE, 0, "Sam")));
  EXPECT_TRUE(sees_participant(sam_, 0, [](const auto& who) { return who.frozen_by() == "Ivy"; }));
  Envelope bye;
  bye.mutable_bye();
  ASSERT_TRUE(ivy_.send(bye));
  EXPECT_TRUE(sees_participant(sam_, 0, [](const auto& who) { return who.frozen_by() == "Ivy"; }))
      << "Ian can release it";
  ASSERT_TRUE(ian.send(bye));
  EXPECT_TRUE(sees_participant(sam_, 0, [](const auto& who) { return who.frozen_by().empty(); }));
}

TEST_F(Teaching, AClaimThatIsTakenEndsAtOnce) {
  auto grasp = make_sample(1);
  grasp.mutable_tool_sample()->set_verb(proto::VERB_GRASP);
  ASSERT_TRUE(sam_.send(grasp));
  EXPECT_EQ(drain_after(1).samples[0].sample.verb, tool::Verb::Grasp);
  ASSERT_TRUE(ivy_.send(teach(proto::TEACH_TAKE_CLAIM, 0, "Sam")));
  EXPECT_EQ(told(sam_).text(), "Ivy has taken away what Sam holds: let go, then ask for it again");
  // Though the hand has said nothing since.
  const auto inputs = drain_after(1);
  ASSERT_EQ(inputs.samples.size(), 1u);
  EXPECT_EQ(inputs.samples[0].sample.verb, tool::Verb::None);
}

TEST_F(Teaching, WhoeverIsNotHereAnyMoreIsNotMeant) {
  for (const auto& request :
       {teach(proto::TEACH_FREEZE, 0, "Tom"), teach(proto::TEACH_EXPEL, 5, "Sam", "late"),
        teach(proto::TEACH_RENAME, 0, "Tom", "Tim"), teach(proto::TEACH_ADMIT, "Tom"),
        teach(proto::TEACH_FREEZE, static_cast<std::uint32_t>(kMaxHands), "Ivy"),
        teach(proto::TEACH_EXPEL, static_cast<std::uint32_t>(kMaxHands), "Ivy", "herself"),
        teach(proto::TEACH_RENAME, 0, "Sam", "Ivy"), teach(proto::TEACH_RENAME, 0, "Sam", " x")}) {
    pass_seconds(1);
    ASSERT_TRUE(ivy_.send(request));
    const auto event = told(ivy_);
    EXPECT_FALSE(event.is_done());
    EXPECT_TRUE(event.text().starts_with("not done: ")) << event.text();
  }
  pass_seconds(1);
  ASSERT_TRUE(ivy_.send(teach(proto::TEACH_NOTE, "done")));
  EXPECT_EQ(told(sam_).text(), "note by Ivy: done") << "refusals are nobody else's business";
  EXPECT_EQ(recorded().size(), 1u);
}

TEST_F(Teaching, ALineIsReadByAllAndAFloodByNobody) {
  ASSERT_TRUE(sam_.send(teach(proto::TEACH_CHAT, "where shall I cut?")));
  const auto line = told(ivy_);
  EXPECT_EQ(line.text(), "Sam: where shall I cut?");
  EXPECT_EQ(line.by(), 0u);
  EXPECT_EQ(line.action(), proto::TEACH_CHAT);
  told(sam_);
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(sam_.send(teach(proto::TEACH_CHAT, "again")));
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(told(sam_).is_done());
  pass_seconds(7);  // what a flood asked for counts, too
  ASSERT_TRUE(sam_.send(teach(proto::TEACH_CHAT, "sorry")));
  EXPECT_EQ(told(ivy_).text(), "Sam: sorry");
  const auto entries = recorded();
  ASSERT_EQ(entries.size(), 2u);
  proto::LessonRecord record;
  ASSERT_TRUE(record.ParseFromArray(entries[0].message.data(),
                                    static_cast<int>(entries[0].message.size())));
  EXPECT_EQ(record.teach().text(), "Sam: where shall I cut?");
}

TEST_F(Teaching, WhoIsPutOutComesBackWhenAdmittedOnly) {
  ASSERT_TRUE(ivy_.send(teach(proto::TEACH_EXPEL, 0, "Sam", "You are too loud.")));
  const auto goodbye = sam_.read_goodbye();
  ASSERT_TRUE(goodbye);
  EXPECT_EQ(goodbye->reason(), proto::GOODBYE_PUT_OUT);
  EXPECT_EQ(goodbye->text(), "Ivy has put Sam out: You are too loud.");
  RawClient again(session_.port());
  ASSERT_TRUE(again.send(make_hello("Sam", proto::ROLE_SURGEON)));
  EXPECT_EQ(again.read_goodbye()->reason(), proto::GOODBYE_CLOSED);
  // The instructor sees that somebody waits.
  bool has_seen = false;
  while (!has_seen) {
    const auto list = ivy_.receive(Envelope::kParticipants);
    ASSERT_TRUE(list);
    has_seen = list->participants().waiting_size() == 1;
  }
  ASSERT_TRUE(ivy_.send(teach(proto::TEACH_ADMIT, "Sam")));
  EXPECT_EQ(told(ivy_).text(), "Ivy lets Sam in");
  RawClient admitted(session_.port());
  EXPECT_TRUE(admitted.join("Sam", proto::ROLE_SURGEON));
}

TEST_F(Teaching, WhoIsAwayCanBePutOut) {
  std::string token;
  {
    RawClient tom(session_.port());
    token = tom.join_to_return("Tom", proto::ROLE_SURGEON)->return_token();
  }
  ASSERT_TRUE(sees_participant(ivy_, 1, [](const auto& who) { return who.is_away(); }));
  ASSERT_TRUE(ivy_.send(teach(proto::TEACH_EXPEL, 1, "Tom", "You are away.")));
  EXPECT_TRUE(told(ivy_).is_done());
  RawClient back(session_.port());
  auto hello = make_hello("Tom", proto::ROLE_SURGEON);
  hello.mutable_hello()->set_return_token(token);
  ASSERT_TRUE(back.send(hello));
  EXPECT_EQ(back.read_goodbye()->reason(), proto::GOODBYE_CLOSED);
}

TEST_F(Teaching, AClosedSessionLetsInstructorsInAndWhoIsAdmitted) {
  ASSERT_TRUE(ivy_.send(teach(proto::TEACH_CLOSE)));
  told(ivy_);
  const auto outcome = [&](const std::string& name, proto::Role role) {
    RawClient client(session_.port());
    EXPECT_TRUE(client.send(make_hello(name, role)));
    while (const auto message = client.receive()) {
      if (message->has_welcome()) return proto::GOODBYE_UNSPECIFIED;
      if (message->has_goodbye()) return message->goodbye().reason();
    }
    return proto::GOODBYE_TIMEOUT;
  };
  EXPECT_EQ(outcome("Tom", proto::ROLE_OBSERVER), proto::GOODBYE_CLOSED);
  EXPECT_EQ(outcome("Ian", proto::ROLE_INSTRUCTOR), proto::GOODBYE_UNSPECIFIED);
  ASSERT_TRUE(ivy_.send(teach(proto::TEACH_ADMIT, "Tom")));
  EXPECT_TRUE(told(ivy_).is_done());
  EXPECT_EQ(outcome("Tom", proto::ROLE_OBSERVER), proto::GOODBYE_UNSPECIFIED);
  ASSERT_TRUE(ivy_.send(teach(proto::TEACH_OPEN)));
  EXPECT_TRUE(told(ivy_).is_done());
  EXPECT_EQ(outcome("Ulf", proto::ROLE_OBSERVER), proto::GOODBYE_UNSPECIFIED);
}

TEST_F(Teaching, WhoWasRenamedComesBackWithTheOldNameAndTheToken) {
  std::string token;
  {
    RawClient tom(session_.port());
    token = tom.join_to_return("Tom", proto::ROLE_SURGEON)->return_token();
    ASSERT_TRUE(ivy_.send(teach(proto::TEACH_RENAME, 1, "Tom", "Thomas")));
    EXPECT_EQ(told(tom).text(), "Ivy has renamed Tom to Thomas");
  }
  ASSERT_TRUE(sees_participant(
      ivy_, 1, [](const auto& who) { return who.is_away() && who.name() == "Thomas"; }));
  RawClient back(session_.port());
  const auto welcome = back.join_to_return("Tom", proto::ROLE_SURGEON, token);
  ASSERT_TRUE(welcome);
  EXPECT_EQ(welcome->participant(), 1u);
}

TEST_F(Teaching, TheSessionIsEndedInTheInstructorsWords) {
  ASSERT_TRUE(ivy_.send(teach(proto::TEACH_END)));
  EXPECT_EQ(told(sam_).text(), "Ivy has ended the session");
  EXPECT_EQ(session_.on_io([&] { return end_words_; }), "Ivy has ended the session");
}

TEST_F(Teaching, APauseHoldsToolsAndIsKnownToAll) {
  const auto slow = [](float rate) {
    auto request = teach(proto::TEACH_SLOW);
    request.mutable_teach_request()->set_rate(rate);
    return request;
  };
  const auto pace_of = [](RawClient& client) {
    const auto message = client.receive(Envelope::kSessionPace);
    EXPECT_TRUE(message);
    return message ? message->session_pace() : proto::SessionPace();
  };
  ASSERT_TRUE(sam_.send(make_sample(1)));
  drain_after(1);
  ASSERT_TRUE(ivy_.send(teach(proto::TEACH_PAUSE)));
  // The pace is told before the words.
  const auto paused = pace_of(sam_);
  EXPECT_TRUE(paused.is_paused());
  EXPECT_EQ(paused.by(), "Ivy");
  EXPECT_EQ(told(sam_).text(), "Ivy has paused the session");
  auto moved = make_sample(2);
  moved.mutable_tool_sample()->mutable_position_m()->set_x(0.3f);
  ASSERT_TRUE(sam_.send(moved));
  EXPECT_EQ(drain_after(2).samples.at(0).sample.world_from_tool.position, (Vec3f{0, 0.1f, 0}));
  RawClient late(session_.port());
  ASSERT_TRUE(late.join("Late", proto::ROLE_OBSERVER));
  EXPECT_TRUE(pace_of(late).is_paused());

  ASSERT_TRUE(ivy_.send(teach(proto::TEACH_PAUSE)));
  while (true) {
    const auto event = told(ivy_);
    if (event.is_done()) continue;
    EXPECT_EQ(event.text(), "not done: it is paused already");
    break;
  }
  pass_seconds(1);
  ASSERT_TRUE(ivy_.send(slow(0.25f)));
  const auto slowed = pace_of(sam_);
  EXPECT_TRUE(slowed.is_paused()) << "slow time begins when it goes on";
  EXPECT_EQ(slowed.rate(), 0.25f);
  EXPECT_EQ(told(sam_).text(), "Ivy has slowed time down to 25 %");
  ASSERT_TRUE(ivy_.send(teach(proto::TEACH_GO_ON)));
  EXPECT_FALSE(pace_of(sam_).is_paused());
  EXPECT_EQ(session_.on_io([&] { return rates_; }), (std::vector<float>{0, 0, 0.25f}));
  pass_seconds(1);
  moved.mutable_tool_sample()->set_sequence(3);
  ASSERT_TRUE(sam_.send(moved));
  const auto inputs = drain_after(3);
  const float x = inputs.samples.at(0).sample.world_from_tool.position.x;
  EXPECT_GT(x, 0.0f);
  EXPECT_LE(x, 0.05f * participants::kReturnSpeed * 1.001f) << "it goes back slowly";
  EXPECT_EQ(recorded().size(), 3u) << "what was refused is not recorded";
}

TEST_F(Teaching, TimeGoesOnWithoutAnInstructor) {
  ASSERT_TRUE(ivy_.send(teach(proto::TEACH_PAUSE)));
  ASSERT_TRUE(sam_.receive(Envelope::kSessionPace));
  Envelope bye;
  bye.mutable_bye();
  ASSERT_TRUE(ivy_.send(bye));
  const auto message = sam_.receive(Envelope::kSessionPace);
  ASSERT_TRUE(message);
  EXPECT_FALSE(message->session_pace().is_paused());
  EXPECT_EQ(message->session_pace().rate(), 1.0f);
  EXPECT_EQ(session_.on_io([&] { return rates_; }), (std::vector<float>{0, 1}));
}

TEST_F(Teaching, ARateBeyondItsBoundsEndsTheSession) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const auto& [action, rate] :
       {std::pair{proto::TEACH_SLOW, 0.0f}, std::pair{proto::TEACH_SLOW, 0.249f},
        std::pair{proto::TEACH_SLOW, 1.01f}, std::pair{proto::TEACH_SLOW, -1.0f},
        std::pair{proto::TEACH_SLOW, nan}, std::pair{proto::TEACH_PAUSE, 0.5f}}) {
    RawClient client(session_.port());
    ASSERT_TRUE(client.join("Ian", proto::ROLE_INSTRUCTOR));
    auto request = teach(action);
    request.mutable_teach_request()->set_rate(rate);
    ASSERT_TRUE(client.send(request));
    const auto goodbye = client.read_goodbye();
    ASSERT_TRUE(goodbye);
    EXPECT_EQ(goodbye->reason(), proto::GOODBYE_PROTOCOL_ERROR);
    EXPECT_NE(goodbye->text().find("TeachRequest.rate"), std::string::npos) << goodbye->text();
  }
  EXPECT_TRUE(session_.on_io([&] { return rates_; }).empty());
}

TEST_F(Teaching, MarksStandSideBySideByTheirNames) {
  const auto ask = [&](proto::MarkAction action, const std::string& name) {
    pass_seconds(2);
    Envelope request, ping;
    request.mutable_mark_request()->set_action(action);
    request.mutable_mark_request()->set_name(name);
    ping.mutable_ping();
    EXPECT_TRUE(ivy_.send(request) && ivy_.send(ping));
    std::string refusal;
    for (auto message = ivy_.receive(); message && !message->has_pong(); message = ivy_.receive())
      if (message->has_mark_event()) refusal = message->mark_event().text();
    hands::TickInputs inputs;
    session_.on_io([&] { session_.inbox.drain(inputs); });
    return inputs.mark == hands::MarkAction::None ? refusal : std::to_string(inputs.mark_number);
  };
  session_.publish(10);
  EXPECT_EQ(ask(proto::MARK_SET, ""), "0");
  EXPECT_EQ(ask(proto::MARK_SET, "before"), "1");
  EXPECT_EQ(ask(proto::MARK_SET, "first cut"), "2");
  EXPECT_EQ(ask(proto::MARK_SET, "before"), "1");
  EXPECT_EQ(ask(proto::MARK_RETURN, "first cut"), "2");
  EXPECT_EQ(ask(proto::MARK_SET, "third"), "3");
  EXPECT_NE(ask(proto::MARK_SET, "fourth").find("3 marks with names already"), std::string::npos);
  EXPECT_NE(ask(proto::MARK_RETURN, "fourth").find("no mark called fourth"), std::string::npos);

  auto frame = std::make_shared<step::PublishedFrame>(*session_.make_frame(1));
  frame->mark_events.push_back({frame->tick, hands::MarkAction::Set, true, 2});
  session_.publish_all({frame});
  const auto event = sam_.receive(Envelope::kMarkEvent);
  ASSERT_TRUE(event);
  EXPECT_EQ(event->mark_event().name(), "first cut");
  EXPECT_NE(event->mark_event().text().find("first cut"), std::string::npos);
  const auto list = sam_.receive(Envelope::kMarkList);
  ASSERT_TRUE(list);
  ASSERT_EQ(list->mark_list().name_size(), 1);
  EXPECT_EQ(list->mark_list().name(0), "first cut");
  RawClient late(session_.port());
  ASSERT_TRUE(late.join("Late", proto::ROLE_OBSERVER));
  EXPECT_TRUE(late.receive(Envelope::kMarkList));
  EXPECT_EQ(recorded().size(), 1u);

  for (const std::string& bad : {std::string(33, 'a'), std::string("a\nb"), std::string("\xff")}) {
    RawClient client(session_.port());
    ASSERT_TRUE(client.join("Ian", proto::ROLE_INSTRUCTOR));
    Envelope request;
    request.mutable_mark_request()->set_action(proto::MARK_SET);
    request.mutable_mark_request()->set_name(bad);
    ASSERT_TRUE(client.send(request));
    EXPECT_EQ(client.read_goodbye()->reason(), proto::GOODBYE_PROTOCOL_ERROR);
  }
}

TEST_F(Teaching, ALineOnTheOrganIsSeenByAllAndByWhoComesLater) {
  session_.publish(10);
  ASSERT_TRUE(ivy_.send(stroke({0, 3, 1'000'000})));
  const auto seen = sam_.receive(Envelope::kDrawing);
  ASSERT_TRUE(seen);
  EXPECT_TRUE(seen->drawing().is_addition());
  ASSERT_EQ(seen->drawing().stroke_size(), 1);
  const auto& line = seen->drawing().stroke(0);
  EXPECT_EQ(line.participant(), static_cast<std::uint32_t>(kMaxHands));
  ASSERT_EQ(line.rest_quanta_size(), 6) << "the triangle that is not there is left out";
  const auto& layout = session_.layout();
  const auto& corners = layout.triangles[0];
  const auto at = [&](std::size_t i) { return layout.rest_quanta[corners[i].value]; };
  EXPECT_NEAR(line.rest_quanta(0), 0.25 * at(0).x + 0.25 * at(1).x + 0.5 * at(2).x, 1);
  EXPECT_NEAR(line.rest_quanta(1), 0.25 * at(0).y + 0.25 * at(1).y + 0.5 * at(2).y, 1);
  RawClient late(session_.port());
  ASSERT_TRUE(late.join("Late", proto::ROLE_OBSERVER));
  const auto all = late.receive(Envelope::kDrawing);
  ASSERT_TRUE(all);
  EXPECT_FALSE(all->drawing().is_addition());
  EXPECT_EQ(all->drawing().stroke_size(), 1);
  ASSERT_TRUE(ivy_.send(teach(proto::TEACH_WIPE)));
  const auto wiped = sam_.receive(Envelope::kDrawing);
  ASSERT_TRUE(wiped);
  EXPECT_EQ(wiped->drawing().stroke_size(), 0);
  EXPECT_FALSE(wiped->drawing().is_addition());
  const auto entries = recorded();
  ASSERT_EQ(entries.size(), 3u);
  EXPECT_EQ(entries[0].kind, wire::LessonKind::Drawing);
  EXPECT_EQ(entries[1].kind, wire::LessonKind::Said);
  EXPECT_EQ(entries[2].kind, wire::LessonKind::Drawing);
}

TEST_F(Teaching, ADrawingHasAnEnd) {
  Envelope full;
  for (std::size_t i = 0; i < wire::kMostStrokePoints; ++i) {
    full.mutable_stroke_request()->add_triangle(1);
    for (int k = 0; k < 2; ++k) full.mutable_stroke_request()->add_weight(0.5f);
  }
  pass_seconds(10);
  const auto most = wire::kMostDrawingPoints / wire::kMostStrokePoints;
  for (std::size_t i = 0; i < most; ++i) ASSERT_TRUE(ivy_.send(full));
  for (std::size_t i = 0; i < most; ++i) ASSERT_TRUE(sam_.receive(Envelope::kDrawing));
  ASSERT_TRUE(ivy_.send(full));
  EXPECT_EQ(told(ivy_).text(), "not drawn: the drawing is full, wipe it first");
}

TEST_F(Teaching, LinesThatCannotBeEndTheSession) {
  const auto with = [](int points, std::vector<float> weights) {
    Envelope envelope;
    envelope.mutable_stroke_request();
    for (int i = 0; i < points; ++i) envelope.mutable_stroke_request()->add_triangle(0);
    for (const float weight : weights) envelope.mutable_stroke_request()->add_weight(weight);
    return envelope;
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const auto& request :
       {with(0, {}), with(1, {0.5f}), with(1, {0.5f, 0.6f}), with(1, {-0.1f, 0.5f}),
        with(1, {nan, 0.5f}), with(65, std::vector<float>(130, 0.1f))}) {
    RawClient client(session_.port());
    ASSERT_TRUE(client.join("Ian", proto::ROLE_INSTRUCTOR));
    ASSERT_TRUE(client.send(request));
    const auto goodbye = client.read_goodbye();
    ASSERT_TRUE(goodbye);
    EXPECT_EQ(goodbye->reason(), proto::GOODBYE_PROTOCOL_ERROR);
    EXPECT_NE(goodbye->text().find("StrokeRequest."), std::string::npos) << goodbye->text();
  }
}

proto::Envelope view_from(float x, float target = 0) {
  Envelope envelope;
  envelope.mutable_view_request()->mutable_eye_m()->set_x(x);
  envelope.mutable_view_request()->mutable_target_m()->set_x(target);
  return envelope;
}

TEST_F(Teaching, TheViewIsOfWhoWasGivenIt) {
  ASSERT_TRUE(sam_.send(view_from(0.1f)));  // it was not given yet
  ASSERT_TRUE(sam_.send(teach(proto::TEACH_CHAT, "ready")));
  EXPECT_EQ(told(ivy_).text(), "Sam: ready");
  ASSERT_TRUE(ivy_.send(teach(proto::TEACH_GIVE_VIEW, 0, "Sam")));
  EXPECT_TRUE(sees_participant(sam_, 0, [](const auto& who) { return who.leads_view(); }));
  ASSERT_TRUE(sam_.send(view_from(0.2f)));
  ASSERT_TRUE(sam_.send(view_from(0.3f)));  // too soon
  const auto seen = ivy_.receive(Envelope::kViewEvent);
  ASSERT_TRUE(seen);
  EXPECT_FLOAT_EQ(seen->view_event().eye_m().x(), 0.2f);
  EXPECT_EQ(seen->view_event().participant(), 0u);
  RawClient late(session_.port());
  ASSERT_TRUE(late.join("Late", proto::ROLE_OBSERVER));
  const auto last = late.receive(Envelope::kViewEvent);
  ASSERT_TRUE(last);
  EXPECT_FLOAT_EQ(last->view_event().eye_m().x(), 0.2f);
  for (const auto& wrong : {view_from(11.0f), view_from(0.1f, 0.1f),
                            view_from(std::numeric_limits<float>::quiet_NaN())}) {
    RawClient client(session_.port());
    ASSERT_TRUE(client.join("Eve", proto::ROLE_OBSERVER));
    ASSERT_TRUE(client.send(wrong));
    EXPECT_EQ(client.read_goodbye()->reason(), proto::GOODBYE_PROTOCOL_ERROR);
  }
}

TEST_F(Teaching, PointingIsRecorded) {
  Envelope point;
  point.mutable_point_request()->mutable_position_m()->set_x(0.05f);
  ASSERT_TRUE(ivy_.send(point));
  ASSERT_TRUE(sam_.receive(Envelope::kPointEvent));
  const auto entries = recorded();
  ASSERT_EQ(entries.size(), 1u);
  proto::LessonRecord record;
  ASSERT_TRUE(record.ParseFromArray(entries[0].message.data(),
                                    static_cast<int>(entries[0].message.size())));
  EXPECT_FLOAT_EQ(record.point().position_m().x(), 0.05f);
}

TEST(Door, KeepsCodesAndNotOtherPeople) {
  access::Door door;
  door.put_out({{}, "Sam", wire::Role::Surgeon, 3});
  EXPECT_TRUE(door.check({{}, "Other", wire::Role::Surgeon, 3})) << "the same code";
  EXPECT_FALSE(door.check({{}, "Sam", wire::Role::Surgeon, 4})) << "another code";
  for (int i = 0; i < 100; ++i)
    EXPECT_TRUE(door.check({{}, "Guest " + std::to_string(i), wire::Role::Observer, 3}));
  EXPECT_EQ(door.waiting().size(), access::Door::kMostWaiting);
  EXPECT_FALSE(door.admit("Guest 0")) << "the oldest has made room";
  EXPECT_TRUE(door.admit("Guest 99"));
  EXPECT_FALSE(door.check({{}, "Guest 99", wire::Role::Observer, 3}));
  door.note_entry("Guest 99");
  EXPECT_TRUE(door.check({{}, "Guest 99", wire::Role::Observer, 3})) << "once";
}

}  // namespace
}  // namespace trocar::testing
