#pragma once

// Whether a session is being recorded whole, as the recorder, the server and clients say it. The
// numbers are those of proto::RecordingStatus.

#include <cstdint>
#include <string>

namespace trocar::wire {

enum class RecordingStatus : std::uint8_t {
  Unknown = 0,  // nothing heard yet, or a number that this program does not know
  Off = 1,      // the session is not recorded
  Whole = 2,    // everything so far has been taken
  Gapped = 3,   // frames are missing, the rest is recorded
  Failed = 4,   // the recording has ended, the session has not
};

// It never becomes better again.
struct RecordingState {
  RecordingStatus status = RecordingStatus::Unknown;
  std::uint64_t frames_missing = 0;
  std::string text;  // one line for people; empty while nothing is wrong

  bool is_damaged() const {
    return status == RecordingStatus::Gapped || status == RecordingStatus::Failed;
  }
  bool operator==(const RecordingState&) const = default;
};

constexpr const char* name_of(RecordingStatus status) {
  switch (status) {
    case RecordingStatus::Unknown:
      return "unknown";
    case RecordingStatus::Off:
      return "off";
    case RecordingStatus::Whole:
      return "whole";
    case RecordingStatus::Gapped:
      return "gapped";
    case RecordingStatus::Failed:
      return "failed";
  }
  return "unknown";
}

}  // namespace trocar::wire
