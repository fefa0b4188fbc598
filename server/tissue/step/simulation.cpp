#include "server/tissue/step/simulation.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "common/base/assert.h"
#include "server/organs/organ/any_material.h"
#include "server/tissue/cutting/edits.h"
#include "server/tissue/dynamics/relaxation.h"
#include "server/tissue/step/edit_followers.h"
#include "server/tissue/step/thread_stage.h"
#include "server/tissue/step/tie_breaks.h"
#include "server/tissue/topology/surface_mesh.h"

namespace trocar::step {

State::State(const Scene& scene)
    : cuts(scene.organ, scene.rules.cutting),
      world(scene.organ),
      claims(scene.organ.mesh.node_count()),
      quantised(cuts.layout().vertex_count()),
      strain_scheme(scene.strain_scheme) {
  dynamics::start_relaxed(scene.organ, world, strain_scheme);
  if (scene.rules.bleeding) blood.emplace();
  if (scene.rules.threads) threads.emplace(*scene.rules.threads);
  for (const auto& load : scene.rules.loads.displaced)
    if (load.axes == kAllAxes)
      for (const auto node : load.nodes) world.node_classes[node.value] = world::NodeClass::Fixed;
}

void State::visit(world::StateArchive& archive) {
  marks.visit_state(archive);
  visit_without_marks(archive);  // ends with what may take no bytes
}

void State::set_mark(std::uint8_t number) {
  Bytes bytes;
  auto archive = world::StateArchive::writing(bytes);
  visit_without_marks(archive);
  marks.set(number, std::move(bytes));
}

std::unique_ptr<State> State::returned_to_mark(std::uint8_t number, const Scene& scene) const {
  if (!marks.is_set(number)) return nullptr;
  auto marked = std::make_unique<State>(scene);
  auto archive = world::StateArchive::reading(marks.state(number));
  marked->visit_without_marks(archive);
  if (!archive.ok() || !archive.at_end()) return nullptr;
  marked->cuts.replace(cuts);
  marked->world.tick = world.tick;
  marked->tools = tools;
  marked->claims.let_go(claims);
  marked->grasps = {};
  marked->proxies = {};
  if (threads) marked->threads->let_go(*threads);
  marked->marks = marks;
  return marked;
}

void State::visit_without_marks(world::StateArchive& archive) {
  cuts.visit_state(archive, [this](const topology::Edit& edit) { hand_out(edit, *this); });
  world.visit_state(archive);
  if (archive.is_reading() && archive.ok()) read_breaks(cuts, world);
  tools.visit_state(archive);
  claims.visit_state(archive);
  grasps.visit_state(archive, world.node_count());
  proxies.visit_state(archive);
  archive.fixed_array(quantised);
  if (blood) blood->visit_state(archive);
  if (threads) threads->visit_state(archive);
  self_contacts.visit_state(archive, world.surface_nodes, cuts.layout().triangles.size());
}

namespace {

std::shared_ptr<const Scene> scene_of(organ::Organ organ, SceneRules rules) {
  auto scene = std::make_shared<Scene>();
  scene->organ = std::move(organ);
  scene->rules = std::move(rules);
  scene->strain_scheme =
      scene->rules.strain_scheme
          ? *scene->rules.strain_scheme
          : dynamics::scheme_for(scene->organ, world::World(scene->organ), kTickSeconds);
  return scene;
}

// Springs and linear tets cost no more than the matrices of a linear far field.
bool is_costly(const organ::Organ& organ) {
  return organ::any_material(organ, material::is_hyperelastic);
}

bool is_under_tension(const material::Material& material) {
  return material.tension > 0 || material.fibre_tension > 0;
}

}  // namespace

SolveWork::SolveWork(const Scene& scene, unsigned workers, const world::World& uncut)
    : solver(scene.organ, uncut, workers, scene.strain_scheme),
      far_plan(solver.far_plan(kTickSeconds)),
      has_linear_far_field(is_costly(scene.organ)),
      has_tension(organ::any_material(scene.organ, is_under_tension)) {
  if (has_linear_far_field) solver.use_linear_far_field(uncut);
}

// The solver begins with the organ as it was, whatever the state: plans and places follow from that
// and from the edits since.
StepContext::StepContext(const Scene& s, unsigned workers, State& state)
    : StepContext(s, workers, world::World(s.organ), state) {}

StepContext::StepContext(const Scene& s, unsigned workers, const world::World& uncut, State& state)
    : contact{.finder = contact::ContactFinder(s.organ),
              .self_finder = contact::SelfContactFinder(s.organ),
              .found = {},
              .requests = {}},
      near{.neighbours = s.organ.mesh.node_neighbours,
           .queue = propagation::PropagationQueue(state.world.node_count()),
           .active = propagation::ActiveSet(state.world.node_count()),
           .seeds = {}},
      solve(s, workers, uncut),
      pieces(s.organ),
      touches(s.organ),
      surface_displacements(state.cuts.layout().vertex_count()) {
  if (s.rules.bleeding) bleed.emplace(*s.rules.bleeding);
  if (s.rules.threads) threads = std::make_shared<ThreadWork>(*s.rules.threads);
  contact.found.reserve();
  contact.requests.reserve(kMaxTools);
  near.seeds.reserve(2 * kMaxTools);
  outbox.claim_events.reserve(4 * kMaxTools);
  topology::Topology topology(s.organ);
  cutting::Places places(topology);
  topology::SurfaceMesh surface(s.organ);
  for (const auto& events : state.cuts.history()) {
    const auto applied = cutting::apply(events, topology, places);
    TROCAR_ASSERT(applied.ok());
    const auto& edit = surface.update(topology);
    topology::follow_ties(edit, topology);
    hand_out({topology, {}, edit}, state.world, contact, near, solve);
    topology.clear_changes();
  }
  const auto tied = state.cuts.topology().ties().nodes();
  near.neighbours.update(state.cuts.topology(), tied);
  // From now on everybody looks at the state's own topology.
  if (!state.cuts.history().empty())
    hand_out({state.cuts.topology(), {}, {}}, state.world, contact, near, solve);
  solve.solver.read_state(state.world);
  pieces.read_state(state.cuts.topology(), state.world);
}

namespace {

template <typename Value>
Error out_of_range(const char* field, Value value, const char* range) {
  return {ErrorCode::Usage,
          std::string(field) + ": " + std::to_string(value) + " is outside " + range};
}

Status validate_policy(const TickDecisions& d) {
  const auto& policy = d.policy;
  if (policy.steps_per_tick < 1 || policy.steps_per_tick > kMaxStepsPerTick)
    return out_of_range("steps_per_tick", policy.steps_per_tick, "1 to 1000");
  if (!(policy.residual_tolerance_n >= 0 && policy.residual_tolerance_n <= 1))
    return out_of_range("residual_tolerance_n", policy.residual_tolerance_n, "0 to 1 N");
  if (policy.max_sweeps < 1 || policy.max_sweeps > kMaxPolicySweeps)
    return out_of_range("max_sweeps", policy.max_sweeps, "1 to 1000000");
  const float far = policy.far_over_relaxation;
  if (!(far == 0 || (far >= 0.5f && far <= 1.9f)))
    return out_of_range("far_over_relaxation", far, "0.5 to 1.9 (or 0: as the organ needs)");
  const bool has_tolerance = policy.residual_tolerance_n > 0;
  if (has_tolerance && d.boundary == world::Boundary::Graded)
    return Error{ErrorCode::Usage,
                 "residual_tolerance_n: is not for the boundary graded, whose "
                 "far nodes are swept once"};
  if (policy.steps_per_tick > 1 && d.far_interval > 1)
    return Error{ErrorCode::Usage, "far_interval: is for one step of time in a tick"};
  return {};
}

}  // namespace

Status validate(const TickDecisions& d) {
  if (d.depth_limit > kMaxDepthLimit)
    return out_of_range("depth_limit", d.depth_limit, "0 to 1000 layers");
  if (d.node_limit < 1 || d.node_limit > kMaxNodeLimit)
    return out_of_range("node_limit", d.node_limit, "1 to 10000000 nodes");
  if (d.sweeps < 1 || d.sweeps > kMaxSweeps) return out_of_range("sweeps", d.sweeps, "1 to 64");
  const auto sweeps = sweeps_of_layers(d);
  for (std::size_t layer = 1; layer < kSweepLayers; ++layer)
    if (sweeps[layer] > sweeps[layer - 1])
      return Error{ErrorCode::Usage, "layer_sweeps: layer " + std::to_string(layer) + " has " +
                                         std::to_string(sweeps[layer]) +
                                         " sweeps, more than the layer before: give at most " +
                                         std::to_string(sweeps[layer - 1])};
  if (d.boundary > world::Boundary::Whole)
    return out_of_range("boundary", static_cast<int>(d.boundary), "0 (frozen) to 2 (whole)");
  if (d.far_interval < 1 || d.far_interval > kMaxFarInterval)
    return out_of_range("far_interval", d.far_interval, "1 to 3 ticks");
  if (d.linger_ticks < 1 || d.linger_ticks > propagation::kQuietTicks)
    return out_of_range("linger_ticks", d.linger_ticks, "1 to 100 ticks");
  if (d.far_sweeps > kMaxFarSweeps)
    return out_of_range("far_sweeps", d.far_sweeps, "0 (as the organ needs) to 16");
  if (!(d.over_relaxation >= 1.0f && d.over_relaxation <= 1.9f))
    return out_of_range("over_relaxation", d.over_relaxation, "1 to 1.9");
  return validate_policy(d);
}

Simulation::Simulation(organ::Organ organ, unsigned workers, SceneRules rules)
    : Simulation(scene_of(std::move(organ), std::move(rules)), workers) {}

Simulation::Simulation(std::shared_ptr<const Scene> scene, unsigned workers)
    : scene_(std::move(scene)),
      workers_(workers),
      state_(std::make_unique<State>(*scene_)),
      context_(std::make_unique<StepContext>(*scene_, workers_, *state_)),
      loads_(std::make_unique<ExternalLoads>(scene_->rules.loads, scene_->organ.fixed_nodes,
                                             scene_->organ.mesh.node_count())) {}

Simulation Simulation::beside() const {
  return {scene_, 1};
}

TickDecisions Simulation::with_sweeps_for_organ(TickDecisions decisions) const {
  const bool is_soft = context_->solve.far_plan.sweeps == 1;
  if (decisions.boundary != world::Boundary::Graded || !is_soft) return decisions;
  decisions.sweeps = 3;
  decisions.layer_sweeps = {2, 1, 1};
  return decisions;
}

const TickReport& Simulation::tick(const hands::TickInputs& inputs,
                                   const TickDecisions& decisions) {
  if (inputs.mark != hands::MarkAction::None) use_mark(inputs.mark, inputs.mark_number);
  run_tick(inputs, decisions, scene_->rules.loads.empty() ? nullptr : loads_.get(), *state_,
           *context_);
  return context_->report;
}

void Simulation::use_mark(hands::MarkAction action, std::uint8_t number) {
  MarkEvent event{state_->world.tick + 1, action, true, number};
  if (action == hands::MarkAction::Set) {
    state_->set_mark(number);
    context_->outbox.mark_events.push_back(event);
    return;
  }
  auto marked = state_->returned_to_mark(number, *scene_);
  auto context = marked ? context_of(*marked) : nullptr;
  event.is_done = context != nullptr;
  if (event.is_done) {
    state_ = std::move(marked);
    context->outbox = std::move(context_->outbox);
    context_ = std::move(context);
    loads_->forget_cuts();
  }
  context_->outbox.mark_events.push_back(event);
}

std::unique_ptr<StepContext> Simulation::context_of(State& state) const {
  return std::make_unique<StepContext>(*scene_, workers_, state);
}

void Simulation::start_relaxed(std::span<const Vec3f> displacements,
                               std::span<const Vec3f> velocities) {
  auto& world = state_->world;
  TROCAR_ASSERT(displacements.size() == world.node_count());
  std::ranges::copy(displacements, world.displacements.begin());
  std::ranges::fill(world.velocities, Vec3f{});
  std::ranges::copy(velocities, world.velocities.begin());
  dynamics::start_relaxed(scene_->organ, world, state_->strain_scheme);
  context_ = context_of(*state_);
}

void Simulation::tick_by(const std::function<void(world::World&)>& move) {
  ++state_->world.tick;
  move(state_->world);
}

void Simulation::write_snapshot(Bytes& out) const {
  auto archive = world::StateArchive::writing(out);
  state_->visit(archive);
}

std::uint64_t Simulation::state_hash() const {
  StateHasher hasher;
  auto archive = world::StateArchive::hashing(hasher);
  state_->visit(archive);
  return hasher.digest();
}

Status Simulation::restore_snapshot(BytesView snapshot) {
  auto restored = std::make_unique<State>(*scene_);
  auto archive = world::StateArchive::reading(snapshot);
  restored->visit(archive);
  auto context = archive.ok() && archive.at_end() ? context_of(*restored) : nullptr;
  if (!context)
    return Error{ErrorCode::BadFile, "snapshot: " + std::to_string(snapshot.size()) +
                                         " bytes do not hold a state of this organ (" +
                                         std::to_string(scene_->organ.mesh.node_count()) +
                                         " nodes)"};
  state_ = std::move(restored);
  context_ = std::move(context);
  loads_->forget_cuts();
  return {};
}

}  // namespace trocar::step
