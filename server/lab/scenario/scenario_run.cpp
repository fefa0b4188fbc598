#include "server/lab/scenario/scenario_run.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "common/base/assert.h"
#include "server/lab/scenario/relaxed_organ.h"
#include "server/tissue/contact/update_claims.h"
#include "server/tissue/dynamics/relaxation.h"

namespace trocar::scenario {
namespace {

using scenario::kAllAxes;

// A hand reads its devices this often, in a session as here.
constexpr Tick kSampleTicks = 8;
// With a step of time this long inertia and damping are nothing, so that a step ends in
// equilibrium.
constexpr float kStaticStep_s = 100;
// Without inertia the best over-relaxation is high, and the residual grows before it falls: it is
// judged from stretch to stretch of sweeps, and lowered where a stretch brought nothing.
constexpr float kStaticOverRelaxation = 1.85f;
constexpr float kOverRelaxationStepDown = 0.8f;
// Springs that are compressed buckle, and sweeps that overshoot may then jump to a far equilibrium,
// or climb from one to the next: stable tissue loses potential energy from stretch to stretch. One
// that gains is taken back and done again with shorter steps, which descend if they are short
// enough.
constexpr float kOverRelaxationStepBack = 0.8f;
// Rounding of displacements in float, as a share of the energy.
constexpr double kEnergySlack = 1e-6;
constexpr std::uint32_t kSweepsPerRelaxation = 100;
// A contact that is found changes the equilibrium, and that the contacts. First the tool walks to
// its new place, as it does in a session, and its claim takes effect.
constexpr int kMinContactRounds = static_cast<int>(hands::kPoseTicks) + 2;
constexpr int kMaxContactRounds = 60;
constexpr float kContactChange_m = 1e-5f;
constexpr float kNoLimit_m = 10;
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
                   .strain_scheme = scheme_of(scenario().run, solver)}),
      decisions_(decisions_of(scenario().run, solver, simulation_)) {
  for (std::size_t i = 0; i < scenario().probes.size(); ++i)
    watched_.push_back(is_reaction(scenario().probes[i])
                           ? simulation_.loads().watch(resolved_.probe_nodes[i])
                           : 0);
  if (scenario().run.integrator == scenario::Integrator::Explicit)
    explicit_.emplace(organ(), world());
  for (std::uint32_t i = 0; i < world().node_count(); ++i)
    if (world().node_classes[i] != world::NodeClass::Fixed) free_nodes_.push_back(NodeIndex(i));
  if (scenario().run.starts_in_equilibrium) settle(threads);
}

// Tissue that relaxes is put where it would be with nothing left to relax. Its stresses are then
// those of having been there for long.
bool ScenarioRun::has_implicit_strain() const {
  return simulation_.state().strain_scheme == dynamics::StrainScheme::Implicit;
}

void ScenarioRun::settle(unsigned threads) {
  auto& world = simulation_.editable_state().world;
  if (dynamics::Relaxation::is_needed(organ())) {
    auto relaxed = resolved_;
    relaxed.organ = relaxed_organ(std::move(relaxed.organ));
    const ScenarioRun run(std::move(relaxed), solver_kind_, threads);
    world.displacements = run.world().displacements;
    settling_ = run.settling();
  } else {
    settling_ = relax(simulation_.loads().at_rest(world));
  }
  dynamics::start_relaxed(organ(), world, simulation_.state().strain_scheme);
  simulation_.resume();
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
  sample_tools(before + 1, seconds_of(before), before % kSampleTicks == 0);
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
  auto& world = simulation_.editable_state().world;
  const double begin_s = seconds_of(world.tick++);
  const auto& run = scenario().run;
  for (std::uint32_t i = 1; i <= run.steps_per_tick; ++i)
    explicit_->step(run.dt_s(), world, simulation_.loads().at(begin_s + run.dt_s() * i, world));
  StepReport report;
  report.active_nodes = free_nodes_.size();
  for (const auto& u : world.displacements) report.solve.nodes_rejected += is_finite(u) ? 0 : 1;
  return report;
}

void ScenarioRun::place_held(const dynamics::ExternalLoads& loads) {
  auto& world = simulation_.editable_state().world;
  auto& context = simulation_.editable_context();
  float largest_move_m = 0;
  const auto put = [&](NodeIndex node, std::uint8_t axes, const Vec3f& displacement) {
    Vec3f& u = world.displacements[node.value];
    const Vec3f from = u;
    if (axes & 1) u.x = displacement.x;
    if (axes & 2) u.y = displacement.y;
    if (axes & 4) u.z = displacement.z;
    largest_move_m = std::max(largest_move_m, length(u - from));
  };
  for (std::size_t i = 0; i < loads.held.size(); ++i)
    put(loads.held[i], kAllAxes, loads.held_displacements[i]);
  for (const auto& hold : loads.axis_holds) put(hold.node, hold.axes, hold.displacement);
  context.solve.solver.read_motion(world);
  context.contact.finder.surface_moved(largest_move_m);
}

