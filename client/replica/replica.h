#pragma once

// The client's copy of the session, built from messages and nothing else.
//
// The surface is the server's own integers. Every delta names the frame it starts from and carries
// the CRC of what must come out:
//
//   in step --(CRC differs, base or epoch unknown, payload malformed,--> needs keyframe
//      ^        a SurfaceChange that does not follow or whose sum differs)   | one KeyframeRequest,
//      +---- (SurfaceTopology,) keyframe with right CRC <--------------------+ deltas ignored
//
// What SurfaceTopology and SurfaceChange say is shown from the first frame of their epoch on, never
// before: then every frame of the history has every vertex. A vertex that an earlier frame did not
// have lies there between those it was made from, or without parents as in the next frame that has
// it; so no vertex is seen to jump because it is new.
//
// A second Welcome begins the stream anew after the connection broke: topology and keyframe follow,
// and until then the last picture stays.
//
// Frames also come as datagrams, against any frame that was acknowledged; what comes after a newer
// one is ignored. A frame that does not check out is never shown: the last good one stays. A
// keyframe may go back in time (a replay that seeks), which clears the history. Barrier is answered
// with FrameAck for exactly that frame and the replica's own CRC, after healing if need be;
// FrameAck also goes out for each frame, so that the server knows what has arrived, and when.
// Outside data: an invalid message sets `fault()`, after which messages are ignored. Thread: render
// thread.

#include <deque>
#include <functional>
#include <memory>
#include <optional>

#include "client/replica/frame_assembler.h"
#include "client/replica/moved_share.h"
#include "client/replica/session_source.h"
#include "client/replica/session_view.h"
#include "client/replica/shown_surface.h"
#include "client/replica/told.h"
#include "common/base/result.h"
#include "common/wire/fine_surface.h"

namespace trocar::proto {
class Barrier;
class FineSurfacePart;
class FrameState;
class SurfaceChange;
class FrameStatePart;
class SurfaceFrame;
class SurfaceSlice;
class SurfaceTopology;
class Welcome;
}  // namespace trocar::proto

namespace trocar::replica {

inline constexpr std::size_t kHistoryFrames = 8;  // 128 ms: covers the display delay and its jitter

enum class SyncState : std::uint8_t {
  WaitingForTopology,
  WaitingForKeyframe,  // the first one
  InStep,
  Healing,  // a keyframe was asked for
};

struct ReplicaCounters {
  std::uint64_t frames = 0;          // applied, keyframes included
  std::uint64_t keyframes = 0;       // applied
  std::uint64_t by_datagram = 0;     // applied, in slices
  std::uint64_t frames_late = 0;     // after a newer one: ignored
  std::uint64_t deltas_ignored = 0;  // while healing
  std::uint64_t crc_mismatches = 0;  // also payloads that do not decode
  std::uint64_t base_mismatches = 0;
  std::uint64_t surface_changes = 0;    // applied
  std::uint64_t change_mismatches = 0;  // changes that did not follow, malformed ones included
  std::uint64_t change_bytes = 0;       // of applied changes
  std::uint64_t healed = 0;             // returned to InStep after a mismatch of either kind
  std::uint64_t bytes = 0;              // all messages, on the wire
  std::uint64_t delta_bytes = 0;        // payloads of applied deltas
  std::uint64_t changed_vertices = 0;   // by applied deltas
  double bytes_per_changed_vertex() const {
    return changed_vertices == 0
               ? 0.0
               : static_cast<double>(delta_bytes) / static_cast<double>(changed_vertices);
  }
};

struct BarrierOutcome {
  Frame frame = 0;
  std::uint32_t server_crc = 0;
  std::uint32_t own_crc = 0;
};

class Replica final : public MessageSink {
 public:
  // `send` queues a message to the server and returns false if it could not; then it is tried again
  // with the next frame.
  using Send = std::function<bool(const proto::Envelope&)>;
  explicit Replica(Send send);
  ~Replica() override;

  void on_message(const proto::Envelope& message, std::uint64_t arrival_ns,
                  std::size_t bytes) override;

