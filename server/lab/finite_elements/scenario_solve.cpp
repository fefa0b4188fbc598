#include "server/lab/finite_elements/scenario_solve.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>

#include "server/lab/finite_elements/state_file.h"
#include "server/lab/finite_elements/surface_traction.h"

namespace trocar::finite_elements {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// A number of steps may be off by this through decimal fractions: 3,600 s of 1 us are wrong by
// less.
constexpr double kStepRounding = 1e-5;

Eigen::Index first_dof(std::uint32_t node) {
  return 3 * static_cast<Eigen::Index>(node);
}

void add_at(Vector& all, std::uint32_t node, const Vec3d& value) {
  all.segment<3>(first_dof(node)) += Eigen::Vector3d(value.x, value.y, value.z);
}
Vec3d at_node(const Vector& all, std::uint32_t node) {
  const auto v = all.segment<3>(first_dof(node));
  return {v[0], v[1], v[2]};
}

double component(const Vec3d& v, std::uint32_t axis) {
  return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

Status check_organ(const scenario::ResolvedScenario& resolved) {
  const auto& scenario = resolved.scenario;
  const auto wrong = [&](const scenario::Place& place, const char* what) {
    return scenario::scenario_error(scenario, place, what);
  };
  if (resolved.organ.mesh.tets.empty())
    return wrong(scenario.organ.place, "has no tets, which the solver \"fem\" needs");
  if (!resolved.organ.stress_free_positions_m.empty())
    return wrong(scenario.organ.place,
                 "is settled; the solver \"fem\" takes organs free of stress");
  if (!scenario.tools.empty())
    return wrong(scenario.run_place, "the solver \"fem\" has no tools: displace a set instead");
  for (const auto& probe : scenario.probes)
    if (probe.quantity == scenario::ProbeQuantity::ToolForce)
      return wrong(probe.place, "the solver \"fem\" has no tools");
  return {};
}

// Checks the steps of a dynamic run; a part of a step that is left over would silently change its
// length.
Status check_steps(double seconds, double dt_s) {
  const double steps = seconds / dt_s;
  if (dt_s > 0 && steps > 0.5 && std::abs(steps - std::round(steps)) <= kStepRounding) return {};
  char text[160];
  std::snprintf(text, sizeof text,
                "--step-ms: %g s are %.6g steps of %g ms, choose a step of which they are a whole "
                "number",
                seconds, steps, dt_s * 1e3);
  return Error{ErrorCode::Usage, text};
}

}  // namespace

ScenarioSolve::ScenarioSolve(scenario::ResolvedScenario resolved, const ScenarioSettings& settings)
    : resolved_(std::move(resolved)), settings_(settings) {
  const auto& run = resolved_.scenario.run;
  step_count_ = is_static() ? run.load_times_s.size()
                            : static_cast<std::uint64_t>(std::llround(run.seconds / settings.dt_s));
}

Result<std::unique_ptr<ScenarioSolve>> ScenarioSolve::create(scenario::ResolvedScenario resolved,
                                                             const ScenarioSettings& settings) {
  if (auto s = check_organ(resolved); !s) return s.error();
  if (const auto& run = resolved.scenario.run; run.mode == scenario::RunMode::Dynamic)
    if (auto s = check_steps(run.seconds, settings.dt_s); !s) return s.error();
  std::unique_ptr<ScenarioSolve> solve(new ScenarioSolve(std::move(resolved), settings));
  Problem problem;
  if (auto s = solve->make_problem_of(problem); !s) return s.error();
  for (const auto& nodes : solve->resolved_.probe_nodes)
    solve->probe_nodes_.push_back(solve->with_middles(nodes, problem.mesh));
  solve->solver_ = std::make_unique<Solver>(std::move(problem), settings.solver);
  solve->add_forces();
  return solve;
}

Status ScenarioSolve::make_problem_of(Problem& problem) {
  const auto& mesh = resolved_.organ.mesh;
  problem.mesh = make_elements(mesh, mesh.rest_positions, settings_.order);
  problem.damping_per_s = resolved_.organ.material.node_damping_per_s;
  if (auto s = add_materials(problem); !s) return s;
  add_holds(problem);
  return validate(problem);
}

Status ScenarioSolve::add_materials(Problem& problem) const {
  const auto& organ = resolved_.organ;
  problem.element_materials = organ::material_map(organ).tets;
  for (std::size_t i = 0; i <= organ.regions.size(); ++i) {
    const auto& material = organ::material_at(organ, static_cast<std::uint16_t>(i));
    const std::string name = i == 0 ? organ.name : organ.regions[i - 1].name;
    problem.densities_kg_m3.push_back(material.density_kg_m3);
    if (material.tension != 0 || material.fibre_tension != 0)
      return scenario::scenario_error(resolved_.scenario, resolved_.scenario.material.place,
                                      "the solver \"fem\" has no tension, set it to 0 for " + name);
    if (i == 0 && settings_.material) {
      problem.materials.push_back(*settings_.material);
      continue;
    }
    if (!material::is_hyperelastic(material))
      return scenario::scenario_error(
          resolved_.scenario, resolved_.scenario.material.place,
          "the solver \"fem\" needs elastic_law = \"neo-hookean\" or \"measured\" for " + name +
              ", see --material");
    problem.materials.push_back(law_of(material, name));
  }
  return {};
}

std::vector<std::uint32_t> ScenarioSolve::with_middles(const scenario::NodeList& nodes,
                                                       const ElementMesh& mesh) const {
  std::vector<std::uint8_t> is_in(mesh.corner_count, 0);
  std::vector<std::uint32_t> all;
  for (const auto node : nodes) {
    is_in[node.value] = 1;
    all.push_back(node.value);
  }
  for (std::size_t i = 0; i < mesh.edge_ends.size(); ++i)
    if (is_in[mesh.edge_ends[i][0]] != 0 && is_in[mesh.edge_ends[i][1]] != 0)
      all.push_back(static_cast<std::uint32_t>(mesh.corner_count + i));
  return all;
}

void ScenarioSolve::add_holds(Problem& problem) {
  std::map<std::uint32_t, std::int32_t> rules;  // by degree of freedom
  for (const auto node : with_middles(resolved_.organ.fixed_nodes, problem.mesh))
    for (std::uint32_t axis = 0; axis < 3; ++axis) rules.emplace(3 * node + axis, -1);
  for (std::size_t i = 0; i < resolved_.displacements.size(); ++i)
    for (const auto node : with_middles(resolved_.displacements[i].nodes, problem.mesh))
      for (std::uint32_t axis = 0; axis < 3; ++axis)
        if ((resolved_.displacements[i].axes >> axis & 1) != 0)
          rules.emplace(3 * node + axis, static_cast<std::int32_t>(i));
  for (const auto& [dof, rule] : rules) {
    problem.held_dofs.push_back(dof);
    held_rules_.push_back(rule);
  }
}

void ScenarioSolve::add_forces() {
  const Problem& problem = solver_->problem();
  weight_ = solver_->weights(resolved_.organ.gravity_m_s2);
  const auto& mesh = resolved_.organ.mesh;
  for (std::size_t i = 0; i < resolved_.forces.size(); ++i) {
    const auto& force = resolved_.forces[i];
    area_shares_.emplace_back();
    normal_shares_.emplace_back();
    if (i < resolved_.scenario.forces.size()) continue;  // on the nodes themselves
    std::vector<std::uint8_t> is_in(mesh.node_count(), 0);
    for (const auto node : force.nodes) is_in[node.value] = 1;
    if (force.normal_areas_m2.empty())
      area_shares_.back() = area_shares(mesh, problem.mesh, is_in);
    else
      normal_shares_.back() = normal_area_shares(mesh, problem.mesh, is_in);
  }
}

Loads ScenarioSolve::loads_at(double time_s) const {
  const Problem& problem = solver_->problem();
  Loads loads{weight_, std::vector<double>(held_rules_.size(), 0.0)};
  for (std::size_t i = 0; i < resolved_.forces.size(); ++i) {
    const auto& force = resolved_.forces[i];
    const Vec3d value = force.over_time.at(time_s);
    for (std::uint32_t n = 0; n < area_shares_[i].size(); ++n)
      add_at(loads.forces, n, value * area_shares_[i][n]);
    for (std::uint32_t n = 0; n < normal_shares_[i].size(); ++n)
      add_at(loads.forces, n, normal_shares_[i][n] * -value.x);
    if (i < resolved_.scenario.forces.size())
      for (std::size_t k = 0; k < force.nodes.size(); ++k)
        add_at(loads.forces, force.nodes[k].value, force.on_node(k, value));
  }
  for (std::size_t i = 0; i < held_rules_.size(); ++i) {
    if (held_rules_[i] < 0) continue;
    const auto& rule = resolved_.displacements[static_cast<std::size_t>(held_rules_[i])];
    loads.held_moves[i] = component(rule.over_time.at(time_s), problem.held_dofs[i] % 3);
  }
  return loads;
}

double ScenarioSolve::time_after(std::uint64_t steps) const {
  if (!is_static()) return static_cast<double>(steps) * settings_.dt_s;
  return steps == 0 ? 0 : resolved_.scenario.run.load_times_s[steps - 1];
}

bool ScenarioSolve::starts_in_equilibrium() const {
  return resolved_.scenario.run.starts_in_equilibrium;
}

// Returns the loads of the state at time 0: it is in equilibrium with all, or at rest with nothing
// moved but what is held.
Loads ScenarioSolve::start_loads() const {
  Loads loads = loads_at(0);
  if (!starts_in_equilibrium()) loads.forces.setZero();
  return loads;
}

StepSettings ScenarioSolve::start_settings() const {
  return {starts_in_equilibrium() ? kInfinity : 0.0, false};
}

StepSettings ScenarioSolve::step_settings() const {
  if (is_static()) return {settings_.is_equilibrium ? kInfinity : 0.0, false};
  return {settings_.dt_s, true};
}

const StepReport& ScenarioSolve::start() {
  if (is_started_ || is_static()) return settling_;
  is_started_ = true;
  settling_ = solver_->step(start_loads(), start_settings());
  if (!starts_in_equilibrium()) solver_->set_forces(loads_at(0).forces);
  return settling_;
}

StepReport ScenarioSolve::step() {
  start();
  ++steps_done_;
  return solver_->step(loads_at(time_s()), step_settings());
}

bool ScenarioSolve::is_due(std::size_t probe) const {
  if (is_static()) return true;
  const double period_s = 1e-3 * resolved_.scenario.probes[probe].every_ticks;
  const double now = time_s() + 1e-9, before = now - settings_.dt_s;
  return std::floor(now / period_s) > std::floor(before / period_s);
}

Vec3d ScenarioSolve::probe(std::size_t index) const {
  const auto& nodes = resolved_.probe_nodes[index];
  const auto mean = [&](const Vector& all) {
    Vec3d sum;
    for (const auto node : nodes) sum += at_node(all, node.value);
    return sum / static_cast<double>(nodes.size());
  };
  switch (resolved_.scenario.probes[index].quantity) {
    case scenario::ProbeQuantity::Displacement:
      return mean(solver_->displacements());
    case scenario::ProbeQuantity::Velocity:
      return mean(solver_->velocities());
    case scenario::ProbeQuantity::Reaction:
    case scenario::ProbeQuantity::ToolForce:
    case scenario::ProbeQuantity::StartForce:
    case scenario::ProbeQuantity::EndForce:
      break;
  }
  const Vector holding = solver_->reactions() - loads_at(time_s()).forces;
  const auto& held = solver_->problem().held_dofs;
  Vec3d sum;
  for (const auto node : probe_nodes_[index]) {
    Vec3d force = at_node(holding, node);
    const auto is_held = [&](std::uint32_t axis) {
      return std::binary_search(held.begin(), held.end(), 3 * node + axis);
    };
    if (!is_held(0)) force.x = 0;
    if (!is_held(1)) force.y = 0;
    if (!is_held(2)) force.z = 0;
    sum += force;
  }
  return sum;
}

std::vector<Vec3d> ScenarioSolve::displacements() const {
  std::vector<Vec3d> all;
  for (std::uint32_t n = 0; n < resolved_.organ.mesh.node_count(); ++n)
    all.push_back(at_node(solver_->displacements(), n));
  return all;
}

std::vector<Vec3d> ScenarioSolve::velocities() const {
  std::vector<Vec3d> all;
  for (std::uint32_t n = 0; n < resolved_.organ.mesh.node_count(); ++n)
    all.push_back(at_node(solver_->velocities(), n));
  return all;
}

std::vector<std::uint8_t> ScenarioSolve::held_nodes() const {
  std::vector<std::uint8_t> axes(resolved_.organ.mesh.node_count(), 0);
  for (const auto dof : solver_->problem().held_dofs)
    if (dof / 3 < axes.size()) ++axes[dof / 3];
  for (auto& count : axes) count = count == 3 ? 1 : 0;
  return axes;
}

Status ScenarioSolve::save(const std::filesystem::path& path) const {
  return write_state(path, *solver_);
}

Status ScenarioSolve::resume(const std::filesystem::path& path) {
  const auto state = read_state(path, solver_->problem());
  if (!state) return state.error();
  const std::uint64_t first = is_static() ? 0 : 1;  // the step to the loads at the start
  if (state->steps < first || state->steps - first > step_count_)
    return Error{ErrorCode::BadFile, path.string() + ": is not at a step of this scenario"};
  const std::uint64_t steps = state->steps - first;
  const double time = time_after(steps);
  if (!is_static() && std::abs(state->time_s - time) > kStepRounding * time)
    return Error{ErrorCode::BadFile,
                 path.string() + ": has other steps of time, resume with the same --step-ms"};
  if (state->path != path_to(steps))
    return Error{ErrorCode::BadFile, path.string() +
                                         ": was come to with other loads, another start or "
                                         "--response: resume with those of its run"};
  solver_->restore(*state);
  steps_done_ = steps;
  is_started_ = true;
  return {};
}

// Hashes the solver's path to the state in which these steps are done.
std::uint64_t ScenarioSolve::path_to(std::uint64_t steps) const {
  std::uint64_t path = 0;
  if (!is_static()) {
    path = path_after(path, start_loads(), start_settings());
    if (!starts_in_equilibrium()) path = path_after(path, loads_at(0), {});
  }
  for (std::uint64_t i = 1; i <= steps; ++i)
    path = path_after(path, loads_at(time_after(i)), step_settings());
  return path;
}

}  // namespace trocar::finite_elements
