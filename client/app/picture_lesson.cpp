// The picture's part about the lesson that the session gives.

#include <cstdio>

#include "client/app/picture.h"

namespace trocar::app {

std::optional<Vec3f> Picture::lesson_target(const replica::Replica& replica) {
  if (!replica.lesson() || replica.newest() == nullptr) return std::nullopt;
  return replica.lesson()->target_m(replica.newest()->tick);
}

void Picture::add_lesson(const replica::Replica& replica, bool is_replay,
                         ui::HudModel& model) const {
  const auto& lesson = replica.lesson();
  if (!lesson) return;
  ui::HudLesson shown{.title = lesson->title,
                      .stage = std::to_string(lesson->stage + 1) + " of " +
                               std::to_string(lesson->stages) + ": " + lesson->name,
                      .text = lesson->text,
                      .hint = lesson->hint,
                      .progress = lesson->progress,
                      .seconds = static_cast<double>(lesson->seconds),
                      .limit_s = static_cast<double>(lesson->limit_s),
                      .force_limit_n = lesson->force_limit_n,
                      .is_too_strong = lesson->is_too_strong,
                      .is_over = lesson->is_over,
                      .points = lesson->points};
  if (!is_replay) {
    shown.can_answer = lesson->goal == replica::LessonView::Goal::Find && replica::has_tools(role_);
    shown.can_lead = role_ == replica::Role::Instructor;
  }
  for (const auto& result : lesson->results) {
    char points[48];
    std::snprintf(points, sizeof points, ": %s, %.0f points",
                  result.is_reached ? "reached" : "not reached",
                  static_cast<double>(result.points));
    shown.results.emplace_back(result.name + points, result.lines);
  }
  model.lesson = std::move(shown);
}

}  // namespace trocar::app
