#include "server/tissue/step/tick.h"

#include <algorithm>
#include <utility>

#include "common/base/timing.h"
#include "server/tissue/contact/update_claims.h"
#include "server/tissue/step/edit_followers.h"
#include "server/tissue/step/rest.h"
#include "server/tissue/step/thread_stage.h"
#include "server/tissue/step/tie_breaks.h"

namespace trocar::step {

std::uint32_t admit_inputs(const hands::TickInputs& inputs, Tick tick, hands::ToolTable& tools,
                           hands::ClaimTable& claims, contact::GraspTable& grasps) {
  for (const auto slot : inputs.leaves)
    for (int i = 0; slot.has_tools() && i < kToolsPerHand; ++i) {
      const auto tool = tool_slot(slot, i);
      grasps.anchor(tool);
      claims.leave(tool, tick);
    }
  for (const auto& change : inputs.changes) {
    if (!change.tool.is_valid()) continue;
    grasps.anchor(change.tool);
    claims.leave(change.tool, tick);
  }
  return tools.admit(inputs, tick);
}

namespace {

// A tool takes along what it holds and where it presses. False: the input was dropped.
bool hand_over(const hands::Handover& handover, State& state, Outbox& outbox) {
  const Tick tick = state.world.tick;
  if (!state.tools.hand_over(handover, tick)) return false;
  state.claims.hand_over(handover.from, handover.to, tick, outbox.claim_events);
  state.grasps.hand_over(handover.from, handover.to);
  state.proxies.hand_over(handover.from, handover.to);
  if (state.threads) state.threads->hand_over(handover.from, handover.to);
  return true;
}

void find_contacts(State& state, const TickDecisions& decisions, ContactWork& contact) {
  auto& found = contact.found;
  state.grasps.follow(state.tools, decisions.waiting_tools);
  contact.finder.find({.world = state.world,
                       .tools = state.tools,
                       .claims = state.claims,
                       .grasps = state.grasps,
                       .proxies = state.proxies,
                       .tick = state.world.tick,
                       .held_back = decisions.waiting_tools},
                      found);
  if (decisions.policy.has_self_contact)
    contact.self_finder.find(state.world, state.self_contacts, found);
}

ContactReport report_of(const contact::ContactList& found, const State& state) {
  return {.nodes = static_cast<std::uint32_t>(found.seeds.size()),
          .self_pairs = static_cast<std::uint32_t>(state.self_contacts.nodes().size()),
          .is_full = found.dropped > 0,
          .has_tool_inside = found.tools_inside > 0};
}

// Nodes that enter the queue are activated in the world.
wire::NearFigures fill_queue(const contact::ContactList& contacts, const ExternalLoads* loads,
                             const TickDecisions& decisions, bool has_tension, world::World& world,
                             NearWork& near) {
  auto& seeds = near.seeds;
  seeds.assign(kMaxTools, {});
  for (const auto& tool : contacts.tools) seeds[tool.tool.value] = contacts.seeds_of(tool);
  // The surroundings of pairs are swept more where all else stands still, and where tension keeps
  // wounds from coming to rest. Else there are too many while people cut.
  const std::span<const NodeIndex> pressed(contacts.self_seeds);
  const bool spreads =
      decisions.boundary != world::Boundary::Graded || (has_tension && contacts.tools.empty());
  if (spreads) seeds.push_back(pressed);
  if (loads != nullptr) seeds.insert(seeds.end(), loads->seeds().begin(), loads->seeds().end());
  // However little else there is room for, every touched or loaded node is in the queue.
  std::size_t touched = 0;
  for (const auto& nodes : seeds) touched += nodes.size();
  const auto node_limit = std::max(decisions.node_limit, static_cast<std::uint32_t>(touched));
  near.queue.fill(near.neighbours, seeds, {decisions.depth_limit, node_limit});
  near.active.collect(near.queue, spreads ? std::span<const NodeIndex>{} : pressed,
                      decisions.boundary, world);
  return {.active_nodes = static_cast<std::uint32_t>(near.active.nodes().size()),
          .queue_nodes = static_cast<std::uint32_t>(near.queue.nodes().size()),
          .node_limit = decisions.node_limit,
          .region_count = near.queue.region_count()};
}

// Swept nodes stand by layer, those that have left the queue last. Returns how many each layer has.
LayerCounts find_bands(const propagation::ActiveSet& active,
                       const propagation::PropagationQueue& queue, const TickDecisions& decisions,
                       std::span<dynamics::SweepBand> bands) {
  const auto nodes = active.nodes();
  LayerCounts layer_nodes{};
  if (decisions.boundary == world::Boundary::Whole) {  // No layer has less than another.
    std::ranges::fill(bands, dynamics::SweepBand{nodes.size(), decisions.sweeps});
    layer_nodes.back() = static_cast<std::uint32_t>(nodes.size());
    return layer_nodes;
  }
  const auto layer_of = [&queue](NodeIndex node) { return queue.layer_of(node); };
  const auto unpressed = nodes.subspan(active.pressed_count());
  const auto sweeps = sweeps_of_layers(decisions);
  std::size_t begin = 0;
  for (std::size_t layer = 0; layer < kSweepLayers; ++layer) {
    const bool is_last = layer + 1 == kSweepLayers;
    const auto end =
        is_last
            ? nodes.size()
            : active.pressed_count() +
                  static_cast<std::size_t>(
                      std::ranges::upper_bound(unpressed, layer, {}, layer_of) - unpressed.begin());
    bands[layer] = {end, sweeps[layer]};
    layer_nodes[layer] = static_cast<std::uint32_t>(end - begin);
    begin = end;
  }
  return layer_nodes;
}

// Tets along wounds are small and stiff: what moves there without a tool comes to rest under more
// sweeps than the uncut mesh needs. While people cut nothing has to rest, and time is short: fewer
// only keep it from shaking more. Where there is tension, what is cut shakes too long after those,
// and tangles stay unless all that pulls at them is swept as often.
constexpr std::uint32_t kRestSweeps = 4, kCutSweeps = 2;
constexpr Tick kRestsAfter = 256;  // from what a blade did last in tissue

void sweep_until_rest(bool is_being_cut, bool has_tension, dynamics::SolveSettings& settings) {
  const auto least = is_being_cut && !has_tension ? kCutSweeps : kRestSweeps;
  settings.sweeps = std::max(settings.sweeps, least);
  if (has_tension) settings.far_sweeps = std::max(settings.far_sweeps, least);
  settings.cut_sweeps = least;
  settings.bands = {};
}

// The solver is told this for one step of time.
dynamics::SolveSettings settings_of(const TickDecisions& decisions, const SolveWork& work) {
  const auto& policy = decisions.policy;
  dynamics::SolveSettings settings{decisions.sweeps, decisions.over_relaxation, kTickSeconds};
  if (policy.steps_per_tick > 1) settings.dt = static_cast<float>(1e-3 / policy.steps_per_tick);
  if (decisions.boundary == world::Boundary::Graded) {
    const auto plan = work.far_plan.with_steps(policy.steps_per_tick)
                          .with_sweeps(decisions.far_sweeps)
                          .with_interval(decisions.far_interval);
    settings.far_interval = decisions.far_interval;
    settings.far_sweeps = plan.sweeps;
    settings.far_over_relaxation =
        policy.far_over_relaxation > 0 ? policy.far_over_relaxation : plan.over_relaxation;
    settings.has_linear_far_field = work.has_linear_far_field && !decisions.is_far_exact;
  }
  if (policy.residual_tolerance_n > 0) {
    settings.sweeps = policy.max_sweeps;
    settings.residual_tolerance_n = policy.residual_tolerance_n;
  } else if (work.bands.back().sweeps < decisions.sweeps) {
    settings.bands = work.bands;
  }
  return settings;
}

// Writes the world's displacements and velocities.
SolveReport solve_steps(const contact::ContactList& contacts, std::span<const NodeIndex> nodes,
                        const dynamics::SolveSettings& settings, std::uint32_t steps,
                        ExternalLoads* loads, world::World& world, dynamics::BlockDescent& solver) {
  SolveReport report;
  const double begin_s = static_cast<double>(world.tick - 1) / static_cast<double>(kTicksPerSecond);
  for (std::uint32_t i = 1; i <= steps; ++i) {
    const auto loads_now =
        loads != nullptr ? loads->at(begin_s + 1e-3 / steps * i, world) : dynamics::ExternalLoads{};
    const auto solved = solver.solve(contacts, nodes, settings, world, loads_now);
    report.largest_move_m += solved.largest_move_m;
    report.figures.residual_n = solved.residual_n;
    report.figures.sweeps += solved.sweeps;
    report.node_sweeps += solved.node_sweeps;
    report.far_node_sweeps += solved.far_node_sweeps;
    report.nodes_rejected += solved.nodes_rejected;
    report.nodes_restored += solved.nodes_restored;
    report.is_converged &=
        settings.residual_tolerance_n == 0 ||
        (solved.residual_n <= settings.residual_tolerance_n && solved.nodes_rejected == 0);
    report.is_stepped_down |= solved.is_stepped_down;
  }
  if (loads != nullptr) loads->measure(solver, contacts);
  report.figures.far_sweeps = settings.far_sweeps;
  report.figures.far_interval = settings.far_interval;
  report.is_far_linear = settings.has_linear_far_field;
  return report;
}

// Active nodes that have come to rest are let go.
SolveReport solve(const contact::ContactList& contacts, bool may_rest,
                  const TickDecisions& decisions, ExternalLoads* loads, State& state,
                  NearWork& near, SolveWork& work) {
  auto& world = state.world;
  auto& active = near.active;
  const auto& queue = near.queue;
  const auto nodes = active.nodes();
  const auto layer_nodes = find_bands(active, queue, decisions, work.bands);
  auto settings = settings_of(decisions, work);
  const bool has_untouched_wounds = contacts.tools.empty() && !world.origins.empty();
  if (may_rest && has_untouched_wounds && !(settings.residual_tolerance_n > 0))
    sweep_until_rest(world.tick < state.cuts.last_work() + kRestsAfter, work.has_tension, settings);
  auto report = solve_steps(contacts, nodes, settings, decisions.policy.steps_per_tick, loads,
                            world, work.solver);
  const auto settled =
      active.settle(queue, work.solver.residuals_n(), decisions.linger_ticks, world);
  work.solver.read_state(world, settled);
  report.largest_move_m += settled.empty() ? 0 : propagation::kQuietDisplacementMetres;
  report.layer_nodes = layer_nodes;
  report.figures.layer_sweeps = sweeps_of_layers(decisions);
  return report;
}

// These look only at what may have moved far enough, and are told how far that is.
void note_motion(float largest_move_m, float carried_m, ContactWork& contact, CutWork& cut) {
  const float any_move_m = std::max(largest_move_m, carried_m);
  contact.finder.surface_moved(any_move_m);
  cut.travel_m += static_cast<double>(any_move_m);
}

// Free pieces that tools hold, each as often as tools hold it.
void find_held(const contact::GraspTable& grasps, const pieces::PieceList& pieces,
               std::vector<std::uint32_t>& held) {
  held.clear();
  if (pieces.size() == 0) return;
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    const auto begin = static_cast<std::ptrdiff_t>(held.size());
    for (const auto node : grasps[ToolSlot{i}].nodes) {
      const auto piece = pieces.piece_of(node);
      if (piece != pieces::PieceList::kBody &&
          std::find(held.begin() + begin, held.end(), piece) == held.end())
        held.push_back(piece);
    }
  }
}

// Each active node once a frame: what has been stretched for that long tears. Not where it is held:
// there it would find no relief. Nor does a free piece but between two tools: nothing else pulls at
// it from two sides, and what swings after a tear would go on tearing.
void find_tears(std::span<const NodeIndex> nodes, const contact::GraspTable& grasps,
                const pieces::PieceList& pieces, const world::World& world,
                blades::TissueCuts& cuts, CutWork& work) {
  if (!cuts.can_tear()) return;
  find_held(grasps, pieces, work.held_pieces);
  const auto is_pulled = [&](NodeIndex node) {
    const auto piece = pieces.piece_of(node);
    return piece == pieces::PieceList::kBody || std::ranges::count(work.held_pieces, piece) > 1;
  };
  work.may_tear.clear();
  for (auto i = world.tick % kTicksPerFrame; i < nodes.size(); i += kTicksPerFrame)
    if (is_pulled(nodes[i]) && !grasps.holds(nodes[i])) work.may_tear.push_back(nodes[i]);
  cuts.tear(world, work.may_tear);
}

// Nothing is solved where all tissue sleeps.
SolveReport solve_awake(const contact::ContactList& contacts, bool may_rest,
                        const TickDecisions& decisions, ExternalLoads* loads, State& state,
                        StepContext& context) {
  auto& work = context.solve;
  SolveReport report;
  if (begin_solving(may_rest, state.world, context.pieces, work.solver))
    report = solve(contacts, may_rest, decisions, loads, state, context.near, work);
  const auto motion = end_solving(may_rest, contacts, state.world, context.pieces, work.solver);
  report.largest_move_m += motion.awake_m;
  note_motion(report.largest_move_m, motion.carried_m, context.contact, context.cut);
  return report;
}

// An edit of the topology goes to all of the state, and to the work that follows from it.
blades::CutReport cut_tissue(std::uint32_t waiting_tools, State& state, CutWork& cut,
                             pieces::Pieces& pieces, ContactWork& contact, NearWork& near,
                             SolveWork& solve) {
  auto& cuts = state.cuts;
  find_tears(near.active.nodes(), state.grasps, pieces.list(), state.world, cuts, cut);
  blades::CutReport report;
  const auto edit =
      cuts.cut({state.tools, state.claims, waiting_tools}, state.world, cut.travel_m, report);
  if (edit) {
    hand_out(*edit, state, pieces, contact, near, solve);
    cuts.end_edit();
  }
  return report;
}

// The frame's blood is state of the next tick, as its rounding is.
void bleed(const hands::ToolTable& tools, const wire::SurfaceLayout& layout, bleeding::Blood& blood,
           BleedWork& work, PublishedFrame& frame) {
  work.tools.clear();
  for (const auto& tool : frame.tools)
    if (!tool.is_silent && !tool.is_inside)
      work.tools.push_back({tool.tool, tools[tool.tool].shape, tool.verb,
                            to_double(tool.world_from_proxy.position),
                            length(to_double(tool.force_n))});
  frame.figures.blood = work.bleeding.run(
      {layout, frame.surface, frame.change.get(), frame.new_layout != nullptr}, work.tools, blood);
  frame.blood = blood.levels;
  frame.blood_crc = wire::blood_crc(frame.blood);
}

std::uint64_t hash_of(State& state, StateHasher& hasher) {
  hasher.reset();
  auto archive = world::StateArchive::hashing(hasher);
  state.visit(archive);
  return hasher.digest();
}

touch::TouchTable::Scene touch_scene(const State& state, const contact::ContactList& contacts) {
  return {state.world, state.tools, state.claims, state.grasps, contacts, state.cuts};
}

ToolFrame describe_tool(const State& state, const contact::ContactList& contacts, ToolSlot slot) {
  const auto& tool = state.tools[slot];
  ToolFrame frame{.tool = slot, .world_from_tool = tool.pose, .verb = tool.verb};
  frame.has_claim = state.claims.is_in_effect(slot);
  frame.world_from_proxy = state.proxies[slot].is_placed  ? state.proxies[slot].pose
                           : state.grasps[slot].is_behind ? state.grasps[slot].jaws
                                                          : tool.pose;
  frame.is_silent = state.world.tick - tool.last_sample_tick > hands::kLeaseTicks;
  for (const auto& contact : contacts.tools) {
    if (contact.tool != slot) continue;
    frame.is_inside = contact.verb == tool::Verb::Push && !contact.is_placed;
    frame.contact_nodes = contact.seeds_end - contact.seeds_begin;
    const auto reaction = contact::reaction_on(contacts, contact, state.world);
    frame.force_n = reaction.force_n;
    frame.torque_nm = reaction.torque_nm;
    frame.penetration_m = reaction.penetration_m;
  }
  frame.force_n += state.cuts.felt(slot).force_n;
  frame.torque_nm += state.cuts.felt(slot).torque_nm;
  return frame;
}

// Takes the surface's change from the cuts, and rounds with the hysteresis that the state keeps.
std::shared_ptr<PublishedFrame> publish(State& state, const contact::ContactList& contacts,
                                        const propagation::PropagationQueue& queue,
                                        const dynamics::Tissue& tissue, const TickReport& report,
                                        touch::TouchTable& touches,
                                        std::vector<Vec3f>& displacements, Outbox& outbox) {
  auto frame = std::make_shared<PublishedFrame>();
  frame->new_layout = state.cuts.pop_new_layout();
  frame->change = state.cuts.pop_change();
  const auto& layout = state.cuts.layout();
  displacements.resize(layout.vertex_count());
  for (std::size_t v = 0; v < layout.vertex_count(); ++v)
    displacements[v] = state.world.displacements[layout.node_of_vertex[v].value];
  wire::quantise(displacements, state.quantised);

  frame->frame = frame_of(report.tick);
  frame->tick = report.tick;
  frame->epoch = layout.epoch;
  frame->surface = state.quantised;
  frame->surface_crc = wire::surface_crc(state.quantised);
  frame->regions.reserve(layout.vertex_count());
  for (const auto node : layout.node_of_vertex) frame->regions.push_back(queue.region(node));
  for (std::uint8_t i = 0; i < kMaxTools; ++i)
    if (state.tools[ToolSlot{i}].has_sample) {
      frame->tools.push_back(describe_tool(state, contacts, ToolSlot{i}));
      if (state.tools[ToolSlot{i}].time_us > 0)
        frame->tools.back().touch = touches.describe(touch_scene(state, contacts), ToolSlot{i});
    }
  frame->claim_events = outbox.claim_events;
  outbox.claim_events.clear();
  frame->mark_events = std::exchange(outbox.mark_events, {});
  frame->figures = {.near = report.near,
                    .solve = report.solve.figures,
                    .relaxation = tissue.relaxation_figures(),
                    .state_hash = report.state_hash,
                    .pace = {}};
  return frame;
}

}  // namespace

