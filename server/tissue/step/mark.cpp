#include "server/tissue/step/mark.h"

namespace trocar::step {
namespace {

constexpr std::uint32_t kMostBytes = 1u << 30;

}  // namespace

void Mark::set(Bytes state) {
  state_ = std::move(state);
  hash_ = xxh3_64(state_);
}

void Mark::visit_state(world::StateArchive& archive) {
  archive.value(hash_);
  if (archive.is_hashing()) return;
  archive.sized_array(state_, kMostBytes);
  if (archive.is_reading() && hash_ != (state_.empty() ? 0 : xxh3_64(state_))) archive.fail();
}

}  // namespace trocar::step
