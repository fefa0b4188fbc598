#include "server/step/reduced_tissue.h"

#include <algorithm>
#include <limits>

#include "server/contact/contact_law.h"

namespace trocar::step {
namespace {

// Beyond the training's force a patch errs more; it gives up at so many times of it on a node.
constexpr float kForceMargin = 1.5f;
// After it gave up, ticks until it may act again.
constexpr std::uint16_t kWaitTicks = 250;
constexpr float kLargestEstimate = 1e9f;
constexpr std::size_t kMaxTouched = 4096;

}  // namespace

const char* name_of(SolverReason reason) {
  switch (reason) {
    case SolverReason::None:
      return "no reduction";
    case SolverReason::Idle:
      return "nothing touched yet";
    case SolverReason::Fits:
      return "contact within a patch";
    case SolverReason::Frozen:
      return "tissue frozen beyond its limits";
    case SolverReason::Outside:
      return "contact not within one patch";
    case SolverReason::Force:
      return "more force than trained";
    case SolverReason::Cut:
      return "tissue was cut";
    case SolverReason::Error:
      return "estimated error too large";
    case SolverReason::Off:
      return "switched off";
  }
  return "?";
}

void ReducedState::visit_state(world::StateArchive& archive) {
  exterior.visit_state(archive);
  archive.value(reason);
  archive.value(wait_ticks);
  archive.flag(was_cut);
  if (archive.is_reading() && static_cast<std::uint8_t>(reason) >= kSolverReasons) archive.fail();
}

ReducedTissue::ReducedTissue(const exterior::LocalModels& models)
    : models_(models), exterior_(models) {
  touched_.reserve(kMaxTouched);
  near_.reserve(models.node_count());
  loaded_.reserve(kMaxTouched);
  node_forces_.reserve(kMaxTouched);
}

bool ReducedTissue::choose(const Inputs& inputs, ReducedState& state,
                           dynamics::BlockDescent& solver, world::World& world) {
  exterior_.use(state.exterior);
  if (state.wait_ticks > 0) --state.wait_ticks;
  figures_.largest_node_force_n = largest_node_force(inputs.contacts, world);
  std::uint32_t patch = state.exterior.patch;
  const auto reason = decide(inputs, state, world, patch);
  if (reason != SolverReason::Fits) {
    if (state.exterior.acts()) {
      exterior_.hand_back(world);
      solver.take_state(world);
    }
    const bool has_failed = reason == SolverReason::Force || reason == SolverReason::Error;
    if (has_failed && state.wait_ticks == 0) state.wait_ticks = kWaitTicks;
  } else if (!state.exterior.acts() || patch != state.exterior.patch) {
    if (state.exterior.acts()) {
      exterior_.hand_back(world);
      solver.take_state(world);
    }
    solver.elastic_gradient(world, gradient_);
    exterior_.take_over(patch, gradient_, world);
  }
  state.reason = reason;
  figures_.is_reduced = state.exterior.acts();
  figures_.reason = reason;
  figures_.estimate = figures_.is_reduced ? state.exterior.estimate : 0;
  figures_.patch = figures_.is_reduced ? state.exterior.patch : 0;
  if (!figures_.is_reduced) return false;
  exterior_.near_of(inputs.active, near_);
  return true;
}

SolverReason ReducedTissue::decide(const Inputs& inputs, const ReducedState& state,
                                   const world::World& world, std::uint32_t& patch) {
  if (inputs.is_off) return SolverReason::Off;
  if (inputs.boundary != world::Boundary::Graded) return SolverReason::Frozen;
  if (state.was_cut) return SolverReason::Cut;
  if (state.wait_ticks > 0) return state.reason;
  touched_.clear();
  for (const auto& seeds :
       {std::span(inputs.contacts.seeds), std::span(inputs.contacts.self_seeds)})
    for (const auto node : seeds)
      if (touched_.size() < kMaxTouched) touched_.push_back(node);
  if (touched_.empty()) return state.exterior.acts() ? SolverReason::Fits : SolverReason::Idle;
  if (figures_.largest_node_force_n > kForceMargin * static_cast<float>(models_.force_n()))
    return SolverReason::Force;
  if (state.exterior.acts() && state.exterior.estimate > kLargestEstimate)
    return SolverReason::Error;
  if (state.exterior.acts() && has_room(patch)) return SolverReason::Fits;
  Vec3f middle;
  for (const auto node : touched_) middle += world.rest_positions[node.value];
  middle = middle * (1 / static_cast<float>(touched_.size()));
  float nearest = std::numeric_limits<float>::infinity();
  bool is_found = false;
  for (std::uint32_t p = 0; p < models_.size(); ++p) {
    const auto& centre = world.rest_positions[models_[p].centre().value];
    const float distance = length_squared(centre - middle);
    if (!(distance < nearest) || !has_room(p)) continue;
    nearest = distance;
    patch = p;
    is_found = true;
  }
  return is_found ? SolverReason::Fits : SolverReason::Outside;
}

bool ReducedTissue::has_room(std::uint32_t patch) const {
  const auto& model = models_[patch];
  return std::ranges::all_of(touched_, [&](NodeIndex node) {
    const auto local = model.local(node);
    return local != exterior::PatchModel::kNone && model.may_be_free(local);
  });
}

// Of what tools press and pull with.
float ReducedTissue::largest_node_force(const contact::ContactList& contacts,
                                        const world::World& world) {
  loaded_.clear();
  node_forces_.clear();
  for (const auto& point : contacts.points) {
    const auto load = contact::load_at(point, contact::displacement_of(point, world));
    if (load.pressed_n == 0 && load.tangential_secant == 0) continue;
    for (std::size_t k = 0; k < point.node_count; ++k) {
      auto at =
          static_cast<std::size_t>(std::ranges::find(loaded_, point.nodes[k]) - loaded_.begin());
      if (at == loaded_.size()) {
        if (at == kMaxTouched) continue;
        loaded_.push_back(point.nodes[k]);
        node_forces_.emplace_back();
      }
      node_forces_[at] += load.gradient * point.weights[k];
    }
  }
  float squared = 0;
  for (const auto& force : node_forces_) squared = std::max(squared, length_squared(force));
  return std::sqrt(squared);
}

void ReducedTissue::stop_for_cut(ReducedState& state, dynamics::BlockDescent& solver,
                                 world::World& world) {
  exterior_.use(state.exterior);
  state.was_cut = true;
  if (!state.exterior.acts()) return;
  exterior_.hand_back(world);
  solver.take_state(world);
}

}  // namespace trocar::step
