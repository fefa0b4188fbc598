#include "server/tissue/step/reduced_tissue.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/tissue/contact/contact_law.h"

namespace trocar::step {
namespace {

// Beyond the training's force a patch errs more; it gives up at so many times of it on a node.
constexpr float kForceMargin = 1.5f;
// After it gave up, ticks until it may act again.
constexpr std::uint16_t kWaitTicks = 250;
// Least ticks of either solver, and of a patch before the next: what a hand-over leaves in the
// tissue is to fade before there is another (in every other tick they added up, in every tenth they
// do not).
constexpr std::uint16_t kLeastTicks = 16;
// After a cut, until what was near the wound has come to rest there.
constexpr std::uint16_t kCutWaitTicks = 400;
// Of the estimate of the error: where it is larger something is wrong. Errors of the force of some
// per cent, of which the estimate says little, are far below.
constexpr float kLargestEstimate = 0.25f;
constexpr std::size_t kMaxLoaded = 4096;
// Of making patches ready to act together, ticks: long enough for a thread beside the ticks to be
// done, nearly always; the tick waits for it. In proportion to the organ.
constexpr std::uint32_t kPrepareTicks = 60, kNodesPerPrepareTick = 40;

bool has_room(const reduction::PatchModel& model, std::span<const NodeIndex> nodes) {
  return std::ranges::all_of(nodes, [&](NodeIndex node) {
    const auto local = model.local(node);
    return local != reduction::PatchModel::kNone && model.may_be_free(local);
  });
}

}  // namespace

const char* name_of(SolverReason reason) {
  switch (reason) {
    case SolverReason::None:
      return "no reduction";
    case SolverReason::Idle:
      return "nothing touched yet";
    case SolverReason::Fits:
      return "contact within patches";
    case SolverReason::Frozen:
      return "tissue frozen beyond its limits";
    case SolverReason::Outside:
      return "contact not within patches";
    case SolverReason::Force:
      return "more force than trained";
    case SolverReason::Cut:
      return "tissue was cut";
    case SolverReason::Error:
      return "estimated error too large";
    case SolverReason::Off:
      return "switched off";
    case SolverReason::Preparing:
      return "patches are being made ready together";
  }
  return "?";
}

void ReducedState::visit_state(world::StateArchive& archive, const reduction::LocalModels& models) {
  exterior.visit_state(archive);
  archive.value(reason);
  archive.value(wait_ticks);
  visit(archive, preparing);
  archive.value(prepare_ticks);
  archive.value(ready_count);
  if (archive.is_reading() && ready_count > kMaxReady) {
    archive.fail();
    ready_count = 0;
  }
  for (std::uint32_t i = 0; i < ready_count; ++i) visit(archive, ready[i]);
  is_cut.resize(models.size());
  archive.fixed_array(is_cut);
  if (!archive.is_reading()) return;
  const auto are_there = [&](const reduction::PatchSet& set) {
    return std::ranges::all_of(set.all(), [&](std::uint32_t p) { return p < models.size(); });
  };
  bool is_good = static_cast<std::uint8_t>(reason) < kSolverReasons &&
                 are_there(exterior.patches) && are_there(preparing);
  for (std::uint32_t i = 0; i < ready_count; ++i) is_good = is_good && are_there(ready[i]);
  if (is_good) return;
  archive.fail();
  *this = {};
  is_cut.resize(models.size());
}

ReducedTissue::ReducedTissue(const reduction::LocalModels& models)
    : models_(models), exterior_(models) {
  near_.reserve(models.node_count());
  loaded_.reserve(kMaxLoaded);
  node_forces_.reserve(kMaxLoaded);
}

bool ReducedTissue::resume(const ReducedState& state) {
  acting_ = model_of(state.exterior.patches);
  return acting_ == nullptr || acting_->field_count() == state.exterior.amplitudes.size();
}

ReducedTissue::Model ReducedTissue::model_of(const reduction::PatchSet& patches) {
  if (patches.count == 0) return nullptr;
  // Single patches live as long as all of them.
  if (patches.count == 1) return {std::shared_ptr<void>(), &models_[patches.patches[0]]};
  const auto found = std::ranges::find(joints_, patches, &Joint::patches);
  if (found != joints_.end()) return found->model;
  // Of a restored state, or the thread had no time for them.
  if (joints_.size() == ReducedState::kMaxReady) joints_.erase(joints_.begin());
  joints_.push_back({patches, std::make_shared<reduction::PatchModel>(models_, patches)});
  return joints_.back().model;
}

void ReducedTissue::hand_back(ReducedState& state, dynamics::BlockDescent& solver,
                              world::World& world) {
  if (!state.exterior.acts()) return;
  exterior_.hand_back(world);
  acting_ = nullptr;
  solver.take_motion(world);
}

bool ReducedTissue::choose(const Inputs& inputs, ReducedState& state,
                           dynamics::BlockDescent& solver, world::World& world) {
  exterior_.use(state.exterior, acting_.get());
  exterior_.follow_cuts(world);
  if (state.wait_ticks > 0) --state.wait_ticks;
  figures_.largest_node_force_n = largest_node_force(inputs.contacts, world);
  auto patches = state.exterior.patches;
  const auto reason = decide(inputs, state, world, patches);
  if (reason != SolverReason::Fits) {
    const bool has_failed = reason == SolverReason::Force || reason == SolverReason::Error;
    const bool gives_up = state.exterior.acts() && reason != SolverReason::Off;
    hand_back(state, solver, world);
    if ((has_failed || gives_up) && state.wait_ticks == 0)
      state.wait_ticks = has_failed ? kWaitTicks : kLeastTicks;
  } else if (!(patches == state.exterior.patches)) {
    hand_back(state, solver, world);
    gradient_.resize(world.node_count());
    solver.elastic_gradient(gradient_);
    acting_ = model_of(patches);
    exterior_.take_over(patches, *acting_, gradient_, world);
  }
  state.reason = reason;
  figures_.is_reduced = state.exterior.acts();
  figures_.reason = reason;
  figures_.estimate = figures_.is_reduced ? state.exterior.estimate : 0;
  figures_.patches = state.exterior.patches;
  if (!figures_.is_reduced) return false;
  exterior_.near_of(inputs.active, near_);
  return true;
}

SolverReason ReducedTissue::decide(const Inputs& inputs, ReducedState& state,
                                   const world::World& world, reduction::PatchSet& patches) {
  if (inputs.is_off) return SolverReason::Off;
  if (inputs.boundary != world::Boundary::Graded) return SolverReason::Frozen;
  if (state.wait_ticks > 0) return state.reason;
  const bool acts = state.exterior.acts();
  bool is_touched = false, has_all = acts, is_near_cut = false;
  reduction::PatchSet needed;
  for (const auto& tool : inputs.contacts.tools) {
    const auto nodes = inputs.contacts.seeds_of(tool);
    if (nodes.empty()) continue;
    is_touched = true;
    has_all = has_all && has_room(*acting_, nodes);
  }
  if (acts && !(state.exterior.estimate <= kLargestEstimate)) return SolverReason::Error;
  if (!is_touched) return acts ? SolverReason::Fits : SolverReason::Idle;
  if (figures_.largest_node_force_n > kForceMargin * static_cast<float>(models_.force_n()))
    return SolverReason::Force;
  if (has_all) return SolverReason::Fits;
  if (acts && state.exterior.age < kLeastTicks) return SolverReason::Outside;
  for (const auto& tool : inputs.contacts.tools) {
    const auto nodes = inputs.contacts.seeds_of(tool);
    if (nodes.empty()) continue;
    // Those that act, before others.
    const auto acting = state.exterior.patches.all();
    const auto same =
        std::ranges::find_if(acting, [&](std::uint32_t p) { return has_room(models_[p], nodes); });
    std::uint32_t patch = same != acting.end() ? *same : 0;
    if (same == acting.end() && !find_patch(nodes, state, world, patch, is_near_cut))
      return is_near_cut ? SolverReason::Cut : SolverReason::Outside;
    if (!needed.add(patch)) return SolverReason::Outside;
  }
  // Tissue that presses on tissue elsewhere goes with the fields.
  for (const auto p : needed.all())
    for (const auto node : inputs.contacts.self_seeds) {
      const auto local = models_[p].local(node);
      if (local != reduction::PatchModel::kNone && !models_[p].may_be_free(local))
        return SolverReason::Outside;
    }
  if (needed.count > 1 && !is_ready(needed, state)) return SolverReason::Preparing;
  patches = needed;
  return SolverReason::Fits;
}

bool ReducedTissue::find_patch(std::span<const NodeIndex> nodes, const ReducedState& state,
                               const world::World& world, std::uint32_t& patch,
                               bool& is_near_cut) const {
  Vec3f middle;
  for (const auto node : nodes) middle += world.rest_positions[node.value];
  middle = middle * (1 / static_cast<float>(nodes.size()));
  float nearest = std::numeric_limits<float>::infinity();
  for (std::uint32_t p = 0; p < models_.size(); ++p) {
    const auto& centre = world.rest_positions[models_[p].centre().value];
    const float distance = length_squared(centre - middle);
    if (!(distance < nearest) || !has_room(models_[p], nodes)) continue;
    if (state.is_cut[p] != 0) {
      is_near_cut = true;
      continue;
    }
    nearest = distance;
    patch = p;
  }
  return std::isfinite(nearest);
}

// Patches that act together are made ready by a thread of their own, and are so after a number of
// ticks that does not depend on it. While it still makes others these wait.
bool ReducedTissue::is_ready(const reduction::PatchSet& patches, ReducedState& state) {
  const auto known = std::span(state.ready).first(state.ready_count);
  if (std::ranges::find(known, patches) != known.end()) return true;
  if (!(state.preparing == patches)) {
    state.preparing = patches;
    state.prepare_ticks =
        kPrepareTicks + static_cast<std::uint32_t>(models_.node_count()) / kNodesPerPrepareTick;
  }
  if (!(making_.patches == patches) && !background_.is_busy()) {
    making_ = {patches, nullptr};
    background_.start([this] {
      making_.model = std::make_shared<reduction::PatchModel>(models_, making_.patches);
    });
  }
  if (state.prepare_ticks > 0) --state.prepare_ticks;
  if (state.prepare_ticks > 0) return false;
  if (making_.patches == patches) {
    background_.wait();
    if (joints_.size() == ReducedState::kMaxReady) joints_.erase(joints_.begin());
    joints_.push_back(std::move(making_));
    making_ = {};
  }
  if (state.ready_count == ReducedState::kMaxReady) {
    std::shift_left(state.ready.begin(), state.ready.end(), 1);
    --state.ready_count;
  }
  state.ready[state.ready_count++] = patches;
  state.preparing = {};
  return true;
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
        if (at == kMaxLoaded) continue;
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

void ReducedTissue::stop_for_cut(std::span<const NodeIndex> changed, ReducedState& state,
                                 dynamics::BlockDescent& solver, world::World& world) {
  for (std::uint32_t p = 0; p < models_.size(); ++p)
    if (state.is_cut[p] == 0 && std::ranges::any_of(changed, [&](NodeIndex node) {
          return models_[p].local(node) != reduction::PatchModel::kNone;
        }))
      state.is_cut[p] = 1;
  state.wait_ticks = kCutWaitTicks;
  state.reason = SolverReason::Cut;
  hand_back(state, solver, world);
}

}  // namespace trocar::step