  SyncState sync_state() const { return sync_state_; }
  const Status& fault() const { return fault_; }
  // Invalid until Welcome.
  ParticipantSlot own_slot() const { return own_slot_; }
  // How often the server has said Welcome: more than once after a return.
  std::uint64_t welcome_count() const { return welcome_count_; }
  // Valid once sync_state() is past WaitingForTopology; `topology_version` counts its changes, the
  // large and the small. It only grows between two values of `history_version`.
  const Topology& topology() const { return surface_.topology(); }
  std::uint64_t topology_version() const { return surface_.version(); }
  // Returns what is drawn instead of the surface's outside, at rest; null: that itself, or it is
  // not whole yet. Another pointer means another one.
  const std::shared_ptr<const wire::FineSurface>& fine_surface() const { return fine_surface_; }
  // Ascending by tick, at most kHistoryFrames; `history_version` counts restarts (seek, topology).
  const std::deque<SessionFrame>& history() const { return history_; }
  std::uint64_t history_version() const { return history_version_; }
  const SessionFrame* newest() const { return history_.empty() ? nullptr : &history_.back(); }
  std::uint32_t surface_crc() const { return surface_crc_; }  // of the newest frame
  // Returns what the session tells of people and of its lesson.
  const Told& told() const { return told_; }
  const std::optional<BarrierOutcome>& barrier() const { return barrier_; }
  const ReplicaCounters& counters() const { return counters_; }
  // When the server published the newest change of the surface that is shown; 0: none, or unknown.
  std::uint64_t shown_change_us() const { return surface_.change_us(); }
  // Share of surface vertices whose displacement exceeded 1 mm in any applied frame, 0 to 1.
  double share_moved() const { return moved_.share(); }
  // How long ago the server published the newest frame, in ms by its clock; nothing if unknown.
  // `server_now_us`: its clock at this moment.
  std::optional<double> age_ms(double server_now_us) const;

  // For tests of healing: flips one bit of the n-th delta (from 1), however it came.
  void corrupt_delta(std::uint64_t n) { corrupt_at_ = n; }

 private:
  void apply_welcome(const proto::Welcome& message);
  void begin_anew();
  void apply_topology(const proto::SurfaceTopology& message);
  void apply_change(const proto::SurfaceChange& message, std::size_t bytes);
  void apply_fine_surface(const proto::FineSurfacePart& message);
  void apply_surface(const proto::SurfaceFrame& message, std::uint64_t arrival_ns);
  void apply_state(const proto::FrameState& message);
  void apply_slice(const proto::SurfaceSlice& message, std::uint64_t arrival_ns);
  void apply_state_part(const proto::FrameStatePart& message);
  // Decodes into scratch_ and scratch_blood_.
  bool decode_surface(const proto::SurfaceFrame& message);
  // On the levels of its base.
  bool decode_blood(const proto::SurfaceFrame& message, const wire::BloodLevels& base);
  struct Base {
    const wire::QuantisedSurface* surface = nullptr;  // null: it is not known
    const wire::BloodLevels* blood = nullptr;
  };
  Base find_base(Frame frame) const;
  bool is_overtaken(const proto::SurfaceFrame& message) const;
  // scratch_ and scratch_blood_ are right.
  void accept_frame(const FrameHeader& header, std::uint64_t arrival_ns);
  void show_frame(const FrameHeader& header, std::uint64_t arrival_ns);
  // Another surface begins.
  void show_anew();
  // Gives the history's frames the new vertices, `surface` being the next frame after them.
  void extend_history(const wire::QuantisedSurface& surface);
  void need_keyframe(Frame frame);
  void answer_barrier();
  void fail(std::string what);

  Send send_;
  Status fault_;
  SyncState sync_state_ = SyncState::WaitingForTopology;
  ParticipantSlot own_slot_;
  std::uint64_t welcome_count_ = 0;
  ShownSurface surface_;
  wire::FineSurfaceAssembler fine_parts_;
  std::shared_ptr<const wire::FineSurface> fine_surface_;
  std::deque<SessionFrame> history_;
  std::uint64_t history_version_ = 0;
  wire::QuantisedSurface scratch_;  // the frame being reconstructed
  wire::BloodLevels scratch_blood_;
  bool has_datagrams_ = false;  // frames may come late
  FrameAssembler assembler_;
  std::unique_ptr<proto::FrameState> early_state_;  // its surface is still under way
  std::uint32_t surface_crc_ = 0;
  bool request_pending_ = false;  // a KeyframeRequest that could not be queued yet
  Told told_;
  std::optional<BarrierOutcome> barrier_;
  bool barrier_answered_ = false;
  ReplicaCounters counters_;
  std::uint64_t deltas_seen_ = 0, corrupt_at_ = 0;
  MovedShare moved_;
};

}  // namespace trocar::replica
