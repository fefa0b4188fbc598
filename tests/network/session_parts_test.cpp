// The parts of a session, each with an audience that only listens: no socket, no simulation.

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "common/wire/tool_shape.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/replication/admission.h"
#include "server/session/replication/lesson_course.h"
#include "server/session/replication/marks.h"
#include "server/session/replication/returns.h"
#include "server/session/replication/teaching.h"
#include "server/session/replication/viewers.h"

namespace trocar::replication {
namespace {

class Listeners final : public Audience {
 public:
  bool send(const Speaker& to, const wire::SharedBytes& bytes) override {
    return has_room && (heard[to.participant->name].push_back(read(bytes)), true);
  }
  void broadcast(const wire::SharedBytes& bytes) override { offer(bytes, nullptr); }
  void offer(const wire::SharedBytes& bytes, const Speaker* but) override {
    for (auto* who : present)
      if (who != but) send(*who, bytes);
  }
  Speaker* find(ParticipantSlot slot) const override {
    for (auto* who : present)
      if (who->participant->slot == slot) return who;
    return nullptr;
  }
  void put_out(ParticipantSlot slot, const std::string& words) override {
    put_out_words[slot.value] = words;
  }
  const step::SharedFrame& newest_frame() const override { return frame; }

  std::vector<Speaker*> present;
  std::map<std::string, std::vector<proto::Envelope>> heard;
  std::map<std::uint8_t, std::string> put_out_words;
  step::SharedFrame frame;
  bool has_room = true;

 private:
  static proto::Envelope read(const wire::SharedBytes& bytes) {
    proto::Envelope envelope;
    EXPECT_TRUE(
        wire::decode_envelope(BytesView(*bytes).subspan(wire::kHeaderBytes), envelope).ok());
    return envelope;
  }
};

class SessionParts : public ::testing::Test {
 protected:
  SessionParts() {
    options_.clock_ns = [this] { return now_ns_; };
    options_.on_lesson = [this](wire::LessonEntry entry) { recorded_.push_back(entry.kind); };
    options_.on_pace = [this](float rate) { rates_.push_back(rate); };
    join(ada_, "Ada", participants::Role::Instructor);
    join(ben_, "Ben", participants::Role::Surgeon);
  }
  void join(Speaker& who, const std::string& name, participants::Role role) {
    auto refusal = participants::JoinRefusal::Full;
    auto joined = roster_.join(name, role, {}, refusal);
    ASSERT_TRUE(joined.ok());
    who.participant = *joined;
    who.applicant.name = name;
    audience_.present.push_back(&who);
  }
  void wait_s(double seconds) { now_ns_ += static_cast<std::uint64_t>(1e9 * seconds); }
  // Returns what that one has heard since the last call.
  std::vector<proto::Envelope> heard(const std::string& name) {
    return std::exchange(audience_.heard[name], {});
  }
  std::optional<Ending> ask_mark(Speaker& who, proto::MarkAction action, const std::string& name) {
    wait_s(2);
    proto::MarkRequest request;
    request.set_action(action);
    request.set_name(name);
    return marks_.ask(who, request, pace_.is_paused());
  }
  hands::TickInputs drained() {
    hands::TickInputs inputs;
    inbox_.drain(inputs);
    return inputs;
  }
  std::string order(Speaker& who, TeachAction action, const std::string& about = {},
                    const std::string& text = {}) {
    wait_s(10);
    proto::TeachRequest request;
    request.set_action(static_cast<proto::TeachAction>(action));
    if (const auto* whom = roster_.find(about)) {
      request.set_participant(whom->slot.value);
      request.set_name(about);
    }
    request.set_text(text);
    const auto ending = teaching_.order(who, request);
    return ending ? ending->text : std::string();
  }

