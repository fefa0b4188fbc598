#pragma once

// The channels of a Trocar journal, and how ticks become times.
//
//   /organ           Organ            once, first
//   /loads           ExternalLoads    of scenarios: once, at the start; what acts besides tools
//   /world/snapshot  WorldSnapshot    full state: at start, every 10 s, at marks
//   /tick_batch      TickBatch        one per frame: inputs, decisions, hashes of its ticks
//   /surface/key     SurfaceFrame     1 Hz
//   /surface/delta   SurfaceFrame     every frame, against the frame before
//   /topology        SurfaceTopology  at start; once cut, before each keyframe
//   /topology/change SurfaceChange    frames that begin an epoch
//   /participants    Participants     on change
//   /claims          ClaimLog         frames that have claim events
//   /hands           HandLog          what hands that feel have felt, as their clients said
//   /lesson          LessonRecord     what instructors did with people, what people said, where
//                                     they pointed, and the view to follow
//   /drawing         Drawing          all that is drawn on the surface, on change
//   /frame_state     FrameState       tools, regions and figures of a frame, as a client got them
//   /overview        Overview         every 30 s, in a chunk of its own: what a page plots of them
//   /bleeding        BleedingRules    once, at the start, of a session that bleeds
//   /threads         ThreadRules      once, at the start, of a session with surgical thread
//   /gap             JournalGap       where the queue to the writer was full
//   /tool/<slot>     ToolState        one channel per tool, for plots in other programs
//
// A message of frame f carries tick 16 f; log_time = start (UTC) + tick x 1 ms, so all messages of
// a tick share it. publish_time is the wall clock.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/tick.h"

namespace google::protobuf {
class Descriptor;
}

namespace trocar::journal {

enum class JournalTopic : std::uint8_t {
  Organ,
  Snapshot,
  TickBatch,
  SurfaceKey,
  SurfaceDelta,
  Topology,
  Participants,
  Claims,
  FrameState,
  Gap,
  TopologyChange,
  Loads,
  Hands,
  Lesson,
  Drawing,
  Overview,
  Bleeding,
  Threads,
};
inline constexpr int kJournalTopicCount = 18;

inline constexpr const char* kJournalProfile = "trocar";
inline constexpr const char* kSessionMetadataName = "trocar.session";

const char* topic_name(JournalTopic topic);
std::optional<JournalTopic> topic_of(std::string_view name);
const google::protobuf::Descriptor& topic_message(JournalTopic topic);

// A journal that goes on with the session of another one, after the server was killed: its first
// snapshot is of this tick, and its ticks go on from there. The metadata say so as continues_file
// and continues_tick; absent in a journal that has its session from the start.
//
// A journal of which a part was taken off says likewise, as trimmed_file and trimmed_tick, of which
// journal it is what came after a tick.
struct Continuation {
  std::string file;  // of the other journal, without folders
  Tick tick = 0;     // the last one that counts in it

  bool operator==(const Continuation&) const = default;
};

// Log times of one session.
struct JournalTimes {
  std::uint64_t start_utc_ns = 0;  // of tick 0

  std::uint64_t log_time(Tick tick) const { return start_utc_ns + tick * kTickNanoseconds; }
  // The tick at or before a log time; 0 before the start.
  Tick tick(std::uint64_t log_time_ns) const {
    return log_time_ns <= start_utc_ns ? 0 : (log_time_ns - start_utc_ns) / kTickNanoseconds;
  }
};

}  // namespace trocar::journal
