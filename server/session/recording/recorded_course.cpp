#include "server/session/recording/recorded_course.h"

#include <utility>

#include "server/session/recording/lesson_frames.h"

namespace trocar::recording {

Result<std::optional<lesson::Course>> recorded_course(journal::SessionJournal& journal,
                                                      const std::string& path) {
  auto recorded = read_recorded_lesson(journal, path);
  if (!recorded) return recorded.error();
  if (!recorded->lesson) return std::optional<lesson::Course>();
  lesson::Course course(*std::move(recorded->lesson));
  auto input = recorded->inputs.cbegin();
  bool has_begun = false;
  const auto read = read_lesson_frames(
      journal, path,
      [&](const LessonFrame& frame) {
        has_begun |= frame.has_tools;
        if (!has_begun) return;
        for (const auto& event : frame.claims)
          if (is_loss(event)) course.note_refusal();
        course.observe(frame.moment);
        for (; input != recorded->inputs.cend() && input->tick() <= frame.moment.tick; ++input)
          apply(*input, frame.moment, course);
      },
      [](const std::string&) {});
  if (!read) return read.error();
  return std::optional<lesson::Course>(std::move(course));
}

}  // namespace trocar::recording