double ScenarioRun::potential_energy_j(const dynamics::ExternalLoads& loads) const {
  double energy_j = simulation_.context().solve.solver.tissue().energy_j(world().displacements);
  for (std::size_t i = 0; i < world().node_count(); ++i) {
    Vec3d load = organ().gravity_m_s2 * static_cast<double>(world().masses[i]);
    if (!loads.forces.empty()) load += to_double(loads.forces[i]);
    energy_j -= dot(load, to_double(world().displacements[i]));
  }
  return energy_j;
}

StepReport ScenarioRun::relax(const dynamics::ExternalLoads& loads) {
  auto& world = simulation_.editable_state().world;
  auto& context = simulation_.editable_context();
  const std::uint32_t most = scenario().run.max_sweeps;
  dynamics::SolveSettings how{.dt = kStaticStep_s};
  how.residual_tolerance_n = static_cast<float>(scenario().run.tolerance_n);
  how.over_relaxation = kStaticOverRelaxation;
  how.has_safeguard = false;
  StepReport report;
  report.active_nodes = free_nodes_.size();
  std::uint32_t sweeps = 0;
  float last_residual = INFINITY;
  place_held(loads);
  // Contacts that slide have no potential energy, so that nothing can be said about its descent.
  const bool descends = context.contact.found.points.empty();
  double last_energy_j = descends ? potential_energy_j(loads) : 0;
  do {
    if (descends) before_stretch_.assign(world.displacements.begin(), world.displacements.end());
    how.sweeps = std::min(kSweepsPerRelaxation, most - sweeps);
    report.solve =
        context.solve.solver.solve(context.contact.found, free_nodes_, how, world, loads);
    context.contact.finder.surface_moved(report.solve.largest_move_m);
    std::ranges::fill(world.velocities, Vec3f{});
    sweeps += report.solve.sweeps;
    const double energy_j = descends ? potential_energy_j(loads) : 0;
    if (!(energy_j <= last_energy_j + kEnergySlack * std::abs(last_energy_j))) {
      std::ranges::copy(before_stretch_, world.displacements.begin());
      context.solve.solver.read_motion(world);
      how.over_relaxation *= kOverRelaxationStepBack;
      continue;
    }
    last_energy_j = energy_j;
    report.is_converged =
        report.solve.residual_n <= how.residual_tolerance_n && report.solve.nodes_rejected == 0;
    if (!(report.solve.residual_n < last_residual) && how.over_relaxation > 1)
      how.over_relaxation = 1 + (how.over_relaxation - 1) * kOverRelaxationStepDown;
    last_residual = report.solve.residual_n;
  } while (!report.is_converged && sweeps < most);
  report.solve.sweeps = sweeps;
  return report;
}

StepReport ScenarioRun::step_static() {
  auto& state = simulation_.editable_state();
  auto& context = simulation_.editable_context();
  auto& world = state.world;
  const double now = scenario().run.load_times_s[steps_done_];
  const auto loads = simulation_.loads().at(now, world);
  StepReport report;
  std::uint32_t sweeps = 0;
  float change = scenario().tools.empty() ? 0 : INFINITY;
  if (scenario().tools.empty()) {
    report = relax(loads);
    sweeps = report.solve.sweeps;
  }
  for (int round = 0; !scenario().tools.empty() && round < kMaxContactRounds &&
                      (round < kMinContactRounds || change > kContactChange_m);
       ++round) {
    sample_tools(++world.tick, now, round == 0);
    step::admit_inputs(inputs_, world.tick, state.tools, state.claims, state.grasps);
    state.grasps.follow(state.tools, 0);
    // Without time a tool has no speed either.
    context.contact.finder.find({.world = world,
                                 .tools = state.tools,
                                 .claims = state.claims,
                                 .grasps = state.grasps,
                                 .proxies = state.proxies,
                                 .tick = world.tick,
                                 .max_step_m = kNoLimit_m,
                                 .jump_m = kNoLimit_m},
                                context.contact.found);
    before_.assign(world.displacements.begin(), world.displacements.end());
    report = relax(loads);
    sweeps += report.solve.sweeps;
    change = 0;
    for (std::size_t i = 0; i < before_.size(); ++i)
      change = std::max(change, length(world.displacements[i] - before_[i]));
    state.proxies.update(context.contact.found, world, state.tools);
    context.outbox.claim_events.clear();
    contact::update_claims(world, state.tools, context.contact.found, context.contact.requests,
                           state.claims, state.grasps, context.outbox.claim_events);
  }
  simulation_.loads().measure(context.solve.solver, context.contact.found);
  report.is_converged &= change <= kContactChange_m;
  report.solve.sweeps = sweeps;
  return report;
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
  }
  return sum;
}

}  // namespace trocar::scenario
