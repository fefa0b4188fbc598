#include "server/tissue/step/equilibrium.h"

#include <algorithm>
#include <cmath>

#include "server/tissue/contact/update_claims.h"

namespace trocar::step {
namespace {

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
}  // namespace

Equilibrium::Equilibrium(Simulation& simulation, const EquilibriumRules& rules)
    : simulation_(simulation), rules_(rules) {
  const auto& world = state().world;
  for (std::uint32_t i = 0; i < world.node_count(); ++i)
    if (world.node_classes[i] != world::NodeClass::Fixed) free_nodes_.push_back(NodeIndex(i));
}

EquilibriumReport Equilibrium::find(const dynamics::ExternalLoads& loads) {
  auto report = relax(loads);
  simulation_.loads().measure(context().solve.solver, context().contact.found);
  return report;
}

EquilibriumReport Equilibrium::find(const dynamics::ExternalLoads& loads, const Inputs& inputs) {
  auto& world = state().world;
  EquilibriumReport report;
  std::uint32_t sweeps = 0;
  float change = INFINITY;
  for (int round = 0;
       round < kMaxContactRounds && (round < kMinContactRounds || change > kContactChange_m);
       ++round) {
    meet_tools(inputs(++world.tick, round == 0));
    before_.assign(world.displacements.begin(), world.displacements.end());
    report = relax(loads);
    sweeps += report.solve.sweeps;
    change = 0;
    for (std::size_t i = 0; i < before_.size(); ++i)
      change = std::max(change, length(world.displacements[i] - before_[i]));
    auto& contact = context().contact;
    auto& events = context().outbox.claim_events;
    state().proxies.update(contact.found, world, state().tools);
    events.clear();
    contact::update_claims(world, state().tools, contact.found, {}, contact.requests,
                           state().claims, state().grasps, events);
  }
  simulation_.loads().measure(context().solve.solver, context().contact.found);
  report.is_converged &= change <= kContactChange_m;
  report.solve.sweeps = sweeps;
  return report;
}

void Equilibrium::meet_tools(const hands::TickInputs& inputs) {
  auto& now = state();
  admit_inputs(inputs, now.world.tick, now.tools, now.claims, now.grasps);
  now.grasps.follow(now.tools, 0);
  // Without time a tool has no speed either.
  context().contact.finder.find({.world = now.world,
                                 .tools = now.tools,
                                 .claims = now.claims,
                                 .grasps = now.grasps,
                                 .proxies = now.proxies,
                                 .tick = now.world.tick,
                                 .max_step_m = kNoLimit_m,
                                 .jump_m = kNoLimit_m},
                                context().contact.found);
}

EquilibriumReport Equilibrium::relax(const dynamics::ExternalLoads& loads) {
  auto& world = state().world;
  auto& solver = context().solve.solver;
  auto& contact = context().contact;
  const std::uint32_t most = rules_.max_sweeps;
  dynamics::SolveSettings how{.dt = kStaticStep_s};
  how.residual_tolerance_n = rules_.tolerance_n;
  how.over_relaxation = kStaticOverRelaxation;
  how.has_safeguard = false;
  EquilibriumReport report;
  std::uint32_t sweeps = 0;
  float last_residual = INFINITY;
  place_held(loads);
  // Contacts that slide have no potential energy, so that nothing can be said about its descent.
  const bool descends = contact.found.points.empty();
  double last_energy_j = descends ? potential_energy_j(loads) : 0;
  do {
    if (descends) before_stretch_.assign(world.displacements.begin(), world.displacements.end());
    how.sweeps = std::min(kSweepsPerRelaxation, most - sweeps);
    report.solve = solver.solve(contact.found, free_nodes_, how, world, loads);
    contact.finder.surface_moved(report.solve.largest_move_m);
    std::ranges::fill(world.velocities, Vec3f{});
    sweeps += report.solve.sweeps;
    const double energy_j = descends ? potential_energy_j(loads) : 0;
    if (!(energy_j <= last_energy_j + kEnergySlack * std::abs(last_energy_j))) {
      std::ranges::copy(before_stretch_, world.displacements.begin());
      solver.read_motion(world);
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

void Equilibrium::place_held(const dynamics::ExternalLoads& loads) {
  auto& world = state().world;
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
  context().solve.solver.read_motion(world);
  context().contact.finder.surface_moved(largest_move_m);
}

double Equilibrium::potential_energy_j(const dynamics::ExternalLoads& loads) const {
  const auto& world = simulation_.state().world;
  double energy_j = simulation_.context().solve.solver.tissue().energy_j(world.displacements);
  for (std::size_t i = 0; i < world.node_count(); ++i) {
    Vec3d load = simulation_.organ().gravity_m_s2 * static_cast<double>(world.masses[i]);
    if (!loads.forces.empty()) load += to_double(loads.forces[i]);
    energy_j -= dot(load, to_double(world.displacements[i]));
  }
  return energy_j;
}

}  // namespace trocar::step
