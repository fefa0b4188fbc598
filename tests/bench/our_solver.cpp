#include "tests/bench/our_solver.h"

#include <array>
#include <cmath>
#include <vector>

#include "common/base/assert.h"
#include "common/base/checksum.h"
#include "server/dynamics/block_descent.h"
#include "server/dynamics/spring_network.h"
#include "server/step/simulation.h"
#include "server/world/world.h"

namespace trocar::bench {

const char* name_of(Law law) {
  switch (law) {
    case Law::Springs:
      return "springs";
    case Law::LinearTets:
      return "linear tets";
    case Law::NeoHookean:
      return "neo-Hookean tets";
    case Law::NeoHookeanAveraged:
      return "neo-Hookean tets, averaged volume";
  }
  return "?";
}

scene::Organ with_law(scene::Organ organ, Law law) {
  auto& material = organ.material;
  material.elastic_law = law == Law::Springs      ? scene::ElasticLaw::Springs
                         : law == Law::LinearTets ? scene::ElasticLaw::TensorMass
                                                  : scene::ElasticLaw::NeoHookean;
  material.has_averaged_volume = law == Law::NeoHookeanAveraged;
  return organ;
}

const char* name_of(BoundaryMode mode) {
  return mode == BoundaryMode::Frozen ? "frozen" : "graded";
}

bool has(Law law) {
  return law == Law::Springs;
}
bool has_graded_mode() {
  return false;
}
std::uint32_t max_threads() {
  return 1;
}

struct OurSolver::Engine {
  Engine(const scene::Organ& organ, const SolverOptions& o)
      : springs(organ), world(organ), solver(world, springs) {
    settings = {.sweeps = o.sweeps,
                .over_relaxation = o.over_relaxation,
                .residual_tolerance_n = o.tolerance_n};
    for (std::uint32_t n = 0; n < world.node_count(); ++n)
      if (world.node_classes[n] != world::NodeClass::Fixed) {
        world.node_classes[n] = world::NodeClass::Active;
        free_nodes.push_back(NodeIndex(n));
      }
  }

  dynamics::SpringNetwork springs;
  world::World world;
  dynamics::BlockDescent solver;
  dynamics::SolveSettings settings;
  dynamics::SolveReport report;
  contact::ContactList no_contacts;
  std::vector<NodeIndex> free_nodes;
};

OurSolver::OurSolver(const scene::Organ& organ, const SolverOptions& options) {
  TROCAR_ASSERT(has(options.law) && options.threads <= max_threads());
  engine_ = std::make_unique<Engine>(organ, options);
}

OurSolver::~OurSolver() = default;

void OurSolver::step(std::span<const Vec3f> forces_n) {
  Engine& e = *engine_;
  ++e.world.tick;
  e.report = e.solver.solve(e.no_contacts, e.free_nodes, e.settings, e.world, {.forces = forces_n});
}

std::span<const Vec3f> OurSolver::displacements() const {
  return engine_->world.displacements;
}

std::uint64_t OurSolver::state_hash() const {
  StateHasher hasher;
  auto archive = world::StateArchive::hashing(hasher);
  engine_->world.visit_state(archive);
  return hasher.digest();
}

std::uint32_t OurSolver::last_sweeps() const {
  return engine_->report.sweeps;
}
float OurSolver::last_residual_n() const {
  return engine_->report.residual_n;
}

struct OurSession::Engine {
  Engine(scene::Organ organ, std::span<const BenchTool> t, const SessionOptions& o)
      : simulation(std::move(organ)), tools(t.begin(), t.end()) {
    decisions = {.depth_limit = o.depth, .node_limit = o.nodes, .sweeps = o.sweeps};
    for (std::size_t i = 0; i < tools.size(); i += kToolsPerHand) {
      session::HandJoin join{.slot = slot(i).owner()};
      for (std::size_t k = 0; k < kToolsPerHand && i + k < tools.size(); ++k) {
        join.shapes[k] = {
            .radius_m = tools[i + k].radius_m, .length_m = 0.3f, .reach_m = tools[i + k].reach_m};
        join.tool_count = static_cast<std::uint8_t>(k + 1);
      }
      inputs.joins.push_back(join);
    }
  }

  static ToolSlot slot(std::size_t i) { return ToolSlot{static_cast<std::uint8_t>(i)}; }

  // A triangle wave between 0.4 and 1 of the amplitude, so that contact is kept; every tool at its
  // own phase.
  void sample_tools(Tick tick) {
    for (std::size_t i = 0; i < tools.size(); ++i) {
      const BenchTool& tool = tools[i];
      const float t = static_cast<float>(tick + 37 * i) * 4e-3f;
      const float swing = 1.0f - 0.6f * std::abs(std::fmod(t, 2.0f) - 1.0f);
      // A grasp closes at rest and pulls later.
      const float pulled = tick == 0 ? 0 : tool.amplitude_m * swing;
      const float out = tool.grasps ? pulled : -tool.amplitude_m * swing;
      inputs.samples.push_back({slot(i),
                                {{tool.place + tool.outward * out, rotation_from_z(tool.outward)},
                                 tool.grasps ? scene::Verb::Grasp : scene::Verb::Push}});
    }
  }

  step::Simulation simulation;
  std::vector<BenchTool> tools;
  step::TickDecisions decisions;
  session::TickInputs inputs;
  step::TickReport report;
  std::vector<Vec3f> forces;
};

OurSession::OurSession(scene::Organ organ, std::span<const BenchTool> tools,
                       const SessionOptions& options) {
  TROCAR_ASSERT(has(options.law) && options.threads <= max_threads());
  TROCAR_ASSERT(options.mode == BoundaryMode::Frozen || has_graded_mode());
  engine_ = std::make_unique<Engine>(std::move(organ), tools, options);
}

OurSession::~OurSession() = default;

TickTimes OurSession::tick() {
  constexpr Tick kSampleTicks = 8;
  Engine& e = *engine_;
  if (e.simulation.current_tick() % kSampleTicks == 0) e.sample_tools(e.simulation.current_tick());
  e.report = e.simulation.tick(e.inputs, e.decisions);
  e.inputs.clear();
  if (const auto frame = e.simulation.take_frame())
    for (const auto& tool : frame->tools) e.forces.push_back(tool.force_n);
  const auto seconds = [&](step::Stage stage) {
    return 1e-9 * e.report.stage_cpu_ns[static_cast<std::size_t>(stage)];
  };
  return {
      seconds(step::Stage::Admit) + seconds(step::Stage::Contacts), seconds(step::Stage::Queue),
      seconds(step::Stage::Solve),
      seconds(step::Stage::Claims) + seconds(step::Stage::Hash) + seconds(step::Stage::Publish)};
}

TickCounts OurSession::counts() const {
  const auto& r = engine_->report;
  return {r.queue_nodes, r.active_nodes, r.contact_nodes, r.faults};
}

const std::vector<Vec3f>& OurSession::published_forces() const {
  return engine_->forces;
}

std::span<const Vec3f> OurSession::displacements() const {
  return engine_->simulation.state().world.displacements;
}

std::uint64_t OurSession::state_hash() const {
  return engine_->simulation.state_hash();
}

}  // namespace trocar::bench
