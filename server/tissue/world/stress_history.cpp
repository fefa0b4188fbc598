#include "server/tissue/world/stress_history.h"

#include <algorithm>
#include <cmath>

#include "common/base/checksum.h"

namespace trocar::world {

StressHistory::StressHistory(std::size_t terms, std::size_t places) : tensors_(terms + 1) {
  extend(places);
}

void StressHistory::extend(std::size_t places) {
  const auto blocks = (places + kPlaces - 1) / kPlaces, before = block_count();
  if (blocks <= before) return;
  values_.resize(blocks * block_size());
  advanced_in_.resize(blocks * kPlaces, step_);
  last_spans_.resize(blocks * kPlaces);
  hashes_.resize(blocks);
  for (auto i = before; i < blocks; ++i) hash_ += rehash(i);
}

StressHistory::Steps StressHistory::age(std::size_t index) const {
  Steps age;
  for (std::size_t i = 0; i < kPlaces; ++i)
    age[i] = static_cast<std::uint8_t>(step_ - advanced_in_[index * kPlaces + i]);
  return age;
}

StressHistory::Steps StressHistory::last_span(std::size_t index) const {
  Steps spans;
  std::copy_n(last_spans_.begin() + static_cast<std::ptrdiff_t>(index * kPlaces), kPlaces,
              spans.begin());
  return spans;
}

std::uint64_t StressHistory::advanced(std::size_t index) {
  std::ranges::copy(age(index), last_spans_.begin() + static_cast<std::ptrdiff_t>(index * kPlaces));
  std::fill_n(advanced_in_.begin() + static_cast<std::ptrdiff_t>(index * kPlaces), kPlaces, step_);
  return rehash(index);
}

std::uint64_t StressHistory::hash_of(std::size_t block) const {
  const auto values = this->block(block);
  const auto of_values =
      xxh3_64({reinterpret_cast<const std::uint8_t*>(values.data()), values.size_bytes()});
  const auto of_steps = xxh3_64(BytesView(advanced_in_).subspan(block * kPlaces, kPlaces));
  const auto of_spans = xxh3_64(BytesView(last_spans_).subspan(block * kPlaces, kPlaces));
  // Odd factors: which block has which values counts.
  return of_values * (2 * block + 1) + of_steps * (2 * block + 3) + of_spans * (2 * block + 5);
}

std::uint64_t StressHistory::rehash(std::size_t block) {
  const auto before = hashes_[block];
  hashes_[block] = hash_of(block);
  return hashes_[block] - before;
}

void StressHistory::inherit(std::size_t child, std::size_t parent) {
  if (is_empty()) return;
  extend(child + 1);
  const auto place = [&](std::size_t i) { return i / kPlaces * block_size() + i % kPlaces; };
  for (std::size_t i = 0; i < tensors_ * kComponents; ++i)
    values_[place(child) + i * kPlaces] = values_[place(parent) + i * kPlaces];
  advanced_in_[child] = advanced_in_[parent];
  last_spans_[child] = last_spans_[parent];
  hash_ += rehash(child / kPlaces);
}

void StressHistory::visit_hash(StateArchive& archive) {
  if (is_empty()) return;
  archive.value(step_);
  archive.value(hash_);
}

void StressHistory::visit_values(StateArchive& archive) {
  if (is_empty()) return;
  archive.fixed_array(advanced_in_);
  archive.fixed_array(last_spans_);
  archive.fixed_array(values_);
  if (!archive.is_reading()) return;
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < block_count(); ++i) sum += hashes_[i] = hash_of(i);
  if (sum != hash_) archive.fail();
  if (!std::ranges::all_of(values_, [](float v) { return std::isfinite(v); })) archive.fail();
}

}  // namespace trocar::world
