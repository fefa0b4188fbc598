#pragma once

// The frames of a recording as a lesson's course sees them, and the lesson that it holds. The
// server shows its course the same frames, answers and orders while people learn.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/lesson/course.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"

namespace trocar::journal {
class SessionJournal;
}

namespace trocar::recording {

struct RecordedLesson {
  std::optional<lesson::Lesson> lesson;    // nothing: the session gave none
  std::vector<proto::LessonInput> inputs;  // answers and orders, by tick
  std::optional<proto::LessonStage> told;  // the newest that people were told of
  bool has_left_out = false;               // the recording had no room for some of it
};

// `name` begins each error.
Result<RecordedLesson> read_recorded_lesson(journal::SessionJournal& journal,
                                            const std::string& name);

struct LessonFrame {
  lesson::Moment moment;
  std::vector<Vec3d> forces_n;            // by tip: of the tissue, world frame
  std::vector<proto::ClaimEvent> claims;  // since the frame before
  bool has_tools = false;                 // somebody with a tool is there: a lesson has begun
};
using LessonFrameVisitor = std::function<void(const LessonFrame&)>;
using NoteVisitor =
    std::function<void(std::string)>;  // a line about what is missing or does not fit

// Reads the whole file; simulates nothing. Error: a message cannot be decoded.
Status read_lesson_frames(journal::SessionJournal& journal, const std::string& name,
                          const LessonFrameVisitor& visit, const NoteVisitor& note);

bool is_loss(const proto::ClaimEvent& event);  // refused, or slipped out of the grasp
// Gives the course an answer or an order; what became of an answer.
std::optional<lesson::Answer> apply(const proto::LessonInput& input, const lesson::Moment& moment,
                                    lesson::Course& course);

}  // namespace trocar::recording
