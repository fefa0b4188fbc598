#include "server/lab/scenario/scenario_run.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "common/base/assert.h"
#include "server/lab/scenario/relaxed_organ.h"
#include "server/tissue/contact/contact_list.h"
#include "server/tissue/dynamics/relaxation.h"
#include "server/tissue/hands/sampling.h"
#include "server/tissue/step/thread_stage.h"

namespace trocar::scenario {
namespace {

using scenario::kAllAxes;

// A paper's subdivision gets a patch of this many mean edges at a time: shorter ones pull the same
// nodes again and again.
constexpr double kPatchEdges = 1;

double seconds_of(Tick tick) {
  return static_cast<double>(tick) / static_cast<double>(kTicksPerSecond);
}

std::uint64_t steps_of(const scenario::RunRule& run) {
  return run.mode == scenario::RunMode::Static
             ? run.load_times_s.size()
             : static_cast<std::uint64_t>(
                   std::llround(run.seconds * static_cast<double>(kTicksPerSecond)));
}

world::Boundary boundary_of(const scenario::RunRule& run, Solver solver) {
  switch (run.boundary) {
    case scenario::Boundary::Whole:
      return world::Boundary::Whole;
    case scenario::Boundary::Frozen:
      return world::Boundary::Frozen;
    case scenario::Boundary::Graded:
      // To solve every node to a tolerance makes graded sweeps pointless.
      return solver == Solver::Full ? world::Boundary::Whole : world::Boundary::Graded;
  }
  return world::Boundary::Whole;
}

step::TickDecisions decisions_of(const scenario::RunRule& run, Solver solver,
                                 const step::Simulation& simulation) {
  step::TickDecisions decisions;
  decisions.boundary = boundary_of(run, solver);
  decisions.sweeps = run.sweeps;
  decisions.over_relaxation = static_cast<float>(run.over_relaxation);
  if (decisions.boundary != world::Boundary::Whole) {
    decisions.depth_limit = run.depth.value_or(step::kMaxDepthLimit);
    decisions.node_limit = run.nodes.value_or(step::kMaxNodeLimit);
  }
  decisions.is_far_exact = !run.has_linear_far_field;
  decisions.far_sweeps = run.far_sweeps.value_or(0);
  auto& policy = decisions.policy;
  policy.far_over_relaxation = static_cast<float>(run.far_over_relaxation.value_or(0));
  policy.steps_per_tick = run.steps_per_tick;
  policy.has_self_contact = run.self_contact;
  if (solver == Solver::Full) {
    policy.residual_tolerance_n = static_cast<float>(run.tolerance_n);
    policy.max_sweeps = run.max_sweeps;
  }
  return run.has_sweeps_for_organ ? simulation.with_sweeps_for_organ(decisions) : decisions;
}

cutting::Settings cutting_of(const scenario::RunRule& run) {
  return run.cutting ? nakao::settings_of(*run.cutting, kPatchEdges) : cutting::Settings{};
}

bool is_reaction(const scenario::ProbeRule& probe) {
  return probe.quantity == scenario::ProbeQuantity::Reaction;
}

step::LoadRules loads_of(const scenario::ResolvedScenario& resolved) {
  return {resolved.displacements, resolved.forces,
          std::ranges::any_of(resolved.scenario.probes, is_reaction)};
}

// Equilibria, and steps that are solved to a tolerance, have all forces implicit. Others are as in
// a session.
std::optional<dynamics::StrainScheme> scheme_of(const scenario::RunRule& run, Solver solver) {
  if (run.mode == scenario::RunMode::Static || solver == Solver::Full || run.starts_in_equilibrium)
    return dynamics::StrainScheme::Implicit;
  return {};
}

const scenario::Place& run_key(const scenario::Scenario& scenario, std::string_view key) {
  return scenario::place_of_key(scenario.run.given, key, scenario.run_place);
}

// The world of a scenario, with what it displaces held.
world::World world_of(const scenario::ResolvedScenario& resolved) {
  world::World world(resolved.organ);
  dynamics::start_relaxed(resolved.organ, world);
  for (const auto& load : resolved.displacements)
    for (const auto node : load.nodes)
      if (load.axes == kAllAxes) world.node_classes[node.value] = world::NodeClass::Fixed;
  return world;
}

// A static run has no time in which to relax: measured tissue responds as at once.
scenario::ResolvedScenario with_response(scenario::ResolvedScenario resolved) {
  if (resolved.scenario.run.mode != scenario::RunMode::Static) return resolved;
  resolved.organ.material.measured.relaxation.clear();
  for (auto& region : resolved.organ.regions) region.material.measured.relaxation.clear();
  return resolved;
}

Status check_explicit(const scenario::ResolvedScenario& resolved) {
  const auto& scenario = resolved.scenario;
  const auto& place = run_key(scenario, "integrator");
  if (!scenario.tools.empty())
    return scenario::scenario_error(
        scenario, place, "\"explicit\" has no tools: take \"implicit\", or displace a set");
  for (const auto& probe : scenario.probes)
    if (is_reaction(probe))
      return scenario::scenario_error(scenario, probe.place,
                                      "a reaction needs integrator = \"implicit\" in [run]");
  if (dynamics::Relaxation::is_needed(resolved.organ))
    return scenario::scenario_error(
        scenario, place,
        "\"explicit\" knows no relaxation, which this material has: take "
        "\"implicit\"");
  const double stable = nakao::ExplicitEuler(resolved.organ, world_of(resolved)).stable_dt_s();
  if (scenario.run.dt_s() <= stable) return {};
  char text[160];
  const double most = 1e-3 / std::ceil(1e-3 / stable);
  if (most < 1e-6)
    std::snprintf(text, sizeof text,
                  "\"explicit\" is stable up to %.3g s here, which would take too long", stable);
  else
    std::snprintf(text, sizeof text, "is %g, \"explicit\" is stable up to %.3g here: write %.6g",
                  scenario.run.dt_s(), stable, most);
  return scenario::scenario_error(
      scenario, most < 1e-6 ? place : scenario::place_of_key(scenario.run.given, "dt_s", place),
      text);
}

}  // namespace

Status check_supported(const scenario::ResolvedScenario& resolved) {
  const auto& scenario = resolved.scenario;
  const auto& rule = scenario.run;
  for (const auto& load : scenario.displacements)
    if (load.axes != kAllAxes && (rule.boundary == scenario::Boundary::Frozen ||
                                  rule.integrator == scenario::Integrator::Explicit))
      return scenario::scenario_error(
          scenario, load.set.place,
          "is held along some axes only, which needs boundary = \"whole\" or \"graded\" and the "
          "implicit integrator: see [run]");
  return rule.integrator == scenario::Integrator::Explicit ? check_explicit(resolved) : Status{};
}

ScenarioRun::ScenarioRun(scenario::ResolvedScenario resolved, Solver solver, unsigned threads)
    : resolved_(with_response(std::move(resolved))),
      solver_kind_(solver),
      step_count_(steps_of(scenario().run)),
      simulation_(resolved_.organ, threads,
                  {.cutting = cutting_of(scenario().run),
                   .loads = loads_of(resolved_),
                   .strain_scheme = scheme_of(scenario().run, solver),
                   .threads = scenario().threads}),
      decisions_(decisions_of(scenario().run, solver, simulation_)),
      equilibrium_(simulation_, {.tolerance_n = static_cast<float>(scenario().run.tolerance_n),
                                 .max_sweeps = scenario().run.max_sweeps}) {
  for (std::size_t i = 0; i < scenario().probes.size(); ++i)
    watched_.push_back(is_reaction(scenario().probes[i])
                           ? simulation_.loads().watch(resolved_.probe_nodes[i])
                           : 0);
  if (scenario().run.integrator == scenario::Integrator::Explicit)
    explicit_.emplace(organ(), world());
  if (scenario().run.starts_in_equilibrium) settle(threads);
}

// Tissue that relaxes is put where it would be with nothing left to relax. Its stresses are then
// those of having been there for long.
bool ScenarioRun::has_implicit_strain() const {
  return simulation_.state().strain_scheme == dynamics::StrainScheme::Implicit;
}

void ScenarioRun::settle(unsigned threads) {
  if (dynamics::Relaxation::is_needed(organ())) {
    auto relaxed = resolved_;
    relaxed.organ = relaxed_organ(std::move(relaxed.organ));
    const ScenarioRun run(std::move(relaxed), solver_kind_, threads);
    simulation_.start_relaxed(run.world().displacements);
    settling_ = run.settling();
  } else {
    settling_ = report_of(equilibrium_.relax(simulation_.loads().at_rest(world())));
    simulation_.start_relaxed(world().displacements);
  }
}

double ScenarioRun::time_s() const {
  if (!is_static()) return seconds_of(steps_done_);
  return steps_done_ == 0 ? 0 : scenario().run.load_times_s[steps_done_ - 1];
}

std::size_t ScenarioRun::inverted_tets() const {
  const auto& topology = simulation_.state().cuts.topology();
  const auto at = [&](NodeIndex node) { return to_double(world().position(node)); };
  std::size_t count = 0;
  for (std::uint32_t t = 0; t < topology.tet_count(); ++t) {
    if (!topology.has_tet(TetIndex(t))) continue;
    const auto& [a, b, c, d] = topology.tet(TetIndex(t));
    const Vec3d origin = at(a);
    count += !(dot(cross(at(b) - origin, at(c) - origin), at(d) - origin) > 0);
  }
  return count;
}

bool ScenarioRun::is_due(std::size_t probe) const {
  return is_static() || steps_done_ % scenario().probes[probe].every_ticks == 0;
}

void ScenarioRun::sample_tools(Tick tick, double time_s, bool has_samples) {
  inputs_.clear();
  const auto& tools = scenario().tools;
  for (std::size_t i = 0; tick == 1 && i < tools.size(); i += kToolsPerHand) {
    hands::HandJoin join{.slot = ToolSlot{static_cast<std::uint8_t>(i)}.owner()};
    join.shapes[0] = tools[i].shape;
    if (i + 1 < tools.size()) {
      join.tool_count = 2;
      join.shapes[1] = tools[i + 1].shape;
    }
    inputs_.joins.push_back(join);
  }
  for (std::size_t i = 0; has_samples && i < tools.size(); ++i)
    inputs_.samples.push_back({ToolSlot{static_cast<std::uint8_t>(i)},
                               tool::sample(tools[i], time_s, resolved_.anchors[i])});
}

StepReport ScenarioRun::step_dynamic() {
  if (explicit_) return step_explicit();
  const Tick before = simulation_.current_tick();
  sample_tools(before + 1, seconds_of(before), hands::takes_samples(before + 1));
  const auto& tick = simulation_.tick(inputs_, decisions_);
  StepReport report;
  report.active_nodes = tick.near.active_nodes;
  report.is_converged = tick.solve.is_converged;
  report.solve.residual_n = tick.solve.figures.residual_n;
  report.solve.sweeps = tick.solve.figures.sweeps;
  report.solve.node_sweeps = tick.solve.node_sweeps;
  report.solve.far_node_sweeps = tick.solve.far_node_sweeps;
  report.solve.nodes_rejected = tick.solve.nodes_rejected;
  report.solve.nodes_restored = tick.solve.nodes_restored;
  return report;
}

// It has no tools, so there are no contacts to keep.
StepReport ScenarioRun::step_explicit() {
  const auto& run = scenario().run;
  const double begin_s = seconds_of(simulation_.current_tick());
  simulation_.tick_by([&](world::World& world) {
    for (std::uint32_t i = 1; i <= run.steps_per_tick; ++i)
      explicit_->step(run.dt_s(), world, simulation_.loads().at(begin_s + run.dt_s() * i, world));
  });
  StepReport report;
  report.active_nodes = equilibrium_.free_nodes();
  for (const auto& u : world().displacements) report.solve.nodes_rejected += is_finite(u) ? 0 : 1;
  return report;
}

StepReport ScenarioRun::step_static() {
  const double now = scenario().run.load_times_s[steps_done_];
  const auto loads = simulation_.loads().at(now, world());
  const auto inputs = [&](Tick tick, bool is_first) -> const hands::TickInputs& {
    sample_tools(tick, now, is_first);
    return inputs_;
  };
  return report_of(scenario().tools.empty() ? equilibrium_.find(loads)
                                            : equilibrium_.find(loads, inputs));
}

StepReport ScenarioRun::report_of(const step::EquilibriumReport& found) const {
  return {found.solve, equilibrium_.free_nodes(), found.is_converged};
}

StepReport ScenarioRun::step() {
  const StepReport report = is_static() ? step_static() : step_dynamic();
  ++steps_done_;
  return report;
}

Vec3d ScenarioRun::force_on(ToolSlot tool) const {
  const auto& state = simulation_.state();
  const auto& contacts = simulation_.context().contact.found;
  Vec3d force = to_double(state.cuts.felt(tool).force_n);
  for (const auto& contact : contacts.tools)
    if (contact.tool == tool)
      force += to_double(contact::reaction_on(contacts, contact, state.world).force_n);
  if (const auto& threads = simulation_.context().threads)
    force += threads->step.pull(tool).force_n;
  return force;
}

Vec3d ScenarioRun::probe(std::size_t index) const {
  const auto& rule = scenario().probes[index];
  const auto& nodes = resolved_.probe_nodes[index];
  const auto& world = this->world();
  Vec3d sum;
  switch (rule.quantity) {
    case scenario::ProbeQuantity::Displacement:
      for (const auto node : nodes) sum += to_double(world.displacements[node.value]);
      return sum / static_cast<double>(nodes.size());
    case scenario::ProbeQuantity::Velocity:
      for (const auto node : nodes) sum += to_double(world.velocities[node.value]);
      return sum / static_cast<double>(nodes.size());
    case scenario::ProbeQuantity::Reaction:
      return simulation_.loads().holding_force_n(watched_[index]);
    case scenario::ProbeQuantity::ToolForce:
      return force_on(ToolSlot{static_cast<std::uint8_t>(*rule.tool)});
    case scenario::ProbeQuantity::StartForce:
      return simulation_.context().threads->step.end_forces()[*rule.thread].start_n;
    case scenario::ProbeQuantity::EndForce:
      return simulation_.context().threads->step.end_forces()[*rule.thread].end_n;
  }
  return sum;
}

}  // namespace trocar::scenario
