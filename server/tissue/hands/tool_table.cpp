#include "server/tissue/hands/tool_table.h"

#include <algorithm>
#include <span>
#include <utility>

namespace trocar::hands {

namespace {

// A hand that is silent because it does not move says so at least this often.
constexpr Tick kKeepAliveTicks = 25;
constexpr float kLeastScissorsEdge_m = 0.00025f;  // half of it, where the blades part

// Times go as poses do. A hand that rests is where it was a millisecond later, too.
void move_time(Tool& tool, Tick tick) {
  if (tool.target_time_us == 0) return;
  if (tool.steps_left > 0)
    tool.time_us += (tool.target_time_us - tool.time_us) / tool.steps_left;
  else if (tick - tool.last_sample_tick <= kKeepAliveTicks)
    tool.time_us += 1000;
}

void move_blades(Tool& tool) {
  if (tool.shape.form != tool::Form::Scissors) return;
  const float way =
      tool.verb == tool::Verb::Cut ? 1 / kScissorsCloseTicks : -1 / kScissorsOpenTicks;
  tool.closed = std::clamp(tool.closed + way, 0.0f, 1.0f);
}

}  // namespace

std::array<Vec3f, 2> edge_of(const Tool& tool) {
  const float length = tool.shape.edge_m;
  switch (tool.shape.form) {
    case tool::Form::Scissors: {
      const float closed = length * tool.closed;
      const float half = std::max(0.5f * kScissorsOpening * closed, kLeastScissorsEdge_m);
      return {tool.pose.apply({0, -half, length - closed}),
              tool.pose.apply({0, half, length - closed})};
    }
    case tool::Form::Hook:
      return {tool.pose.position, tool.pose.apply({0, length, 0})};
    default:
      return {tool.pose.position, tool.pose.apply({0, 0, length})};
  }
}

Vec3f cut_line_of(const Tool& tool) {
  const float length = tool.shape.edge_m;
  return rotate(tool.pose.orientation,
                tool.shape.form == tool::Form::Hook ? Vec3f{0, length, 0} : Vec3f{0, 0, length});
}

std::uint32_t ToolTable::admit(const hands::TickInputs& inputs, Tick tick) {
  std::uint32_t dropped = 0;
  for (const auto slot : inputs.leaves) {
    const bool is_known = slot.has_tools() && tools_[tool_slot(slot, 0).value].is_present;
    if (!is_known) {
      ++dropped;
      continue;
    }
    for (int i = 0; i < kToolsPerHand; ++i) tools_[tool_slot(slot, i).value] = Tool{};
  }
  for (const auto& join : inputs.joins) dropped += admit_join(join, tick) ? 0 : 1;
  for (const auto& change : inputs.changes) dropped += admit_change(change, tick) ? 0 : 1;
  for (const auto& sample : inputs.samples) dropped += admit_sample(sample, tick) ? 0 : 1;

  for (auto& tool : tools_) {
    move_time(tool, tick);
    move_blades(tool);
    if (tool.steps_left == 0) continue;
    const float t = 1.0f / static_cast<float>(tool.steps_left);
    if (--tool.steps_left == 0) {
      tool.pose = tool.target;
    } else {
      tool.pose.position += (tool.target.position - tool.pose.position) * t;
      tool.pose.orientation = interpolate(tool.pose.orientation, tool.target.orientation, t);
    }
  }
  return dropped;
}

// Both have a tick without a sample of their new hands ahead of them, so their leases begin anew.
bool ToolTable::hand_over(const hands::Handover& handover, Tick tick) {
  const auto [from, to] = handover;
  if (!from.is_valid() || !to.is_valid() || from.owner() == to.owner()) return false;
  Tool& given = tools_[from.value];
  Tool& taken = tools_[to.value];
  if (!given.is_present || !taken.is_present) return false;
  std::swap(given, taken);
  for (Tool* tool : {&given, &taken}) {
    if (tool->verb == tool::Verb::Cut) tool->verb = tool::Verb::None;
    tool->last_sample_tick = tick;
    tool->time_us = tool->target_time_us = 0;
  }
  return true;
}

bool ToolTable::admit_join(const hands::HandJoin& join, Tick tick) {
  if (!join.slot.has_tools() || join.tool_count < 1 || join.tool_count > kToolsPerHand ||
      tools_[tool_slot(join.slot, 0).value].is_present)
    return false;
  const auto shapes = std::span(join.shapes).first(static_cast<std::size_t>(join.tool_count));
  if (!std::all_of(shapes.begin(), shapes.end(), tool::is_valid)) return false;
  for (int i = 0; i < join.tool_count; ++i)
    tools_[tool_slot(join.slot, i).value] = Tool{
        .is_present = true, .shape = shapes[static_cast<std::size_t>(i)], .last_sample_tick = tick};
  return true;
}

bool ToolTable::admit_change(const hands::ToolChange& change, Tick tick) {
  if (!change.tool.is_valid() || !tool::is_valid(change.shape)) return false;
  Tool& tool = tools_[change.tool.value];
  if (!tool.is_present) return false;
  tool = {.is_present = true, .shape = change.shape, .last_sample_tick = tick};
  return true;
}

bool ToolTable::admit_sample(const hands::ToolInput& input, Tick tick) {
  if (!input.tool.is_valid()) return false;
  Tool& tool = tools_[input.tool.value];
  if (!tool.is_present) return false;
  tool.target = input.sample.world_from_tool;
  tool.verb = tool::possible(tool.shape, input.sample.verb);
  tool.last_sample_tick = tick;
  // A clock that goes back is another one.
  if (!tool.has_sample || tool.time_us == 0 || input.client_time_us < tool.time_us)
    tool.time_us = input.client_time_us;
  tool.target_time_us = input.client_time_us;
  if (tool.has_sample) {
    tool.steps_left = kPoseTicks;
  } else {
    tool.has_sample = true;  // appears where it is; there is no path to walk
    tool.pose = tool.target;
  }
  return true;
}

void ToolTable::visit_state(world::StateArchive& archive) {
  for (auto& tool : tools_) {
    archive.flag(tool.is_present);
    archive.flag(tool.has_sample);
    archive.value(tool.shape.radius_m);
    archive.value(tool.shape.length_m);
    archive.value(tool.shape.reach_m);
    archive.value(tool.shape.half_width_m);
    archive.value(tool.shape.friction);
    archive.value(tool.shape.grip_n);
    archive.value(tool.shape.edge_m);
    archive.value(tool.shape.form);
    archive.value(tool.closed);
    archive.value(tool.verb);
    archive.value(tool.pose);
    archive.value(tool.target);
    archive.value(tool.steps_left);
    archive.value(tool.last_sample_tick);
    if (archive.is_reading() && tool.is_present &&
        (!tool::is_valid(tool.shape) || tool.verb > tool::Verb::Cut ||
         !(tool.closed >= 0 && tool.closed <= 1)))
      archive.fail();
  }
}

}  // namespace trocar::hands
