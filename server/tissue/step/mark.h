#pragma once

// States of the organ that an instructor has marked, to be returned to: shape and motion of the
// tissue and its topology. Marks are part of the state, so journals, snapshots and replays have
// them; the tick hash covers their hashes.

#include <array>

#include "common/base/bytes.h"
#include "server/tissue/hands/inputs.h"
#include "server/tissue/world/state_archive.h"

namespace trocar::step {

class Marks {
 public:
  // `number` is less than hands::kMostMarks.
  bool is_set(std::uint8_t number = 0) const { return !marks_[number].state.empty(); }
  BytesView state(std::uint8_t number) const { return marks_[number].state; }
  void set(std::uint8_t number, Bytes state);

  // With the first mark alone, bytes and hash are those of sessions that know no other.
  void visit_state(world::StateArchive& archive);

 private:
  struct Mark {
    Bytes state;
    std::uint64_t hash = 0;
  };
  bool has_more() const;
  static void check(world::StateArchive& archive, const Mark& mark);

  std::array<Mark, hands::kMostMarks> marks_;
};

}  // namespace trocar::step