  std::uint64_t now_ns_ = 1'000'000'000;
  ReplicatorOptions options_;
  ReplicatorCounters counters_;
  Listeners audience_;
  participants::Roster roster_;
  participants::SimulationInbox inbox_;
  access::Door door_;
  std::vector<wire::LessonKind> recorded_;
  std::vector<float> rates_;
  SessionContext session_{options_, audience_, roster_, inbox_};
  Hands hands_{session_, counters_};
  Marks marks_{session_};
  Pace pace_{session_, hands_.held()};
  Drawing drawing_{session_};
  Teaching teaching_{session_, door_, hands_, pace_, drawing_};
  Returns returns_{session_, counters_};
  Admission admission_{session_, door_, returns_.absences()};
  Speaker ada_{1, options_}, ben_{2, options_};
};

TEST_F(SessionParts, MarksHaveNumbersAndWhoComesLaterIsToldWhichAreSet) {
  EXPECT_TRUE(marks_.show(ben_));
  EXPECT_TRUE(heard("Ben").empty()) << "there is none";
  ASSERT_FALSE(ask_mark(ada_, proto::MARK_SET, "before the cut"));
  auto inputs = drained();
  EXPECT_EQ(inputs.mark, hands::MarkAction::Set);
  EXPECT_EQ(inputs.mark_number, 1);
  marks_.note({7, hands::MarkAction::Set, true, 1});
  EXPECT_EQ(recorded_.size(), 1u);
  heard("Ben");
  EXPECT_TRUE(marks_.show(ben_));
  const auto told = heard("Ben");
  ASSERT_EQ(told.size(), 1u);
  ASSERT_EQ(told[0].mark_list().name_size(), 1);
  EXPECT_EQ(told[0].mark_list().name(0), "before the cut");
  ASSERT_FALSE(ask_mark(ada_, proto::MARK_RETURN, "before the cut"));
  EXPECT_EQ(drained().mark_number, 1);
  audience_.has_room = false;
  EXPECT_FALSE(marks_.show(ben_));
}

TEST_F(SessionParts, MarksRefuseWhatIsNotThereTooSoonOrTooMuch) {
  heard("Ada");
  EXPECT_FALSE(ask_mark(ada_, proto::MARK_RETURN, "nowhere"));
  EXPECT_EQ(drained().mark, hands::MarkAction::None);
  EXPECT_NE(heard("Ada").at(0).mark_event().text().find("no mark called nowhere"),
            std::string::npos);
  for (std::size_t i = 1; i < hands::kMostMarks; ++i)
    EXPECT_FALSE(ask_mark(ada_, proto::MARK_SET, std::string(i, 'x')));
  EXPECT_FALSE(ask_mark(ada_, proto::MARK_SET, "one more"));
  EXPECT_NE(heard("Ada").back().mark_event().text().find("use one of these"), std::string::npos);
  const auto ending = ask_mark(ben_, proto::MARK_SET, "");
  ASSERT_TRUE(ending);
  EXPECT_EQ(ending->reason, EndReason::Role);
}

TEST_F(SessionParts, AHandThatAnInstructorHoldsStaysHeldWhenTimeGoesOn) {
  EXPECT_EQ(order(ada_, TeachAction::Freeze, "Ben"), "");
  EXPECT_EQ(order(ada_, TeachAction::Pause), "");
  EXPECT_EQ(order(ada_, TeachAction::Pause), "");  // refused in words, not by an end
  EXPECT_NE(heard("Ada").back().teach_event().text().find("paused already"), std::string::npos);
  EXPECT_EQ(order(ada_, TeachAction::GoOn), "");
  EXPECT_EQ(rates_, (std::vector<float>{0, 1}));
  EXPECT_TRUE(hands_.held().is_frozen(ben_.participant->slot));
  EXPECT_EQ(order(ada_, TeachAction::Release, "Ben"), "");
  EXPECT_FALSE(hands_.held().is_frozen(ben_.participant->slot));
}

TEST_F(SessionParts, WithoutAnInstructorToolsAndTimeAreFree) {
  order(ada_, TeachAction::Freeze, "Ben");
  order(ada_, TeachAction::Pause);
  roster_.leave(ada_.participant->slot);
  audience_.present.erase(audience_.present.begin());
  teaching_.release_unless_led();
  EXPECT_FALSE(hands_.held().is_frozen(ben_.participant->slot));
  EXPECT_FALSE(pace_.is_paused());
  EXPECT_EQ(rates_.back(), 1);
}

TEST_F(SessionParts, OrdersAreTheInstructorsAndOneIsPutOutOnceAllAreTold) {
  EXPECT_NE(order(ben_, TeachAction::Pause), "");
  EXPECT_EQ(order(ben_, TeachAction::Chat, {}, "hello"), "");
  EXPECT_EQ(heard("Ada").back().teach_event().text(), "Ben: hello");
  EXPECT_EQ(order(ada_, TeachAction::Expel, "Ben", "too rough"), "");
  EXPECT_EQ(audience_.put_out_words.count(ben_.participant->slot.value), 1u);
  EXPECT_TRUE(door_.check(ben_.applicant)) << "he waits outside";
}

TEST_F(SessionParts, AViewGoesToAllButWhoLeadsIt) {
  proto::ViewRequest request;
  request.mutable_eye_m()->set_z(0.3f);
  wait_s(1);
  EXPECT_FALSE(drawing_.view(ada_, request));
  EXPECT_TRUE(heard("Ben").empty()) << "nobody has given her the view";
  order(ada_, TeachAction::GiveView, "Ada");
  heard("Ada"), heard("Ben");
  EXPECT_FALSE(drawing_.view(ada_, request));
  EXPECT_TRUE(heard("Ada").empty());
  ASSERT_EQ(heard("Ben").size(), 1u);
  EXPECT_TRUE(drawing_.show_view(ben_));
  EXPECT_TRUE(heard("Ben").at(0).has_view_event()) << "also who comes later";
}

TEST_F(SessionParts, SamplesOfTheStreamMustGrowAndLateDatagramsAreLeftOut) {
  proto::ToolSample sample;
  sample.set_sequence(5);
  sample.mutable_orientation()->set_w(1);
  sample.mutable_position_m();
  EXPECT_FALSE(hands_.sample(ben_, sample, true));
  EXPECT_FALSE(hands_.sample(ben_, sample, false)) << "a datagram may come late";
  EXPECT_EQ(counters_.samples, 1u);
  const auto ending = hands_.sample(ben_, sample, true);
  ASSERT_TRUE(ending);
  EXPECT_EQ(ending->reason, EndReason::ProtocolError);
  ASSERT_TRUE(hands_.sample(ada_, sample, true)) << "she has no tools";
}

TEST_F(SessionParts, ASessionWithoutALessonSaysSo) {
  LessonCourse course(session_);
  proto::LessonRequest request;
  request.set_action(proto::LESSON_NEXT);
  EXPECT_FALSE(course.ask(ada_, request, {}));
  EXPECT_NE(heard("Ada").back().teach_event().text().find("no lesson"), std::string::npos);
  EXPECT_TRUE(course.ask(ben_, request, {})) << "stages are the instructor's";
}

HelloRequest request_of(const std::string& name, participants::Role role) {
  HelloRequest request;
  request.name = name;
  request.role = role;
  request.can_return = true;
  return request;
}

Speaker newcomer(const HelloRequest& request, const ReplicatorOptions& options) {
  Speaker who(3, options);
  who.applicant = {"10.0.0.3", request.name, request.role};
  return who;
}

TEST_F(SessionParts, WhoIsAdmittedHasAPlaceAToolAndATokenToComeBackWith) {
  auto request = request_of("Cy", participants::Role::Assistant);
  auto cy = newcomer(request, options_);
  ASSERT_FALSE(admission_.admit(cy, request));
  ASSERT_TRUE(cy.participant);
  EXPECT_EQ(roster_.find("Cy")->slot, cy.participant->slot);
  EXPECT_NE(returns_.absences().find(cy.participant->slot), nullptr);
  const auto inputs = drained();
  ASSERT_EQ(inputs.joins.size(), 1u);
  EXPECT_EQ(inputs.joins[0].slot, cy.participant->slot);
  auto again = request_of("Cy", participants::Role::Observer);
  auto other = newcomer(again, options_);
  const auto refused = admission_.admit(other, again);
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->reason, EndReason::NameTaken);
  EXPECT_FALSE(other.participant);
}

TEST_F(SessionParts, AClosedDoorLetsInstructorsInAndListsWhoWaits) {
  door_.set_closed(true);
  session_.is_told = true;
  auto request = request_of("Cy", participants::Role::Observer);
  auto cy = newcomer(request, options_);
  const auto refused = admission_.admit(cy, request);
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->reason, EndReason::Closed);
  EXPECT_FALSE(session_.is_told) << "everybody is to see who waits";
  EXPECT_EQ(roster_.find("Cy"), nullptr);
  auto leader = request_of("Di", participants::Role::Instructor);
  auto di = newcomer(leader, options_);
  EXPECT_FALSE(admission_.admit(di, leader));
}

