#include "tests/client/synthetic_source.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/base/assert.h"
#include "common/base/timing.h"
#include "common/base/version.h"
#include "common/wire/surface_codec.h"
#include "common/wire/surface_messages.h"

namespace trocar::testing {
namespace {

void put(proto::Vec3& out, const Vec3f& v) {
  out.set_x(v.x), out.set_y(v.y), out.set_z(v.z);
}
void put(proto::Quat& out, const Quatf& q) {
  out.set_x(q.x), out.set_y(q.y), out.set_z(q.z), out.set_w(q.w);
}

// A smooth bump: 1 at the centre, 0 beyond `radius`.
float bump(const Vec3f& p, const Vec3f& centre, float radius) {
  const float d = length(p - centre) / radius;
  return d < 1 ? (1 - d * d) * (1 - d * d) : 0.0f;
}

}  // namespace

wire::SurfaceLayout make_blob_layout(int rings, int segments, double radius_m) {
  wire::SurfaceLayout layout;
  std::vector<Vec3d> rest;
  const double pi = std::numbers::pi;
  rest.push_back({0, radius_m * 0.6, 0});
  for (int i = 1; i < rings; ++i)
    for (int j = 0; j < segments; ++j) {
      const double theta = pi * i / rings, phi = 2 * pi * j / segments;
      const double r = radius_m * (1 + 0.12 * std::sin(2 * phi) * std::sin(theta));
      rest.push_back({r * 1.5 * std::sin(theta) * std::cos(phi), 0.6 * r * std::cos(theta),
                      r * std::sin(theta) * std::sin(phi)});
    }
  rest.push_back({0, -radius_m * 0.6, 0});
  const auto at = [&](int i, int j) {
    return VertexIndex(1 + (i - 1) * segments + (j % segments));
  };
  const VertexIndex south(rest.size() - 1);
  for (int j = 0; j < segments; ++j) {
    layout.triangles.push_back({VertexIndex(0), at(1, j + 1), at(1, j)});
    for (int i = 1; i + 1 < rings; ++i) {
      layout.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j)});
      layout.triangles.push_back({at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)});
    }
    layout.triangles.push_back({at(rings - 1, j), at(rings - 1, j + 1), south});
  }
  layout.rest_quanta = wire::quantise_rest(rest);
  layout.is_wound.resize(layout.triangles.size());
  layout.triangle_sum = layout.compute_triangle_sum();
  for (std::size_t i = 0; i < rest.size(); ++i) layout.node_of_vertex.push_back(NodeIndex(i));
  return layout;
}

SyntheticSource::SyntheticSource(wire::SurfaceLayout layout, std::string organ_name)
    : layout_(std::move(layout)), organ_name_(std::move(organ_name)) {
  layout_.epoch = 1;
  follow_layout();
}

void SyntheticSource::follow_layout() {
  for (std::size_t i = rest_.size(); i < layout_.vertex_count(); ++i)
    rest_.push_back(wire::to_metres(layout_.rest_quanta[i]));
  surface_.resize(rest_.size());
  regions_.resize(rest_.size());
}

void SyntheticSource::queue_change(const wire::SurfaceChange& change) {
  const Status applied = wire::apply(change, layout_);
  TROCAR_ASSERT(applied.ok());
  follow_layout();
  proto::Envelope envelope;
  wire::write(change, layout_, *envelope.mutable_surface_change());
  queue(std::move(envelope));
}

void SyntheticSource::queue_topology() {
  proto::Envelope topology;
  wire::write(layout_, organ_name_, *topology.mutable_surface_topology());
  queue(std::move(topology));
  wants_keyframe_ = true;
  wants_topology_ = false;
}

