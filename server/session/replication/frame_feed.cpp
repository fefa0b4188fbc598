#include "server/session/replication/frame_feed.h"

#include <algorithm>

#include "common/secure/datagram_channel.h"
#include "proto/wire.pb.h"

namespace trocar::replication {
namespace {

// A datagram path without news for so long is taken for blocked. Claims lapse after 250 ms without
// samples, so it is shorter; but never shorter than what news takes.
constexpr std::uint64_t kShortestSilenceNs = 200'000'000;
constexpr std::uint64_t kProbeIntervalNs = 250'000'000;
constexpr std::size_t kProbeOverheadBytes = 12;
constexpr std::uint64_t kFirstRestNs = 30'000'000'000, kLongestRestNs = 120'000'000'000;
constexpr std::uint64_t kShortestRestNs = 4'000'000'000;
constexpr double kFramesOfFreeLink = 8;

}  // namespace

bool FrameFeed::may_have_requested_keyframe() const {
  return options_.clock_ns() - last_requested_keyframe_ns_ >= options_.keyframe_interval_ns;
}

void FrameFeed::forget_before(Frame first) {
  first_useful_ = first;
  streamed_.reset();
  acknowledged_.reset();
}

void FrameFeed::acknowledge(const FrameEncoder& encoder, Frame frame) {
  for (auto* pacer : {&datagram_pacer_, &stream_pacer_})
    pacer->on_acknowledged(frame, options_.clock_ns());
  if (frame < first_useful_ || (acknowledged_ && frame <= acknowledged_->frame)) return;
  if (auto known = encoder.find(frame)) acknowledged_ = std::move(known);
}

bool FrameFeed::is_resting() const {
  const auto now = options_.clock_ns();
  if (now >= rest_end_ns_) return false;
  const bool is_free = stream_pacer_.window() >= kFramesOfFreeLink;
  return !is_free || rest_end_ns_ - now > rest_ns_ - kShortestRestNs;
}

void FrameFeed::rest_if_congested() {
  const auto now = options_.clock_ns();
  if (!datagram_pacer_.is_congested(now)) return;
  datagram_pacer_.restart();
  ++counters_.datagram_rests;
  const bool was_long_ago = now - rest_end_ns_ > kLongestRestNs;
  rest_ns_ = was_long_ago ? kFirstRestNs : std::min(2 * rest_ns_, kLongestRestNs);
  rest_end_ns_ = now + rest_ns_;
}

void FrameFeed::hear(std::uint32_t received) {
  if (received <= heard_) return;
  heard_ = received;
  heard_ns_ = options_.clock_ns();
}

bool FrameFeed::uses_datagrams() const {
  if (!heard_ns_ || !connections_.has_datagrams(id_)) return false;
  if (is_resting()) return false;
  const auto silence = std::max(kShortestSilenceNs, 3 * datagram_pacer_.shortest_ns());
  return options_.clock_ns() - *heard_ns_ <= silence;
}

bool FrameFeed::may_send(const pacing::FramePacer& pacer) const {
  return !is_paced_ || pacer.may_send(options_.clock_ns());
}

bool FrameFeed::is_stream_busy(const FrameEncoder& encoder) const {
  if (!may_send(stream_pacer_)) return true;
  const auto limit = std::max(options_.skip_above_bytes, 2 * encoder.typical_frame_bytes());
  return connections_.outstanding_bytes(id_) > limit;
}

bool FrameFeed::give(FrameEncoder& encoder, bool is_required) {
  const auto newest = encoder.current()->frame;
  const bool is_there = is_required ? streamed_ && streamed_->frame == newest
                                    : newest_given_ && *newest_given_ == newest;
  if (is_there && !is_keyframe_due()) return true;
  rest_if_congested();
  const bool has_path = uses_datagrams();
  if (!has_path) probe();
  const bool is_by_datagrams =
      !is_required && has_path && !wants_keyframe_ && is_recent(acknowledged_, *encoder.current());
  bool is_given = false;
  if (is_by_datagrams && !may_send(datagram_pacer_)) {
    ++counters_.frames_skipped;
    return false;
  }
  if (is_by_datagrams) is_given = give_by_datagrams(encoder);
  if (!is_given && (is_required || !is_stream_busy(encoder))) is_given = give_by_stream(encoder);
  ++(is_given ? counters_.frames_given : counters_.frames_skipped);
  return is_given;
}

void FrameFeed::give_beside(const FrameEncoder& encoder, const wire::SharedBytes& message) {
  if (uses_datagrams())
    send(BytesView(*message).subspan(wire::kHeaderBytes));
  else if (!is_stream_busy(encoder) && connections_.send(id_, message))
    counters_.bytes_queued += message->size();
}

void FrameFeed::note_given(Frame frame, pacing::FramePacer& pacer) {
  newest_given_ = frame;
  pacer.on_sent(frame, options_.clock_ns());
}

bool FrameFeed::is_recent(const step::SharedFrame& base, const step::PublishedFrame& frame) const {
  return base && frame.frame - base->frame <= options_.keyframe_after_frames;
}

bool FrameFeed::give_by_datagrams(FrameEncoder& encoder) {
  const auto& slices = encoder.slices_from(*acknowledged_);
  if (slices.empty()) return false;  // too large
  encoder.each_change_since(acknowledged_->epoch, [this](BytesView change) { send(change); });
  for (const auto* datagrams : {&slices, &encoder.state_parts()})
    for (const auto& datagram : *datagrams) send(datagram);
  ++counters_.frames_by_datagram;
  note_given(encoder.current()->frame, datagram_pacer_);
  return true;
}

void FrameFeed::send(BytesView datagram) {
  connections_.send_datagram(id_, datagram);
  counters_.bytes_queued += datagram.size();
  ++counters_.datagrams;
}

// Without datagrams a client has what the stream took. With them it may have been ahead of that: a
// frame of an epoch that is over is of no use to it.
const step::PublishedFrame* FrameFeed::stream_base(const step::PublishedFrame& frame) const {
  if (heard_ns_ && is_recent(acknowledged_, frame)) return acknowledged_.get();
  return is_recent(streamed_, frame) ? streamed_.get() : nullptr;
}

bool FrameFeed::give_by_stream(FrameEncoder& encoder) {
  const auto& frame = *encoder.current();
  const bool is_requested = is_keyframe_due();
  const auto* base = stream_base(frame);
  const bool is_keyframe = is_requested || base == nullptr;
  const auto& bytes = is_keyframe ? encoder.keyframe() : encoder.delta_from(*base);
  if (!connections_.send(id_, bytes)) return false;
  counters_.bytes_queued += bytes->size();
  streamed_ = encoder.current();
  note_given(frame.frame, stream_pacer_);
  if (is_keyframe) ++counters_.keyframes_given;
  if (is_requested) {
    wants_keyframe_ = false;
    last_requested_keyframe_ns_ = options_.clock_ns();
  }
  // Figures and tools: if they do not fit, the next frame brings newer ones.
  const auto& state = encoder.state();
  if (connections_.send(id_, state)) counters_.bytes_queued += state->size();
  return true;
}

void FrameFeed::probe() {
  const auto now = options_.clock_ns();
  if (!connections_.has_datagrams(id_) || now - probe_ns_ < kProbeIntervalNs) return;
  probe_ns_ = now;
  proto::Envelope envelope;
  envelope.mutable_datagram_probe()->set_padding(
      std::string(secure::kDatagramMessageBytes - kProbeOverheadBytes, '\0'));
  const auto bytes = envelope.SerializeAsString();
  connections_.send_datagram(id_, bytes_of(std::string_view(bytes)));
}

}  // namespace trocar::replication
