#include "server/step/simulation.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "common/scene/any_material.h"

namespace trocar::step {

State::State(const scene::Organ& organ, const wire::SurfaceLayout& layout)
    : world(organ),
      claims(organ.mesh.node_count()),
      quantised(layout.vertex_count()),
      self_contacts(organ) {}

void State::visit(world::StateArchive& archive) {
  world.visit_state(archive);
  tools.visit_state(archive);
  claims.visit_state(archive);
  grasps.visit_state(archive, world.node_count());
  proxies.visit_state(archive);
  archive.fixed_array(quantised);
  self_contacts.visit_state(archive);
}

Scene::Scene(scene::Organ o, unsigned worker_count)
    : organ(std::move(o)), layout(wire::make_surface_layout(organ)), workers(worker_count) {}

namespace {

// Springs and linear tets cost no more than the matrices of a linear far field.
bool is_costly(const scene::Organ& organ) {
  return scene::any_material(organ, [](const scene::Material& m) {
    return m.elastic_law == scene::ElasticLaw::NeoHookean;
  });
}

}  // namespace

StepContext::StepContext(const Scene& s, const world::World& world)
    : scene(s),
      finder(s.organ),
      self_finder(s.organ),
      queue(world.node_count()),
      active(world.node_count()),
      solver(s.organ, world, s.workers),
      far_plan(solver.far_plan(kTickSeconds)),
      has_linear_far_field(is_costly(s.organ) && solver.use_linear_far_field(world)),
      surface_displacements(s.layout.vertex_count()) {
  contacts.reserve();
  requests.reserve(kMaxTools);
  claim_events.reserve(4 * kMaxTools);
}

Status validate(const TickDecisions& d) {
  const auto out_of_range = [](const char* field, auto value, const char* range) {
    return Error{ErrorCode::Usage,
                 std::string(field) + ": " + std::to_string(value) + " is outside " + range};
  };
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
  if (d.boundary > world::Boundary::Graded)
    return out_of_range("boundary", static_cast<int>(d.boundary), "0 (frozen) to 1 (graded)");
  if (d.far_interval < 1 || d.far_interval > kMaxFarInterval)
    return out_of_range("far_interval", d.far_interval, "1 to 4 ticks");
  if (d.far_sweeps > kMaxFarSweeps)
    return out_of_range("far_sweeps", d.far_sweeps, "0 (as the organ needs) to 16");
  if (!(d.over_relaxation >= 1.0f && d.over_relaxation <= 1.9f))
    return out_of_range("over_relaxation", d.over_relaxation, "1 to 1.9");
  return {};
}

Simulation::Simulation(scene::Organ organ, unsigned workers)
    : scene_(std::make_unique<Scene>(std::move(organ), workers)),
      state_(std::make_unique<State>(scene_->organ, scene_->layout)),
      context_(std::make_unique<StepContext>(*scene_, state_->world)) {}

const TickReport& Simulation::tick(const session::TickInputs& inputs,
                                   const TickDecisions& decisions) {
  context_->inputs = &inputs;
  context_->decisions = decisions;
  run_tick(*state_, *context_);
  context_->inputs = nullptr;
  return context_->report;
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
  auto restored = std::make_unique<State>(scene_->organ, scene_->layout);
  auto archive = world::StateArchive::reading(snapshot);
  restored->visit(archive);
  if (!archive.ok() || !archive.at_end())
    return Error{ErrorCode::BadFile, "snapshot: " + std::to_string(snapshot.size()) +
                                         " bytes do not hold a state of this organ (" +
                                         std::to_string(scene_->organ.mesh.node_count()) +
                                         " nodes)"};
  state_ = std::move(restored);
  context_ = std::make_unique<StepContext>(*scene_, state_->world);
  return {};
}

}  // namespace trocar::step
