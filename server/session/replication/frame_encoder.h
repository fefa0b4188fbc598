#pragma once

// Encodes the newest frame, each way at most once: as keyframe, as delta against each baseline that
// some client has, whole or in slices for datagrams, and its FrameState. Clients with equal lag
// share one buffer. Keeps the last 64 frames, for those to whom they are a baseline.
//
// Thread: the I/O thread. Cost per distinct baseline: a scan of the surface plus what changed.

#include <array>
#include <deque>
#include <map>
#include <vector>

#include "common/wire/framing.h"
#include "server/session/replication/duration_histogram.h"
#include "server/tissue/step/published_frame.h"

namespace trocar::replication {

struct EncodeStatistics {
  DurationHistogram delta_cpu;  // thread CPU time of one delta
  DurationHistogram keyframe_cpu;
  DurationHistogram slices_cpu;  // of one delta in slices
  // Deltas against the frame just before, where one was encoded: the stream as recorded and as a
  // client that keeps up sees it.
  std::uint64_t deltas = 0, delta_payload_bytes = 0, changed_vertices = 0;
  std::uint64_t shared = 0;  // buffers handed out again instead of encoded again
};

class FrameEncoder {
 public:
  // `server_time_us`: what clients measure the frame's age by. `state`: the frame's FrameState as
  // another server has encoded it; null: it is made of the frame.
  void set_current(step::SharedFrame frame, std::uint64_t server_time_us,
                   wire::SharedBytes state = nullptr);
  const step::SharedFrame& current() const { return current_; }
  // Null if it is not among the last 64.
  step::SharedFrame find(Frame frame) const;

  // Only with a current frame. `baseline`: of this or an earlier epoch; vertices that it lacks
  // count as zero in it.
  wire::SharedBytes keyframe();
  wire::SharedBytes delta_from(const step::PublishedFrame& baseline);
  wire::SharedBytes state();
  // Messages for datagrams. No slices: the delta is too large for them.
  using Datagrams = std::vector<Bytes>;
  const Datagrams& slices_from(const step::PublishedFrame& baseline);
  const Datagrams& state_parts();

  // Changes of the surface as messages, for those who have an earlier epoch. What does not fit a
  // datagram is left out.
  void add_change(std::uint32_t epoch, const wire::SharedBytes& framed);
  void forget_changes() { changes_.clear(); }
  template <typename Take>
  void each_change_since(std::uint32_t epoch, const Take& take) const {
    for (const auto& change : changes_)
      if (change.epoch > epoch) take(BytesView(change.message));
  }

  // Size of the last delta and its FrameState: what one frame costs at present.
  std::size_t typical_frame_bytes() const { return typical_frame_bytes_; }
  const EncodeStatistics& statistics() const { return statistics_; }

 private:
  static constexpr std::size_t kRecentFrames = 64;
  struct Change {
    std::uint32_t epoch = 0;
    Bytes message;
  };

  std::span<const wire::QuantisedVertex> extend(const step::PublishedFrame& baseline);
  wire::SharedBytes wrap(const step::PublishedFrame* baseline, const Bytes& payload) const;

  step::SharedFrame current_;
  std::uint64_t server_time_us_ = 0;
  std::array<step::SharedFrame, kRecentFrames> recent_;  // by frame number
  wire::SharedBytes keyframe_, state_;
  wire::QuantisedSurface extended_;            // a baseline of an earlier epoch
  std::map<Frame, wire::SharedBytes> deltas_;  // by baseline frame
  std::map<Frame, Datagrams> slices_;          // likewise
  Datagrams state_parts_;
  std::deque<Change> changes_;  // the last ones, ascending
  std::size_t typical_frame_bytes_ = 0;
  EncodeStatistics statistics_;
};

}  // namespace trocar::replication
