#pragma once

// The course of a lesson as it stood at a tick of a recorded session: it sees the recorded frames,
// answers and orders again, as the server's did. So stage, time, points and all that was measured
// go on in a session that does.

#include <optional>
#include <string>

#include "common/base/result.h"
#include "common/base/tick.h"
#include "common/lesson/course.h"

namespace trocar::recording {

struct RecordedCourse {
  std::optional<lesson::Course> course;  // nothing: no lesson has begun
  std::string missing;                   // as SessionParts::missing
};
// Reads the recording and those before it whole; simulates nothing.
Result<RecordedCourse> recorded_course(const std::string& path, Tick until);

}  // namespace trocar::recording
