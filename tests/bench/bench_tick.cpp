// CPU time of every stage of a tick: the built-in liver with three hands, with 1,200 nodes in the
// queue and the rest still, and as sessions are by default. The state hash beside the times says
// that it is the same work.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <cstdio>

#include "common/base/program.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/step/simulation.h"

namespace trocar {
namespace {

constexpr const char* kProgram = "bench_tick";
constexpr Tick kTicks = 6000;
constexpr Tick kWarmUp = 1000;
constexpr std::uint8_t kHands = 3;

// A surface node of the organ that lies farthest along `direction` and is not fixed.
Vec3f extreme(const step::Simulation& simulation, const Vec3f& direction) {
  const auto& world = simulation.state().world;
  Vec3f best;
  float farthest = -INFINITY;
  for (const auto node : world.surface_nodes) {
    const Vec3f p = world.rest_positions[node.value];
    if (world.node_classes[node.value] == world::NodeClass::Fixed || dot(p, direction) < farthest)
      continue;
    farthest = dot(p, direction);
    best = p;
  }
  return best;
}

float percentile(std::vector<std::uint32_t>& ns, double share) {
  const auto at =
      ns.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(ns.size() - 1));
  std::nth_element(ns.begin(), at, ns.end());
  return static_cast<float>(*at) * 1e-3f;
}

int run(const char* title, material::ElasticLaw law, const step::TickDecisions& decisions) {
  auto liver = catalogue::make_liver();
  if (!liver) return report(kProgram, liver.error());
  liver->material.elastic_law = law;
  step::Simulation simulation(std::move(*liver));
  const std::array<Vec3f, kHands> directions{
      Vec3f{0, -1, 0.9f}, {-0.5f, -0.4f, 1}, {0.6f, -0.2f, 1}};
  std::array<Vec3f, kHands> places;
  hands::TickInputs inputs;
  for (std::uint8_t hand = 0; hand < kHands; ++hand) {
    places[hand] = extreme(simulation, directions[hand]);
    hands::HandJoin join{.slot = {hand}};
    join.shapes[0] = {.radius_m = 0.008f, .length_m = 0.3f, .reach_m = 0.016f};
    inputs.joins.push_back(join);
  }

  std::array<std::vector<std::uint32_t>, step::kStageCount> stages;
  std::vector<std::uint32_t> totals;
  std::uint64_t active = 0, queued = 0;
  for (Tick tick = 1; tick <= kTicks; ++tick) {
    const float t = static_cast<float>(tick) * 1e-3f;
    const float swing = 1.0f - std::abs(std::fmod(t, 2.0f) - 1.0f);  // 0 .. 1 .. 0, period 2 s
    if (tick % 8 == 1)
      for (std::uint8_t hand = 0; hand < kHands; ++hand) {
        const Vec3f out = normalized(directions[hand], {0, 0, 1});
        const bool grasps = hand == 0;
        const Vec3f move =
            grasps ? Vec3f{0, 0.03f, 0.01f} * swing : out * (0.002f - 0.015f * swing);
        inputs.samples.push_back({tool_slot({hand}, 0),
                                  {{places[hand] + move, rotation_from_z(out)},
                                   grasps ? tool::Verb::Grasp : tool::Verb::Push}});
      }
    const auto& report = simulation.tick(inputs, decisions);
    inputs.clear();
    simulation.pop_frame();
    if (tick <= kWarmUp) continue;
    std::uint32_t total = 0;
    for (std::size_t s = 0; s < stages.size(); ++s) {
      total += report.stage_cpu_ns[s];
      if (report.stage_cpu_ns[s] > 0) stages[s].push_back(report.stage_cpu_ns[s]);
    }
    totals.push_back(total);
    active += report.near.active_nodes;
    queued += report.near.queue_nodes;
  }
  const auto& organ = simulation.organ();
  std::printf(
      "%s, %s: %zu nodes, %zu springs, %u sweeps; mean %.0f nodes in the queue, %.0f active\n",
      organ.name.c_str(), title, organ.mesh.node_count(), organ.mesh.spring_pairs().size(),
      decisions.sweeps, static_cast<double>(queued) / static_cast<double>(totals.size()),
      static_cast<double>(active) / static_cast<double>(totals.size()));
  std::printf("thread CPU time per tick, us %22s %10s\n", "median", "p99");
  for (std::size_t s = 0; s < stages.size(); ++s)
    std::printf("  %-36s %14.1f %10.1f\n", wire::name_of(static_cast<step::Stage>(s)),
                static_cast<double>(percentile(stages[s], 0.5)),
                static_cast<double>(percentile(stages[s], 0.99)));
  std::printf("  %-36s %14.1f %10.1f\n", "whole tick", static_cast<double>(percentile(totals, 0.5)),
              static_cast<double>(percentile(totals, 0.99)));
  std::printf("state hash after %" PRIu64 " ticks: %016" PRIx64 "\n", kTicks,
              simulation.state_hash());
  return 0;
}

}  // namespace
}  // namespace trocar

int main(int argc, char** argv) {
  trocar::begin_program(trocar::kProgram);
  CLI::App app{
      "CPU time of every stage of a tick: the built-in liver with three hands for 6 s, of springs\n"
      "and neo-Hookean, frozen beyond 1,200 nodes and graded. Takes about 10 s.",
      trocar::kProgram};
  CLI11_PARSE(app, argc, argv);
  using trocar::world::Boundary;
  const trocar::step::TickDecisions frozen{
      .depth_limit = 40, .node_limit = 1200, .boundary = Boundary::Frozen};
  using enum trocar::material::ElasticLaw;
  for (const auto& [law, name] : {std::pair{Springs, "springs"}, {NeoHookean, "neo-Hookean"}})
    for (const auto& [decisions, mode] : {std::pair{frozen, "frozen"}, {{}, "graded"}}) {
      const auto title = std::string(name) + ", " + mode;
      if (const int code = trocar::run(title.c_str(), law, decisions); code != 0) return code;
    }
  return 0;
}
