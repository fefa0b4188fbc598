#include "server/session/control/cost_model.h"

#include <algorithm>
#include <span>

namespace trocar::control {
namespace {

constexpr double kLevelGain = 0.3, kSlopeGain = 0.1;
constexpr double kMaxRatio = 4;  // one tick's correction sees no more than this
// Less than so much variation of node sweeps says nothing about their cost.
constexpr double kMinVariation = 0.1;
constexpr std::size_t kMinHalf = 5;
// No organ's tick is free of overhead, and none is overhead alone.
constexpr double kMinShare = 0.1, kMaxShare = 0.95;
// Before anything was swept: springs take 0.02 us, hyperelastic tetrahedra up to 0.09 us.
constexpr double kFirstPerSweepUs = 0.05;
constexpr double kFewSweeps = 100;

double median(std::span<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

void CostModel::add(double node_sweeps, double cost_us, double solve_share) {
  samples_[count_ % kWindow] = {node_sweeps, std::max(cost_us, 0.01), solve_share};
  ++count_;
  if (count_ < kLevelWindow) return;
  if (count_ == kLevelWindow) begin();
  fit_level();
  fit_slope();
}

void CostModel::begin() {
  std::array<double, kLevelWindow> costs{}, sweeps{}, shares{};
  for (std::size_t i = 0; i < kLevelWindow; ++i) {
    costs[i] = back(i).cost_us;
    sweeps[i] = back(i).node_sweeps;
    shares[i] = back(i).solve_share;
  }
  const double cost = median(costs), x = median(sweeps);
  const double share = std::clamp(median(shares), kMinShare, kMaxShare);
  per_sweep_us_ = x < kFewSweeps ? kFirstPerSweepUs : share * cost / x;
  fixed_us_ = x < kFewSweeps ? cost : (1 - share) * cost;
}

void CostModel::fit_level() {
  std::array<double, kLevelWindow> ratios{};
  for (std::size_t i = 0; i < kLevelWindow; ++i)
    ratios[i] = back(i).cost_us / predict_us(back(i).node_sweeps);
  const double ratio = std::clamp(median(ratios), 1 / kMaxRatio, kMaxRatio);
  const double factor = 1 + kLevelGain * (ratio - 1);
  fixed_us_ *= factor;
  per_sweep_us_ *= factor;
}

void CostModel::fit_slope() {
  const auto seen = std::min(count_, kWindow);
  double low = back(0).node_sweeps, high = low;
  for (std::size_t i = 1; i < seen; ++i) {
    low = std::min(low, back(i).node_sweeps);
    high = std::max(high, back(i).node_sweeps);
  }
  const double middle = (low + high) / 2;
  if (high < kFewSweeps || high - low < kMinVariation * middle) return;
  std::array<double, kWindow> below{}, above{};
  std::size_t below_count = 0, above_count = 0;
  double below_sum = 0, above_sum = 0;
  for (std::size_t i = 0; i < seen; ++i) {
    const double x = back(i).node_sweeps, ratio = back(i).cost_us / predict_us(x);
    if (x < middle) {
      below[below_count++] = ratio;
      below_sum += x;
    } else {
      above[above_count++] = ratio;
      above_sum += x;
    }
  }
  if (below_count < kMinHalf || above_count < kMinHalf) return;
  const double distance =
      above_sum / static_cast<double>(above_count) - below_sum / static_cast<double>(below_count);
  const double tilt =
      median(std::span(above).first(above_count)) - median(std::span(below).first(below_count));
  const double cost = predict_us(middle);
  const double share =
      (per_sweep_us_ + kSlopeGain * std::clamp(tilt, -0.5, 0.5) * cost / distance) * middle / cost;
  const double kept = std::clamp(share, kMinShare, kMaxShare);
  per_sweep_us_ = kept * cost / middle;
  fixed_us_ = (1 - kept) * cost;
}

}  // namespace trocar::control
