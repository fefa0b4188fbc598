#pragma once

// People say and show this in a lesson; here it is on its way into a recording, with its bounds.

#include <cstddef>
#include <cstdint>

#include "common/base/bytes.h"

namespace trocar::wire {

inline constexpr std::size_t kMostPictureBytes = 64 * 1024;
inline constexpr std::size_t kMostLessonText = 500;  // bytes, of a note or a line
inline constexpr std::size_t kMostReason = 200;      // bytes, of why somebody is put out
inline constexpr std::size_t kMostStrokePoints = 64;
inline constexpr std::size_t kMostDrawingPoints = 2048;  // of all strokes together
inline constexpr float kMostViewDistanceM = 10;          // of an eye from the origin
inline constexpr float kLeastViewM = 0.001f;             // from the eye to what it looks at

inline constexpr std::size_t kMostMarks = 4;      // with the one without a name
inline constexpr std::size_t kMostMarkName = 32;  // bytes
inline constexpr float kLeastPace = 0.25f;        // simulated time over real time

enum class LessonKind : std::uint8_t { Said, Drawing };

// A message as the journal holds it: proto::LessonRecord or, of all that is drawn, proto::Drawing.
struct LessonEntry {
  LessonKind kind = LessonKind::Said;
  Bytes message;
};

}  // namespace trocar::wire
