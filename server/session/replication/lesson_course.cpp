#include "server/session/replication/lesson_course.h"

#include "common/base/log.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/replication/lesson_messages.h"

namespace trocar::replication {
namespace {

constexpr Frame kFramesPerProgress = 16;  // about four a second

const char* words_of(lesson::Answer answer) {
  switch (answer) {
    case lesson::Answer::NotAsked:
      return "nothing is to be found in this stage";
    case lesson::Answer::NoTissue:
      return "put the tip on the tissue first";
    case lesson::Answer::Wrong:
      return "it is not there";
    case lesson::Answer::Right:
      return "that is right";
  }
  return "";
}

}  // namespace

LessonCourse::LessonCourse(SessionContext& session) : session_(session) {
  const auto& options = session.options;
  if (options.course)
    course_.emplace(std::move(*options.course));
  else if (options.lesson)
    course_.emplace(*options.lesson);
}

void LessonCourse::observe(const step::PublishedFrame& frame, const wire::SurfaceLayout& layout) {
  if (!course_) return;
  bool is_first = false;
  if (!has_begun_) {
    if (frame.tools.empty()) return;
    is_first = has_begun_ = true;
    proto::LessonRecord record;
    record.mutable_lesson()->set_source(course_->lesson().source);
    for (const auto& picture : course_->lesson().pictures) {
      auto& recorded = *record.mutable_lesson()->add_picture();
      recorded.set_name(picture.name);
      recorded.set_image(picture.bytes);
    }
    session_.record(wire::LessonKind::Said, record);
  }
  for (const auto& event : frame.claim_events)
    if (wire::is_refusal(event.outcome) || event.outcome == wire::ClaimOutcome::Slipped)
      course_->note_refusal();
  const bool is_stage_over = course_->observe(moment_of(frame, layout, tips_));
  if (is_stage_over) tell_line(words_of_last_stage(*course_), course_->results().back().is_reached);
  const bool is_hint_due = course_->shows_hint() && !is_hint_told_;
  if (is_stage_over || is_first || is_hint_due) tell_stage();
  if (frame.frame % kFramesPerProgress != 0 || course_->is_over()) return;
  proto::Envelope event;
  describe(*course_, *event.mutable_lesson_progress());
  session_.audience.offer(wire::encode_envelope(event));
}

void LessonCourse::tell_stage() {
  is_hint_told_ = course_->shows_hint();
  proto::LessonRecord record;
  describe(*course_, *record.mutable_stage());
  session_.record(wire::LessonKind::Said, record);
  proto::Envelope event;
  *event.mutable_lesson_stage() = record.stage();
  session_.audience.broadcast(wire::encode_envelope(event));
}

void LessonCourse::tell_line(const std::string& words, bool is_good) {
  log::info("{}", words);
  proto::Envelope event;
  event.mutable_teach_event()->set_tick(session_.audience.newest_tick());
  event.mutable_teach_event()->set_is_done(true);
  event.mutable_teach_event()->set_is_trouble(!is_good);
  event.mutable_teach_event()->set_text(words);
  session_.audience.broadcast(wire::encode_envelope(event));
}

std::optional<Ending> LessonCourse::ask(Speaker& who, const proto::LessonRequest& request,
                                        const wire::SurfaceLayout& layout) {
  const auto role = who.participant->role;
  const auto slot = who.participant->slot;
  const int action = request.action();
  const bool answers = action == proto::LESSON_ANSWER;
  if (!answers && action != proto::LESSON_NEXT && action != proto::LESSON_RESTART)
    return Ending{EndReason::ProtocolError, "LessonRequest.action: " + std::to_string(action) +
                                                " is not 1 (answer), 2 (next) or 3 (restart)"};
  if (answers ? !slot.has_tools() : !wire::rights_of(role).may_teach)
    return Ending{EndReason::Role, std::string("LessonRequest: ") +
                                       (answers ? "who answers has a tool, not "
                                                : "stages are the instructor's, not of ") +
                                       wire::one_of(role)};
  if (answers && request.tool() >= who.participant->tools.size())
    return Ending{EndReason::ProtocolError,
                  "LessonRequest.tool: " + std::to_string(request.tool()) + ", you have " +
                      std::to_string(who.participant->tools.size()) + " (counted from 0)"};
  const auto refuse = [&](const std::string& why) {
    session_.refuse(who, "not done: " + why);
    return std::nullopt;
  };
  if (!course_) return refuse("this session gives no lesson");
  if (!who.sayings.take(0.5, session_.now_ns())) return refuse("wait a second");
  if (!has_begun_) return refuse("the lesson begins when somebody has a tool");
  const auto tool = tool_slot(slot, static_cast<int>(request.tool()));
  proto::LessonRecord record;
  record.mutable_input()->set_tick(session_.audience.newest_tick());
  record.mutable_input()->set_action(request.action());
  if (answers) record.mutable_input()->set_tool(tool.value);
  if (answers) {
    const auto answer =
        course_->answer(tool, moment_of(*session_.audience.newest_frame(), layout, tips_));
    if (answer == lesson::Answer::NotAsked || answer == lesson::Answer::NoTissue)
      return refuse(words_of(answer));
    session_.record(wire::LessonKind::Said, record);
    tell_line(who.participant->name + " says that it is here: " + words_of(answer),
              answer == lesson::Answer::Right);
    if (answer == lesson::Answer::Wrong) return std::nullopt;
    tell_line(words_of_last_stage(*course_));
  } else {
    action == proto::LESSON_NEXT ? course_->skip() : course_->restart();
    session_.record(wire::LessonKind::Said, record);
    if (auto* gate = session_.options.gate)
      gate->note_action(who.applicant,
                        action == proto::LESSON_NEXT ? "next-stage" : "restart-lesson");
    tell_line(who.participant->name + (action == proto::LESSON_NEXT ? " goes on to the next stage"
                                                                    : " begins the lesson anew"));
  }
  tell_stage();
  return std::nullopt;
}

bool LessonCourse::show(const Speaker& newcomer) const {
  if (!course_) return true;
  proto::Envelope event;
  describe(*course_, *event.mutable_lesson_stage());
  return session_.audience.send(newcomer, wire::encode_envelope(event));
}

}  // namespace trocar::replication
