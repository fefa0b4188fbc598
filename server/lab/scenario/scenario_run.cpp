#include "server/lab/scenario/scenario_run.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/base/assert.h"
#include "server/lab/scenario/relaxed_organ.h"
#include "server/tissue/contact/update_claims.h"

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

double seconds_of(Tick tick) {
  return static_cast<double>(tick) / static_cast<double>(kTicksPerSecond);
}

std::uint64_t steps_of(const scenario::RunRule& run) {
  return run.mode == scenario::RunMode::Static
             ? run.load_times_s.size()
             : static_cast<std::uint64_t>(
                   std::llround(run.seconds * static_cast<double>(kTicksPerSecond)));
}

// To solve every node to a tolerance makes graded sweeps pointless.
scenario::Boundary boundary_of(const scenario::RunRule& run, Solver solver) {
  const bool is_graded = run.boundary == scenario::Boundary::Graded;
  return run.mode == scenario::RunMode::Static || (is_graded && solver == Solver::Full)
             ? scenario::Boundary::Whole
             : run.boundary;
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
    if (probe.quantity == scenario::ProbeQuantity::Reaction)
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
      boundary_(boundary_of(scenario().run, solver)),
      step_count_(steps_of(scenario().run)),
      world_(world_of(resolved_)),
      claims_(world_.node_count()),
      finder_(organ()),
      queue_(world_.node_count()),
      active_set_(world_.node_count()),
      solver_(organ(), world_, threads) {
  held_ = organ().fixed_nodes;
  for (const auto& load : resolved_.displacements)
    if (load.axes == kAllAxes) held_.insert(held_.end(), load.nodes.begin(), load.nodes.end());
  list_axis_holds();
  held_displacements_.resize(held_.size());
  if (!resolved_.forces.empty()) forces_.resize(world_.node_count());
  for (std::uint32_t i = 0; i < world_.node_count(); ++i) {
    if (world_.node_classes[i] == world::NodeClass::Fixed) continue;
    free_nodes_.push_back(NodeIndex(i));
    if (boundary_ == scenario::Boundary::Whole) world_.node_classes[i] = world::NodeClass::Active;
  }
  solver_.take_state(world_);
  if (scenario().run.integrator == scenario::Integrator::Explicit)
    explicit_.emplace(organ(), world_);
  else if (scenario().run.self_contact && !is_static())
    self_finder_.emplace(organ());
  if (boundary_ == scenario::Boundary::Graded) far_plan_ = solver_.far_plan(settings().dt);
  if (!scenario().run.starts_in_equilibrium) return;
  settling_ = dynamics::Relaxation::is_needed(organ()) ? relax_for_long(threads) : relax();
}

// Where tissue is that has nothing left to relax; then its stresses are those of having been there.
StepReport ScenarioRun::relax_for_long(unsigned threads) {
  auto relaxed = resolved_;
  relaxed.organ = relaxed_organ(std::move(relaxed.organ));
  const ScenarioRun run(std::move(relaxed), solver_kind_, threads);
  world_.displacements = run.world().displacements;
  dynamics::start_relaxed(organ(), world_);
  solver_.take_state(world_);
  return run.settling();
}

double ScenarioRun::time_s() const {
  if (!is_static()) return seconds_of(steps_done_);
  return steps_done_ == 0 ? 0 : scenario().run.load_times_s[steps_done_ - 1];
}

bool ScenarioRun::is_due(std::size_t probe) const {
  return is_static() || steps_done_ % scenario().probes[probe].every_ticks == 0;
}

// One per node, though several sets may hold it along an axis each.
void ScenarioRun::list_axis_holds() {
  for (const auto& load : resolved_.displacements) {
    if (load.axes == kAllAxes) continue;
    for (const auto node : load.nodes) axis_holds_.push_back({node, 0, {}});
  }
  std::ranges::sort(axis_holds_, {}, &dynamics::AxisHold::node);
  const auto is_same = [](const dynamics::AxisHold& a, const dynamics::AxisHold& b) {
    return a.node == b.node;
  };
  axis_holds_.erase(std::unique(axis_holds_.begin(), axis_holds_.end(), is_same),
                    axis_holds_.end());
  for (const auto& load : resolved_.displacements)
    if (load.axes != kAllAxes)
      for (const auto node : load.nodes) axis_hold_of(node)->axes |= load.axes;
}

dynamics::AxisHold* ScenarioRun::axis_hold_of(NodeIndex node) {
  const auto found = std::ranges::lower_bound(axis_holds_, node, {}, &dynamics::AxisHold::node);
  return found != axis_holds_.end() && found->node == node ? &*found : nullptr;
}

void ScenarioRun::apply_loads(double time_s) {
  std::size_t entry = organ().fixed_nodes.size();
  for (const auto& load : resolved_.displacements) {
    const Vec3f displacement = to_float(load.over_time.at(time_s));
    for (const auto node : load.nodes) {
      if (load.axes == kAllAxes) {
        held_displacements_[entry++] = displacement;
        continue;
      }
      Vec3f& held = axis_hold_of(node)->displacement;
      if (load.axes & 1) held.x = displacement.x;
      if (load.axes & 2) held.y = displacement.y;
      if (load.axes & 4) held.z = displacement.z;
    }
  }
  std::ranges::fill(forces_, Vec3f{});
  for (const auto& load : resolved_.forces) {
    const Vec3d value = load.over_time.at(time_s);
    for (std::size_t i = 0; i < load.nodes.size(); ++i)
      forces_[load.nodes[i].value] += to_float(load.on_node(i, value));
  }
}

void ScenarioRun::move_tools(double time_s, bool takes_samples) {
  inputs_.clear();
  const auto& tools = scenario().tools;
  for (std::size_t i = 0; world_.tick == 1 && i < tools.size(); i += kToolsPerHand) {
    hands::HandJoin join{.slot = ToolSlot{static_cast<std::uint8_t>(i)}.owner()};
    join.shapes[0] = tools[i].shape;
    if (i + 1 < tools.size()) {
      join.tool_count = 2;
      join.shapes[1] = tools[i + 1].shape;
    }
    inputs_.joins.push_back(join);
  }
  for (std::size_t i = 0; takes_samples && i < tools.size(); ++i)
    inputs_.samples.push_back({ToolSlot{static_cast<std::uint8_t>(i)},
                               tool::sample(tools[i], time_s, resolved_.anchors[i])});
  tools_.admit(inputs_, world_.tick);
}

std::span<const NodeIndex> ScenarioRun::collect_active() {
  if (boundary_ == scenario::Boundary::Whole) return free_nodes_;
  // Each has its place in every step, as the queue wants it. What is moved or loaded from outside
  // is where a force enters, like a contact.
  seeds_.assign(scenario().tools.size() + 1, {});
  for (const auto& tool : contacts_.tools) seeds_[tool.tool.value] = contacts_.seeds_of(tool);
  seeds_.back() = contacts_.self_seeds;
  const auto moves = [](const auto& key) { return length(key.value) > 0; };
  for (const auto& load : resolved_.displacements)
    if (std::ranges::any_of(load.over_time.keys, moves)) seeds_.push_back(load.nodes);
  for (const auto& load : resolved_.forces) seeds_.push_back(load.nodes);
  const auto& run = scenario().run;
  constexpr auto kNoLimit = std::numeric_limits<std::uint32_t>::max();
  queue_.fill(organ().mesh.node_neighbours, seeds_,
              {run.depth.value_or(kNoLimit), run.nodes.value_or(kNoLimit)});
  active_set_.collect(
      queue_,
      boundary_ == scenario::Boundary::Frozen ? world::Boundary::Frozen : world::Boundary::Graded,
      world_);
  return active_set_.nodes();
}

void ScenarioRun::follow_contacts() {
  proxies_.follow(contacts_, world_, tools_);
  claim_events_.clear();
  contact::update_claims(world_, tools_, contacts_, requests_, claims_, grasps_, claim_events_);
}

dynamics::SolveSettings ScenarioRun::settings() const {
  const auto& run = scenario().run;
  dynamics::SolveSettings result{run.sweeps, static_cast<float>(run.over_relaxation),
                                 static_cast<float>(run.dt_s())};
  if (boundary_ == scenario::Boundary::Graded) {
    const auto plan = far_plan_.with_sweeps(run.far_sweeps.value_or(0));
    result.far_sweeps = plan.sweeps;
    result.far_over_relaxation =
        static_cast<float>(run.far_over_relaxation.value_or(plan.over_relaxation));
  }
  if (solver_kind_ == Solver::Full || is_static()) {
    result.sweeps = run.max_sweeps;
    result.residual_tolerance_n = static_cast<float>(run.tolerance_n);
  }
  return result;
}

StepReport ScenarioRun::step_dynamic() {
  ++world_.tick;
  move_tools(seconds_of(world_.tick - 1), (world_.tick - 1) % kSampleTicks == 0);
  finder_.find({world_, tools_, claims_, grasps_, proxies_, world_.tick}, contacts_);
  if (self_finder_) self_finder_->find(world_, self_contacts_, contacts_);
  const auto active = collect_active();

  const auto& run = scenario().run;
  const auto how = settings();
  const std::uint32_t steps = run.steps_per_tick;
  StepReport report;
  report.active_nodes = active.size();
  std::uint32_t sweeps = 0;
  float largest_move = 0;
  for (std::uint32_t i = 1; i <= steps; ++i) {
    apply_loads(seconds_of(world_.tick - 1) + run.dt_s() * i);
    const dynamics::ExternalLoads loads{forces_, held_, held_displacements_, axis_holds_};
    if (explicit_) {
      explicit_->step(run.dt_s(), world_, loads);  // without tools: no contacts to keep
      continue;
    }
    report.solve = solver_.solve(contacts_, active, how, world_, loads);
    largest_move += report.solve.largest_move_m;
    sweeps += report.solve.sweeps;
    report.is_converged &=
        solver_kind_ == Solver::Live ||
        (report.solve.residual_n <= how.residual_tolerance_n && report.solve.nodes_rejected == 0);
  }
  report.solve.sweeps = sweeps;
  if (explicit_)
    for (const auto& u : world_.displacements) report.solve.nodes_rejected += is_finite(u) ? 0 : 1;
  if (boundary_ != scenario::Boundary::Whole) {
    const auto settled = active_set_.settle(queue_, solver_.residuals_n(), world_);
    solver_.take_state(world_, settled);
    if (!settled.empty()) largest_move += propagation::kQuietDisplacementMetres;
  }
  finder_.surface_moved(largest_move);
  if (self_finder_) self_finder_->surface_moved(largest_move);
  follow_contacts();
  return report;
}

void ScenarioRun::place_held() {
  float largest_move_m = 0;
  const auto put = [&](NodeIndex node, std::uint8_t axes, const Vec3f& displacement) {
    Vec3f& u = world_.displacements[node.value];
    const Vec3f from = u;
    if (axes & 1) u.x = displacement.x;
    if (axes & 2) u.y = displacement.y;
    if (axes & 4) u.z = displacement.z;
    largest_move_m = std::max(largest_move_m, length(u - from));
  };
  for (std::size_t i = 0; i < held_.size(); ++i) put(held_[i], kAllAxes, held_displacements_[i]);
  for (const auto& hold : axis_holds_) put(hold.node, hold.axes, hold.displacement);
  solver_.take_motion(world_);
  finder_.surface_moved(largest_move_m);
}

double ScenarioRun::potential_energy_j() const {
  double energy_j = solver_.tissue().energy_j(world_.displacements);
  for (std::size_t i = 0; i < world_.node_count(); ++i) {
    Vec3d load = organ().gravity_m_s2 * static_cast<double>(world_.masses[i]);
    if (!forces_.empty()) load += to_double(forces_[i]);
    energy_j -= dot(load, to_double(world_.displacements[i]));
  }
  return energy_j;
}

StepReport ScenarioRun::relax() {
  auto how = settings();
  const std::uint32_t most = scenario().run.max_sweeps;
  how.residual_tolerance_n = static_cast<float>(scenario().run.tolerance_n);
  how.dt = kStaticStep_s;
  how.far_sweeps = 0;
  how.over_relaxation = kStaticOverRelaxation;
  how.has_safeguard = false;
  StepReport report;
  report.active_nodes = free_nodes_.size();
  std::uint32_t sweeps = 0;
  float last_residual = INFINITY;
  place_held();
  // Contacts that slide have no potential energy, so that nothing can be said about its descent.
  const bool descends = contacts_.points.empty();
  double last_energy_j = descends ? potential_energy_j() : 0;
  do {
    if (descends) before_stretch_.assign(world_.displacements.begin(), world_.displacements.end());
    how.sweeps = std::min(kSweepsPerRelaxation, most - sweeps);
    report.solve = solver_.solve(contacts_, free_nodes_, how, world_,
                                 {forces_, held_, held_displacements_, axis_holds_});
    finder_.surface_moved(report.solve.largest_move_m);
    std::ranges::fill(world_.velocities, Vec3f{});
    sweeps += report.solve.sweeps;
    const double energy_j = descends ? potential_energy_j() : 0;
    if (!(energy_j <= last_energy_j + kEnergySlack * std::abs(last_energy_j))) {
      std::ranges::copy(before_stretch_, world_.displacements.begin());
      solver_.take_motion(world_);
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
  const double now = scenario().run.load_times_s[steps_done_];
  apply_loads(now);
  StepReport report;
  if (scenario().tools.empty()) return relax();
  std::uint32_t sweeps = 0;
  float change = INFINITY;
  for (int round = 0;
       round < kMaxContactRounds && (round < kMinContactRounds || change > kContactChange_m);
       ++round) {
    ++world_.tick;
    move_tools(now, round == 0);
    // Without time a tool has no speed either.
    finder_.find({world_, tools_, claims_, grasps_, proxies_, world_.tick, kNoLimit_m, kNoLimit_m},
                 contacts_);
    before_.assign(world_.displacements.begin(), world_.displacements.end());
    report = relax();
    sweeps += report.solve.sweeps;
    change = 0;
    for (std::size_t i = 0; i < before_.size(); ++i)
      change = std::max(change, length(world_.displacements[i] - before_[i]));
    follow_contacts();
  }
  report.is_converged &= change <= kContactChange_m;
  report.solve.sweeps = sweeps;
  return report;
}

StepReport ScenarioRun::step() {
  const StepReport report = is_static() ? step_static() : step_dynamic();
  ++steps_done_;
  return report;
}

Vec3d ScenarioRun::holding_force(NodeIndex node) const {
  Vec3d force = to_double(solver_.holding_force(contacts_, node));
  const auto hold = std::ranges::lower_bound(axis_holds_, node, {}, &dynamics::AxisHold::node);
  if (hold == axis_holds_.end() || hold->node != node) return force;
  // Along the others it is what the solver left out of balance.
  if (!(hold->axes & 1)) force.x = 0;
  if (!(hold->axes & 2)) force.y = 0;
  if (!(hold->axes & 4)) force.z = 0;
  return force;
}

Vec3d ScenarioRun::probe(std::size_t index) const {
  const auto& rule = scenario().probes[index];
  const auto& nodes = resolved_.probe_nodes[index];
  Vec3d sum;
  switch (rule.quantity) {
    case scenario::ProbeQuantity::Displacement:
      for (const auto node : nodes) sum += to_double(world_.displacements[node.value]);
      return sum / static_cast<double>(nodes.size());
    case scenario::ProbeQuantity::Velocity:
      for (const auto node : nodes) sum += to_double(world_.velocities[node.value]);
      return sum / static_cast<double>(nodes.size());
    case scenario::ProbeQuantity::Reaction:
      for (const auto node : nodes) sum += holding_force(node);
      return sum;
    case scenario::ProbeQuantity::ToolForce:
      for (const auto& contact : contacts_.tools)
        if (contact.tool.value == *rule.tool)
          sum = to_double(contact::reaction_on(contacts_, contact, world_).force_n);
      return sum;
  }
  return sum;
}

}  // namespace trocar::scenario
