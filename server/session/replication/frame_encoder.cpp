#include "server/session/replication/frame_encoder.h"

#include "common/base/assert.h"
#include "common/base/timing.h"
#include "common/wire/surface_codec.h"
#include "proto/wire.pb.h"
#include "server/session/replication/messages.h"

namespace trocar::replication {
namespace {

wire::SharedBytes wrap(const step::PublishedFrame& frame, const step::PublishedFrame* baseline,
                       const Bytes& payload) {
  proto::Envelope envelope;
  auto& message = *envelope.mutable_surface_frame();
  message.set_frame(frame.frame);
  message.set_tick(frame.tick);
  message.set_epoch(frame.epoch);
  message.set_is_keyframe(baseline == nullptr);
  if (baseline) message.set_base_frame(baseline->frame);
  message.set_payload(payload.data(), payload.size());
  message.set_surface_crc(frame.surface_crc);
  return wire::encode_envelope(envelope);
}

}  // namespace

void FrameEncoder::set_current(step::SharedFrame frame) {
  current_ = std::move(frame);
  keyframe_.reset();
  state_.reset();
  deltas_.clear();
}

wire::SharedBytes FrameEncoder::keyframe() {
  TROCAR_ASSERT(current_);
  if (keyframe_) {
    ++statistics_.shared;
    return keyframe_;
  }
  const auto begin = thread_cpu_ns();
  Bytes payload;
  wire::encode_keyframe(current_->surface, payload);
  keyframe_ = wrap(*current_, nullptr, payload);
  statistics_.keyframe_cpu.add(thread_cpu_ns() - begin);
  return keyframe_;
}

wire::SharedBytes FrameEncoder::delta_from(const step::PublishedFrame& baseline) {
  TROCAR_ASSERT(current_ && baseline.surface.size() <= current_->surface.size());
  auto& cached = deltas_[baseline.frame];
  if (cached) {
    ++statistics_.shared;
    return cached;
  }
  const auto begin = thread_cpu_ns();
  Bytes payload;
  std::span<const wire::QuantisedVertex> from = baseline.surface;
  if (from.size() < current_->surface.size()) {
    extended_.assign(from.begin(), from.end());
    extended_.resize(current_->surface.size());
    from = extended_;
  }
  const auto report = wire::encode_delta(from, current_->surface, payload);
  statistics_.delta_cpu.add(thread_cpu_ns() - begin);
  cached = wrap(*current_, &baseline, payload);
  if (baseline.frame + 1 == current_->frame) {
    ++statistics_.deltas;
    statistics_.delta_payload_bytes += payload.size();
    statistics_.changed_vertices += report.changed_vertices;
  }
  typical_frame_bytes_ = cached->size() + state()->size();
  return cached;
}

wire::SharedBytes FrameEncoder::state() {
  TROCAR_ASSERT(current_);
  if (!state_) state_ = encode_frame_state(*current_);
  return state_;
}

}  // namespace trocar::replication