TEST_F(SessionParts, WithoutRoomInTheInboxNobodyWithToolsIsLetIn) {
  while (inbox_.try_push_join({ben_.participant->slot, 1, {}})) continue;
  auto request = request_of("Cy", participants::Role::Surgeon);
  auto cy = newcomer(request, options_);
  const auto refused = admission_.admit(cy, request);
  ASSERT_TRUE(refused);
  EXPECT_NE(refused->text.find("busy"), std::string::npos) << refused->text;
  EXPECT_EQ(roster_.find("Cy"), nullptr);
}

TEST_F(SessionParts, ASeatIsKeptForItsTokenAndNameAndGivenUpInTheEnd) {
  const auto slot = ben_.participant->slot;
  auto lost = std::make_unique<Speaker>(ben_);
  EXPECT_FALSE(returns_.keep(lost)) << "he has no token";
  const auto token = *returns_.absences().issue(slot);
  ASSERT_TRUE(returns_.keep(lost));
  EXPECT_TRUE(roster_.find("Ben")->is_away);
  EXPECT_EQ(counters_.lost, 1u);
  ASSERT_NE(returns_.find(slot), nullptr);

  auto request = request_of("Ben", participants::Role::Surgeon);
  request.return_token.assign(token.begin(), token.end());
  ASSERT_NE(returns_.find_own_place(request), nullptr);
  auto stranger = request;
  stranger.name = "Eve";
  EXPECT_EQ(returns_.find_own_place(stranger), nullptr) << "the name is not hers";
  stranger = request;
  stranger.return_token[0] ^= 1;
  EXPECT_EQ(returns_.find_own_place(stranger), nullptr);

  Speaker back(9, options_);
  returns_.come_back(back, *returns_.take(slot));
  EXPECT_EQ(back.participant->slot, slot);
  EXPECT_FALSE(roster_.find("Ben")->is_away);
  EXPECT_EQ(returns_.find(slot), nullptr);

  lost = std::make_unique<Speaker>(back);
  ASSERT_TRUE(returns_.keep(lost));
  wait_s(options_.return_seconds - 1);
  EXPECT_TRUE(returns_.take_expired(now_ns_).empty());
  wait_s(2);
  EXPECT_EQ(returns_.take_expired(now_ns_).size(), 1u);
}

