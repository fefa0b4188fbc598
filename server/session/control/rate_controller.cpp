#include "server/session/control/rate_controller.h"

#include <algorithm>

#include "common/base/tick.h"

namespace trocar::control {
namespace {

constexpr double kRaiseBelow = 0.9;  // of the budget
constexpr int kExtraHaste = 16;      // A press has its peak in a quarter of a second.
constexpr int kRegret = 500, kForget = 5000;
constexpr int kLongAgo = 1'000'000;
constexpr std::uint32_t kNodeShare = 16;
constexpr double kForgetPeaks = 1.0 / 2048;
// Load and lateness.
constexpr double kTickUs = static_cast<double>(kTickNanoseconds) * 1e-3;
constexpr double kLoadGain = 1.0 / 256, kLateGain = 1.0 / 64;
constexpr double kMaxWorkTicks = 4;
constexpr std::uint64_t kLateNs = kTicksPerFrame / 2 * kTickNanoseconds;
constexpr double kHighLoad = 0.95, kLowLoad = 0.85, kHighLateShare = 0.2;
constexpr double kMinBudgetShare = 0.5, kShrink = 1.0 / 512, kGrow = 1.0 / 2048;

// Share of the tick's cost that is the solver's.
double solve_share(const step::TickReport& report) {
  double total = 0;
  for (const auto ns : report.stage_cpu_ns) total += ns;
  const double solve = report.stage_cpu_ns[static_cast<std::size_t>(step::Stage::Solve)];
  return total > 0 ? solve / total : 0;
}

// In node sweeps by energies.
double far_work(const step::TickReport& report) {
  return static_cast<double>(report.solve.far_node_sweeps) *
         (report.solve.is_far_linear ? RateController::kLinearWork : 1.0);
}
double work_of(const step::TickReport& report) {
  return static_cast<double>(report.solve.node_sweeps - report.solve.far_node_sweeps) +
         far_work(report);
}

}  // namespace

RateController::RateController(const RateLimits& limits)
    : limits_(limits),
      highest_sweeps_(step::sweeps_of_layers(limits.highest)),
      lowest_nodes_(std::min(limits.nodes, limits.highest.node_limit)),
      longest_interval_(std::max(limits.far_interval, limits.highest.far_interval)),
      sweeps_(highest_sweeps_),
      nodes_(limits.highest.node_limit),
      far_interval_(limits.highest.far_interval),
      decisions_(limits.highest) {
  for (std::size_t layer = 0; layer < step::kSweepLayers; ++layer)
    lowest_sweeps_[layer] =
        std::min(std::max(1u, layer == 0 ? std::max(limits.touched_sweeps, limits.layer_sweeps)
                                         : limits.layer_sweeps),
                 highest_sweeps_[layer]);
}

void RateController::observe(const step::TickReport& report, const TickTiming& timing) {
  const double work_us = static_cast<double>(timing.work_ns) * 1e-3;
  const double node_sweeps = work_of(report);
  model_.add(node_sweeps, work_us, solve_share(report));
  remember_peaks(report);
  since_lower_ = std::min(since_lower_ + 1, kLongAgo);
  since_raise_ = std::min(since_raise_ + 1, kLongAgo);
  if (since_lower_ > kForget) hold_ = kHold;
  if (!model_.is_ready()) return;
  predicted_us_ = model_.predict_us(node_sweeps);
  const bool can_lower = next_lower(report).is_any;
  watch_load(timing, can_lower);
  is_too_much_ = predicted_us_ > budget_us() && !can_lower;
  if (predicted_us_ > budget_us() || (extra_ > 0 && is_pressed_)) {
    room_ticks_ = 0;
    lower(report);
  } else {
    raise(report);
  }
}

void RateController::remember_peaks(const step::TickReport& report) {
  const auto remember = [](double& peak, std::uint32_t now) {
    peak = std::max(static_cast<double>(now), peak - kForgetPeaks * peak);
    if (peak < 1) peak = 0;
  };
  for (std::size_t layer = 0; layer < step::kSweepLayers; ++layer)
    remember(peak_layer_nodes_[layer], report.solve.layer_nodes[layer]);
  remember(peak_queue_nodes_, report.near.queue_nodes);
  far_work_ = far_work(report) * report.solve.figures.far_interval;
  far_sweeps_ = std::max(1u, report.solve.figures.far_sweeps);
}

void RateController::watch_load(const TickTiming& timing, bool can_lower) {
  const double work = static_cast<double>(timing.work_ns) * 1e-3 / kTickUs;
  load_ += kLoadGain * (std::min(work, kMaxWorkTicks) - load_);
  const double is_late = timing.lateness_ns > kLateNs ? 1 : 0;
  late_share_ += kLateGain * (is_late - late_share_);
  is_pressed_ = load_ > kHighLoad || late_share_ > kHighLateShare;
  if (is_pressed_ && can_lower && predicted_us_ <= budget_us())
    budget_share_ = std::max(kMinBudgetShare, budget_share_ - kShrink);
  else if (load_ < kLowLoad)
    budget_share_ = std::min(1.0, budget_share_ + kGrow);
}

// The first is above what the organ has by itself. Each costs a third to a half more.
std::uint32_t RateController::extra_after(std::uint32_t extra) const {
  if (extra > 0) return extra + (extra < 4 ? 1 : 2);
  return std::max({2u, limits_.layer_sweeps, (highest_sweeps_.front() + 1) / 2,
                   highest_sweeps_.back() / 2 + 1});
}

template <typename Nodes>
double RateController::change_by(std::uint32_t extra, const Nodes& layer_nodes) const {
  const double far_sweeps = extra > 0 ? extra : std::max(1u, limits_.layer_sweeps);
  double change = far_work_ / far_sweeps_ * (far_sweeps - far_sweeps_);
  for (std::size_t layer = 0; layer < step::kSweepLayers; ++layer)
    change += layer_nodes[layer] * (static_cast<double>(sweeps_of(layer, extra)) -
                                    static_cast<double>(sweeps_of(layer, extra_)));
  return change;
}

// Extra, then the deepest layer that has sweeps to give, then nodes.
RateController::Step RateController::next_lower(const step::TickReport& report) const {
  Step step{sweeps_, far_interval_, nodes_, 0, 0, report.near.active_nodes > 0 || extra_ > 0};
  if (!step.is_any) return step;
  if (extra_ > 0) {
    step.change = change_by(0, report.solve.layer_nodes);
    return step;
  }
  for (std::size_t layer = step::kSweepLayers; layer-- > 0;) {
    if (sweeps_[layer] == lowest_sweeps_[layer]) continue;
    --step.sweeps[layer];
    step.change = -static_cast<double>(report.solve.layer_nodes[layer]);
    return step;
  }
  if (far_interval_ < longest_interval_) {
    ++step.far_interval;
    step.change = -far_work_ / (far_interval_ * step.far_interval);
    return step;
  }
  // A limit above what the queue holds limits nothing.
  const auto least = std::max(lowest_nodes_, report.contact.nodes);
  if (nodes_ > std::max(least, report.near.queue_nodes)) {
    step.nodes = std::max(least, report.near.queue_nodes);
  } else if (nodes_ > least) {
    step.nodes = std::max(least, nodes_ - std::max(1u, nodes_ / kNodeShare));
    step.change = -static_cast<double>(nodes_ - step.nodes);
  } else {
    step.is_any = false;
  }
  return step;
}

RateController::Step RateController::next_higher(const step::TickReport& report) const {
  Step step{sweeps_, far_interval_, nodes_, extra_, 0, true};
  if (nodes_ < limits_.highest.node_limit) {
    if (peak_queue_nodes_ < nodes_) {
      step.nodes = limits_.highest.node_limit;  // there are no more
    } else {
      step.nodes = std::min(limits_.highest.node_limit, nodes_ + std::max(1u, nodes_ / kNodeShare));
      step.change = static_cast<double>(step.nodes - nodes_) * sweeps_.back();
    }
    return step;
  }
  if (far_interval_ > limits_.highest.far_interval) {
    --step.far_interval;
    step.change = far_work_ / (far_interval_ * step.far_interval);
    return step;
  }
  for (std::size_t layer = 0; layer < step::kSweepLayers; ++layer) {
    if (sweeps_[layer] == highest_sweeps_[layer]) continue;
    ++step.sweeps[layer];
    step.change = peak_layer_nodes_[layer];
    return step;
  }
  step.extra = extra_after(extra_);
  step.change = change_by(step.extra, peak_layer_nodes_);
  step.is_any = step.extra <= limits_.most_far_sweeps && report.near.active_nodes > 0 &&
                budget_share_ >= 1 && late_share_ < kHighLateShare / 2;
  return step;
}

// Keeps what fits into the budget, and nothing where others need the time.
void RateController::lower_extra(const step::TickReport& report) {
  std::uint32_t kept = 0;
  for (auto extra = extra_after(0); !is_pressed_ && extra < extra_; extra = extra_after(extra)) {
    const double node_sweeps = work_of(report) + change_by(extra, report.solve.layer_nodes);
    if (model_.predict_us(node_sweeps) >= kExtraBelow * budget_us()) break;
    kept = extra;
  }
  apply({sweeps_, far_interval_, nodes_, kept, 0, true});
}

void RateController::lower(const step::TickReport& report) {
  if (since_lower_ < kLowerEvery) return;
  auto step = next_lower(report);
  if (!step.is_any) return;
  if (extra_ > 0) {
    lower_extra(report);
    step.is_any = false;
  }
  while (step.is_any && step.change == 0) {
    apply(step);
    step = next_lower(report);
  }
  if (step.is_any) apply(step);
  if (since_raise_ < kRegret && since_lower_ > since_raise_) hold_ = std::min(kMaxHold, 2 * hold_);
  since_lower_ = 0;
  ++lowered_;
}

void RateController::raise(const step::TickReport& report) {
  double node_sweeps = work_of(report);
  for (std::size_t layer = 0; layer < step::kSweepLayers; ++layer)
    node_sweeps +=
        (peak_layer_nodes_[layer] - report.solve.layer_nodes[layer]) * sweeps_of(layer, extra_);
  const auto has_room = [&](const Step& step) {
    const double below = step.extra > 0 ? kExtraBelow : kRaiseBelow;
    return step.is_any && model_.predict_us(node_sweeps + step.change) < below * budget_us();
  };
  auto step = next_higher(report);
  if (!has_room(step)) {
    room_ticks_ = 0;
    return;
  }
  const bool is_extra = step.extra > 0;
  const int hold = is_extra ? hold_ / kExtraHaste : hold_;
  if (++room_ticks_ < hold) return;
  while (step.is_any && step.change == 0) {
    apply(step);
    step = next_higher(report);
  }
  if (has_room(step)) apply(step);
  room_ticks_ = std::max(0, hold - (is_extra ? kLowerEvery : kRaiseEvery));
  since_raise_ = 0;
  ++raised_;
}

void RateController::apply(const Step& step) {
  sweeps_ = step.sweeps;
  nodes_ = step.nodes;
  far_interval_ = step.far_interval;
  extra_ = step.extra;
  decisions_ = limits_.highest;
  decisions_.far_interval = far_interval_;
  decisions_.node_limit = nodes_;
  if (extra_ > 0) {
    decisions_.sweeps = 2 * extra_;
    decisions_.layer_sweeps = {};
    decisions_.far_sweeps = extra_;
    return;
  }
  if (sweeps_ == highest_sweeps_) return;
  decisions_.sweeps = sweeps_[0];
  if (sweeps_ == lowest_sweeps_) decisions_.linger_ticks = limits_.linger_ticks;
  for (std::size_t layer = 1; layer < step::kSweepLayers; ++layer)
    decisions_.layer_sweeps[layer - 1] = sweeps_[layer];
}

wire::RateFigures RateController::figures() const {
  using wire::RateLevel;
  const bool is_full = extra_ > 0 || decisions_ == limits_.highest;
  return {.level = is_too_much_ ? RateLevel::Overloaded
                                : (is_full ? RateLevel::Full : RateLevel::Reduced),
          .budget_us = static_cast<float>(budget_us()),
          .predicted_us = static_cast<float>(predicted_us_),
          .lowered = lowered_,
          .raised = raised_};
}

}  // namespace trocar::control
