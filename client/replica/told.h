#pragma once

// A session tells this of people and of its lesson: who takes part, points, draws and leads, what
// has been refused or granted, the stage, pace and marks. Thread: render thread.

#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "client/replica/session_view.h"
#include "common/base/result.h"
#include "common/wire/recording_state.h"

namespace trocar::proto {
class ClaimEvent;
class Drawing;
class Envelope;
class LessonProgress;
class LessonStage;
class MarkList;
class Participants;
class PointEvent;
class RecordingState;
class SessionPace;
class ViewEvent;
class Welcome;
}  // namespace trocar::proto

namespace trocar::replica {

inline constexpr std::size_t kMaxNotices = 32;
inline constexpr std::size_t kMaxRecordingText = 200;
inline constexpr std::uint64_t kPointerNs = 1'500'000'000;  // as long a pointer stays without news

class Told {
 public:
  // Takes a message that has come; one that is about something else has no effect. An error if it
  // is not as it may be.
  Status take(const proto::Envelope& message, std::uint64_t arrival_ns);

  const std::vector<Participant>& participants() const { return participants_; }
  const Participant* find_participant(ParticipantSlot slot) const;
  // Latest last; `notice_count` counts all that ever came.
  const std::deque<Notice>& notices() const { return notices_; }
  std::uint64_t notice_count() const { return notice_count_; }
  // Who points where at `now_ns` (monotonic), one entry for each participant.
  std::vector<Pointer> pointers(std::uint64_t now_ns) const;
  // Returns what is drawn on the organ; `drawing_version` changes unless lines were only added.
  const std::vector<Stroke>& strokes() const { return strokes_; }
  std::uint64_t drawing_version() const { return drawing_version_; }
  // The lesson that the session gives, if it does.
  const std::optional<LessonView>& lesson() const { return lesson_; }
  const SessionPace& pace() const { return pace_; }
  // Whether the server knows pauses, slow time and marks with names.
  bool has_pace() const { return server_minor_ >= 18; }
  // The marks that the organ can be returned to; an empty text is the one without a name.
  const std::vector<std::string>& marks() const { return marks_; }
  // How many were set by the instructor, or returned to.
  std::uint64_t mark_count() const { return mark_count_; }
  // Returns where the view to follow was last, if somebody has had it.
  const std::optional<LedView>& led_view() const { return led_view_; }
  // Returns what the server last said of its recording.
  const wire::RecordingState& recording() const { return recording_; }

 private:
  Status apply(const proto::Participants& message);
  Status apply(const proto::ClaimEvent& message, std::uint64_t arrival_ns);
  Status apply(const proto::PointEvent& message, std::uint64_t arrival_ns);
  Status apply(const proto::Drawing& message);
  Status apply(const proto::ViewEvent& message, std::uint64_t arrival_ns);
  Status apply(const proto::SessionPace& message);
  Status apply(const proto::MarkList& message);
  Status apply(const proto::LessonStage& message);
  void apply(const proto::Welcome& message);
  void apply(const proto::LessonProgress& message);
  void apply(const proto::RecordingState& message);
  void tell_all(Tick tick, const std::string& text, bool is_refused, std::uint64_t arrival_ns);
  void add_notice(Notice notice);

  bool has_begun_ = false;
  std::vector<Participant> participants_;
  std::deque<Notice> notices_;
  std::uint64_t notice_count_ = 0, mark_count_ = 0;
  wire::RecordingState recording_;
  std::vector<Pointer> pointers_;  // one of a participant at most
  std::vector<Stroke> strokes_;
  std::uint64_t drawing_version_ = 0;
  std::optional<LedView> led_view_;
  SessionPace pace_;
  std::uint32_t server_minor_ = 0;
  std::vector<std::string> marks_;
  std::optional<LessonView> lesson_;
  std::size_t lesson_strokes_ = 0;  // of strokes_, the first ones: the line of a stage
};

}  // namespace trocar::replica
