// The parts of a session, each with an audience that only listens: no socket, no simulation.

#include <gtest/gtest.h>

#include <map>

#include "common/wire/tool_shape.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/replication/lesson_course.h"
#include "server/session/replication/marks.h"
#include "server/session/replication/teaching.h"

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

}  // namespace
}  // namespace trocar::replication
