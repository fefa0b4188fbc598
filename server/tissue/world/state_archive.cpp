#include "server/tissue/world/state_archive.h"

namespace trocar::world {

StateArchive StateArchive::hashing(StateHasher& hasher) {
  return {Mode::Hash, &hasher, nullptr, {}};
}
StateArchive StateArchive::writing(Bytes& out) {
  return {Mode::Write, nullptr, &out, {}};
}
StateArchive StateArchive::reading(BytesView bytes) {
  return {Mode::Read, nullptr, nullptr, bytes};
}

void StateArchive::flag(bool& value) {
  std::uint8_t byte = value ? 1 : 0;
  this->value(byte);
  if (is_reading()) {
    if (byte > 1) fail();
    value = byte == 1;
  }
}

void StateArchive::bytes(std::span<std::uint8_t> data) {
  switch (mode_) {
    case Mode::Hash:
      hasher_->update(data);
      return;
    case Mode::Write:
      out_->insert(out_->end(), data.begin(), data.end());
      return;
    case Mode::Read: {
      const auto source = ok_ ? reader_.read_bytes(data.size()) : BytesView{};
      if (source.size() != data.size()) {
        ok_ = false;
        std::fill(data.begin(), data.end(), std::uint8_t{0});
        return;
      }
      std::copy(source.begin(), source.end(), data.begin());
      return;
    }
  }
}

}  // namespace trocar::world
