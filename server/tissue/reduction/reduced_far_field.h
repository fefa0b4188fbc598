#pragma once

// A local reduction at work in a session: around a patch that is touched, nodes are swept as ever;
// all others move in the patch's fields (LocalPatch), u = Phi q and what is left of where they were
// when the fields took over, which fades. Between sweeps, q is corrected by a step of Newton's
// method among the fields: forces of the tets near the patch, those of swept nodes included, are as
// they are; the others respond as at rest. Implicit Euler, as the solver's. Stress that has relaxed
// is kept per tet, by the solver; its forces come along the fields.
//
// Swept nodes leave the fields where these move hardly anything else; after each step the fields
// follow them there.
//
// Displacements and velocities of nodes stay what holds: whatever solver goes on from them. Of far
// nodes an eighth is placed in each step, in turns, each where it will be halfway to its next.
//
// Its error is estimated from what its fields leave at the nodes of the patch's rim, where all tets
// are known as they are but nodes do not move on their own: the root of the sum of squared forces
// over stiffness, an energy, beside the larger of twice what the fields have stored and the work
// that the contacts' forces would do along their nodes' displacements.
//
// Work per step: the patch's tets and nodes times fields, and an eighth of the organ's. No
// allocation, but when more fields take over than ever before. One caller; deterministic.

#include <span>
#include <vector>

#include "server/tissue/dynamics/far_field_solver.h"
#include "server/tissue/reduction/patch_model.h"
#include "server/tissue/reduction/reduced_far_state.h"

namespace trocar::reduction {

// The time in which places and forces that the fields do not have fade.
inline constexpr double kFade_s = 0.05;

class ReducedFarField : public dynamics::FarFieldSolver {
 public:
  // Outlives it.
  explicit ReducedFarField(const LocalModels& models);

  // The state of calls from now on, and the model of its patches, null if there are none. Both must
  // outlive their use.
  void use(ReducedFarState& state, const PatchModel* model);

  // Takes up nodes that cuts have made: they go with those that they are between. No work if there
  // are none since the last call. While no patch acts.
  void add_cut_nodes(const world::World& world);
  // From now on the fields of these patches, whose model it is, move what is not near. gradient: of
  // the elastic energy, N per node, where the tissue is. Continuous in place, momentum along the
  // fields, and force.
  void take_over(const PatchSet& patches, const PatchModel& model, std::span<const Vec3f> gradient,
                 const world::World& world);
  // Every node where the fields have it; then others move it.
  void hand_back(world::World& world);

  // The nodes of `active` that may be swept while the patch acts, in that order.
  void near_of(std::span<const NodeIndex> active, std::vector<NodeIndex>& near) const;

  void begin(const dynamics::FarFieldStep& step) override;
  void correct(const dynamics::FarFieldStep& step) override;
  float end(const dynamics::FarFieldStep& step, dynamics::Float4* velocities,
            world::World& world) override;

 private:
  struct Touched {
    std::uint32_t local;
    SymMat3f block;  // N/m
  };

  struct Share {
    std::uint32_t node;  // of the organ
    float weight;
  };
  // Returns the organ's nodes with which a node made by cuts moves, and their weights.
  std::span<const Share> shares_of(std::size_t cut_node) const {
    return std::span(shares_).subspan(share_begins_[cut_node],
                                      share_begins_[cut_node + 1] - share_begins_[cut_node]);
  }
  std::size_t cut_node_count() const { return share_begins_.size() - 1; }
  // Values of the organ's nodes from `begin` to `end`, with the shares of those that follow.
  std::span<const float> gathered(std::span<const Vec3f> values, std::size_t begin,
                                  std::size_t end);
  void place_cut_nodes(std::size_t begin, std::size_t end, const dynamics::FarFieldStep* step,
                       dynamics::Float4* velocities, world::World& world);
  void keep_rates(world::World& world);
  void set_model(const PatchModel* model);
  void gather(const dynamics::FarFieldStep& step);
  void add_contacts(const dynamics::FarFieldStep& step);
  Vec3f of_change(std::uint32_t local) const;
  void add_inertia(const dynamics::FarFieldStep& step);
  bool make_factors(double inertia_per_s2);
  void fit_to_near(const dynamics::FarFieldStep& step);
  float estimate_error(const dynamics::FarFieldStep& step, const world::World& world);
  float place(std::uint32_t turn, const dynamics::FarFieldStep* step, dynamics::Float4* velocities,
              double dt, world::World& world);

  const std::size_t node_count_;
  const double drag_per_s_;
  ReducedFarState* state_ = nullptr;
  const PatchModel* model_ = nullptr;   // of the state's patches
  std::vector<std::uint8_t> is_local_;  // per node of the organ

  std::vector<std::uint32_t> share_begins_{0};
  std::vector<Share> shares_;

  // The members below are the workspace of a step. These have an entry per field:
  std::vector<double> start_, ahead_, gradient_, scratch_, solving_;
  std::vector<float> along_, change_;
  BlockSystem system_;
  bool has_factors_ = false;
  // These have x, y, z per local node:
  std::vector<float> u_, f_, moved_;
  std::vector<dynamics::Slot> slots_;
  std::vector<std::uint8_t> is_near_;
  std::vector<std::uint32_t> near_;  // local numbers
  std::vector<Touched> touched_;
  double contact_work_j_ = 0, field_work_j_ = 0;  // of the last correction
  std::vector<float> run_, gathered_;
  std::vector<Vec3f> momentum_;  // per node
};

}  // namespace trocar::reduction
