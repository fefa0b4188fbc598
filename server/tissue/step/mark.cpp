#include "server/tissue/step/mark.h"

#include <algorithm>

namespace trocar::step {
namespace {

constexpr std::uint32_t kMostBytes = 1u << 30;
// A bit of the first mark's count, which is less: the other marks follow.
constexpr std::uint32_t kMoreFollow = 1u << 31;

}  // namespace

void Marks::set(std::uint8_t number, Bytes state) {
  marks_[number].state = std::move(state);
  marks_[number].hash = xxh3_64(marks_[number].state);
}

bool Marks::has_more() const {
  return std::any_of(marks_.begin() + 1, marks_.end(),
                     [](const Mark& mark) { return !mark.state.empty(); });
}

void Marks::check(world::StateArchive& archive, const Mark& mark) {
  if (archive.is_reading() && mark.hash != (mark.state.empty() ? 0 : xxh3_64(mark.state)))
    archive.fail();
}

void Marks::visit_state(world::StateArchive& archive) {
  auto& first = marks_.front();
  bool more = has_more();
  archive.value(first.hash);
  if (!archive.is_hashing()) {
    auto count = static_cast<std::uint32_t>(first.state.size()) | (more ? kMoreFollow : 0);
    archive.value(count);
    more = (count & kMoreFollow) != 0;
    archive.counted_array(first.state, count & ~kMoreFollow, kMostBytes);
    check(archive, first);
  }
  if (!more) return;
  for (auto mark = marks_.begin() + 1; mark != marks_.end(); ++mark) {
    archive.value(mark->hash);
    if (archive.is_hashing()) continue;
    archive.sized_array(mark->state, kMostBytes);
    check(archive, *mark);
  }
}

}  // namespace trocar::step
