#pragma once

// Springs and masses as Nakao 2003 prints them, for comparison with the live solver: every edge has
// a stiffness and a rest length of its own, a cut re-models the system (sec. 3.2) and time goes by
// eq. 2, velocity first; viscosity acts on nodes (eq. 1) and is taken implicitly.
//
// Re-modelling, so that energy and the forces on neighbours stay what they are:
//   - a split edge becomes two in series, k/t and k/(1-t), of t and 1-t of the rest length;
//   - edges from the new node into the ring have the paper's k and the length they have just then;
//   - an edge that lies in the wound becomes one on each side, its stiffness shared out.
// A node that moves to the border of the cut: parts of old edges get eq. 3 of their new length, new
// ones the length they have. Energy may change by that, as in the paper.

#include <array>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "server/tissue/cutting/edits.h"

namespace trocar::validation {

class RemodelledSprings {
 public:
  // Takes an organ with SpringLaw::Constant; the viscosity is in N s/m per node.
  RemodelledSprings(const organ::Organ& organ, double viscosity_n_s_m);

  // Repeats what a cut of the same organ did.
  Status update(const cutting::CutEvents& events);
  // Advances by at least this time, in stable steps; nodes of `held` stay at their y.
  void advance(double seconds, std::span<const std::uint8_t> held);

  std::span<const Vec3d> positions() const { return positions_; }  // m, per node
  const topology::Topology& topology() const { return topology_; }
  double energy_j() const;
  double stable_step_s() const { return stable_step_s_; }
  // By which the lightest nodes were made heavier for the sake of the step, share of all mass.
  double added_mass() const { return added_mass_; }

 private:
  struct Spring {
    double stiffness_n_m = 0;
    double rest_length_m = 0;
    bool is_of_ring = false;  // has come into being by a split
  };
  using Edge = std::pair<NodeIndex, NodeIndex>;  // ascending
  // Springs as they are summed over.
  struct Pull {
    std::uint32_t a, b;
    double stiffness_n_m, rest_length_m;
  };

  double distance(const Edge& edge) const;
  void split(const cutting::Split& split);
  void move(const cutting::Move& move);
  void open(std::span<const cutting::CutEvent> copies);
  void take_masses();
  void list_pulls();

  const organ::Organ& organ_;
  const double viscosity_n_s_m_;
  topology::Topology topology_;
  cutting::Places places_;
  std::map<Edge, Spring> springs_;
  std::vector<Vec3d> positions_, velocities_, forces_;
  std::vector<double> masses_;  // kg
  double stable_step_s_ = 0, added_mass_ = 0;
  std::vector<std::uint8_t> is_fixed_;  // per node
  std::vector<Pull> pulls_;
};

}  // namespace trocar::validation
