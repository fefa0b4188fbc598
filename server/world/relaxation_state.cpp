#include "server/world/relaxation_state.h"

#include <algorithm>
#include <cmath>

#include "common/base/checksum.h"

namespace trocar::world {

std::size_t RelaxationState::terms_of(const scene::Organ& organ) {
  std::size_t most = 0;
  for (std::size_t i = 0; i <= organ.regions.size(); ++i) {
    const auto& material = scene::material_at(organ, static_cast<std::uint16_t>(i));
    if (material.elastic_law == scene::ElasticLaw::Measured)
      most = std::max(most, material.measured.relaxation.size());
  }
  return most;
}

RelaxationState::RelaxationState(const scene::Organ& organ) {
  const auto terms = terms_of(organ);
  if (terms == 0) return;
  tensors_ = terms + 1;
  forces_.resize(organ.mesh.node_count());
  extend(organ.mesh.tets.size());
}

void RelaxationState::extend(std::size_t tets) {
  const auto blocks = (tets + kTets - 1) / kTets, before = block_count();
  if (blocks <= before) return;
  values_.resize(blocks * block_size());
  advanced_in_.resize(blocks * kTets, step_);
  hashes_.resize(blocks);
  for (auto i = before; i < blocks; ++i) hash_ += rehash(i);
}

RelaxationState::Steps RelaxationState::age(std::size_t index) const {
  Steps age;
  for (std::size_t i = 0; i < kTets; ++i)
    age[i] = static_cast<std::uint8_t>(step_ - advanced_in_[index * kTets + i]);
  return age;
}

std::uint64_t RelaxationState::advanced(std::size_t index) {
  std::fill_n(advanced_in_.begin() + static_cast<std::ptrdiff_t>(index * kTets), kTets, step_);
  return rehash(index);
}

std::uint64_t RelaxationState::hash_of(std::size_t block) const {
  const auto values = this->block(block);
  const auto of_values =
      xxh3_64({reinterpret_cast<const std::uint8_t*>(values.data()), values.size_bytes()});
  const auto of_steps = xxh3_64(BytesView(advanced_in_).subspan(block * kTets, kTets));
  // Odd factors: which block has which values counts.
  return of_values * (2 * block + 1) + of_steps * (2 * block + 3);
}

std::uint64_t RelaxationState::rehash(std::size_t block) {
  const auto before = hashes_[block];
  hashes_[block] = hash_of(block);
  return hashes_[block] - before;
}

void RelaxationState::inherit(TetIndex child, TetIndex parent) {
  if (is_empty()) return;
  extend(child.value + std::size_t{1});
  for (std::size_t i = 0; i < tensors_ * kComponents; ++i)
    values_[place(child) + i * kTets] = values_[place(parent) + i * kTets];
  advanced_in_[child.value] = advanced_in_[parent.value];
  hash_ += rehash(child.value / kTets);
}

void RelaxationState::visit_state(StateArchive& archive) {
  if (is_empty()) return;
  archive.value(step_);
  archive.value(hash_);
  archive.fixed_array(forces_);
  if (archive.is_hashing()) return;
  archive.fixed_array(advanced_in_);
  archive.fixed_array(values_);
  if (!archive.is_reading()) return;
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < block_count(); ++i) sum += hashes_[i] = hash_of(i);
  if (sum != hash_) archive.fail();
  if (!std::ranges::all_of(values_, [](float v) { return std::isfinite(v); }) ||
      !std::ranges::all_of(forces_, [](const Vec3f& f) { return is_finite(f); }))
    archive.fail();
}

}  // namespace trocar::world
