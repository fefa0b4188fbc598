// This file sweeps near nodes that are few in their groups eight together.

#include <atomic>

#include "server/tissue/dynamics/block_descent.h"
#include "server/tissue/dynamics/node_move.h"

namespace trocar::dynamics {

// Nodes of one colour that share a contact point are swept in their groups, for there it matters
// which of them are swept at once.
void BlockDescent::plan_packs(std::span<const NodeIndex> near, std::span<const SweepBand> bands) {
  const auto& groups = tissue_.groups();
  packed_slots_.clear();
  const auto is_kept = [&](Slot slot) { return serial_stamp_[slot / kLanes] == current_; };
  for (const auto node : near)
    if (const Slot slot = groups.slot_of(node); !is_kept(slot)) packed_slots_.push_back(slot);
  packs_.place(groups, packed_slots_);
  for (const auto& [pack, changed] : packs_.changed())
    tissue_.pack({kFirstPack + pack, packs_.slots(pack), changed, packs_.held(pack)});

  const std::size_t count = std::max<std::size_t>(bands.size(), 1);
  for (std::size_t b = 0; b < count; ++b) {
    auto& [nodes, kept, packed] = bands_[b];
    if (packed.lanes.size() < packs_.size()) packed.lanes.resize(packs_.size());
    for (const auto node : bands.empty() ? near : near.first(bands[b].end)) {
      const Slot slot = groups.slot_of(node);
      if (is_kept(slot)) {
        kept.add(groups, node);
        continue;
      }
      const Slot place = packs_.place_of(slot);
      packed.add(place / kLanes, static_cast<std::uint8_t>(1u << place % kLanes));
    }
    kept.finish(groups);
    packed.finish(packs_);
  }
}

NodeStep8 BlockDescent::inertia_at(const SlotLanes& slots, const Vec8& own) const {
  Lanes inertia;
  Vec3Lanes momentum;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const Inertia& of_group = inertia_[slots.v[lane] / kLanes];
    const std::size_t at = slots.v[lane] % kLanes;
    inertia.v[lane] = of_group.inertia.v[at];
    momentum.x.v[lane] = of_group.momentum.x.v[at];
    momentum.y.v[lane] = of_group.momentum.y.v[at];
    momentum.z.v[lane] = of_group.momentum.z.v[at];
  }
  const Float8 m = load(inertia);
  const Vec8 moved = own - gather(start_.data(), slots);
  NodeStep8 step{moved * m - load(momentum), zero_sym_mat8()};
  step.block.add_identity(m);
  return step;
}

void BlockDescent::relax_pack(std::uint8_t lanes, Group pack, const contact::ContactList& contacts,
                              float omega) {
  const SlotLanes& slots = packs_.slots(pack);
  const Group group = kFirstPack + pack;
  const Vec8 own = gather(x_.data(), slots);
  NodeStep8 step = inertia_at(slots, own);
  tissue_.add_elements(group, x_.data(), own, step);
  if (implicit_strain_ != nullptr) tissue_.add_averaged(group, step);
  Lanes factors;
  store(factors, all(omega));
  add_contacts(contacts, slots, step, factors);
  const NodeMove move = move_of(step, all(0) - load(factors), lanes);
  scatter(x_.data(), slots, own + move.dx, lanes);
  if (implicit_strain_ != nullptr) implicit_strain_->after_move(group, move.dx, lanes);
  if (is_far_linear_) linear_far_field_->after_move(slots, lanes, move.dx, inverse_dt_);
  Lanes squares;
  store(squares, move.squared);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    if ((lanes >> lane & 1) == 0) continue;
    const Slot slot = slots.v[lane];
    squares_[slot / kLanes].v[slot % kLanes] = squares.v[lane];
    // Other packs may have other lanes of the same group.
    if (move.rejected >> lane & 1)
      std::atomic_ref(rejected_[slot / kLanes])
          .fetch_or(static_cast<std::uint8_t>(1u << slot % kLanes), std::memory_order_relaxed);
  }
}

}  // namespace trocar::dynamics