// Connections of which a test sees what is queued, and whose room it sets.
class FakeConnections final : public net::Connections {
 public:
  bool send(net::ConnectionId id, wire::SharedBytes frame) override {
    if (full.contains(id)) return false;
    proto::Envelope message;
    EXPECT_TRUE(wire::decode_envelope(BytesView(*frame).subspan(wire::kHeaderBytes), message).ok());
    sent[id].push_back(message);
    return true;
  }
  bool has_datagrams(net::ConnectionId) const override { return false; }
  bool send_datagram(net::ConnectionId, BytesView) override { return false; }
  std::size_t outstanding_bytes(net::ConnectionId id) const override {
    return busy.contains(id) ? 1'000'000 : 0;
  }
  std::string peer_address(net::ConnectionId) const override { return "10.0.0.1"; }
  net::ConnectionId carrier_of(net::ConnectionId id) const override { return id >= 100 ? 9 : 0; }
  void close_after_flush(net::ConnectionId id, wire::SharedBytes) override { closed.insert(id); }
  void close(net::ConnectionId id) override { closed.insert(id); }
  // Returns what that one was sent of a kind, since the last call.
  std::size_t count(net::ConnectionId id, proto::Envelope::MessageCase kind) {
    const auto all = std::exchange(sent[id], {});
    return static_cast<std::size_t>(std::ranges::count(all, kind, &proto::Envelope::message_case));
  }

  std::map<net::ConnectionId, std::vector<proto::Envelope>> sent;
  std::set<net::ConnectionId> full, busy, closed;
};

// Lets in whoever says Hello.
class OpenHouse final : public ViewerHost {
 public:
  explicit OpenHouse(const ReplicatorOptions& options)
      : viewers(connections, *this, options, counters) {
    proto::Envelope envelope;
    envelope.mutable_surface_topology();
    surface = wire::encode_envelope(envelope);
  }
  std::optional<Ending> heed(Viewer& who, const proto::Envelope& message) override {
    heeded.push_back(message.message_case());
    if (!message.has_hello()) return std::nullopt;
    proto::Envelope words;
    words.mutable_welcome();
    return viewers.welcome(who, wire::encode_envelope(words), true);
  }
  std::optional<Ending> heed_samples(const Viewer&, const proto::ClientDatagram&) override {
    return std::nullopt;
  }
  void note_shown(const Viewer& who, const proto::FrameAck&) override { shown.push_back(who.id); }
  bool show(const Viewer& who) override { return viewers.send(who.id, surface); }
  const wire::SharedBytes& topology() override { return surface; }
  const std::vector<wire::SharedBytes>& fine_parts() const override { return parts; }
  std::uint64_t server_time_us() const override { return 7; }
  bool keep(const Viewer&) override { return false; }
  void forget(const Viewer& who, const Ending* ending) override {
    gone[who.id] = ending ? ending->reason : EndReason::Unspecified;
  }

