#include "server/watch/follow/session_copy.h"

#include "common/wire/blood_codec.h"
#include "common/wire/surface_codec.h"
#include "common/wire/surface_messages.h"
#include "proto/wire.pb.h"

namespace trocar::follow {
namespace {

// A drawing has 2,048 points at most, and the server keeps to that.
constexpr int kMostStrokes = 4096;

}  // namespace

SessionCopy::SessionCopy() = default;
SessionCopy::~SessionCopy() = default;

Result<News> SessionCopy::take(const proto::Envelope& message, const wire::SharedBytes& framed) {
  switch (message.message_case()) {
    case proto::Envelope::kSurfaceTopology: {
      const auto taken = take_topology(message.surface_topology());
      if (!taken) return taken.error();
      topology_ = framed;
      return News::NewSurface;
    }
    case proto::Envelope::kSurfaceChange:
      return take_change(message.surface_change()) ? News::Event : News::Nothing;
    case proto::Envelope::kSurfaceFrame:
      return take_frame(message.surface_frame()) ? News::Frame : News::Nothing;
    case proto::Envelope::kFrameState:
      if (!has_frame() || message.frame_state().frame() != current_->frame) return News::Nothing;
      state_ = framed;
      return News::WholeFrame;
    case proto::Envelope::kParticipants:
      participants_ = framed;
      return News::Event;
    case proto::Envelope::kRecordingState:
      recording_ = framed;
      return News::Event;
    case proto::Envelope::kDrawing:
      take_drawing(message.drawing());
      return News::Event;
    case proto::Envelope::kFineSurfacePart:
      return take_fine_part(message.fine_surface_part(), framed);
    case proto::Envelope::kViewEvent:
      view_ = framed;
      return News::Fleeting;
    case proto::Envelope::kLessonStage:
      stage_ = framed;
      return News::Event;
    case proto::Envelope::kSessionPace:
      pace_ = framed;
      return News::Event;
    case proto::Envelope::kMarkList:
      marks_ = framed;
      return News::Event;
    case proto::Envelope::kPointEvent:
    case proto::Envelope::kLessonProgress:
      return News::Fleeting;
    case proto::Envelope::kTeachEvent:
      if (message.teach_event().action() == proto::TEACH_GIVE_VIEW ||
          message.teach_event().action() == proto::TEACH_END_VIEW)
        view_.reset();
      return News::Event;
    case proto::Envelope::kBarrier:
      last_frame_ = message.barrier().frame();
      return News::LastFrame;
    case proto::Envelope::kClaimEvent:
    case proto::Envelope::kMarkEvent:
      return News::Event;
    default:
      return News::Nothing;
  }
}

bool SessionCopy::needs_keyframe() {
  if (!wants_keyframe_ || has_asked_) return false;
  has_asked_ = true;
  return true;
}

void SessionCopy::acknowledge(proto::FrameAck& ack) const {
  ack.set_frame(static_cast<std::uint32_t>(current_->frame));
  ack.set_surface_crc(current_->surface_crc);
  if (!current_->blood.empty()) ack.set_blood_crc(current_->blood_crc);
}

void SessionCopy::lose_count() {
  current_ = nullptr;
  wants_keyframe_ = true;
}

Status SessionCopy::take_topology(const proto::SurfaceTopology& message) {
  auto layout = wire::read(message);
  if (!layout) return layout.error();
  layout_ = std::move(*layout);
  has_layout_ = true;
  organ_name_ = message.organ_name();
  kept_ = {};
  current_ = nullptr;
  return {};
}

bool SessionCopy::take_change(const proto::SurfaceChange& message) {
  if (!has_layout_) return false;
  const auto change = wire::read(message, layout_);
  const bool is_applied = change.ok() && wire::apply(*change, layout_).ok();
  topology_.reset();
  if (!is_applied) lose_count();
  return is_applied;
}

const step::PublishedFrame* SessionCopy::find(Frame frame) const {
  const auto& kept = kept_[frame % kKeptFrames];
  return kept && kept->frame == frame ? kept.get() : nullptr;
}

bool SessionCopy::take_frame(const proto::SurfaceFrame& message) {
  if (!has_layout_ || (!message.is_keyframe() && current_ == nullptr)) return false;
  auto next = std::make_shared<step::PublishedFrame>();
  const Bytes payload(message.payload().begin(), message.payload().end());
  bool is_decoded = false;
  if (message.epoch() == layout_.epoch && message.is_keyframe()) {
    next->surface.assign(layout_.vertex_count(), {});
    is_decoded =
        wire::decode_keyframe(payload, next->surface).ok() && take_blood(message, nullptr, *next);
  } else if (const auto* base = find(message.base_frame());
             base != nullptr && message.epoch() == layout_.epoch) {
    next->surface = base->surface;
    next->surface.resize(layout_.vertex_count());  // zeros, as on the server
    is_decoded =
        wire::decode_delta(payload, next->surface).ok() && take_blood(message, base, *next);
  }
  if (!is_decoded || wire::surface_crc(next->surface) != message.surface_crc()) {
    lose_count();
    return false;
  }
  next->frame = message.frame();
  next->tick = message.tick();
  next->epoch = message.epoch();
  next->surface_crc = message.surface_crc();
  next->blood_crc = message.blood_crc();
  server_time_us_ = message.server_time_us();
  current_ = std::move(next);
  kept_[current_->frame % kKeptFrames] = current_;
  wants_keyframe_ = has_asked_ = false;
  state_.reset();
  return true;
}

bool SessionCopy::take_blood(const proto::SurfaceFrame& message, const step::PublishedFrame* base,
                             step::PublishedFrame& next) {
  if (!message.has_blood()) return true;
  if (base != nullptr) next.blood = base->blood;
  next.blood.resize(next.surface.size(), 0);
  const auto payload = bytes_of(std::string_view(message.blood()));
  return wire::decode_blood(payload, next.blood).ok() &&
         wire::blood_crc(next.blood) == message.blood_crc();
}

void SessionCopy::take_drawing(const proto::Drawing& message) {
  if (!drawing_ || !message.is_addition())
    drawing_ = std::make_unique<proto::Drawing>(message);
  else if (drawing_->stroke_size() + message.stroke_size() <= kMostStrokes)
    drawing_->mutable_stroke()->MergeFrom(message.stroke());
  drawing_->set_is_addition(false);
}

// A session tells it once; so those who have been given some of it have them of this one.
Result<News> SessionCopy::take_fine_part(const proto::FineSurfacePart& message,
                                         const wire::SharedBytes& framed) {
  if (is_fine_whole_ || message.part() != fine_parts_.size())
    return Error{ErrorCode::BadMessage, "FineSurfacePart.part: does not follow"};
  const auto added = fine_order_.add(message);
  if (!added.ok()) return added.error();
  is_fine_whole_ = *added;
  fine_parts_.push_back(framed);
  return News::FinePart;
}

const wire::SharedBytes& SessionCopy::topology() {
  if (!topology_) {
    proto::Envelope envelope;
    wire::write(layout_, organ_name_, *envelope.mutable_surface_topology());
    topology_ = wire::encode_envelope(envelope);
  }
  return topology_;
}

std::vector<wire::SharedBytes> SessionCopy::all_but_frames() {
  std::vector<wire::SharedBytes> all;
  if (participants_) all.push_back(participants_);
  all.push_back(topology());
  if (recording_) all.push_back(recording_);
  if (drawing_) {
    proto::Envelope envelope;
    *envelope.mutable_drawing() = *drawing_;
    all.push_back(wire::encode_envelope(envelope));
  }
  for (const auto& kept : {pace_, marks_, stage_, view_})
    if (kept) all.push_back(kept);
  return all;
}

}  // namespace trocar::follow
