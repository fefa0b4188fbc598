#include "server/tissue/step/thread_stage.h"

#include <algorithm>

namespace trocar::step {
namespace {

static_assert(wire::kMostThreads == thread::kMostThreads &&
              wire::kMostThreadPegs == thread::kMostPegs &&
              wire::kMostThreadNodes == thread::kMostNodes &&
              wire::kLeastThreadNodes == thread::kLeastNodes &&
              wire::kThreadMaterials == thread::kMaterialNames.size() &&
              wire::kThreadMetres == static_cast<float>(thread::kContactM));

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

bool holds_thread(const thread::Threads& threads, ToolSlot slot) {
  return std::ranges::find(threads.holds.tools, slot) != threads.holds.tools.end();
}

// A silent tool keeps what it holds for a while, as a grasp of tissue is kept.
bool is_there(const State& state, ToolSlot slot) {
  const auto& tool = state.tools[slot];
  if (!tool.has_sample) return false;
  const Tick silent = state.world.tick - tool.last_sample_tick;
  return silent <= (holds_thread(*state.threads, slot) ? hands::kAbandonTicks : hands::kLeaseTicks);
}

// Who holds the nearest thread within reach of these jaws; invalid: nobody.
ToolSlot holder_in_reach(const thread::ToolNow& tool, const thread::Threads& threads) {
  const double reach = std::min(thread::kTakesM, static_cast<double>(tool.shape.reach_m));
  double least = reach * reach;
  ToolSlot holder;
  for (std::size_t k = 0; k < threads.holds.nodes.size(); ++k) {
    const auto& place = threads.places_m[threads.holds.nodes[k]];
    const double distance = length_squared(place - to_double(tool.pose.position));
    if (!(distance < least)) continue;
    least = distance;
    holder = threads.holds.tools[k];
  }
  return holder;
}

}  // namespace

ThreadWork::ThreadWork(const thread::Rules& rules) : step(rules) {
  tools.reserve(kMaxTools);
  for (const auto& rule : rules.threads)
    picture.threads.push_back({static_cast<std::uint32_t>(thread::nodes_along(rule.path_m).size()),
                               static_cast<std::uint8_t>(rule.material)});
  for (const auto& peg : rules.pegs)
    picture.pegs.push_back({wire::quantised_place(peg.from_m), wire::quantised_place(peg.to_m),
                            wire::quantised_place({peg.radius_m, 0, 0}).x});
}

void move_threads(State& state, ThreadWork& work) {
  auto& threads = *state.threads;
  work.tools.clear();
  for (std::uint8_t i = 0; i < kMaxTools; ++i)
    if (is_there(state, ToolSlot{i})) work.tools.push_back(tool_now(state, ToolSlot{i}));
  const double time_s =
      static_cast<double>(state.world.tick) / static_cast<double>(kTicksPerSecond);
  work.report = work.step.run(work.tools, time_s, threads);
  work.grips = {};
  for (const auto& tool : work.tools) {
    auto& grip = work.grips[tool.tool.value];
    grip.is_held = holds_thread(threads, tool.tool);
    if (!grip.is_held && tool.verb == tool::Verb::Grasp)
      grip.holder = holder_in_reach(tool, threads);
  }
}

std::span<const hands::ThreadGrip> thread_grips(const ThreadWork* work) {
  if (work == nullptr) return {};
  return work->grips;
}

void publish_threads(const thread::Threads& threads, ThreadWork& work, PublishedFrame& frame) {
  for (auto& tool : frame.tools) {
    const auto& pull = work.step.pull(tool.tool);
    tool.force_n += to_float(pull.force_n);
    tool.torque_nm += to_float(pull.torque_nm);
  }
  auto& picture = work.picture;
  picture.places.clear();
  for (const auto& place : threads.places_m) picture.places.push_back(wire::quantised_place(place));
  picture.is_joined = threads.is_joined;
  wire::encode_threads(picture, frame.threads);
}

}  // namespace trocar::step