void SyntheticSource::queue_start() {
  proto::Envelope welcome;
  welcome.mutable_welcome()->set_protocol_major(kProtocolMajor);
  welcome.mutable_welcome()->set_tick_us(1000);
  welcome.mutable_welcome()->set_ticks_per_frame(16);
  welcome.mutable_welcome()->set_participant(2);
  queue(std::move(welcome));

  queue_topology();

  proto::Envelope participants;
  const char* names[] = {"Dr. Ada", "Dr. Brook", "You", "Prof. Chen"};
  const proto::Role roles[] = {proto::ROLE_SURGEON, proto::ROLE_ASSISTANT, proto::ROLE_SURGEON,
                               proto::ROLE_INSTRUCTOR};
  for (std::uint32_t i = 0; i < 4; ++i) {
    auto& p = *participants.mutable_participants()->add_participant();
    p.set_slot(i < 3 ? i : kMaxHands);
    p.set_name(names[i]);
    p.set_role(roles[i]);
    if (i < 3) {
      auto& shape = *p.add_tool();
      shape.set_radius_m(0.005f), shape.set_length_m(0.3f), shape.set_reach_m(0.01f);
    }
  }
  queue(std::move(participants));
  wants_keyframe_ = true;
  has_started_ = true;
}

// Tool 0 grasps and lifts, tool 1 presses; both follow the surface vertices nearest to fixed
// points.
void SyntheticSource::deform() {
  const float time = 0.016f * static_cast<float>(frame_);
  Vec3f low = rest_[0], high = rest_[0];
  for (const Vec3f& p : rest_) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  const auto nearest = [&](const Vec3f& p) {
    return *std::ranges::min_element(rest_, {},
                                     [&](const Vec3f& q) { return length_squared(q - p); });
  };
  const Vec3f lift_at = nearest({0.6f * high.x, 0.2f * low.y, high.z});
  const Vec3f press_at = nearest({0.45f * low.x, high.y, 0.4f * high.z});
  const float lift = 0.014f * (1 - std::cos(1.3f * time));
  const float press = 0.009f * (1 - std::cos(1.7f * time));
  std::vector<Vec3f> displacement(rest_.size());
  for (std::size_t i = 0; i < rest_.size(); ++i) {
    const float up = bump(rest_[i], lift_at, 0.055f), down = bump(rest_[i], press_at, 0.045f);
    displacement[i] = Vec3f{0.2f, 0.9f, 0.6f} * (lift * up) + Vec3f{0, -1, -0.2f} * (press * down);
    if (also_move) displacement[i] += also_move(i, rest_[i]);
    regions_[i] = up > 0.01f ? 1 : down > 0.01f ? 2 : 0;
  }
  wire::quantise(displacement, surface_);
  tool_poses_[0] = {lift_at + Vec3f{0.2f, 0.9f, 0.6f} * lift + Vec3f{0, 0, 0.004f},
                    rotation_from_z(normalized(Vec3f{0.5f, 0.7f, 0.8f}, Vec3f{0, 0, 1}))};
  tool_poses_[1] = {press_at + Vec3f{0, -1, -0.2f} * press + Vec3f{0, 0.006f, 0},
                    rotation_from_z(normalized(Vec3f{-0.5f, 0.9f, 0.6f}, Vec3f{0, 0, 1}))};
}

proto::Envelope SyntheticSource::make_state() const {
  proto::Envelope envelope;
  auto& state = *envelope.mutable_frame_state();
  state.set_frame(frame_);
  state.set_tick(frame_ * kTicksPerFrame);
  const float time = 0.016f * static_cast<float>(frame_);
  const auto add = [&](std::uint32_t slot, const Pose& pose, proto::Verb verb, const Vec3f& force) {
    auto& tool = *state.add_tool();
    tool.set_tool(slot);
    put(*tool.mutable_position_m(), pose.position);
    put(*tool.mutable_orientation(), pose.orientation);
    tool.set_verb(verb);
    put(*tool.mutable_force_n(), force);
    tool.set_contact_nodes(verb == proto::VERB_NONE ? 0 : 7);
    tool.set_has_claim(verb != proto::VERB_NONE);
  };
  add(0, tool_poses_[0], proto::VERB_GRASP,
      Vec3f{-0.2f, -0.9f, -0.6f} * (1.6f * (1 - std::cos(1.3f * time))));
  add(2, tool_poses_[1], proto::VERB_PUSH,
      Vec3f{0, 1, 0.2f} * (1.1f * (1 - std::cos(1.7f * time))));
  if (has_mouse_)
    add(4, mouse_pose_, static_cast<proto::Verb>(mouse_verb_),
        mouse_verb_ ? Vec3f{0, 0.7f, 0.4f} : Vec3f{});
  for (std::size_t i = 0, begin = 0; i <= regions_.size(); ++i)
    if (i == regions_.size() || regions_[i] != regions_[begin]) {
      state.add_region_runs(regions_[begin]);
      state.add_region_runs(static_cast<std::uint32_t>(i - begin));
      begin = i;
    }
  state.set_active_nodes(1184);
  state.set_queue_nodes(903);
  state.set_region_count(2);
  state.set_tick_cpu_us(412);
  state.set_tick_cpu_p99_us(688);
  state.set_slow_ticks(3);
  auto& rate = *state.mutable_rate();
  rate.set_level(proto::RATE_REDUCED);
  for (const std::uint32_t sweeps : {4u, 3u, 2u, 1u}) rate.add_layer_sweeps(sweeps);
  rate.set_node_limit(1050);
  rate.set_budget_us(800);
  rate.set_predicted_us(742);
  rate.set_lowered(12);
  rate.set_raised(7);
  rate.set_time_rate(1);
  return envelope;
}

