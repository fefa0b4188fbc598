#include "tests/bench/our_session.h"

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"
#include "server/tissue/hands/sampling.h"

namespace trocar::bench {
namespace {

constexpr float kRampTicks = 150;

ToolSlot slot(std::size_t i) {
  return ToolSlot{static_cast<std::uint8_t>(i)};
}

}  // namespace

OurSession::OurSession(organ::Organ organ, std::span<const BenchTool> tools,
                       const SessionOptions& options)
    : simulation_(with_law(std::move(organ), options.law), options.threads),
      tools_(tools.begin(), tools.end()) {
  decisions_ = {.depth_limit = options.depth,
                .node_limit = options.nodes,
                .sweeps = options.sweeps,
                .boundary = options.boundary};
  if (options.is_whole) {
    decisions_.depth_limit = step::kMaxDepthLimit;
    decisions_.node_limit = step::kMaxNodeLimit;
    decisions_.boundary = Boundary::Graded;
  }
  TROCAR_ASSERT(step::validate(decisions_).ok());
  for (std::size_t i = 0; i < tools_.size(); i += kToolsPerHand) {
    hands::HandJoin join{.slot = slot(i).owner()};
    for (std::size_t k = 0; k < kToolsPerHand && i + k < tools_.size(); ++k) {
      join.shapes[k] = {
          .radius_m = tools_[i + k].radius_m, .length_m = 0.3f, .reach_m = tools_[i + k].reach_m};
      join.tool_count = static_cast<int>(k + 1);
    }
    inputs_.joins.push_back(join);
  }
}

// A triangle wave between 0.4 and 1 of the amplitude, so that contact is kept, every tool at its
// own phase; reached from rest in 0.15 s, so that no impact stands above the forces that are
// compared.
void OurSession::sample_tools() {
  const Tick tick = simulation_.current_tick();
  if (!hands::takes_samples(tick + 1)) return;
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    const BenchTool& tool = tools_[i];
    const float t = static_cast<float>(tick + 37 * i) * 4e-3f;
    const float wave = 1.0f - 0.6f * std::abs(std::fmod(t, 2.0f) - 1.0f);
    const float moved =
        tool.amplitude_m * wave * std::min(1.0f, static_cast<float>(tick) / kRampTicks);
    const float out = tool.grasps ? moved : -moved;
    inputs_.samples.push_back({slot(i),
                               {{tool.place + tool.outward * out, rotation_from_z(tool.outward)},
                                tool.grasps ? tool::Verb::Grasp : tool::Verb::Push}});
  }
}

TickTimes OurSession::tick() {
  sample_tools();
  report_ = simulation_.tick(inputs_, decisions_);
  inputs_.clear();
  if (const auto frame = simulation_.pop_frame())
    for (const auto& tool : frame->tools) forces_.push_back(tool.force_n);
  const auto seconds = [&](step::Stage stage) {
    return 1e-9 * report_.stage_cpu_ns[static_cast<std::size_t>(stage)];
  };
  return {
      seconds(step::Stage::Admit) + seconds(step::Stage::Contacts), seconds(step::Stage::Queue),
      seconds(step::Stage::Solve),
      seconds(step::Stage::Claims) + seconds(step::Stage::Hash) + seconds(step::Stage::Publish)};
}

std::size_t OurSession::state_bytes() const {
  Bytes snapshot;
  simulation_.write_snapshot(snapshot);
  return snapshot.size();
}

TickCounts OurSession::counts() const {
  return {report_.near.queue_nodes, report_.near.active_nodes, report_.contact.nodes,
          report_.faults};
}

}  // namespace trocar::bench
