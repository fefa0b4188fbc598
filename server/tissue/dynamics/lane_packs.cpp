#include "server/tissue/dynamics/lane_packs.h"

#include <algorithm>
#include <utility>

namespace trocar::dynamics {
namespace {

std::uint8_t bit(std::size_t lane) {
  return static_cast<std::uint8_t>(1u << lane);
}

}  // namespace

void LanePacks::extend(const Groups& groups) {
  place_of_.resize(groups.slot_count(), kNoSlot);
  packs_of_.resize(std::max(packs_of_.size(), groups.colour_count()));
  nodes_of_.resize(packs_of_.size());
  // Each pack has at least one slot of its own.
  for (auto* packs : {&empty_, &ordered_}) packs->reserve(groups.group_count());
  for (auto* slots : {&place_of_, &waiting_}) slots->reserve(groups.slot_count());
  for (auto* lanes : {&changed_, &dropped_}) lanes->reserve(groups.group_count());
}

void LanePacks::note_change(Group pack, std::size_t lane) {
  if (changed_lanes_[pack] == 0) changed_.push_back({pack, 0});
  changed_lanes_[pack] |= bit(lane);
}

void LanePacks::drop(Group pack, std::size_t lane) {
  place_of_[slots_[pack].v[lane]] = kNoSlot;
  held_[pack] = static_cast<std::uint8_t>(held_[pack] & ~bit(lane));
  used_[pack] = static_cast<std::uint8_t>(used_[pack] & ~bit(lane));
  if (held_[pack] != 0) {
    // Nothing may be read there that others write.
    slots_[pack].v[lane] = slots_[pack].v[__builtin_ctz(held_[pack])];
    dropped_.push_back({pack, bit(lane)});
    return;
  }
  std::erase(packs_of_[std::exchange(colour_[pack], kNoColour)], pack);
  empty_.push_back(pack);
}

void LanePacks::remove(Slot slot) {
  const Slot place = place_of_[slot];
  if (place == kNoSlot) return;
  drop(place / kLanes, place % kLanes);
}

void LanePacks::find_used(const Groups& groups, std::span<const Slot> slots) {
  std::ranges::fill(used_, std::uint8_t{0});
  std::ranges::fill(nodes_of_, 0u);
  waiting_.clear();
  for (const Slot slot : slots) {
    ++nodes_of_[groups.colour_of(slot / kLanes)];
    const Slot place = place_of_[slot];
    if (place == kNoSlot)
      waiting_.push_back(slot);
    else
      used_[place / kLanes] |= bit(place % kLanes);
  }
}

// The nodes of one pack wait again where a colour is spread over twice as many as it needs.
void LanePacks::dissolve_emptiest() {
  for (Colour colour = 0; colour < packs_of_.size(); ++colour) {
    std::size_t active = 0;
    Group emptiest = 0;
    int least = kLanes + 1;
    for (const Group pack : packs_of_[colour]) {
      const int count = __builtin_popcount(used_[pack]);
      active += count > 0;
      if (count > 0 && count < least) least = count, emptiest = pack;
    }
    if (active <= 2 * ((nodes_of_[colour] + kLanes - 1) / kLanes) + 1) continue;
    const auto lanes = used_[emptiest], held = held_[emptiest];
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      if (lanes & bit(lane)) waiting_.push_back(slots_[emptiest].v[lane]);
      if (held & bit(lane)) drop(emptiest, lane);
    }
  }
}

Group LanePacks::pack_with_room(Colour colour) {
  auto& packs = packs_of_[colour];
  for (const Group pack : packs)
    if (used_[pack] != 0 && used_[pack] != 0xff) return pack;
  for (const Group pack : packs)
    if (used_[pack] == 0) return pack;
  Group pack = 0;
  if (empty_.empty()) {
    pack = static_cast<Group>(slots_.size());
    slots_.emplace_back();
    for (auto* lanes : {&held_, &used_, &changed_lanes_}) lanes->push_back(0);
    colour_.push_back(kNoColour);
  } else {
    pack = empty_.back();
    empty_.pop_back();
  }
  colour_[pack] = colour;
  packs.insert(std::ranges::upper_bound(packs, pack), pack);
  return pack;
}

void LanePacks::put(Slot slot, Colour colour) {
  const Group pack = pack_with_room(colour);
  const bool is_new = held_[pack] == 0;
  const auto free =
      static_cast<unsigned>(held_[pack] != 0xff ? ~held_[pack] & 0xff : ~used_[pack] & 0xff);
  const auto lane = static_cast<std::size_t>(__builtin_ctz(free));
  if (held_[pack] & bit(lane)) place_of_[slots_[pack].v[lane]] = kNoSlot;
  held_[pack] |= bit(lane);
  used_[pack] |= bit(lane);
  place_of_[slot] = pack * kLanes + static_cast<Slot>(lane);
  slots_[pack].v[lane] = slot;
  if (!is_new) return note_change(pack, lane);
  for (std::size_t i = 0; i < kLanes; ++i) {
    slots_[pack].v[i] = slot;
    note_change(pack, i);
  }
}

void LanePacks::place(const Groups& groups, std::span<const Slot> slots) {
  for (const auto& lanes : changed_) changed_lanes_[lanes.group] = 0;
  changed_.clear();
  find_used(groups, slots);
  for (const auto& [pack, lane] : dropped_)
    if (held_[pack] != 0) note_change(pack, static_cast<std::size_t>(__builtin_ctz(lane)));
  dropped_.clear();
  dissolve_emptiest();
  for (const Slot slot : waiting_) put(slot, groups.colour_of(slot / kLanes));
  for (auto& lanes : changed_) lanes.lanes = changed_lanes_[lanes.group];
}

void LanePacks::order_by_colour(std::vector<Group>& packs,
                                std::vector<std::uint32_t>& colour_begins) const {
  begins_.assign(packs_of_.size() + 1, 0);
  for (const Group pack : packs) ++begins_[colour_[pack] + 1u];
  for (std::size_t c = 0; c + 1 < begins_.size(); ++c) begins_[c + 1] += begins_[c];
  colour_begins.assign(begins_.begin(), begins_.end());
  ordered_.resize(packs.size());
  for (const Group pack : packs) ordered_[begins_[colour_[pack]]++] = pack;
  std::ranges::copy(ordered_, packs.begin());
}

}  // namespace trocar::dynamics
