#include "server/scenario/scenario_run.h"

#include <cmath>
#include <limits>

namespace trocar::scenario {
namespace {

// A hand reads its devices this often, in a session as here.
constexpr Tick kSampleTicks = 8;

double seconds_of(Tick tick) {
  return static_cast<double>(tick) / static_cast<double>(kTicksPerSecond);
}

Tick ticks_of(double seconds) {
  return static_cast<Tick>(std::llround(seconds * static_cast<double>(kTicksPerSecond)));
}

}  // namespace

ScenarioRun::ScenarioRun(scene::ResolvedScenario resolved, Solver solver)
    : resolved_(std::move(resolved)),
      solver_kind_(solver),
      has_limits_(scenario().run.depth || scenario().run.nodes),
      last_tick_(ticks_of(scenario().run.seconds)),
      world_(organ()),
      claims_(world_.node_count()),
      queue_(world_.node_count()),
      active_set_(world_.node_count()),
      solver_(organ(), world_) {
  held_ = organ().fixed_nodes;
  for (const auto& load : resolved_.displacements)
    for (const auto node : load.nodes) {
      held_.push_back(node);
      world_.node_classes[node.value] = world::NodeClass::Fixed;
    }
  held_displacements_.resize(held_.size());
  if (!resolved_.forces.empty() || length(scenario().gravity_m_s2) > 0)
    forces_.resize(world_.node_count());
  for (std::uint32_t i = 0; i < world_.node_count(); ++i) {
    if (world_.node_classes[i] == world::NodeClass::Fixed) continue;
    free_nodes_.push_back(NodeIndex(i));
    if (!has_limits_) world_.node_classes[i] = world::NodeClass::Active;
  }
  solver_.take_state(world_);
}

void ScenarioRun::apply_loads() {
  const double now = seconds_of(world_.tick);
  std::size_t entry = organ().fixed_nodes.size();
  for (const auto& load : resolved_.displacements) {
    const Vec3f displacement = to_float(load.over_time.at(now));
    for (std::size_t i = 0; i < load.nodes.size(); ++i) held_displacements_[entry++] = displacement;
  }
  if (forces_.empty()) return;
  const Vec3f gravity = to_float(scenario().gravity_m_s2);
  for (std::size_t i = 0; i < forces_.size(); ++i) forces_[i] = gravity * world_.masses[i];
  for (const auto& load : resolved_.forces) {
    const Vec3f share = to_float(load.over_time.at(now) / static_cast<double>(load.nodes.size()));
    for (const auto node : load.nodes) forces_[node.value] += share;
  }
}

void ScenarioRun::move_tools() {
  inputs_.clear();
  const auto& tools = scenario().tools;
  for (std::size_t i = 0; world_.tick == 1 && i < tools.size(); i += kToolsPerHand) {
    session::HandJoin join{.slot = ToolSlot{static_cast<std::uint8_t>(i)}.owner()};
    join.shapes[0] = tools[i].shape;
    if (i + 1 < tools.size()) {
      join.tool_count = 2;
      join.shapes[1] = tools[i + 1].shape;
    }
    inputs_.joins.push_back(join);
  }
  for (std::size_t i = 0; (world_.tick - 1) % kSampleTicks == 0 && i < tools.size(); ++i)
    inputs_.samples.push_back(
        {ToolSlot{static_cast<std::uint8_t>(i)},
         scene::sample(tools[i], seconds_of(world_.tick - 1), resolved_.anchors[i])});
  tools_.admit(inputs_, world_.tick);
}

void ScenarioRun::collect_active() {
  seeds_.clear();
  for (const auto& tool : contacts_.tools) seeds_.push_back(contacts_.seeds_of(tool));
  // What is moved or loaded from outside is where a force enters, like a contact.
  for (const auto& load : resolved_.displacements) seeds_.push_back(load.nodes);
  for (const auto& load : resolved_.forces) seeds_.push_back(load.nodes);
  const auto& run = scenario().run;
  constexpr auto kNoLimit = std::numeric_limits<std::uint32_t>::max();
  queue_.fill(organ().mesh.node_neighbours, seeds_,
              {run.depth.value_or(kNoLimit), run.nodes.value_or(kNoLimit)});
  active_set_.collect(queue_, world::Boundary::Frozen, world_);
}

// As the tick of a session does it (server/step/tick.cpp).
void ScenarioRun::update_claims() {
  requests_.clear();
  for (std::uint8_t i = 0; i < scenario().tools.size(); ++i) {
    const auto& tool = tools_[ToolSlot{i}];
    requests_.push_back(
        {ToolSlot{i}, tool.verb, tool.last_sample_tick, contacts_.reach_of(ToolSlot{i})});
  }
  claim_events_.clear();
  claims_.update(world_.tick, requests_, claim_events_);
  grasps_.follow_claims(world_, tools_, claims_, requests_);
}

StepReport ScenarioRun::step() {
  ++world_.tick;
  apply_loads();
  move_tools();
  contact::find_contacts(world_, tools_, claims_, grasps_, world_.tick, contacts_);
  if (has_limits_) collect_active();
  const std::span<const NodeIndex> active = has_limits_ ? active_set_.nodes() : free_nodes_;

  const auto& run = scenario().run;
  dynamics::SolveSettings settings{run.sweeps, static_cast<float>(run.over_relaxation),
                                   kTickSeconds};
  if (solver_kind_ == Solver::Full) {
    settings.sweeps = run.max_sweeps;
    settings.residual_tolerance_n = static_cast<float>(run.tolerance_n);
  }
  StepReport report;
  report.solve =
      solver_.solve(contacts_, active, settings, world_, {forces_, held_, held_displacements_});
  report.active_nodes = active.size();
  report.is_converged =
      solver_kind_ == Solver::Live || (report.solve.residual_n <= settings.residual_tolerance_n &&
                                       report.solve.nodes_rejected == 0);
  if (has_limits_)
    solver_.take_state(world_, active_set_.settle(queue_, solver_.residuals_n(), world_));
  update_claims();
  return report;
}

Vec3d ScenarioRun::probe(std::size_t index) const {
  const auto& rule = scenario().probes[index];
  const auto& nodes = resolved_.probe_nodes[index];
  Vec3d sum;
  switch (rule.quantity) {
    case scene::ProbeQuantity::Displacement:
      for (const auto node : nodes) sum += to_double(world_.displacements[node.value]);
      return sum / static_cast<double>(nodes.size());
    case scene::ProbeQuantity::Velocity:
      for (const auto node : nodes) sum += to_double(world_.velocities[node.value]);
      return sum / static_cast<double>(nodes.size());
    case scene::ProbeQuantity::Reaction:
      for (const auto node : nodes)
        sum += to_double(solver_.holding_force(contacts_, node, kTickSeconds));
      return sum;
    case scene::ProbeQuantity::ToolForce:
      for (const auto& contact : contacts_.tools)
        if (contact.tool.value == *rule.tool)
          sum = to_double(solver_.reaction(contacts_, contact, world_, kTickSeconds));
      return sum;
  }
  return sum;
}

}  // namespace trocar::scenario
