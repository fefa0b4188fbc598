#pragma once

// A state of the organ that an instructor has marked, to be returned to: shape and motion of the
// tissue and its topology. The mark is part of the state, so journals, snapshots and replays have
// it; the tick hash covers its hash.

#include "common/base/bytes.h"
#include "server/tissue/world/state_archive.h"

namespace trocar::step {

class Mark {
 public:
  bool is_set() const { return !state_.empty(); }
  BytesView state() const { return state_; }
  void set(Bytes state);

  void visit_state(world::StateArchive& archive);

 private:
  Bytes state_;
  std::uint64_t hash_ = 0;
};

}  // namespace trocar::step
