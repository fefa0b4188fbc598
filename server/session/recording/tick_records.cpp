#include "server/session/recording/tick_records.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "common/wire/tool_shape.h"
#include "proto/journal.pb.h"
#include "server/tissue/step/simulation.h"

namespace trocar::recording {
namespace {

Error bad(Tick tick, const char* what) {
  return {ErrorCode::BadFile, "tick " + std::to_string(tick) + ": " + what};
}

bool read_pose(const proto::ToolInput& message, Pose& pose) {
  const auto& p = message.position_m();
  const auto& q = message.orientation();
  pose = {{p.x(), p.y(), p.z()}, {q.x(), q.y(), q.z(), q.w()}};
  return is_finite(pose.position) && length_squared(pose.position) <= 4.0f &&
         std::abs(norm(pose.orientation) - 1.0f) <= 1e-3f;
}

}  // namespace

void to_message(const step::TickRecord& record, const step::TickDecisions* previous,
                proto::TickRecord& message) {
  message.set_tick(record.tick);
  message.set_state_hash(record.state_hash);
  const auto& d = record.decisions;
  if (!previous || *previous != d) {
    auto& decisions = *message.mutable_decisions();
    decisions.set_depth_limit(d.depth_limit);
    decisions.set_node_limit(d.node_limit);
    decisions.set_sweeps(d.sweeps);
    decisions.set_over_relaxation(d.over_relaxation);
    decisions.set_boundary(static_cast<std::uint32_t>(d.boundary));
    decisions.set_far_sweeps(d.far_sweeps);
    decisions.set_is_far_exact(d.is_far_exact);
    if (d.far_interval != 1) decisions.set_far_interval(d.far_interval);
    if (d.linger_ticks != step::TickDecisions{}.linger_ticks)
      decisions.set_linger_ticks(d.linger_ticks);
    if (d.waiting_tools != 0) decisions.set_waiting_tools(d.waiting_tools);
    if (d.layer_sweeps != step::TickDecisions{}.layer_sweeps)
      decisions.mutable_layer_sweeps()->Assign(d.layer_sweeps.begin(), d.layer_sweeps.end());
    const auto& p = d.policy;
    if (p != step::TickPolicy{}) {
      auto& policy = *decisions.mutable_policy();
      policy.set_steps_per_tick(p.steps_per_tick);
      policy.set_residual_tolerance_n(p.residual_tolerance_n);
      policy.set_max_sweeps(p.max_sweeps);
      policy.set_far_over_relaxation(p.far_over_relaxation);
      policy.set_has_no_self_contact(!p.has_self_contact);
    }
  }
  message.set_mark(static_cast<proto::MarkAction>(record.inputs.mark));
  message.set_mark_number(record.inputs.mark_number);
  if (const auto& handover = record.inputs.handover) {
    message.mutable_handover()->set_from(handover->from.value);
    message.mutable_handover()->set_to(handover->to.value);
  }
  for (const auto slot : record.inputs.leaves) message.add_leave()->set_slot(slot.value);
  for (const auto& join : record.inputs.joins) {
    auto& entry = *message.add_join();
    entry.set_slot(join.slot.value);
    for (int i = 0; i < join.tool_count; ++i) {
      const auto& shape = join.shapes[static_cast<std::size_t>(i)];
      wire::write(shape, *entry.add_tool());
    }
  }
  for (const auto& change : record.inputs.changes) {
    auto& entry = *message.add_change();
    entry.set_tool(change.tool.value);
    wire::write(change.shape, *entry.mutable_shape());
  }
  for (const auto& sample : record.inputs.samples) {
    auto& entry = *message.add_sample();
    entry.set_tool(sample.tool.value);
    const auto& pose = sample.sample.world_from_tool;
    entry.mutable_position_m()->set_x(pose.position.x);
    entry.mutable_position_m()->set_y(pose.position.y);
    entry.mutable_position_m()->set_z(pose.position.z);
    entry.mutable_orientation()->set_x(pose.orientation.x);
    entry.mutable_orientation()->set_y(pose.orientation.y);
    entry.mutable_orientation()->set_z(pose.orientation.z);
    entry.mutable_orientation()->set_w(pose.orientation.w);
    entry.set_verb(static_cast<proto::Verb>(sample.sample.verb));
  }
}

Status from_message(const proto::TickRecord& message, step::TickRecord& record) {
  record.tick = message.tick();
  record.state_hash = message.state_hash();
  record.inputs.clear();
  if (message.has_decisions()) {
    const auto& d = message.decisions();
    if (d.boundary() > static_cast<std::uint32_t>(world::Boundary::Whole))
      return bad(record.tick, "unknown boundary mode");
    record.decisions = {.depth_limit = d.depth_limit(),
                        .node_limit = d.node_limit(),
                        .sweeps = d.sweeps(),
                        .over_relaxation = d.over_relaxation(),
                        .boundary = static_cast<world::Boundary>(d.boundary()),
                        .far_sweeps = d.far_sweeps(),
                        .is_far_exact = d.is_far_exact(),
                        .far_interval = std::max(1u, d.far_interval()),
                        .linger_ticks = d.linger_ticks() > 0 ? d.linger_ticks()
                                                             : step::TickDecisions{}.linger_ticks,
                        .waiting_tools = d.waiting_tools()};
    if (d.has_policy())
      record.decisions.policy = {.steps_per_tick = d.policy().steps_per_tick(),
                                 .residual_tolerance_n = d.policy().residual_tolerance_n(),
                                 .max_sweeps = d.policy().max_sweeps(),
                                 .far_over_relaxation = d.policy().far_over_relaxation(),
                                 .has_self_contact = !d.policy().has_no_self_contact()};
    auto& layers = record.decisions.layer_sweeps;
    if (d.layer_sweeps_size() > static_cast<int>(layers.size()))
      return bad(record.tick, "layer_sweeps: more than three layers");
    std::ranges::copy(d.layer_sweeps(), layers.begin());
    if (auto valid = step::validate(record.decisions); !valid)
      return bad(record.tick, valid.error().message.c_str());
  }
  if (message.mark() < 0 || message.mark() > proto::MARK_RETURN)
    return bad(record.tick, "unknown mark");
  if (message.mark_number() >= hands::kMostMarks)
    return bad(record.tick, "mark_number: there are marks 0 to 3");
  record.inputs.mark = static_cast<hands::MarkAction>(message.mark());
  record.inputs.mark_number = static_cast<std::uint8_t>(message.mark_number());
  if (message.has_handover()) {
    const auto from = message.handover().from(), to = message.handover().to();
    if (from >= kMaxTools || to >= kMaxTools)
      return bad(record.tick, "handover: tool out of range");
    record.inputs.handover =
        hands::Handover{{static_cast<std::uint8_t>(from)}, {static_cast<std::uint8_t>(to)}};
  }
  for (const auto& leave : message.leave()) {
    if (leave.slot() >= kMaxHands) return bad(record.tick, "leave: slot out of range");
    record.inputs.leaves.push_back({static_cast<std::uint8_t>(leave.slot())});
  }
  for (const auto& entry : message.join()) {
    hands::HandJoin join{.slot = {static_cast<std::uint8_t>(entry.slot())},
                         .tool_count = entry.tool_size()};
    if (entry.slot() >= kMaxHands) return bad(record.tick, "join: slot out of range");
    if (join.tool_count < 1 || join.tool_count > kToolsPerHand)
      return bad(record.tick, "join: a hand has 1 or 2 tools");
    for (int i = 0; i < join.tool_count; ++i) {
      auto& shape = join.shapes[static_cast<std::size_t>(i)];
      shape = wire::read(entry.tool(i));
      if (!tool::is_valid(shape)) return bad(record.tick, "join: a tool has an impossible shape");
    }
    record.inputs.joins.push_back(join);
  }
  for (const auto& entry : message.change()) {
    if (entry.tool() >= kMaxTools) return bad(record.tick, "change: tool out of range");
    const auto shape = wire::read(entry.shape());
    if (!tool::is_valid(shape)) return bad(record.tick, "change: a tool has an impossible shape");
    record.inputs.changes.push_back({{static_cast<std::uint8_t>(entry.tool())}, shape});
  }
  for (const auto& entry : message.sample()) {
    hands::ToolInput input{.tool = {static_cast<std::uint8_t>(entry.tool())}};
    if (entry.tool() >= kMaxTools) return bad(record.tick, "sample: tool out of range");
    if (!read_pose(entry, input.sample.world_from_tool))
      return bad(record.tick, "sample: pose not finite, beyond 2 m or not a unit rotation");
    if (entry.verb() < 0 || entry.verb() >= tool::kVerbCount)
      return bad(record.tick, "sample: unknown verb");
    input.sample.verb = static_cast<tool::Verb>(entry.verb());
    record.inputs.samples.push_back(input);
  }
  return {};
}

}  // namespace trocar::recording