void SyntheticSource::queue_frame(bool as_keyframe) {
  if (wants_topology_) queue_topology();
  ++frame_;
  const auto baseline = surface_;
  deform();
  proto::Envelope envelope;
  auto& frame = *envelope.mutable_surface_frame();
  frame.set_frame(frame_);
  frame.set_tick(frame_ * kTicksPerFrame);
  frame.set_epoch(layout_.epoch);
  frame.set_surface_crc(wire::surface_crc(surface_));
  Bytes payload;
  if (as_keyframe || wants_keyframe_) {
    frame.set_is_keyframe(true);
    wire::encode_keyframe(surface_, payload);
    wants_keyframe_ = false;
  } else {
    frame.set_base_frame(frame_ - 1);
    wire::encode_delta(baseline, surface_, payload);
  }
  frame.set_payload(payload.data(), payload.size());
  queue(std::move(envelope));
  queue(make_state());
}

void SyntheticSource::poll(replica::MessageSink& sink) {
  const std::uint64_t now = monotonic_ns();
  if (is_real_time_ && state_ == replica::SourceState::Live) {
    if (!has_started_) {
      queue_start();
      start_ns_ = now;
    }
    while (frame_ < (now - start_ns_) / 16'000'000) {
      queue_frame();
      if (frame_ % 250 == 60) {
        proto::Envelope refused;
        auto& event = *refused.mutable_claim_event();
        event.set_tick(frame_ * kTicksPerFrame);
        event.set_tool(4);
        event.set_verb(proto::VERB_GRASP);
        event.set_outcome(proto::CLAIM_REFUSED_HELD);
        event.set_text("grasp refused: Dr. Ada holds this tissue");
        queue(std::move(refused));
      }
    }
  }
  auto messages = std::move(queued_);
  queued_.clear();
  for (auto& message : messages) {
    if (tamper && !tamper(message)) continue;
    const std::size_t bytes = message.ByteSizeLong() + 4;
    statistics_.bytes_received += bytes;
    ++statistics_.messages_received;
    if (message.has_surface_frame()) ++statistics_.frames_received;
    statistics_.round_trip_seconds = 0.0012;
    const std::uint64_t due = is_real_time_ && message.has_surface_frame()
                                  ? start_ns_ + message.surface_frame().frame() * 16'000'000ull
                                  : now;
    sink.on_message(message, due, bytes);
  }
}

bool SyntheticSource::send(const proto::Envelope& message) {
  if (message.has_keyframe_request() && answer_requests) wants_keyframe_ = wants_topology_ = true;
  if (message.has_tool_sample()) {
    const auto& sample = message.tool_sample();
    mouse_pose_ = {{sample.position_m().x(), sample.position_m().y(), sample.position_m().z()},
                   {sample.orientation().x(), sample.orientation().y(), sample.orientation().z(),
                    sample.orientation().w()}};
    mouse_verb_ = sample.verb();
    has_mouse_ = true;
  }
  sent.push_back(message);
  return true;
}

void SyntheticSource::close(const std::string& reason) {
  state_ = replica::SourceState::Closed;
  reason_ = {replica::CloseKind::Ended, reason};
}

}  // namespace trocar::testing
