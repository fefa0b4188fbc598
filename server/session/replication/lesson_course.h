#pragma once

// The lesson that a session gives: its goals are measured in every frame from when somebody with a
// tool is there. What is found is told to all and recorded, with the answers that people give.

#include "common/lesson/course.h"
#include "server/session/replication/audience.h"

namespace trocar::proto {
class LessonRequest;
}

namespace trocar::replication {

class LessonCourse {
 public:
  // Gives the lesson, or goes on with the course, that the options name, if any.
  explicit LessonCourse(SessionContext& session);

  // `layout`: of the frame's epoch.
  void observe(const step::PublishedFrame& frame, const wire::SurfaceLayout& layout);
  std::optional<Ending> ask(Speaker& who, const proto::LessonRequest& request,
                            const wire::SurfaceLayout& layout);
  // Tells a newcomer which stage it is; false: there is no room for it.
  bool show(const Speaker& newcomer) const;

 private:
  void tell_stage();
  void tell_line(const std::string& words, bool is_good = true);

  SessionContext& session_;
  std::optional<lesson::Course> course_;
  bool has_begun_ = false, is_hint_told_ = false;
  std::vector<lesson::Tip> tips_;
};

}  // namespace trocar::replication
