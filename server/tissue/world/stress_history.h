#pragma once

// Stresses that tissue has had, in some places (tets, or smoothing domains): per place the stress
// that would be there at once, as of the step that advanced it last, and how much of it each
// relaxation term has taken away since. Symmetric tensors over the pose without stress (second
// Piola-Kirchhoff, Pa), so that the parts of a tet that is split have those of the whole.
//
// Places by eights: values of a block lie as [tensor][component][place], with components xx, xy,
// xz, yy, yz, zz. A solver advances some blocks in a step: the tick hash covers a sum of theirs,
// which follows in O(blocks that changed). Empty where nothing relaxes.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/tissue/world/state_archive.h"

namespace trocar::world {

class StressHistory {
 public:
  static constexpr std::size_t kPlaces = 8, kComponents = 6;
  using Steps = std::array<std::uint8_t, kPlaces>;

  StressHistory() = default;
  // There is at least one relaxation term.
  StressHistory(std::size_t terms, std::size_t places);

  bool is_empty() const { return tensors_ == 0; }
  std::size_t block_size() const { return tensors_ * kComponents * kPlaces; }
  std::size_t block_count() const { return is_empty() ? 0 : values_.size() / block_size(); }
  std::span<const float> block(std::size_t index) const {
    return std::span(values_).subspan(index * block_size(), block_size());
  }
  // Steps since each of its places was advanced.
  Steps age(std::size_t index) const;
  // Steps over which each of its places was advanced last; 0: it never was.
  Steps last_span(std::size_t index) const;

  // Counts a step.
  void begin_step() { ++step_; }
  // Returns the number of steps so far, modulo 256.
  std::uint8_t step() const { return step_; }

  // A block to be advanced to this step. Once its values are written, advanced() gives what
  // add_to_hash() wants, alone or summed over blocks. Different blocks at once: allowed.
  std::span<float> block(std::size_t index) {
    return std::span(values_).subspan(index * block_size(), block_size());
  }
  std::uint64_t advanced(std::size_t index);
  void add_to_hash(std::uint64_t difference) { hash_ += difference; }

  // The child, which may be a new place, is a part or a copy of what was the parent.
  void inherit(std::size_t child, std::size_t parent);

  void visit_hash(StateArchive& archive);
  // After it, unless the archive is hashing.
  void visit_values(StateArchive& archive);

 private:
  void extend(std::size_t places);
  std::uint64_t hash_of(std::size_t block) const;
  // Takes the block's hash anew; by how much the sum changes.
  std::uint64_t rehash(std::size_t block);

  std::size_t tensors_ = 0;  // per place
  std::vector<float> values_;
  std::vector<std::uint8_t> advanced_in_;  // per place: step()
  std::vector<std::uint8_t> last_spans_;   // per place
  std::uint8_t step_ = 0;
  std::vector<std::uint64_t> hashes_;  // per block
  std::uint64_t hash_ = 0;             // their sum
};

}  // namespace trocar::world
