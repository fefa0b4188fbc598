#include "server/tissue/dynamics/quiet_groups.h"

namespace trocar::dynamics {

void QuietGroups::index(Group group, const Linearisation& linear) {
  if (group >= neighbours_.size()) {
    neighbours_.resize(group + 1);
    for (auto* flags : {&is_busy_, &pauses_, &has_paused_, &keeps_}) flags->resize(group + 1);
  }
  moved(group);
  auto& neighbours = neighbours_[group];
  neighbours.clear();
  for (std::uint32_t lane = 0; lane < kLanes; ++lane)
    linear.for_each_neighbour(static_cast<Slot>(group * kLanes + lane), [&](Slot other) {
      const Group beside = other / kLanes;
      if (beside != group && std::ranges::find(neighbours, beside) == neighbours.end())
        neighbours.push_back(beside);
    });
}

bool QuietGroups::is_undisturbed(Group group) const {
  const auto is_busy = [this](Group g) { return is_busy_[g] != 0; };
  return !is_busy(group) && std::ranges::none_of(neighbours_[group], is_busy);
}

void QuietGroups::begin_step() {
  std::swap(pauses_, has_paused_);
  for (auto* flags : {&pauses_, &keeps_}) std::ranges::fill(*flags, std::uint8_t{0});
}

void QuietGroups::find(float limit_m_s, std::span<const std::uint8_t> free,
                       std::span<const std::uint8_t> near, std::span<const std::uint8_t> in_use,
                       const Float4* velocities) {
  const auto count = static_cast<Group>(neighbours_.size());
  for (Group g = 0; g < count; ++g) {
    const Vec8 v = load_group(velocities + g * kLanes);
    const Float8 is_fast = _mm256_cmp_ps(dot8(v, v), all(limit_m_s * limit_m_s), _CMP_NLT_UQ);
    is_busy_[g] = (bits_of(is_fast) & free[g]) != 0;
  }
  for (Group g = 0; g < count; ++g)
    pauses_[g] = near[g] == 0 && in_use[g] == 0 && is_undisturbed(g);
  for (Group g = 0; g < count; ++g) is_busy_[g] = !stands(g);
  for (Group g = 0; g < count; ++g) keeps_[g] = is_undisturbed(g);
}

}  // namespace trocar::dynamics
