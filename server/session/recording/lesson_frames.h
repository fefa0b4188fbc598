#pragma once

// The frames of a session as a lesson's course sees them, and the lesson that it gave. The
// server shows its course the same frames, answers and orders while people learn.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/lesson/course.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/recording/session_parts.h"

namespace trocar::recording {

struct RecordedLesson {
  std::optional<lesson::Lesson> lesson;    // nothing: the session gave none
  std::vector<proto::LessonInput> inputs;  // answers and orders, by tick
  std::optional<proto::LessonStage> told;  // the newest that people were told of
  bool has_left_out = false;               // the recording had no room for some of it
};

Result<RecordedLesson> read_recorded_lesson(const SessionParts& session);

struct LessonFrame {
  lesson::Moment moment;
  std::vector<Vec3d> forces_n;            // by tip: of the tissue, world frame
  std::vector<proto::ClaimEvent> claims;  // since the frame before
  bool has_tools = false;                 // somebody with a tool is there: a lesson has begun
};
using LessonFrameVisitor = std::function<void(const LessonFrame&)>;
using NoteVisitor =
    std::function<void(std::string)>;  // a line about what is missing or does not fit

// Reads all files whole; simulates nothing. Error: a message cannot be decoded.
Status read_lesson_frames(const SessionParts& session, const LessonFrameVisitor& visit,
                          const NoteVisitor& note);

bool is_loss(const proto::ClaimEvent& event);  // refused, or slipped out of the grasp
// Gives the course an answer or an order; what became of an answer.
std::optional<lesson::Answer> apply(const proto::LessonInput& input, const lesson::Moment& moment,
                                    lesson::Course& course);

}  // namespace trocar::recording
