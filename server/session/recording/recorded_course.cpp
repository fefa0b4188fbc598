#include "server/session/recording/recorded_course.h"

#include <utility>

#include "server/session/recording/lesson_frames.h"

namespace trocar::recording {

Result<RecordedCourse> recorded_course(const std::string& path, Tick until) {
  auto session = open_session_parts(path);
  if (!session) return session.error();
  session->parts.back().until = until;
  auto recorded = read_recorded_lesson(*session);
  if (!recorded) return recorded.error();
  if (!recorded->lesson) return RecordedCourse{};
  lesson::Course course(*std::move(recorded->lesson));
  auto input = recorded->inputs.cbegin();
  bool has_begun = false;
  const auto read = read_lesson_frames(
      *session,
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
  return RecordedCourse{std::move(course), std::move(session->missing)};
}

}  // namespace trocar::recording
