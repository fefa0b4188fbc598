// The reduced far field puts nodes where the fields have them: the organ's own in turns, and those
// that cuts have made by their shares of these.

#include <algorithm>
#include <cmath>

#include "server/tissue/reduction/reduced_far_field.h"

namespace trocar::reduction {

void ReducedFarField::add_cut_nodes(const world::World& world) {
  if (cut_node_count() == world.origins.size()) return;
  share_begins_.assign(1, 0);
  shares_.clear();
  const auto add = [&](NodeIndex node, float weight, std::size_t own) {
    if (weight == 0) return;
    const auto put = [&](std::uint32_t root, float part) {
      const auto mine = std::span(shares_).subspan(own);
      const auto found = std::ranges::find(mine, root, &Share::node);
      if (found != mine.end())
        found->weight += part;
      else
        shares_.push_back({root, part});
    };
    if (node.value < node_count_) return put(node.value, weight);
    const auto parent = node.value - node_count_;
    for (auto i = share_begins_[parent]; i < share_begins_[parent + 1]; ++i)
      put(shares_[i].node, weight * shares_[i].weight);
  };
  for (const auto& origin : world.origins) {
    const auto own = shares_.size();
    const float t = static_cast<float>(origin.t) / 65536.0f;
    add(origin.a, 1 - t, own);
    add(origin.b, t, own);
    share_begins_.push_back(static_cast<std::uint32_t>(shares_.size()));
  }
}

std::span<const float> ReducedFarField::gathered(std::span<const Vec3f> values, std::size_t begin,
                                                 std::size_t end) {
  for (std::size_t n = begin; n < end; ++n) {
    float* const to = &gathered_[3 * (n - begin)];
    to[0] = values[n].x, to[1] = values[n].y, to[2] = values[n].z;
  }
  for (std::size_t i = 0; i < cut_node_count(); ++i)
    for (const auto& [node, weight] : shares_of(i)) {
      if (node < begin || node >= end) continue;
      const Vec3f part = values[node_count_ + i] * weight;
      float* const to = &gathered_[3 * (node - begin)];
      to[0] += part.x, to[1] += part.y, to[2] += part.z;
    }
  return std::span(gathered_).first(3 * (end - begin));
}

// Far nodes move on as the fields do. What they were not in has faded, which is no motion that
// another solver may go on with: it would gain energy at every hand-over.
void ReducedFarField::keep_rates(world::World& world) {
  const auto count = model_->field_count();
  for (std::size_t c = 0; c < count; ++c) change_[c] = static_cast<float>(state_->rates[c]);
  for (std::uint32_t turn = 0; turn < kPlacingTurns; ++turn) {
    const auto begin = node_count_ * turn / kPlacingTurns,
               end = node_count_ * (turn + 1) / kPlacingTurns;
    const auto run = std::span(run_).first(3 * (end - begin));
    std::ranges::fill(run, 0.0f);
    model_->add_everywhere(begin, end, change_, run);
    for (std::size_t n = begin; n < end; ++n)
      if (is_local_[n] == 0 && world.node_classes[n] != world::NodeClass::Fixed)
        world.velocities[n] = {run[3 * (n - begin)], run[3 * (n - begin) + 1],
                               run[3 * (n - begin) + 2]};
  }
  for (std::size_t i = 0; i < cut_node_count(); ++i) {
    Vec3f velocity;
    for (const auto& [node, weight] : shares_of(i)) velocity += world.velocities[node] * weight;
    if (world.node_classes[node_count_ + i] != world::NodeClass::Fixed)
      world.velocities[node_count_ + i] = velocity;
  }
}

// Nodes of one turn where the fields have them, or will have them halfway to their next turn, so
// that they are not late on average; the squared move of the farthest. step: null: it is for the
// world alone, and now.
float ReducedFarField::place(std::uint32_t turn, const dynamics::FarFieldStep* step,
                             dynamics::Float4* velocities, double dt, world::World& world) {
  auto& s = *state_;
  const auto count = model_->field_count();
  const auto begin = node_count_ * turn / kPlacingTurns,
             end = node_count_ * (turn + 1) / kPlacingTurns;
  const auto steps = s.steps_since_placed[turn];
  double stays = 1;
  for (int step_count = 0; step_count < steps; ++step_count) stays *= 1 - dt / kFade_s;
  double* const placed = s.placed.data() + turn * count;
  const double ahead = step != nullptr ? dt * (kPlacingTurns - 1) / 2 : 0;
  for (std::size_t c = 0; c < count; ++c) {
    const double to = s.amplitudes[c] + ahead * s.rates[c];
    change_[c] = static_cast<float>(to - stays * placed[c]);
    placed[c] = to;
  }
  s.steps_since_placed[turn] = 0;
  const auto run = std::span(run_).first(3 * (end - begin));
  std::ranges::fill(run, 0.0f);
  model_->add_everywhere(begin, end, change_, run);
  const auto left = static_cast<float>(stays);
  const float inverse_time =
      1 / (static_cast<float>(dt) * static_cast<float>(std::max<int>(steps, 1)));
  float squared = 0;
  for (std::size_t n = begin; n < end; ++n) {
    float* const moved = &run[3 * (n - begin)];
    if (is_local_[n] != 0 || world.node_classes[n] == world::NodeClass::Fixed) {
      std::fill_n(moved, 3, 0.0f);
      continue;
    }
    Vec3f& displacement = world.displacements[n];
    const Vec3f now = displacement * left + Vec3f{moved[0], moved[1], moved[2]};
    const Vec3f move = now - displacement;
    squared = std::max(squared, length_squared(move));
    displacement = now;
    world.velocities[n] = move * inverse_time;
    moved[0] = move.x, moved[1] = move.y, moved[2] = move.z;
    if (step == nullptr) continue;
    const auto slot = step->groups.slot_of(NodeIndex(static_cast<std::uint32_t>(n)));
    if (slot == dynamics::kNoSlot) continue;
    step->x[slot] = dynamics::to_float4(now);
    velocities[slot] = dynamics::to_float4(world.velocities[n]);
  }
  place_cut_nodes(begin, end, step, velocities, world);
  return squared;
}

// Nodes that cuts made move by their shares of what the organ's nodes of this turn have moved by.
void ReducedFarField::place_cut_nodes(std::size_t begin, std::size_t end,
                                      const dynamics::FarFieldStep* step,
                                      dynamics::Float4* velocities, world::World& world) {
  for (std::size_t i = 0; i < cut_node_count(); ++i) {
    const auto n = node_count_ + i;
    if (world.node_classes[n] == world::NodeClass::Fixed) continue;
    Vec3f moved, velocity;
    bool is_moved = false;
    for (const auto& [node, weight] : shares_of(i)) {
      velocity += world.velocities[node] * weight;
      if (node < begin || node >= end) continue;
      const float* const move = &run_[3 * (node - begin)];
      moved += Vec3f{move[0], move[1], move[2]} * weight;
      is_moved = true;
    }
    if (!is_moved) continue;
    world.displacements[n] += moved;
    world.velocities[n] = velocity;
    if (step == nullptr) continue;
    const auto slot = step->groups.slot_of(NodeIndex(static_cast<std::uint32_t>(n)));
    if (slot == dynamics::kNoSlot) continue;
    step->x[slot] = dynamics::to_float4(world.displacements[n]);
    velocities[slot] = dynamics::to_float4(velocity);
  }
}

}  // namespace trocar::reduction