  void say(net::ConnectionId id, const proto::Envelope& message) {
    const auto bytes = message.SerializeAsString();
    viewers.on_message(id, bytes_of(std::string_view(bytes)));
  }
  void join(net::ConnectionId id) {
    viewers.on_open(id);
    proto::Envelope hello;
    hello.mutable_hello();
    say(id, hello);
  }
  void publish(Frame number) {
    auto frame = std::make_shared<step::PublishedFrame>();
    frame->frame = number;
    frame->tick = 16 * number;
    frame->surface.resize(3);
    frame->surface[0].x = static_cast<std::int32_t>(number);
    viewers.set_frame(frame, 0);
    viewers.give_all();
  }

  FakeConnections connections;
  ReplicatorCounters counters;
  Viewers viewers;
  wire::SharedBytes surface;
  std::vector<wire::SharedBytes> parts;
  std::vector<proto::Envelope::MessageCase> heeded;
  std::vector<net::ConnectionId> shown;
  std::map<net::ConnectionId, EndReason> gone;
};

using Kind = proto::Envelope;

TEST_F(SessionParts, AViewerIsShownEverythingThenEachFrameThatItTakes) {
  OpenHouse house(options_);
  house.publish(1);
  house.join(1);
  const auto& told = house.connections.sent[1];
  ASSERT_EQ(told.size(), 4u);
  EXPECT_TRUE(told[0].has_welcome() && told[1].has_surface_topology());
  EXPECT_TRUE(told[2].surface_frame().is_keyframe() && told[3].has_frame_state());
  house.connections.sent.clear();
  house.publish(2);
  EXPECT_EQ(house.connections.sent[1].at(0).surface_frame().base_frame(), 1u);
  house.connections.busy = {1};
  house.publish(3);
  house.connections.busy = {};
  EXPECT_EQ(house.connections.count(1, Kind::kSurfaceFrame), 1u) << "3 was left out";
  house.viewers.give_all();
  EXPECT_EQ(house.connections.sent[1].at(0).surface_frame().base_frame(), 2u);
}

TEST_F(SessionParts, AViewerWithoutRoomForWhatCannotBeSkippedIsTooSlowAlone) {
  OpenHouse house(options_);
  house.join(1);
  house.join(2);
  house.connections.full = {1};
  house.viewers.offer(house.surface);
  EXPECT_TRUE(house.gone.empty()) << "what was offered may be missed";
  house.viewers.broadcast(house.surface);
  EXPECT_EQ(house.gone, (std::map<net::ConnectionId, EndReason>{{1, EndReason::TooSlow}}));
  EXPECT_TRUE(house.connections.closed.contains(1));
  EXPECT_EQ(house.viewers.connection_count(), 1u);
  EXPECT_EQ(house.connections.count(2, Kind::kSurfaceTopology), 3u);
}

TEST_F(SessionParts, AcknowledgementsAreOfFramesThatWereGiven) {
  OpenHouse house(options_);
  house.join(1);
  house.publish(5);
  proto::Envelope ack;
  ack.mutable_frame_ack()->set_frame(5);
  house.say(1, ack);
  EXPECT_EQ(house.shown, std::vector<net::ConnectionId>{1});
  EXPECT_EQ(house.viewers.find(1)->feed.acknowledged(), 5u);
  ack.mutable_frame_ack()->set_frame(6);
  house.say(1, ack);
  EXPECT_EQ(house.gone.at(1), EndReason::ProtocolError);
}

TEST_F(SessionParts, GuestsShareThePictureOfTheirCarrierAndAnswerForThemselves) {
  OpenHouse house(options_);
  house.viewers.on_open(9);
  house.join(100);
  house.join(101);
  EXPECT_EQ(house.connections.count(9, Kind::kSurfaceTopology), 1u);
  EXPECT_EQ(house.connections.count(100, Kind::kSurfaceTopology), 0u);
  house.publish(1);
  EXPECT_EQ(house.connections.count(9, Kind::kSurfaceFrame), 1u);
  EXPECT_EQ(house.connections.count(101, Kind::kSurfaceFrame), 0u);
  proto::Envelope ack, order;
  ack.mutable_frame_ack()->set_frame(1);
  house.say(101, ack);
  EXPECT_EQ(house.shown, std::vector<net::ConnectionId>{101});
  order.mutable_teach_request();
  house.say(101, order);
  EXPECT_EQ(house.heeded.back(), Kind::kTeachRequest);
  house.say(9, order);
  EXPECT_EQ(house.gone.at(9), EndReason::ProtocolError) << "it says nothing for itself";
}

}  // namespace
}  // namespace trocar::replication
