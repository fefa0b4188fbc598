#pragma once

// A session takes this from the lesson that it gives, and tells people of it in these messages.

#include <optional>
#include <string>
#include <vector>

#include "common/lesson/course.h"
#include "server/tissue/bleeding/rules.h"
#include "server/tissue/step/published_frame.h"

namespace trocar::proto {
class LessonProgress;
class LessonStage;
}  // namespace trocar::proto

namespace trocar::replication {

// A session bleeds if its lesson does, or if it is asked to; vessels are the lesson's. `lesson`
// null: there is none.
std::optional<bleeding::Rules> bleeding_rules(const lesson::Lesson* lesson, bool is_asked_for);

// Returns what the course looks at in a frame; `tips` keeps the tools for as long as it is used.
lesson::Moment moment_of(const step::PublishedFrame& frame, const wire::SurfaceLayout& layout,
                         std::vector<lesson::Tip>& tips);

void describe(const lesson::Course& course, proto::LessonStage& message);
void describe(const lesson::Course& course, proto::LessonProgress& message);
// One line about the stage that has just ended.
std::string words_of_last_stage(const lesson::Course& course);

}  // namespace trocar::replication
