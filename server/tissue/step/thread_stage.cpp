#include "server/tissue/step/thread_stage.h"

namespace trocar::step {
namespace {

Pose pose_of(const State& state, ToolSlot slot) {
  if (state.proxies[slot].is_placed) return state.proxies[slot].pose;
  return state.grasps[slot].is_behind ? state.grasps[slot].jaws : state.tools[slot].pose;
}

thread::ToolNow tool_now(const State& state, ToolSlot slot) {
  const auto& tool = state.tools[slot];
  const auto edge = hands::edge_of(tool);
  return {.tool = slot,
          .shape = tool.shape,
          .verb = tool.verb,
          .pose = pose_of(state, slot),
          .edge_m = {to_double(edge[0]), to_double(edge[1])},
          .can_cut = hands::can_cut(tool)};
}

}  // namespace

void move_threads(State& state, ThreadWork& work) {
  work.tools.clear();
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    const auto& tool = state.tools[ToolSlot{i}];
    const bool is_silent = state.world.tick - tool.last_sample_tick > hands::kLeaseTicks;
    if (tool.has_sample && !is_silent) work.tools.push_back(tool_now(state, ToolSlot{i}));
  }
  const double time_s =
      static_cast<double>(state.world.tick) / static_cast<double>(kTicksPerSecond);
  work.report = work.step.run(work.tools, time_s, *state.threads);
}

void add_pulls(const ThreadWork& work, PublishedFrame& frame) {
  for (auto& tool : frame.tools) {
    const auto& pull = work.step.pull(tool.tool);
    tool.force_n += to_float(pull.force_n);
    tool.torque_nm += to_float(pull.torque_nm);
  }
}

}  // namespace trocar::step
