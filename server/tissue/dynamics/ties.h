#pragma once

// The energy of ties between places of the surface (server/organs/organ/tie.h).
//
// With r from one end to the other, l = |r|, d = l - rest length, A the area and m the larger of d
// and the largest extension so far, the tension is s = A stress(m) d/m along r, and nothing where
// d <= 0. It is the exact derivative of a potential in d as long as the memory stands, which the
// tick moves on after the solve (server/tissue/step/tie_breaks.h). The block has the secant k = A
// stress(m)/m in place of the derivative, so that it stays positive while a tie weakens: w^2 k (d/l
// I + rest/l u u^T) for a node with the weight w. Two ends in one place have no direction between
// them: that tie is silent.
//
// A tie has no linear form: nodes at which one meets have no linear far field.

#include "server/tissue/dynamics/energy.h"

namespace trocar::dynamics {

class Ties final : public Energy {
 public:
  Ties(const topology::Topology& topology, const Groups& groups);

  // Largest extensions so far, m, per tie; they must stay where they are until the next call.
  void use_memory(const float* extensions) { extensions_ = extensions; }
  // Whether a tie meets at a node of the group, broken or not.
  bool act_on(Group group) const { return !rows_[group].empty(); }

  void begin_group(Group group, const Float4* start, const Vec8& own, float inverse_dt) override;
  void pack(const PackedLanes& pack) override { rows_.pack(pack); }
  void add(Group group, const Float4* x, const Vec8& own, NodeStep8& step) const override;
  void linearise(Group, const Float4*, const Vec8&, NodeStep8&, StiffnessSink&) const override {}
  void add_energies_j(std::span<const Vec3d> displacements,
                      std::span<double> energies) const override;
  std::size_t rebuild(const topology::Topology& topology, const Groups& groups,
                      std::span<const GroupLanes> lanes) override;

 private:
  static constexpr std::size_t kBeside = 2, kAcross = 3;  // other nodes, of either end

  struct Row {
    std::array<SlotLanes, kBeside> beside;
    std::array<SlotLanes, kAcross> across;
    SlotLanes tie;
    Lanes weight;  // of the node itself
    std::array<Lanes, kBeside> beside_weights;
    std::array<Lanes, kAcross> across_weights;
    Vec3Lanes rest;           // m, to the other end at rest
    Lanes rest_length;        // m
    Lanes slope, fall, full;  // tension is the lesser of slope m and fall (full - m); N/m, N/m, m
    Lanes most;               // m, the largest extension so far

    void pad(std::size_t lane, Slot own) {
      for (auto& slots : beside) slots.v[lane] = own;
      for (auto& slots : across) slots.v[lane] = own;
    }
  };

  std::size_t fill(const topology::Topology& topology, const Groups& groups, GroupLanes lanes);

  GroupRows<Row> rows_;
  const float* extensions_ = nullptr;
};

}  // namespace trocar::dynamics
