#pragma once

// ReducedTissue chooses in each tick which solver moves the tissue: the full one, or sweeps around
// a patch of a local reduction and the patch's fields beyond it (reduced_far_field.h). The choice
// is a function of the state alone.

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "common/base/background.h"
#include "server/organs/organ/local_reduction.h"
#include "server/tissue/contact/contact_list.h"
#include "server/tissue/dynamics/far_field_model.h"
#include "server/tissue/reduction/reduced_far_field.h"
#include "server/tissue/world/world.h"

namespace trocar::reduction {

using wire::SolverReason;

// In snapshot and hash of sessions with a reduction.
struct ReducedState {
  static constexpr std::size_t kMaxReady = 4;

  void visit_state(world::StateArchive& archive, const LocalModels& models);

  ReducedFarState far;
  SolverReason reason = SolverReason::Idle;
  std::uint16_t wait_ticks = 0;  // until patches may take over again
  // Patches that are being made ready, and ticks until they are; those that were, the latest last.
  PatchSet preparing;
  std::uint32_t prepare_ticks = 0;
  std::array<PatchSet, kMaxReady> ready{};
  std::uint32_t ready_count = 0;
  std::vector<std::uint8_t> is_cut;  // per patch: its tissue is no longer what it is of
};

class ReducedTissue : public dynamics::FarFieldModel {
 public:
  // Outlives it.
  explicit ReducedTissue(const LocalModels& models);

  std::optional<Choice> choose(const Inputs& inputs, dynamics::BlockDescent& solver,
                               world::World& world) override;
  // For good where patches are that have one of the changed nodes.
  void stop_for(const topology::Edit& edit, dynamics::BlockDescent& solver,
                world::World& world) override;
  void visit_state(world::StateArchive& archive) override { state_.visit_state(archive, models_); }
  // Makes the state's patches ready.
  bool resume() override;
  const wire::SolverFigures& figures() const override { return figures_; }

  const ReducedState& state() const { return state_; }

 private:
  using Model = std::shared_ptr<const PatchModel>;
  struct Joint {
    PatchSet patches;
    Model model;
  };

  SolverReason decide(const Inputs& inputs, const world::World& world, PatchSet& patches);
  // The nearest patch that has room for the nodes and was not cut; false: there is none.
  bool find_patch(std::span<const NodeIndex> nodes, const world::World& world, std::uint32_t& patch,
                  bool& is_near_cut) const;
  bool is_ready(const PatchSet& patches);
  Model model_of(const PatchSet& patches);
  void hand_back(dynamics::BlockDescent& solver, world::World& world);
  float largest_node_force(const contact::ContactList& contacts, const world::World& world);

  const LocalModels& models_;
  ReducedState state_;
  ReducedFarField far_field_;
  Model acting_;               // null: the full solver
  std::vector<Joint> joints_;  // some of those that are ready
  Joint making_;
  wire::SolverFigures figures_;
  std::vector<NodeIndex> near_;
  std::vector<Vec3f> gradient_;
  std::vector<NodeIndex> loaded_;
  std::vector<Vec3f> node_forces_;  // of loaded_
  Background background_;           // last: its work uses what stands above
};

// For step::Simulation: makes models with this reduction of the organ; null: makes none.
dynamics::MakeFarFieldModels at_work(std::shared_ptr<const organ::LocalReduction> reduction);

}  // namespace trocar::reduction
