#include "server/tissue/reduction/reduced_tissue.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/tissue/contact/contact_law.h"

namespace trocar::reduction {
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
// An estimate of the error above this means that something is wrong. Errors of the force of some
// per cent, of which the estimate says little, are far below.
constexpr float kLargestEstimate = 0.25f;
constexpr std::size_t kMaxLoaded = 4096;
// Patches need kPrepareTicks ticks until they may act together, and one more per
// kNodesPerPrepareTick nodes of the organ. A thread beside the ticks is nearly always done by then;
// if not, the tick waits for it.
constexpr std::uint32_t kPrepareTicks = 60, kNodesPerPrepareTick = 40;

bool has_room(const PatchModel& model, std::span<const NodeIndex> nodes) {
  return std::ranges::all_of(nodes, [&](NodeIndex node) {
    const auto local = model.local(node);
    return local != PatchModel::kNone && model.may_be_free(local);
  });
}

}  // namespace

void ReducedState::visit_state(world::StateArchive& archive, const LocalModels& models) {
  far.visit_state(archive);
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
  const auto are_there = [&](const PatchSet& set) {
    return std::ranges::all_of(set.all(), [&](std::uint32_t p) { return p < models.size(); });
  };
  bool is_good = static_cast<std::uint8_t>(reason) < wire::kSolverReasons &&
                 are_there(far.patches) && are_there(preparing);
  for (std::uint32_t i = 0; i < ready_count; ++i) is_good = is_good && are_there(ready[i]);
  if (is_good) return;
  archive.fail();
  *this = {};
  is_cut.resize(models.size());
}

ReducedTissue::ReducedTissue(const LocalModels& models) : models_(models), far_field_(models) {
  near_.reserve(models.node_count());
  loaded_.reserve(kMaxLoaded);
  node_forces_.reserve(kMaxLoaded);
  state_.is_cut.resize(models.size());
}

bool ReducedTissue::resume() {
  acting_ = model_of(state_.far.patches);
  return acting_ == nullptr || acting_->field_count() == state_.far.amplitudes.size();
}

ReducedTissue::Model ReducedTissue::model_of(const PatchSet& patches) {
  if (patches.count == 0) return nullptr;
  // Single patches live as long as all of them.
  if (patches.count == 1) return {std::shared_ptr<void>(), &models_[patches.patches[0]]};
  const auto found = std::ranges::find(joints_, patches, &Joint::patches);
  if (found != joints_.end()) return found->model;
  // The state was restored, or the thread had no time to make this model.
  if (joints_.size() == ReducedState::kMaxReady) joints_.erase(joints_.begin());
  joints_.push_back({patches, std::make_shared<PatchModel>(models_, patches)});
  return joints_.back().model;
}

void ReducedTissue::hand_back(dynamics::BlockDescent& solver, world::World& world) {
  if (!state_.far.acts()) return;
  far_field_.hand_back(world);
  acting_ = nullptr;
  solver.read_motion(world);
}

std::optional<dynamics::FarFieldModel::Choice> ReducedTissue::choose(const Inputs& inputs,
                                                                     dynamics::BlockDescent& solver,
                                                                     world::World& world) {
  far_field_.use(state_.far, acting_.get());
  far_field_.add_cut_nodes(world);
  if (state_.wait_ticks > 0) --state_.wait_ticks;
  figures_.largest_node_force_n = largest_node_force(inputs.contacts, world);
  auto patches = state_.far.patches;
  const auto reason = decide(inputs, world, patches);
  if (reason != SolverReason::Fits) {
    const bool has_failed = reason == SolverReason::Force || reason == SolverReason::Error;
    const bool gives_up = state_.far.acts() && reason != SolverReason::Off;
    hand_back(solver, world);
    if ((has_failed || gives_up) && state_.wait_ticks == 0)
      state_.wait_ticks = has_failed ? kWaitTicks : kLeastTicks;
  } else if (!(patches == state_.far.patches)) {
    hand_back(solver, world);
    gradient_.resize(world.node_count());
    solver.elastic_gradient(gradient_);
    acting_ = model_of(patches);
    far_field_.take_over(patches, *acting_, gradient_, world);
  }
  state_.reason = reason;
  figures_.is_reduced = state_.far.acts();
  figures_.reason = reason;
  figures_.estimate = figures_.is_reduced ? state_.far.estimate : 0;
  figures_.patches = state_.far.patches;
  if (!figures_.is_reduced) return std::nullopt;
  far_field_.near_of(inputs.active, near_);
  return Choice{near_, &far_field_};
}

