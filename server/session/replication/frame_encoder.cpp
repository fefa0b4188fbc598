#include "server/session/replication/frame_encoder.h"

#include "common/base/assert.h"
#include "common/base/timing.h"
#include "common/secure/datagram_channel.h"
#include "common/wire/blood_codec.h"
#include "common/wire/surface_codec.h"
#include "common/wire/surface_slices.h"
#include "proto/wire.pb.h"
#include "server/session/replication/messages.h"

namespace trocar::replication {
namespace {

// Numbers, tags and lengths around the bytes in a SurfaceSlice or FrameStatePart take less.
constexpr std::size_t kSliceOverheadBytes = 80, kPartOverheadBytes = 24;
constexpr std::size_t kMostParts = 16;

Bytes serialise(const proto::Envelope& envelope) {
  Bytes bytes(envelope.ByteSizeLong());
  envelope.SerializeToArray(bytes.data(), static_cast<int>(bytes.size()));
  TROCAR_ASSERT(bytes.size() <= secure::kDatagramMessageBytes);
  return bytes;
}

// Returns a FrameState without the envelope that is around it in `framed`.
std::string body_of_state(const Bytes& framed) {
  proto::Envelope envelope;
  const auto body = BytesView(framed).subspan(wire::kHeaderBytes);
  if (!wire::decode_envelope(body, envelope).ok()) return {};
  return envelope.frame_state().SerializeAsString();
}

}  // namespace

wire::SharedBytes FrameEncoder::wrap(const step::PublishedFrame* baseline,
                                     const Bytes& payload) const {
  const auto& frame = *current_;
  proto::Envelope envelope;
  auto& message = *envelope.mutable_surface_frame();
  message.set_frame(frame.frame);
  message.set_tick(frame.tick);
  message.set_epoch(frame.epoch);
  message.set_is_keyframe(baseline == nullptr);
  if (baseline) message.set_base_frame(baseline->frame);
  message.set_payload(payload.data(), payload.size());
  message.set_surface_crc(frame.surface_crc);
  message.set_server_time_us(server_time_us_);
  if (!frame.blood.empty()) {
    Bytes blood;
    wire::encode_blood(baseline ? BytesView(baseline->blood) : BytesView(), frame.blood, blood);
    message.set_blood(blood.data(), blood.size());
    message.set_blood_crc(frame.blood_crc);
  }
  return wire::encode_envelope(envelope);
}

void FrameEncoder::set_current(step::SharedFrame frame, std::uint64_t server_time_us,
                               wire::SharedBytes state) {
  current_ = std::move(frame);
  server_time_us_ = server_time_us;
  recent_[current_->frame % kRecentFrames] = current_;
  slices_.clear();
  state_parts_.clear();
  keyframe_.reset();
  state_ = std::move(state);
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
  keyframe_ = wrap(nullptr, payload);
  statistics_.keyframe_cpu.add(thread_cpu_ns() - begin);
  return keyframe_;
}

step::SharedFrame FrameEncoder::find(Frame frame) const {
  const auto& kept = recent_[frame % kRecentFrames];
  return kept && kept->frame == frame ? kept : nullptr;
}

std::span<const wire::QuantisedVertex> FrameEncoder::extend(const step::PublishedFrame& baseline) {
  if (baseline.surface.size() == current_->surface.size()) return baseline.surface;
  extended_.assign(baseline.surface.begin(), baseline.surface.end());
  extended_.resize(current_->surface.size());
  return extended_;
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
  const auto report = wire::encode_delta(extend(baseline), current_->surface, payload);
  statistics_.delta_cpu.add(thread_cpu_ns() - begin);
  cached = wrap(&baseline, payload);
  if (baseline.frame + 1 == current_->frame) {
    ++statistics_.deltas;
    statistics_.delta_payload_bytes += payload.size();
    statistics_.changed_vertices += report.changed_vertices;
  }
  typical_frame_bytes_ = cached->size() + state()->size();
  return cached;
}

const FrameEncoder::Datagrams& FrameEncoder::slices_from(const step::PublishedFrame& baseline) {
  TROCAR_ASSERT(current_ && baseline.surface.size() <= current_->surface.size());
  const auto [cached, is_new] = slices_.try_emplace(baseline.frame);
  if (!is_new) {
    ++statistics_.shared;
    return cached->second;
  }
  const auto begin = thread_cpu_ns();
  const auto slices = wire::encode_slices(extend(baseline), current_->surface,
                                          secure::kDatagramMessageBytes - kSliceOverheadBytes,
                                          {.baseline = baseline.blood, .current = current_->blood});
  for (std::size_t i = 0; i < slices.size(); ++i) {
    proto::Envelope envelope;
    auto& message = *envelope.mutable_surface_slice();
    message.set_frame(current_->frame);
    message.set_tick(current_->tick);
    message.set_epoch(current_->epoch);
    message.set_base_frame(baseline.frame);
    message.set_surface_crc(current_->surface_crc);
    message.set_slice(static_cast<std::uint32_t>(i));
    message.set_slices(static_cast<std::uint32_t>(slices.size()));
    message.set_first_vertex(slices[i].first_vertex);
    message.set_vertices(slices[i].vertices);
    message.set_payload(slices[i].payload.data(), slices[i].payload.size());
    message.set_server_time_us(server_time_us_);
    if (!current_->blood.empty()) {
      message.set_blood(slices[i].blood.data(), slices[i].blood.size());
      message.set_blood_crc(current_->blood_crc);
    }
    cached->second.push_back(serialise(envelope));
  }
  statistics_.slices_cpu.add(thread_cpu_ns() - begin);
  return cached->second;
}

const FrameEncoder::Datagrams& FrameEncoder::state_parts() {
  if (!state_parts_.empty()) return state_parts_;
  const auto whole = body_of_state(*state());
  const auto room = secure::kDatagramMessageBytes - kPartOverheadBytes;
  const auto parts = (whole.size() + room - 1) / room;
  if (parts > kMostParts) return state_parts_;  // the picture goes without figures and tools
  for (std::size_t i = 0; i < parts; ++i) {
    proto::Envelope envelope;
    auto& message = *envelope.mutable_frame_state_part();
    message.set_frame(current_->frame);
    message.set_part(static_cast<std::uint32_t>(i));
    message.set_parts(static_cast<std::uint32_t>(parts));
    message.set_state(whole.substr(i * room, room));
    state_parts_.push_back(serialise(envelope));
  }
  return state_parts_;
}

void FrameEncoder::add_change(std::uint32_t epoch, const wire::SharedBytes& framed) {
  const auto message = BytesView(*framed).subspan(wire::kHeaderBytes);
  if (message.size() > secure::kDatagramMessageBytes) {
    changes_.clear();  // those before it lead nowhere any more
    return;
  }
  changes_.push_back({epoch, Bytes(message.begin(), message.end())});
  if (changes_.size() > kRecentFrames) changes_.pop_front();
}

wire::SharedBytes FrameEncoder::state() {
  TROCAR_ASSERT(current_);
  if (!state_) state_ = encode_frame_state(*current_);
  return state_;
}

}  // namespace trocar::replication
