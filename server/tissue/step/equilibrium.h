#pragma once

// Equilibria of a simulation's tissue: time stands still until loads, gravity and tools are in
// balance with it. It acts on the simulation's state by the same solver and contacts as ticks do,
// and ticks go on from there.

#include <functional>
#include <vector>

#include "server/tissue/step/simulation.h"

namespace trocar::step {

struct EquilibriumRules {
  float tolerance_n = 1e-5f;  // nothing is out of balance by more than this
  std::uint32_t max_sweeps = 20'000;
};

struct EquilibriumReport {
  dynamics::SolveReport solve;  // the last one's, with the sweeps of all
  bool is_converged = false;
};

class Equilibrium {
 public:
  // `simulation` outlives this. Nodes that are free now are those that move.
  Equilibrium(Simulation& simulation, const EquilibriumRules& rules);

  std::size_t free_nodes() const { return free_nodes_.size(); }

  // Without tools.
  EquilibriumReport find(const dynamics::ExternalLoads& loads);
  // Does likewise, and measures no reactions.
  EquilibriumReport relax(const dynamics::ExternalLoads& loads);
  // With tools, which walk to where their samples are: in rounds of contacts and relaxation until
  // nothing moves any more. `inputs` gives those of a tick; `is_first` says that samples are due.
  using Inputs = std::function<const hands::TickInputs&(Tick tick, bool is_first)>;
  EquilibriumReport find(const dynamics::ExternalLoads& loads, const Inputs& inputs);

 private:
  void meet_tools(const hands::TickInputs& inputs);
  // Held and displaced nodes go where the loads have them.
  void place_held(const dynamics::ExternalLoads& loads);
  // Returns elastic energy minus the work of loads and gravity, J. O(nodes).
  double potential_energy_j(const dynamics::ExternalLoads& loads) const;
  State& state() { return *simulation_.state_; }
  StepContext& context() { return *simulation_.context_; }

  Simulation& simulation_;
  const EquilibriumRules rules_;
  std::vector<NodeIndex> free_nodes_;
  std::vector<Vec3f> before_;          // displacements before a round of contacts
  std::vector<Vec3f> before_stretch_;  // displacements before a stretch of sweeps
};

}  // namespace trocar::step
