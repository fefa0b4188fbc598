#pragma once

// Encodes the newest frame, each way at most once: as keyframe, as delta against each baseline that
// some client has, and its FrameState. Clients with equal lag share one buffer.
//
// Thread: the I/O thread. Cost per distinct baseline: a scan of the surface plus what changed.

#include <map>

#include "common/wire/framing.h"
#include "server/session/replication/duration_histogram.h"
#include "server/tissue/step/published_frame.h"

namespace trocar::replication {

struct EncodeStatistics {
  DurationHistogram delta_cpu;  // thread CPU time of one delta
  DurationHistogram keyframe_cpu;
  // Deltas against the frame just before, where one was encoded: the stream as recorded and as a
  // client that keeps up sees it.
  std::uint64_t deltas = 0, delta_payload_bytes = 0, changed_vertices = 0;
  std::uint64_t shared = 0;  // buffers handed out again instead of encoded again
};

class FrameEncoder {
 public:
  void set_current(step::SharedFrame frame);
  const step::SharedFrame& current() const { return current_; }

  // Only with a current frame. `baseline`: of this or an earlier epoch; vertices that it lacks
  // count as zero in it.
  wire::SharedBytes keyframe();
  wire::SharedBytes delta_from(const step::PublishedFrame& baseline);
  wire::SharedBytes state();

  // Size of the last delta and its FrameState: what one frame costs at present.
  std::size_t typical_frame_bytes() const { return typical_frame_bytes_; }
  const EncodeStatistics& statistics() const { return statistics_; }

 private:
  step::SharedFrame current_;
  wire::SharedBytes keyframe_, state_;
  wire::QuantisedSurface extended_;            // a baseline of an earlier epoch
  std::map<Frame, wire::SharedBytes> deltas_;  // by baseline frame
  std::size_t typical_frame_bytes_ = 0;
  EncodeStatistics statistics_;
};

}  // namespace trocar::replication
