#include "client/replica/replica.h"

#include <algorithm>

#include "client/replica/message_parts.h"
#include "common/base/log.h"
#include "common/base/version.h"
#include "common/wire/figure_messages.h"
#include "common/wire/surface_codec.h"
#include "common/wire/surface_messages.h"
#include "common/wire/tool_shape.h"
#include "proto/wire.pb.h"

namespace trocar::replica {
namespace {

// A jump in time this large is a seek, not a late frame.
constexpr Tick kSeekTicks = 1000;

Pose to_pose(const proto::Vec3& position, const proto::Quat& orientation) {
  const Quatf q{orientation.x(), orientation.y(), orientation.z(), orientation.w()};
  const float length = norm(q);
  return {to_vec3(position), length > 0.5f ? normalized(q) : Quatf{}};
}

// Run lengths to one region per vertex; false if they do not cover the surface exactly.
bool expand_regions(const proto::FrameState& message, std::vector<std::uint16_t>& regions) {
  if (message.region_runs_size() % 2 != 0) return false;
  std::size_t at = 0;
  for (int i = 0; i < message.region_runs_size(); i += 2) {
    const std::size_t count = message.region_runs(i + 1);
    if (count > regions.size() - at) return false;
    std::fill_n(
        regions.begin() + static_cast<std::ptrdiff_t>(at), count,
        static_cast<std::uint16_t>(std::min<std::uint32_t>(message.region_runs(i), 0xffff)));
    at += count;
  }
  std::fill(regions.begin() + static_cast<std::ptrdiff_t>(at), regions.end(), std::uint16_t{0});
  return true;
}

}  // namespace

Replica::Replica(Send send) : send_(std::move(send)) {}
Replica::~Replica() = default;

void Replica::fail(std::string what) {
  if (fault_.ok()) fault_ = Error{ErrorCode::BadMessage, std::move(what)};
}

void Replica::on_message(const proto::Envelope& message, std::uint64_t arrival_ns,
                         std::size_t bytes) {
  counters_.bytes += bytes;
  if (!fault_.ok()) return;
  if (const auto taken = told_.take(message, arrival_ns); !taken)
    return fail(taken.error().message);
  switch (message.message_case()) {
    case proto::Envelope::kWelcome:
      return apply_welcome(message.welcome());
    case proto::Envelope::kSurfaceTopology:
      return apply_topology(message.surface_topology());
    case proto::Envelope::kSurfaceChange:
      return apply_change(message.surface_change(), bytes);
    case proto::Envelope::kFineSurfacePart:
      return apply_fine_surface(message.fine_surface_part());
    case proto::Envelope::kSurfaceFrame:
      return apply_surface(message.surface_frame(), arrival_ns);
    case proto::Envelope::kSurfaceSlice:
      return apply_slice(message.surface_slice(), arrival_ns);
    case proto::Envelope::kFrameState:
      return apply_state(message.frame_state());
    case proto::Envelope::kFrameStatePart:
      return apply_state_part(message.frame_state_part());
    case proto::Envelope::kBarrier:
      barrier_ = BarrierOutcome{message.barrier().frame(), message.barrier().surface_crc(), 0};
      barrier_answered_ = false;
      return answer_barrier();
    default:
      return;  // told_ has it; or a newer minor version's message, or the source's own business
  }
}

void Replica::apply_welcome(const proto::Welcome& message) {
  if (message.protocol_major() != kProtocolMajor)
    return fail("the server speaks protocol " + std::to_string(message.protocol_major()) +
                ", this client " + std::to_string(kProtocolMajor) + ": use the same release");
  if (message.ticks_per_frame() != kTicksPerFrame || message.tick_us() != 1000)
    return fail("Welcome: tick_us and ticks_per_frame must be 1000 and 16");
  has_datagrams_ = message.has_datagrams();
  if (message.participant() < kMaxParticipants)
    own_slot_.value = static_cast<std::uint8_t>(message.participant());
  if (++welcome_count_ > 1) begin_anew();
}

// Forgets what was asked for, and what came before the next topology.
void Replica::begin_anew() {
  request_pending_ = false;
  surface_.forget_waiting();
  if (sync_state_ != SyncState::WaitingForTopology) sync_state_ = SyncState::WaitingForKeyframe;
  barrier_.reset();
}

void Replica::apply_topology(const proto::SurfaceTopology& message) {
  auto layout = wire::read(message);
  if (!layout.ok()) return fail(layout.error().message);
  surface_.begin(std::move(*layout), message.organ_name());
  assembler_.clear();
  early_state_.reset();
  request_pending_ = false;
  if (sync_state_ == SyncState::WaitingForTopology) show_anew();
  if (sync_state_ != SyncState::Healing) sync_state_ = SyncState::WaitingForKeyframe;
}

void Replica::apply_change(const proto::SurfaceChange& message, std::size_t bytes) {
  if (sync_state_ == SyncState::WaitingForTopology) return;
  // Changes come by stream and as datagrams: each counts once, and what is missing is on its way.
  const bool is_known = message.epoch() <= surface_.layout().epoch;
  if (has_datagrams_ && (is_known || message.from_epoch() > surface_.layout().epoch)) return;
  const Status applied = surface_.apply(message);
  if (!applied.ok()) {
    if (sync_state_ == SyncState::Healing) return;  // the topology is on its way
    ++counters_.change_mismatches;
    log::warn("{}; asking for the whole surface", applied.error().message);
    return need_keyframe(history_.empty() ? 0 : history_.back().frame);
  }
  ++counters_.surface_changes;
  counters_.change_bytes += bytes;
}

void Replica::apply_fine_surface(const proto::FineSurfacePart& message) {
  const auto is_whole = fine_parts_.add(message);
  if (!is_whole.ok()) return fail(is_whole.error().message);
  if (!*is_whole) return;
  auto surface = std::make_shared<const wire::FineSurface>(fine_parts_.take());
  // Who comes back gets the same again.
  if (fine_surface_ == nullptr || *fine_surface_ != *surface) fine_surface_ = std::move(surface);
}

void Replica::show_anew() {
  surface_.show();
  history_.clear();
  ++history_version_;
}

void Replica::extend_history(const wire::QuantisedSurface& surface) {
  for (SessionFrame& frame : history_) {
    auto& known = frame.surface;
    for (const wire::SurfaceChange& change : surface_.waiting())
      for (const wire::NewVertex& vertex : change.new_vertices)
        known.push_back(vertex.has_parents()
                            ? wire::between(known[vertex.a.value], known[vertex.b.value], vertex.t)
                            : surface[known.size()]);
    if (!frame.blood.empty()) frame.blood.resize(known.size(), 0);
  }
}

Replica::Base Replica::find_base(Frame frame) const {
  if (!history_.empty() && history_.back().frame == frame)
    return {&history_.back().surface, &history_.back().blood};
  const auto* kept = assembler_.find(frame);
  return kept != nullptr ? Base{&kept->surface, &kept->blood} : Base{};
}

bool Replica::decode_blood(const proto::SurfaceFrame& message, const wire::BloodLevels& base) {
  scratch_blood_.clear();
  if (!message.has_blood()) return true;
  scratch_blood_ = base;
  scratch_blood_.resize(surface_.layout().vertex_count(), 0);  // dry, as on the server
  const auto payload = bytes_of(std::string_view(message.blood()));
  return wire::decode_blood(payload, scratch_blood_).ok() &&
         wire::blood_crc(scratch_blood_) == message.blood_crc();
}

bool Replica::decode_surface(const proto::SurfaceFrame& message) {
  Bytes payload(message.payload().begin(), message.payload().end());
  if (!message.is_keyframe() && ++deltas_seen_ == corrupt_at_ && !payload.empty())
    payload[payload.size() / 2] ^= 0x10u;
  if (message.is_keyframe()) {
    scratch_.assign(surface_.layout().vertex_count(), {});
    if (!wire::decode_keyframe(payload, scratch_).ok() || !decode_blood(message, {})) return false;
  } else {
    const Base base = find_base(message.base_frame());
    if (!decode_blood(message, *base.blood)) return false;
    scratch_ = *base.surface;
    scratch_.resize(surface_.layout().vertex_count());  // zeros, as on the server
    if (!wire::decode_delta(payload, scratch_).ok()) return false;
  }
  return wire::surface_crc(scratch_) == message.surface_crc();
}

// Datagrams have brought a newer frame, or a change of the surface that comes after it.
bool Replica::is_overtaken(const proto::SurfaceFrame& message) const {
  if (!has_datagrams_) return false;
  if (message.epoch() < surface_.layout().epoch) return true;
  return sync_state_ == SyncState::InStep && message.frame() <= history_.back().frame;
}

void Replica::apply_surface(const proto::SurfaceFrame& message, std::uint64_t arrival_ns) {
  if (sync_state_ == SyncState::WaitingForTopology) return;
  if (request_pending_) need_keyframe(message.frame());
  if (!message.is_keyframe() && sync_state_ != SyncState::InStep) {
    ++counters_.deltas_ignored;
    return;
  }
  if (is_overtaken(message)) {
    ++counters_.frames_late;
    return;
  }
  // A keyframe of an unknown epoch is as good as none: its topology has to come first.
  if (message.epoch() != surface_.layout().epoch ||
      (!message.is_keyframe() && find_base(message.base_frame()).surface == nullptr)) {
    ++counters_.base_mismatches;
    return need_keyframe(message.frame());
  }
  if (!decode_surface(message)) {
    ++counters_.crc_mismatches;
    return need_keyframe(message.frame());
  }
  accept_frame({.frame = message.frame(),
                .tick = message.tick(),
                .epoch = message.epoch(),
                .surface_crc = message.surface_crc(),
                .bleeds = message.has_blood(),
                .blood_crc = message.blood_crc(),
                .server_time_us = message.server_time_us(),
                .is_keyframe = message.is_keyframe(),
                .payload_bytes = message.payload().size()},
               arrival_ns);
}

// A slice of another epoch is dropped: its change is still under way by the stream, or it is late.
void Replica::apply_slice(const proto::SurfaceSlice& message, std::uint64_t arrival_ns) {
  if (sync_state_ != SyncState::InStep || message.epoch() != surface_.layout().epoch) return;
  if (message.frame() <= history_.back().frame) return;
  auto whole = assembler_.add(message, surface_.layout().vertex_count());
  if (!whole) return;
  scratch_ = std::move(whole->surface);
  scratch_blood_ = std::move(whole->blood);
  if (++deltas_seen_ == corrupt_at_) scratch_.front().x ^= 1;
  const bool has_right_blood =
      !whole->header.bleeds || wire::blood_crc(scratch_blood_) == whole->header.blood_crc;
  if (wire::surface_crc(scratch_) != whole->header.surface_crc || !has_right_blood) {
    ++counters_.crc_mismatches;
    return need_keyframe(message.frame());
  }
  ++counters_.by_datagram;
  accept_frame(whole->header, arrival_ns);
}

void Replica::apply_state_part(const proto::FrameStatePart& message) {
  if (sync_state_ != SyncState::InStep) return;
  const auto state = assembler_.add(message);
  if (!state) return;
  if (state->frame() <= history_.back().frame)
    apply_state(*state);
  else
    early_state_ = std::make_unique<proto::FrameState>(*state);
}

void Replica::accept_frame(const FrameHeader& header, std::uint64_t arrival_ns) {
  if (has_datagrams_) assembler_.keep(header.frame, scratch_, scratch_blood_);
  show_frame(header, arrival_ns);
  proto::Envelope ack;
  ack.mutable_frame_ack()->set_frame(history_.back().frame);
  ack.mutable_frame_ack()->set_surface_crc(surface_crc_);
  if (header.bleeds) ack.mutable_frame_ack()->set_blood_crc(header.blood_crc);
  send_(ack);  // the next one says the same
  if (early_state_ && early_state_->frame() <= header.frame) {
    apply_state(*early_state_);
    early_state_.reset();
  }
  if (barrier_ && !barrier_answered_) answer_barrier();
}

void Replica::show_frame(const FrameHeader& header, std::uint64_t arrival_ns) {
  if (surface_.is_new()) {
    show_anew();
  } else if (!surface_.waiting().empty()) {
    extend_history(scratch_);
    surface_.show();
  }
  ++counters_.frames;
  if (header.is_keyframe) {
    ++counters_.keyframes;
    if (sync_state_ == SyncState::Healing) ++counters_.healed;
    sync_state_ = SyncState::InStep;
    request_pending_ = false;
    if (!history_.empty() &&
        (header.tick <= history_.back().tick || header.tick - history_.back().tick > kSeekTicks)) {
      history_.clear();
      ++history_version_;
    }
  } else {
    counters_.delta_bytes += header.payload_bytes;
    const auto& before = history_.back().surface;
    for (std::size_t i = 0; i < scratch_.size(); ++i)
      counters_.changed_vertices += !(scratch_[i] == before[i]);
  }
  moved_.count(scratch_);
  SessionFrame next;
  if (history_.size() >= kHistoryFrames) {
    next = std::move(history_.front());  // its buffers are used again
    history_.pop_front();
  }
  next.frame = header.frame;
  next.tick = header.tick;
  next.arrival_ns = arrival_ns;
  next.server_time_us = header.server_time_us;
  next.surface = scratch_;
  next.blood = scratch_blood_;
  next.has_state = false;
  history_.push_back(std::move(next));
  surface_crc_ = header.surface_crc;
}

void Replica::need_keyframe(Frame frame) {
  if (sync_state_ == SyncState::Healing && !request_pending_) return;  // asked once already
  sync_state_ = SyncState::Healing;
  proto::Envelope request;
  request.mutable_keyframe_request()->set_frame(frame);
  request_pending_ = !send_(request);
}

void Replica::answer_barrier() {
  const SessionFrame* last = newest();
  if (sync_state_ == SyncState::InStep && last != nullptr && last->frame == barrier_->frame) {
    // Computed anew from the integers held, not copied from the frame's header.
    barrier_->own_crc = wire::surface_crc(last->surface);
    proto::Envelope ack;
    ack.mutable_frame_ack()->set_frame(barrier_->frame);
    ack.mutable_frame_ack()->set_surface_crc(barrier_->own_crc);
    if (!last->blood.empty()) ack.mutable_frame_ack()->set_blood_crc(wire::blood_crc(last->blood));
    barrier_answered_ = send_(ack);
  } else if (sync_state_ == SyncState::InStep && last != nullptr && last->frame < barrier_->frame) {
    need_keyframe(barrier_->frame);
  }
}

void Replica::apply_state(const proto::FrameState& message) {
  const auto found = std::ranges::find(history_, message.frame(), &SessionFrame::frame);
  if (found == history_.end()) return;  // its surface was ignored, or is not shown any more
  SessionFrame& frame = *found;
  frame.tools.clear();
  for (const auto& state : message.tool()) {
    if (state.tool() >= kMaxTools) return fail("FrameState.tool: slot out of range");
    Tool tool;
    tool.slot.value = static_cast<std::uint8_t>(state.tool());
    tool.world_from_tool = to_pose(state.position_m(), state.orientation());
    tool.verb = to_verb(state.verb());
    tool.force_n = to_vec3(state.force_n());
    if (!is_finite(tool.world_from_tool.position) || !is_finite(tool.force_n))
      return fail("FrameState.tool: position or force is not finite");
    tool.contact_nodes = state.contact_nodes();
    tool.penetration_m = state.penetration_m();
    tool.has_claim = state.has_claim();
    tool.is_silent = state.is_silent();
    tool.is_inside = state.is_inside();
    tool.torque_nm = to_vec3(state.torque_nm());
    tool.world_from_proxy = state.has_proxy_position_m()
                                ? to_pose(state.proxy_position_m(), state.proxy_orientation())
                                : tool.world_from_tool;
    if (!is_finite(tool.torque_nm) || !is_finite(tool.world_from_proxy.position))
      return fail("FrameState.tool: torque or proxy is not finite");
    frame.tools.push_back(tool);
  }
  std::ranges::sort(frame.tools, {}, &Tool::slot);
  frame.regions.resize(surface_.topology().rest_positions.size());
  if (!expand_regions(message, frame.regions))
    return fail("FrameState.region_runs: runs exceed the surface");
  auto figures = wire::read(message);
  if (!figures) return fail(figures.error().message);
  frame.figures = *figures;
  frame.threads = {};
  if (message.has_threads()) {
    auto threads = wire::decode_threads(bytes_of(std::string_view(message.threads())));
    if (!threads) return fail("FrameState." + threads.error().message);
    frame.threads = *std::move(threads);
  }
  frame.has_state = true;
}

std::optional<double> Replica::age_ms(double server_now_us) const {
  if (history_.empty() || history_.back().server_time_us == 0) return std::nullopt;
  return (server_now_us - static_cast<double>(history_.back().server_time_us)) * 1e-3;
}

}  // namespace trocar::replica
