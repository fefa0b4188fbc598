// The picture's part about the lesson that the session gives.

#include <algorithm>
#include <cstdio>

#include "client/app/picture.h"
#include "common/base/log.h"
#include "common/tool/instrument.h"

namespace trocar::app {
namespace {

std::vector<std::string> instruments_of(const std::vector<tool::ToolShape>& shapes) {
  std::vector<std::string> names;
  for (const auto& shape : shapes) {
    const auto known = std::ranges::find(tool::instruments(), shape, &tool::Instrument::shape);
    names.push_back(known != tool::instruments().end() ? known->name : "instrument");
  }
  return names;
}

}  // namespace

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
  if (is_replay) {
    const Tick now = replica.newest() != nullptr ? replica.newest()->tick : 0;
    shown.progress.reset();
    shown.seconds =
        static_cast<double>(now > lesson->begin_tick ? now - lesson->begin_tick : 0) * 1e-3;
  } else {
    shown.can_answer =
        lesson->goal == replica::LessonView::Goal::Find && replica.own_slot().has_tools();
    shown.can_lead = role_ == replica::Role::Instructor;
  }
  if (lesson_image_.name() != 0) {
    shown.picture = lesson_image_.name();
    shown.picture_aspect =
        static_cast<float>(lesson_image_.height()) / static_cast<float>(lesson_image_.width());
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

void Picture::load_lesson_image(const replica::Replica& replica) {
  static const std::string kNone;
  const auto& file =
      replica.lesson() && !replica.lesson()->is_over ? replica.lesson()->picture : kNone;
  if (file == lesson_image_file_) return;
  lesson_image_file_ = file;
  lesson_image_.clear();
  if (file.empty()) return;
  if (const auto loaded = lesson_image_.load(file); !loaded)
    log::warn("the lesson's {}", loaded.error().message);
}

void Picture::add_pace(const replica::Replica& replica, bool is_replay, ui::HudModel& model) const {
  if (is_replay) return;
  const auto& pace = replica.pace();
  model.is_paused = pace.is_paused;
  if (pace.is_paused) {
    model.pace_text = (pace.by.empty() ? "Somebody" : pace.by) + " has paused the session.";
  } else if (pace.rate < 1) {
    char text[48];
    std::snprintf(text, sizeof text, "Time goes at %.0f %%.", 100 * static_cast<double>(pace.rate));
    model.pace_text = text;
  }
  if (!model.can_mark || !replica.has_pace()) return;
  ui::HudConduct conduct{.is_paused = pace.is_paused,
                         .rate = pace.rate,
                         .marks = replica.marks(),
                         .hands = {},
                         .own = replica.own_slot()};
  for (const auto& who : replica.participants())
    if (!who.tools.empty())
      conduct.hands.push_back(
          {who.slot, who.name, !who.frozen_by.empty(), instruments_of(who.tools)});
  model.conduct = std::move(conduct);
}

// A wish that cannot be sent is lost: whoever asked asks again.
void Picture::lead(const ui::HudActions& actions, replica::SessionSource& source) {
  if (actions.lead) replica::send_lead_wish(source, *actions.lead);
  if (actions.mark_named) replica::ask_for_mark(source, false, *actions.mark_named);
  if (actions.return_to_named) replica::ask_for_mark(source, true, *actions.return_to_named);
}

}  // namespace trocar::app
