#include "server/session/recording/frame_messages.h"

#include "common/wire/blood_codec.h"
#include "common/wire/surface_codec.h"
#include "common/wire/surface_messages.h"
#include "proto/journal.pb.h"
#include "server/session/recording/tick_records.h"
#include "server/session/replication/messages.h"

namespace trocar::recording {
namespace {

using journal::JournalTopic;

constexpr Tick kKeyPeriod = 1000;

}  // namespace

Status FrameMessages::skip(const wire::SurfaceLayout* new_layout,
                           std::span<const std::shared_ptr<const wire::SurfaceChange>> changes) {
  has_baseline_ = false;
  has_decisions_ = false;
  if (new_layout != nullptr) layout_ = *new_layout;
  for (const auto& change : changes)
    if (auto s = wire::apply(*change, layout_); !s) return s;
  return {};
}

Status FrameMessages::write(const step::PublishedFrame& frame, const participants::Roster& roster,
                            MessageSink& sink) {
  proto::TickBatch batch;
  for (const auto& record : frame.records) {
    to_message(record, has_decisions_ ? &last_decisions_ : nullptr, *batch.add_record());
    last_decisions_ = record.decisions;
    has_decisions_ = true;
  }
  if (auto s = sink.write(JournalTopic::TickBatch, batch); !s) return s;
  if (auto s = write_surfaces(frame, sink); !s) return s;
  if (!frame.claim_events.empty()) {
    proto::ClaimLog claims;
    for (const auto& event : frame.claim_events)
      replication::describe(event, roster, *claims.add_event());
    if (auto s = sink.write(JournalTopic::Claims, claims); !s) return s;
  }
  proto::FrameState state;
  replication::describe(frame, state);
  for (const auto& tool : state.tool())
    if (auto s = sink.write(tool); !s) return s;
  return sink.write(JournalTopic::FrameState, state);
}

Status FrameMessages::write_surfaces(const step::PublishedFrame& frame, MessageSink& sink) {
  if (frame.new_layout) {
    layout_ = *frame.new_layout;
    has_baseline_ = false;
  }
  if (frame.change) {
    if (auto s = wire::apply(*frame.change, layout_); !s) return s;
    proto::SurfaceChange message;
    wire::write(*frame.change, layout_, message);
    if (auto s = sink.write(JournalTopic::TopologyChange, message); !s) return s;
  }
  const bool has_key = !has_baseline_ || frame.tick - last_key_tick_ >= kKeyPeriod;
  if (has_baseline_) {
    if (auto s = write_surface(frame, false, sink); !s) return s;
  }
  if (!has_key) return {};
  last_key_tick_ = frame.tick;
  if (layout_.epoch > 0) {
    proto::SurfaceTopology topology;
    wire::write(layout_, organ_name_, topology);
    if (auto s = sink.write(JournalTopic::Topology, topology); !s) return s;
  }
  return write_surface(frame, true, sink);
}

Status FrameMessages::write_surface(const step::PublishedFrame& frame, bool is_keyframe,
                                    MessageSink& sink) {
  proto::SurfaceFrame message;
  message.set_frame(frame.frame);
  message.set_tick(frame.tick);
  message.set_epoch(frame.epoch);
  message.set_is_keyframe(is_keyframe);
  message.set_surface_crc(frame.surface_crc);
  Bytes payload;
  if (is_keyframe) {
    wire::encode_keyframe(frame.surface, payload);
  } else {
    message.set_base_frame(baseline_frame_);
    baseline_.resize(frame.surface.size());  // zeros for new vertices
    wire::encode_delta(baseline_, frame.surface, payload);
  }
  message.set_payload(payload.data(), payload.size());
  if (!frame.blood.empty()) {
    Bytes blood;
    wire::encode_blood(is_keyframe ? BytesView() : BytesView(blood_baseline_), frame.blood, blood);
    message.set_blood(blood.data(), blood.size());
    message.set_blood_crc(frame.blood_crc);
    blood_baseline_.assign(frame.blood.begin(), frame.blood.end());
  }
  baseline_.assign(frame.surface.begin(), frame.surface.end());
  baseline_frame_ = frame.frame;
  has_baseline_ = true;
  return sink.write(is_keyframe ? JournalTopic::SurfaceKey : JournalTopic::SurfaceDelta, message);
}

}  // namespace trocar::recording
