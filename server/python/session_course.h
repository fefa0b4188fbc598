#pragma once

// The course of a lesson in a session of Python: it sees each frame that the simulation publishes,
// as the course of a server does, and gives the same points. It begins with the first frame that
// has a tool. Thread: that of the session.

#include <pybind11/pybind11.h>

#include <memory>
#include <vector>

#include "common/lesson/course.h"
#include "server/tissue/step/published_frame.h"

namespace trocar::python {

class SessionCourse {
 public:
  explicit SessionCourse(lesson::Lesson lesson) : course_(std::move(lesson)) {}

  // `layout`: of the frame's epoch.
  void observe(std::shared_ptr<const step::PublishedFrame> frame,
               const wire::SurfaceLayout& layout);
  // A word: right, wrong, not asked, no tissue.
  const char* answer(ToolSlot tool, const wire::SurfaceLayout& layout);
  void skip() { course_.skip(); }
  const lesson::Lesson& lesson() const { return course_.lesson(); }
  // How far it is, as docs/lessons.md names the measures. With the GIL held.
  pybind11::dict told() const;

 private:
  lesson::Course course_;
  std::shared_ptr<const step::PublishedFrame> frame_;  // null: it has not begun
  std::vector<lesson::Tip> tips_;
};

}  // namespace trocar::python