SolverReason ReducedTissue::decide(const Inputs& inputs, const world::World& world,
                                   PatchSet& patches) {
  if (inputs.is_off) return SolverReason::Off;
  if (inputs.boundary != world::Boundary::Graded) return SolverReason::Frozen;
  if (state_.wait_ticks > 0) return state_.reason;
  const bool acts = state_.far.acts();
  bool is_touched = false, has_all = acts, is_near_cut = false;
  PatchSet needed;
  for (const auto& tool : inputs.contacts.tools) {
    const auto nodes = inputs.contacts.seeds_of(tool);
    if (nodes.empty()) continue;
    is_touched = true;
    has_all = has_all && has_room(*acting_, nodes);
  }
  if (acts && !(state_.far.estimate <= kLargestEstimate)) return SolverReason::Error;
  if (!is_touched) return acts ? SolverReason::Fits : SolverReason::Idle;
  if (figures_.largest_node_force_n > kForceMargin * static_cast<float>(models_.force_n()))
    return SolverReason::Force;
  if (has_all) return SolverReason::Fits;
  if (acts && state_.far.age < kLeastTicks) return SolverReason::Outside;
  for (const auto& tool : inputs.contacts.tools) {
    const auto nodes = inputs.contacts.seeds_of(tool);
    if (nodes.empty()) continue;
    // Those that act, before others.
    const auto acting = state_.far.patches.all();
    const auto same =
        std::ranges::find_if(acting, [&](std::uint32_t p) { return has_room(models_[p], nodes); });
    std::uint32_t patch = same != acting.end() ? *same : 0;
    if (same == acting.end() && !find_patch(nodes, world, patch, is_near_cut))
      return is_near_cut ? SolverReason::Cut : SolverReason::Outside;
    if (!needed.add(patch)) return SolverReason::Outside;
  }
  // Tissue that presses on tissue elsewhere goes with the fields.
  for (const auto p : needed.all())
    for (const auto node : inputs.contacts.self_seeds) {
      const auto local = models_[p].local(node);
      if (local != PatchModel::kNone && !models_[p].may_be_free(local))
        return SolverReason::Outside;
    }
  if (needed.count > 1 && !is_ready(needed)) return SolverReason::Preparing;
  patches = needed;
  return SolverReason::Fits;
}

bool ReducedTissue::find_patch(std::span<const NodeIndex> nodes, const world::World& world,
                               std::uint32_t& patch, bool& is_near_cut) const {
  Vec3f middle;
  for (const auto node : nodes) middle += world.rest_positions[node.value];
  middle = middle * (1 / static_cast<float>(nodes.size()));
  float nearest = std::numeric_limits<float>::infinity();
  for (std::uint32_t p = 0; p < models_.size(); ++p) {
    const auto& centre = world.rest_positions[models_[p].centre().value];
    const float distance = length_squared(centre - middle);
    if (!(distance < nearest) || !has_room(models_[p], nodes)) continue;
    if (state_.is_cut[p] != 0) {
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
bool ReducedTissue::is_ready(const PatchSet& patches) {
  const auto known = std::span(state_.ready).first(state_.ready_count);
  if (std::ranges::find(known, patches) != known.end()) return true;
  if (!(state_.preparing == patches)) {
    state_.preparing = patches;
    state_.prepare_ticks =
        kPrepareTicks + static_cast<std::uint32_t>(models_.node_count()) / kNodesPerPrepareTick;
  }
  if (!(making_.patches == patches) && !background_.is_busy()) {
    making_ = {patches, nullptr};
    background_.start(
        [this] { making_.model = std::make_shared<PatchModel>(models_, making_.patches); });
  }
  if (state_.prepare_ticks > 0) --state_.prepare_ticks;
  if (state_.prepare_ticks > 0) return false;
  if (making_.patches == patches) {
    background_.wait();
    if (joints_.size() == ReducedState::kMaxReady) joints_.erase(joints_.begin());
    joints_.push_back(std::move(making_));
    making_ = {};
  }
  if (state_.ready_count == ReducedState::kMaxReady) {
    std::shift_left(state_.ready.begin(), state_.ready.end(), 1);
    --state_.ready_count;
  }
  state_.ready[state_.ready_count++] = patches;
  state_.preparing = {};
  return true;
}

// Returns the largest force of contacts on a node, N.
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

void ReducedTissue::stop_for(const topology::Edit& edit, dynamics::BlockDescent& solver,
                             world::World& world) {
  for (std::uint32_t p = 0; p < models_.size(); ++p)
    if (state_.is_cut[p] == 0 && std::ranges::any_of(edit.topology.changed(), [&](NodeIndex node) {
          return models_[p].local(node) != PatchModel::kNone;
        }))
      state_.is_cut[p] = 1;
  state_.wait_ticks = kCutWaitTicks;
  state_.reason = SolverReason::Cut;
  hand_back(solver, world);
}

namespace {

class SessionModels : public dynamics::FarFieldModels {
 public:
  SessionModels(std::shared_ptr<const organ::LocalReduction> reduction, const organ::Organ& organ)
      : reduction_(std::move(reduction)), models_(*reduction_, organ) {}

  std::unique_ptr<dynamics::FarFieldModel> make() const override {
    return std::make_unique<ReducedTissue>(models_);
  }

 private:
  std::shared_ptr<const organ::LocalReduction> reduction_;
  LocalModels models_;
};

}  // namespace

dynamics::MakeFarFieldModels at_work(std::shared_ptr<const organ::LocalReduction> reduction) {
  if (reduction == nullptr) return {};
  return [reduction = std::move(reduction)](const organ::Organ& organ) {
    return std::make_unique<const SessionModels>(reduction, organ);
  };
}

}  // namespace trocar::reduction
