#pragma once

// Relaxation of tissue whose strain is averaged (nodal_strain.h): the histories of smoothing
// domains, as relaxation.h keeps those of tets. Of the share of the bracket that smoothing domains
// have, what has relaxed acts on their nodes as F Q b; RelaxedStress reads Q here. Blocks are of
// eight nodes by number.

#include "server/tissue/dynamics/nodal_strain.h"
#include "server/tissue/dynamics/relaxation_terms.h"

namespace trocar::dynamics {

// A block of tets or smoothing domains adds these shares to RelaxationFigures.
struct RelaxationShares {
  float energy_j = 0, volume_m3 = 0, growth_m3 = 0;
  float stress_squared = 0, relaxed = 0;  // volume times stress by stress, by what has relaxed
};

class NodalRelaxation {
 public:
  // NodalStrain and terms must outlive it.
  NodalRelaxation(const topology::Topology& topology, const Groups& groups,
                  const NodalStrain& strain, const RelaxationTerms& terms);

  // Follows an edit as Relaxation::update() does, after the smoothing domains have.
  void update(const topology::Topology& topology, const Groups& groups,
              std::span<const GroupLanes> lanes);

  std::size_t block_count() const { return blocks_.size(); }
  // Returns the block of the node at a slot.
  std::uint32_t block_of(Slot slot) const { return block_of_[slot]; }
  static constexpr std::uint32_t kNoBlock = 0xffffffffu;
  // Blocks to be begun, after update().
  std::span<const std::uint32_t> stale() const { return stale_; }
  void clear_stale() { stale_.clear(); }

  // Computes Q for the next step from the history. Different blocks may be begun at once.
  void begin_block(std::size_t index, const world::StressHistory& history,
                   RelaxationTerms::Constants& scratch);
  // Advances the history to where smoothing domains are. Returns the hash's difference.
  std::uint64_t end_block(std::size_t index, world::StressHistory& history,
                          RelaxationTerms::Constants& scratch);
  // Sets the history to that of tissue that has long been where it is. Returns the hash's
  // difference.
  std::uint64_t settle_block(std::size_t index, world::StressHistory& history,
                             RelaxationTerms::Constants& scratch) const;

  // Three per slot, at places of NodalStrain: rows of Q times the smoothing domains' share, Pa.
  const Float4* relaxed() const { return relaxed_.data(); }
  std::span<const RelaxationShares> shares() const { return shares_; }

 private:
  struct Block {
    SlotLanes places;  // among the smoothing domains
    Lanes relaxes;     // 1, or 0: no smoothing domain, or one that does not relax
    LaneMaterials materials;
  };

  void set_lane(const topology::Topology& topology, const Groups& groups, NodeIndex node);
  RelaxationTerms::Response response_of(const Block& block, const RelaxationTerms::Constants& c,
                                        NodalStrain::Gradient& gradient) const;
  void set_relaxed(const Block& block, const SymMat8& q);

  const organ::Organ& organ_;
  const NodalStrain& nodal_strain_;
  const RelaxationTerms& terms_;
  std::vector<Block> blocks_;
  std::vector<RelaxationShares> shares_;
  std::vector<std::uint32_t> block_of_;  // per slot
  std::vector<Float4> relaxed_;
  std::vector<std::uint32_t> stale_;
};

}  // namespace trocar::dynamics
