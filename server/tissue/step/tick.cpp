#include "server/tissue/step/tick.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "common/base/timing.h"
#include "server/tissue/contact/update_claims.h"
#include "server/tissue/step/edit_followers.h"

namespace trocar::step {

void admit_inputs(State& state, StepContext& context) {
  for (const auto slot : context.inputs->leaves)
    for (int i = 0; slot.has_tools() && i < kToolsPerHand; ++i) {
      const auto tool = tool_slot(slot, i);
      state.grasps.anchor(tool, state.tools[tool].pose);
      state.claims.leave(tool, state.world.tick);
    }
  context.report.inputs_dropped = state.tools.admit(*context.inputs, state.world.tick);
  if (context.report.inputs_dropped > 0) context.report.faults |= kFaultInputDropped;
}

void follow_contacts(State& state, StepContext& context) {
  state.proxies.update(context.contacts, state.world, state.tools);
}

void update_claims(State& state, StepContext& context) {
  contact::update_claims(state.world, state.tools, context.contacts, context.requests, state.claims,
                         state.grasps, context.claim_events);
}

namespace {

void find_contacts(State& state, StepContext& context) {
  context.finder.find(
      {state.world, state.tools, state.claims, state.grasps, state.proxies, state.world.tick},
      context.contacts);
  if (context.decisions.policy.has_self_contact)
    context.self_finder.find(state.world, state.self_contacts, context.contacts);
  context.report.self_pairs = static_cast<std::uint32_t>(context.contacts.self_points().size());
  context.report.contact_nodes = static_cast<std::uint32_t>(context.contacts.seeds.size());
  if (context.contacts.dropped > 0) context.report.faults |= kFaultContactLimit;
  if (context.contacts.tools_inside > 0) context.report.faults |= kFaultToolInside;
}

void fill_queue(State& state, StepContext& context) {
  context.seeds.assign(kMaxTools + 1, {});
  for (const auto& tool : context.contacts.tools)
    context.seeds[tool.tool.value] = context.contacts.seeds_of(tool);
  context.seeds.back() = context.contacts.self_seeds;
  if (context.loads != nullptr)
    context.seeds.insert(context.seeds.end(), context.loads->seeds().begin(),
                         context.loads->seeds().end());
  // However little else there is room for, every touched or loaded node is in the queue.
  std::size_t touched = 0;
  for (const auto& seeds : context.seeds) touched += seeds.size();
  const auto node_limit =
      std::max(context.decisions.node_limit, static_cast<std::uint32_t>(touched));
  context.queue.fill(context.neighbours, context.seeds,
                     {context.decisions.depth_limit, node_limit});
  context.active.collect(context.queue, context.decisions.boundary, state.world);
  context.report.queue_nodes = static_cast<std::uint32_t>(context.queue.nodes().size());
  context.report.active_nodes = static_cast<std::uint32_t>(context.active.nodes().size());
  context.report.region_count = context.queue.region_count();
}

// Swept nodes stand by layer, those that have left the queue last.
void find_bands(StepContext& context, std::span<const NodeIndex> nodes) {
  if (context.decisions.boundary == world::Boundary::Whole) {  // No layer has less than another.
    context.sweep_bands.fill({nodes.size(), context.decisions.sweeps});
    context.report.layer_nodes.back() = static_cast<std::uint32_t>(nodes.size());
    return;
  }
  const auto layer_of = [&context](NodeIndex node) { return context.queue.layer_of(node); };
  const auto sweeps = sweeps_of_layers(context.decisions);
  std::size_t begin = 0;
  for (std::size_t layer = 0; layer < kSweepLayers; ++layer) {
    const bool is_last = layer + 1 == kSweepLayers;
    const auto end =
        is_last ? nodes.size()
                : static_cast<std::size_t>(std::ranges::upper_bound(nodes, layer, {}, layer_of) -
                                           nodes.begin());
    context.sweep_bands[layer] = {end, sweeps[layer]};
    context.report.layer_nodes[layer] = static_cast<std::uint32_t>(end - begin);
    begin = end;
  }
}

void note_solver(Tick tick, const SolverFigures& now, StepContext& context) {
  const auto& before = context.solver_figures;
  if (now.is_reduced != before.is_reduced || now.reason != before.reason ||
      !(now.patches == before.patches))
    context.solver_changes.push_back({tick, now});
  context.solver_figures = now;
}

// The solver is told this for one step of time. far: it moves what is not swept; null: sweeps do.
dynamics::SolveSettings settings_of(StepContext& context, dynamics::FarFieldSolver* far) {
  const auto& decisions = context.decisions;
  const auto& policy = decisions.policy;
  dynamics::SolveSettings settings{decisions.sweeps, decisions.over_relaxation, kTickSeconds};
  if (policy.steps_per_tick > 1) settings.dt = static_cast<float>(1e-3 / policy.steps_per_tick);
  if (far != nullptr) {
    settings.far_solver = far;
  } else if (decisions.boundary == world::Boundary::Graded) {
    const auto plan = context.far_plan.with_steps(policy.steps_per_tick)
                          .with_sweeps(decisions.far_sweeps)
                          .with_interval(decisions.far_interval);
    settings.far_interval = decisions.far_interval;
    settings.far_sweeps = plan.sweeps;
    settings.far_over_relaxation =
        policy.far_over_relaxation > 0 ? policy.far_over_relaxation : plan.over_relaxation;
    settings.has_linear_far_field = context.has_linear_far_field && !decisions.is_far_exact;
  }
  if (policy.residual_tolerance_n > 0) {
    settings.sweeps = policy.max_sweeps;
    settings.residual_tolerance_n = policy.residual_tolerance_n;
  } else if (context.sweep_bands.back().sweeps < decisions.sweeps) {
    settings.bands = context.sweep_bands;
  }
  return settings;
}

// Writes the world's displacements and velocities, and the solver's figures of the report.
// largest_move_m: of a node in the whole tick, at most.
float solve_steps(std::span<const NodeIndex> nodes, const dynamics::SolveSettings& settings,
                  State& state, StepContext& context) {
  auto& report = context.report;
  const auto steps = context.decisions.policy.steps_per_tick;
  const double begin_s =
      static_cast<double>(state.world.tick - 1) / static_cast<double>(kTicksPerSecond);
  float largest_move_m = 0;
  for (std::uint32_t i = 1; i <= steps; ++i) {
    const auto loads = context.loads != nullptr
                           ? context.loads->at(begin_s + 1e-3 / steps * i, state.world)
                           : dynamics::ExternalLoads{};
    const auto solved = context.solver.solve(context.contacts, nodes, settings, state.world, loads);
    largest_move_m += solved.largest_move_m;
    report.residual_n = solved.residual_n;
    report.sweeps += solved.sweeps;
    report.node_sweeps += solved.node_sweeps;
    report.far_node_sweeps += solved.far_node_sweeps;
    report.nodes_rejected += solved.nodes_rejected;
    report.nodes_restored += solved.nodes_restored;
    report.is_converged &=
        settings.residual_tolerance_n == 0 ||
        (solved.residual_n <= settings.residual_tolerance_n && solved.nodes_rejected == 0);
    if (solved.is_stepped_down) report.faults |= kFaultOverRelaxation;
    if (solved.nodes_rejected > 0) report.faults |= kFaultNonFinite;
  }
  if (context.loads != nullptr) context.loads->measure(context.solver, context.contacts);
  report.far_sweeps = settings.far_sweeps;
  report.is_far_linear = settings.has_linear_far_field;
  report.far_interval = settings.far_interval;
  return largest_move_m;
}

// Its fields know tools alone, and one step of time in a tick.
bool is_reduction_off(const StepContext& context) {
  const auto& decisions = context.decisions;
  return decisions.is_reduction_off || decisions.policy.steps_per_tick > 1 ||
         (context.loads != nullptr && !context.loads->rules().empty());
}

void solve(State& state, StepContext& context) {
  const auto& decisions = context.decisions;
  auto nodes = context.active.nodes();
  std::optional<dynamics::FarFieldModel::Choice> modelled;
  if (state.far_model) {
    modelled = state.far_model->choose(
        {context.contacts, nodes, decisions.boundary, is_reduction_off(context)}, context.solver,
        state.world);
    note_solver(state.world.tick, state.far_model->figures(), context);
  }
  if (modelled) nodes = modelled->near;
  context.report.is_reduced = modelled.has_value();
  find_bands(context, nodes);
  float largest_move =
      solve_steps(nodes, settings_of(context, modelled ? modelled->far : nullptr), state, context);
  const auto settled =
      context.active.settle(context.queue, context.solver.residuals_n(), state.world);
  context.solver.read_state(state.world, settled);
  largest_move += settled.empty() ? 0 : propagation::kQuietDisplacementMetres;
  context.finder.surface_moved(largest_move);
  context.self_finder.surface_moved(largest_move);
  context.travel_m += static_cast<double>(largest_move);
}

// Each active node once a frame: what has been stretched for that long tears. Not where it is held:
// there it would find no relief.
void find_tears(State& state, StepContext& context) {
  if (!state.cuts.can_tear()) return;
  context.may_tear.clear();
  const auto nodes = context.active.nodes();
  for (auto i = state.world.tick % kTicksPerFrame; i < nodes.size(); i += kTicksPerFrame)
    if (!state.grasps.holds(nodes[i])) context.may_tear.push_back(nodes[i]);
  state.cuts.tear(state.world, context.may_tear);
}

void cut_tissue(State& state, StepContext& context) {
  auto& cuts = state.cuts;
  find_tears(state, context);
  const auto edit =
      cuts.cut(state.tools, state.claims, state.world, context.travel_m, context.report.cut);
  if (context.report.cut.is_full) context.report.faults |= kFaultCutLimit;
  if (!edit) return;
  hand_out(*edit, state, context);
  cuts.end_edit();
}

ToolFrame describe_tool(const State& state, const StepContext& context, ToolSlot slot) {
  const auto& tool = state.tools[slot];
  ToolFrame frame{.tool = slot, .world_from_tool = tool.pose, .verb = tool.verb};
  frame.has_claim = state.claims.is_in_effect(slot);
  frame.world_from_proxy = state.proxies[slot].is_placed ? state.proxies[slot].pose : tool.pose;
  frame.is_silent = state.world.tick - tool.last_sample_tick > hands::kLeaseTicks;
  for (const auto& contact : context.contacts.tools) {
    if (contact.tool != slot) continue;
    frame.is_inside = contact.verb == tool::Verb::Push && !contact.is_placed;
    frame.contact_nodes = contact.seeds_end - contact.seeds_begin;
    const auto reaction = contact::reaction_on(context.contacts, contact, state.world);
    frame.force_n = reaction.force_n;
    frame.torque_nm = reaction.torque_nm;
    frame.penetration_m = reaction.penetration_m;
  }
  if (state.claims.claim(slot).verb == tool::Verb::Cut) frame.force_n = state.cuts.force_n(slot);
  return frame;
}

void quantise_and_publish(State& state, StepContext& context) {
  const auto new_layout = state.cuts.pop_new_layout();
  const auto change = state.cuts.pop_change();
  const auto& layout = state.cuts.layout();
  context.surface_displacements.resize(layout.vertex_count());
  for (std::size_t v = 0; v < layout.vertex_count(); ++v)
    context.surface_displacements[v] = state.world.displacements[layout.node_of_vertex[v].value];
  wire::quantise(context.surface_displacements, state.quantised);

  auto frame = std::make_shared<PublishedFrame>();
  frame->frame = frame_of(state.world.tick);
  frame->tick = state.world.tick;
  frame->epoch = layout.epoch;
  frame->change = change;
  frame->new_layout = new_layout;
  frame->surface = state.quantised;
  frame->surface_crc = wire::surface_crc(state.quantised);
  frame->regions.reserve(layout.vertex_count());
  for (const auto node : layout.node_of_vertex)
    frame->regions.push_back(context.queue.region(node));
  for (std::uint8_t i = 0; i < kMaxTools; ++i)
    if (state.tools[ToolSlot{i}].has_sample)
      frame->tools.push_back(describe_tool(state, context, ToolSlot{i}));
  frame->claim_events = context.claim_events;
  context.claim_events.clear();
  frame->mark_events = std::exchange(context.mark_events, {});
  frame->active_nodes = context.report.active_nodes;
  frame->queue_nodes = context.report.queue_nodes;
  frame->region_count = context.report.region_count;
  frame->sweeps = context.report.sweeps;
  frame->layer_sweeps = sweeps_of_layers(context.decisions);
  frame->node_limit = context.decisions.node_limit;
  frame->far_sweeps = context.report.far_sweeps;
  frame->far_interval = context.report.far_interval;
  frame->residual_n = context.report.residual_n;
  frame->relaxation = context.solver.tissue().relaxation_figures();
  frame->solver = context.solver_figures;
  frame->solver_changes = context.solver_changes;
  context.solver_changes.clear();
  context.frame = std::move(frame);
}

void hash_state(State& state, StepContext& context) {
  context.hasher.reset();
  auto archive = world::StateArchive::hashing(context.hasher);
  state.visit(archive);
  context.report.state_hash = context.hasher.digest();
}

}  // namespace

void run_tick(State& state, StepContext& context) {
  auto& report = context.report;
  report = TickReport{};
  context.frame.reset();
  std::uint64_t before = thread_cpu_ns();
  const auto stage = [&](Stage name, auto&& body) {
    body(state, context);
    const std::uint64_t now = thread_cpu_ns();
    report.stage_cpu_ns[static_cast<std::size_t>(name)] += static_cast<std::uint32_t>(now - before);
    before = now;
  };

  report.tick = ++state.world.tick;
  stage(Stage::Admit, admit_inputs);
  stage(Stage::Contacts, find_contacts);
  stage(Stage::Queue, fill_queue);
  stage(Stage::Solve, solve);
  stage(Stage::Contacts, follow_contacts);
  stage(Stage::Cut, cut_tissue);
  stage(Stage::Claims, update_claims);
  stage(Stage::Hash, hash_state);
  if (publishes_frame(state.world.tick)) stage(Stage::Publish, quantise_and_publish);
}

}  // namespace trocar::step
