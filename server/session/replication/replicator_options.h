#pragma once

// A Replicator is told this, and counts that.

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/base/tick.h"
#include "common/base/timing.h"
#include "common/lesson/course.h"
#include "common/wire/framing.h"
#include "common/wire/hand_report.h"
#include "common/wire/haptic_patch.h"
#include "common/wire/lesson.h"
#include "server/session/access/gate.h"
#include "server/session/participants/roster.h"
#include "server/session/replication/validation.h"

namespace trocar::replication {

struct ReplicatorOptions {
  participants::Places places;
  std::uint32_t max_messages_per_second = 2000;      // per connection; two tools at 250 Hz need 500
  std::uint32_t max_bytes_per_second = 500'000;      // likewise; they need 100 kB
  std::uint32_t max_hand_moments_per_second = 150;   // likewise, of HandReports; 2 x 62.5 are usual
  std::size_t skip_above_bytes = 64 * 1024;          // see above
  Frame keyframe_after_frames = 63;                  // about 1 s
  std::uint64_t keyframe_interval_ns = 250'000'000;  // of keyframes on request
  std::uint64_t participants_interval_ns = 100'000'000;  // of telling all who is here
  std::uint32_t return_seconds = 30;                     // 0: a lost connection is a leave
  std::function<std::uint64_t()> clock_ns = monotonic_ns;
  // Told who is here after each change, with the tick of the newest frame; may be empty.
  std::function<void(const std::vector<participants::Participant>&, Tick)> on_participants;
  // Told what hands have felt; may be empty.
  std::function<void(wire::HandRecord)> on_hand_report;
  // Told what people say and show; may be empty.
  std::function<void(wire::LessonEntry)> on_lesson;
  // Told, in words, that an instructor wants the session to end; empty: nobody can.
  std::function<void(const std::string& words)> on_end_wanted;
  // Told how fast time is to go, simulated over real time, 0: not at all; empty: nobody can say.
  std::function<void(float rate)> on_pace;
  // Told, whenever a hand has shown a frame, the newest that all hands have shown, 0: one of them
  // shows none or is away; may be empty.
  std::function<void(Frame)> on_followed;
  std::optional<lesson::Lesson> lesson;      // empty: the session gives none
  std::shared_ptr<lesson::Course> course;    // of a session that goes on; null: from the beginning
  std::vector<wire::HapticLaw> haptic_laws;  // how the organ answers tools, for hands that feel it
  // The organ's fine surface, in messages; empty: it has none. It fills what room there is in an
  // outbox after what is fresh.
  std::vector<wire::SharedBytes> fine_surface;
  bool has_datagrams = false;  // the transport takes them; clients are told
  // Null: everybody may come, in any role. It outlives the replicator.
  access::Gate* gate = nullptr;
};

struct ReplicatorCounters {
  std::uint64_t sessions = 0;                          // welcomed, returns left out
  std::uint64_t lost = 0, returned = 0;                // connections of those who can return
  std::array<std::uint64_t, kEndReasonCount> ended{};  // by EndReason, where we ended it
  std::uint64_t floods = 0;                            // sessions ended for too much at once
  std::uint64_t samples = 0;
  std::uint64_t hand_reports = 0;
  std::uint64_t frames_published = 0;
  std::uint64_t frames_conflated = 0;  // overtaken by a newer one before this thread saw them
  std::uint64_t frames_given = 0, frames_skipped = 0;   // summed over clients
  std::uint64_t frames_by_datagram = 0, datagrams = 0;  // of the frames given
  std::uint64_t datagram_rests = 0;  // times that the stream took over from too many datagrams
  std::uint64_t keyframes_given = 0;
  std::uint64_t surface_changes = 0, surface_change_bytes = 0;  // each counted once
  std::uint64_t bytes_queued = 0;
};

}  // namespace trocar::replication
