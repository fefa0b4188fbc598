#pragma once

// The model says what a tick costs: cost = a + b x, with x the node sweeps of the solver and b what
// one of them takes. Fitted while the session runs, from the last kWindow ticks, by medians:
//
//   level  a and b are scaled by 1 + 0.3 (q - 1), q the median of measured / predicted over the
//          last kLevelWindow ticks. Up to kLevelWindow / 2 of these may be spikes of any size
//          without moving it more than ordinary ticks do; a lasting change is in it to a tenth
//          within kResponseTicks.
//   slope  when x varied by a tenth and more in the window, b grows if the half with the larger x
//          is under-predicted beside the other half, at the expense of a, and shrinks if it is
//          over-predicted. Otherwise nothing can be learnt about it; it starts from the share of
//          the solve stage.
//
// Pure arithmetic, no clock; microseconds. One thread.

#include <array>
#include <cstddef>

namespace trocar::control {

class CostModel {
 public:
  static constexpr std::size_t kWindow = 32, kLevelWindow = 15;
  static constexpr int kResponseTicks = 16;

  // solve_share: of the tick's cost that is the solver's, 0 to 1.
  void add(double node_sweeps, double cost_us, double solve_share);
  // False until kLevelWindow ticks were seen.
  bool is_ready() const { return count_ >= kLevelWindow; }
  double predict_us(double node_sweeps) const { return fixed_us_ + per_sweep_us_ * node_sweeps; }

  double fixed_us() const { return fixed_us_; }
  double per_sweep_us() const { return per_sweep_us_; }

 private:
  struct Sample {
    double node_sweeps = 0, cost_us = 0, solve_share = 0;
  };

  // 0: the newest.
  const Sample& back(std::size_t i) const { return samples_[(count_ - 1 - i) % kWindow]; }
  void begin();
  void fit_level();
  void fit_slope();

  std::array<Sample, kWindow> samples_{};
  std::size_t count_ = 0;
  double fixed_us_ = 0, per_sweep_us_ = 0;
};

}  // namespace trocar::control