void run_tick(const hands::TickInputs& inputs, const TickDecisions& decisions, ExternalLoads* loads,
              State& state, StepContext& context) {
  const auto& contacts = context.contact.found;
  const auto& queue = context.near.queue;
  auto& report = context.report;
  auto& world = state.world;
  report = {};
  context.frame.reset();
  report.tick = ++world.tick;
  std::uint64_t before = thread_cpu_ns();
  const auto end = [&](Stage stage) {
    const std::uint64_t now = thread_cpu_ns();
    report.stage_cpu_ns[static_cast<std::size_t>(stage)] +=
        static_cast<std::uint32_t>(now - before);
    before = now;
  };

  const bool has_rest = may_rest(decisions, loads);
  const bool is_refused = inputs.handover && !hand_over(*inputs.handover, state, context.outbox);
  report.inputs_dropped =
      admit_inputs(inputs, world.tick, state.tools, state.claims, state.grasps) +
      (is_refused ? 1 : 0);
  end(Stage::Admit);
  find_contacts(state, decisions, context.contact);
  wake_touched(has_rest, decisions.policy.has_self_contact, state, context.pieces, context.contact);
  report.contact = report_of(contacts, state);
  end(Stage::Contacts);
  report.near =
      fill_queue(contacts, loads, decisions, context.solve.has_tension, world, context.near);
  end(Stage::Queue);
  report.solve = solve_awake(contacts, has_rest, decisions, loads, state, context);
  report.ties = follow_ties(decisions.waiting_tools, state, context);
  end(Stage::Solve);
  state.proxies.update(contacts, world, state.tools);
  end(Stage::Contacts);
  report.cut = cut_tissue(decisions.waiting_tools, state, context.cut, context.pieces,
                          context.contact, context.near, context.solve);
  end(Stage::Cut);
  if (context.threads) move_threads(state, *context.threads);
  end(Stage::Solve);
  contact::update_claims(world, state.tools, contacts, thread_grips(context.threads.get()),
                         context.contact.requests, state.claims, state.grasps,
                         context.outbox.claim_events);
  end(Stage::Claims);
  report.state_hash = hash_of(state, context.hasher);
  report.faults = faults_of(report);
  end(Stage::Hash);
  context.touches.update(touch_scene(state, contacts));
  end(Stage::Contacts);
  if (!publishes_frame(world.tick)) return;
  context.frame = publish(state, contacts, queue, context.solve.solver.tissue(), report,
                          context.touches, context.surface_displacements, context.outbox);
  if (context.threads) publish_threads(*state.threads, *context.threads, *context.frame);
  end(Stage::Publish);
  if (!context.bleed) return;
  bleed(state.tools, state.cuts.layout(), *state.blood, *context.bleed, *context.frame);
  end(Stage::Bleed);
}

}  // namespace trocar::step
