#pragma once

// The course of a lesson as it stood at the end of a recording: it sees the recorded frames,
// answers and orders again, as the server's did. So stage, time, points and all that was measured
// go on in a session that does.

#include <optional>
#include <string>

#include "common/base/result.h"
#include "common/lesson/course.h"

namespace trocar::journal {
class SessionJournal;
}

namespace trocar::recording {

// Nothing: no lesson has begun in it. Reads the whole file; simulates nothing.
Result<std::optional<lesson::Course>> recorded_course(journal::SessionJournal& journal,
                                                      const std::string& path);

}  // namespace trocar::recording
