#pragma once

// Decides which frames one client is given, and by which path.
//
//   datagrams, while they are heard to arrive: slices of a delta against the newest frame that the
//   client has acknowledged, after the changes of the surface since; a lost one is not sent again,
//   the next frame brings newer
//   the stream, else: a delta against the newest frame that it surely has or will have
//   a keyframe over the stream: the first, on request, and when all it has is older than 63 frames
//
// A frame is left out while too many are under way (frame_pacer.h; for clients that acknowledge
// each) or too many bytes wait for the stream. Datagrams count as heard while the client reports a
// growing number of them. In between probes of full size are sent, so that a path which is open for
// small ones only is not taken. Where datagrams are more than the link takes even one frame at a
// time, they rest: the stream finds its share of any link. They return when it shows that the link
// is free again, and try after half a minute or more.
//
// Thread: the I/O thread.

#include <optional>

#include "server/session/net/connections.h"
#include "server/session/pacing/frame_pacer.h"
#include "server/session/replication/frame_encoder.h"
#include "server/session/replication/replicator_options.h"

namespace trocar::replication {

class FrameFeed {
 public:
  // All references outlive this.
  FrameFeed(net::Connections& connections, net::ConnectionId id, const ReplicatorOptions& options,
            ReplicatorCounters& counters)
      : connections_(connections), id_(id), options_(options), counters_(counters) {}

  // The client acknowledges every frame.
  void pace() { is_paced_ = true; }
  void want_keyframe() { wants_keyframe_ = true; }
  bool may_have_requested_keyframe() const;
  // True if the next frame is a keyframe that was asked for: the client may have lost count of the
  // surface's changes, too, and wants the topology before it.
  bool is_keyframe_due() const { return wants_keyframe_ && may_have_requested_keyframe(); }
  // No frame before `first` helps the client any more.
  void forget_before(Frame first);

  // True if the client has the newest frame, or it is on its way. `is_required`: it is not left
  // out and goes over the stream.
  bool give(FrameEncoder& encoder, bool is_required);
  // A small message that the next one makes stale: a datagram where frames are, else over the
  // stream unless that is busy. message: as encode_envelope makes it.
  void give_beside(const FrameEncoder& encoder, const wire::SharedBytes& message);
  bool was_given(Frame frame) const { return newest_given_ && frame <= *newest_given_; }
  void acknowledge(const FrameEncoder& encoder, Frame frame);
  // Returns the newest frame that the client says it has; 0: none.
  Frame acknowledged() const { return acknowledged_ ? acknowledged_->frame : 0; }
  // `received`: of our datagrams, as the client counts them.
  void hear(std::uint32_t received);
  bool uses_datagrams() const;

 private:
  bool is_stream_busy(const FrameEncoder& encoder) const;
  bool may_send(const pacing::FramePacer& pacer) const;
  bool give_by_datagrams(FrameEncoder& encoder);
  bool give_by_stream(FrameEncoder& encoder);
  // Returns a recent frame that the client has or will have by the stream; null: none.
  const step::PublishedFrame* stream_base(const step::PublishedFrame& frame) const;
  bool is_recent(const step::SharedFrame& base, const step::PublishedFrame& frame) const;
  void send(BytesView datagram);
  void probe();
  void rest_if_congested();
  bool is_resting() const;
  void note_given(Frame frame, pacing::FramePacer& pacer);

  net::Connections& connections_;
  const net::ConnectionId id_;
  const ReplicatorOptions& options_;
  ReplicatorCounters& counters_;
  pacing::FramePacer datagram_pacer_, stream_pacer_;
  bool is_paced_ = false;
  bool wants_keyframe_ = false;
  std::uint64_t last_requested_keyframe_ns_ = 0;
  step::SharedFrame streamed_;      // the last frame that the stream took
  step::SharedFrame acknowledged_;  // the newest that the client says it has
  std::optional<Frame> newest_given_;
  Frame first_useful_ = 0;
  std::uint32_t heard_ = 0;
  std::optional<std::uint64_t> heard_ns_;  // when that number last grew
  std::uint64_t probe_ns_ = 0;
  std::uint64_t rest_ns_ = 0, rest_end_ns_ = 0;  // of the datagrams
};

}  // namespace trocar::replication
