#pragma once

// Lanes of a colour's groups, gathered eight by eight, so that few nodes here and there cost what
// eight together do. Nodes near a tool are a patch of the organ, and a group of eight of one colour
// is spread as wide as the patch: of its lanes, one or two are near.
//
// Whoever keeps rows for groups (GroupRows, GroupValues) keeps copies of the gathered lanes under
// the numbers from kFirstPack on. Lanes never mix, so that a node's result does not depend on the
// pack that it is in: packs follow from history, are no state, and change no result but speed.
//
// A slot stays in its lane until another of its colour needs the place, so that a tool that moves
// costs copies for the nodes that it comes to alone. Work per call: O(slots that are needed).

#include <span>
#include <vector>

#include "server/tissue/dynamics/groups.h"

namespace trocar::dynamics {

class LanePacks {
 public:
  std::size_t size() const { return slots_.size(); }
  void extend(const Groups& groups);

  // Brings these slots, all distinct and with a node, into packs.
  void place(const Groups& groups, std::span<const Slot> slots);
  // Lanes whose slot is another than before the last place(), or none; by pack. These slots have
  // to be copied, and eight slots of a pack are valid to be read whatever its lanes hold.
  std::span<const GroupLanes> changed() const { return changed_; }
  // The slot's node has changed, or has left it.
  void remove(Slot slot);

  // Lane pack * 8 + lane of a slot that was placed.
  Slot place_of(Slot slot) const { return place_of_[slot]; }
  const SlotLanes& slots(Group pack) const { return slots_[pack]; }
  // Lanes that hold a slot.
  std::uint8_t held(Group pack) const { return held_[pack]; }

  // Sorts packs, each there once, by colour.
  void order_by_colour(std::vector<Group>& packs, std::vector<std::uint32_t>& colour_begins) const;

 private:
  void find_used(const Groups& groups, std::span<const Slot> slots);
  void dissolve_emptiest();
  void put(Slot slot, Colour colour);
  Group pack_with_room(Colour colour);
  void note_change(Group pack, std::size_t lane);
  void drop(Group pack, std::size_t lane);

  std::vector<SlotLanes> slots_;              // per pack
  std::vector<std::uint8_t> held_, used_;     // per pack: lanes; used in this call
  std::vector<std::uint8_t> changed_lanes_;   // per pack
  std::vector<Colour> colour_;                // per pack; kNoColour: it holds nothing
  std::vector<std::vector<Group>> packs_of_;  // per colour, ascending
  std::vector<std::uint32_t> nodes_of_;       // per colour: slots of the last call
  std::vector<Group> empty_;
  std::vector<Slot> place_of_;  // per slot; kNoSlot: none
  std::vector<Slot> waiting_;
  std::vector<GroupLanes> dropped_;  // lanes that lost their slot since the last call
  std::vector<GroupLanes> changed_;
  mutable std::vector<std::uint32_t> begins_;
  mutable std::vector<Group> ordered_;
};

}  // namespace trocar::dynamics
