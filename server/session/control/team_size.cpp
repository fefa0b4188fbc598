#include "server/session/control/team_size.h"

#include <algorithm>

namespace trocar::control {
namespace {

constexpr double kMeanOver = 64;  // ticks

}  // namespace

void TeamSize::Side::add(double load, bool ends_block) {
  sum += load;
  block += load;
  if (!ends_block) return;
  dearest = std::max(dearest, block);
  block = 0;
}

void TeamSize::observe(double load, bool is_short) {
  if (most_ == 1) return;
  short_share_ += ((is_short ? 1.0 : 0.0) - short_share_) / kMeanOver;
  const unsigned worked = count();
  if (is_light_) {
    is_light_ = load <= kHeavyLoad;
    return;
  }
  if (other_ != 0) {
    auto& side = sides_[is_other_turn()];
    side.add(load, ++tried_ticks_ % kBlockTicks == 0);
    if (tried_ticks_ == kBlocks * kBlockTicks) end_trial();
  } else if (++since_trial_ >= wait_ && short_share_ > 0.5) {
    begin_trial();
  }
  is_light_ = load * worked < kLightLoad;
}

unsigned TeamSize::next_other() const {
  const unsigned most_more = std::min(most_, 2 * team_), fewer = (team_ + 1) / 2;
  const bool are_idle = idle_ >= kIdleEach * (most_more - team_);
  const unsigned more = are_idle ? most_more : team_;
  if (more == team_) return fewer;
  return tries_fewer_ && fewer != team_ ? fewer : more;
}

void TeamSize::begin_trial() {
  other_ = next_other();
  if (other_ == team_) {
    other_ = 0;
    return;
  }
  tried_ticks_ = 0;
  sides_ = {};
}

void TeamSize::end_trial() {
  const bool is_more = other_ > team_;
  const auto cost_of = [](const Side& side) { return side.sum - side.dearest; };
  const bool is_kept = cost_of(sides_[1]) <= (is_more ? kWorthwhile : kAsGood) * cost_of(sides_[0]);
  if (is_kept) team_ = other_;
  wait_ = is_kept ? kSoon : std::min(kLate, 2 * wait_);
  tries_fewer_ = is_kept ? !is_more : is_more;
  other_ = 0;
  since_trial_ = 0;
}

}  // namespace trocar::control
