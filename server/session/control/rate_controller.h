#pragma once

// Keeps the tick within its time (Nakao 2003 sec. 4.2): between ticks it decides how much the next
// one may do, from what the ticks before took. Pure arithmetic on what it is given, no clock; its
// decisions are an input of the tick and journalled, so a replay needs no controller.
//
// What is given up, in this order, one step at a time, and taken back in reverse:
//   1. sweeps of layer 3 and deeper down to RateLimits::layer_sweeps, then of layer 2, then of
//      layer 1, then of the touched nodes down to RateLimits::touched_sweeps; with the last of
//      these nodes that have left the queue linger for RateLimits::linger_ticks;
//   2. how often far nodes are swept, up to once in RateLimits::far_interval ticks;
//   3. nodes of the queue, by a sixteenth at a time, down to RateLimits::nodes.
// While a tool touches, room that is left goes into accuracy above what was asked for (`extra`):
// f sweeps of the far nodes and 2 f of all nodes in the queue, f from above what the organ has by
// itself up to RateLimits::most_far_sweeps. That is given up before anything else, as much of it at
// once as the budget asks for.
// Touched nodes stay in the queue whatever is decided (server/tissue/step does that). When the
// least is still too much, simulated time slows: the Pacer counts it, and `level` says so.
//
// Laws, with the cost model's prediction p(x) at the node sweeps x of the tick just done, of which
// those by matrices count kLinearWork each:
//   lower  when p(x) > budget, a step every kLowerEvery ticks at most;
//   extra  is raised as below, with kExtraBelow instead of 0.9, a sixteenth of `hold` and every
//          kLowerEvery ticks, and not while the budget has shrunk or more than a tenth of the ticks
//          are late; it is given up when the load is above 0.95 or a fifth of the ticks are late;
//   raise  when p(y + what the step adds) < 0.9 budget for `hold` ticks without a break, further
//          steps every kRaiseEvery ticks; y is x with layers as large as they lately were (their
//          peak, forgotten with a time constant of about 2 s), so that a hand that lifts for a
//          moment changes nothing. hold is 200; it doubles up to 3,200 when a step down follows
//          within 500 ticks of a step up, and is 200 again after 5,000 ticks without one.
//   budget shrinks by 1/512 of the given one per tick, down to half, when by the prediction all is
//          well and yet the mean load of about a quarter of a second is above 0.95 or a fifth of
//          the ticks begin more than half a frame late: medians do not see many long spikes. It
//          grows back four times slower, below a load of 0.85. A stall counts as 4 ticks, however
//          long.
// A step that changes no node sweeps, since its layer is empty, is free and takes no turn. While no
// node is active there is nothing to give up: the rest of the organ is swept as it must be.

#include <cstdint>

#include "server/session/control/cost_model.h"
#include "server/tissue/step/tick_report.h"

namespace trocar::control {

// Beyond this, contact forces of fast hands are off by 3 % and more, and little time is saved.
inline constexpr std::uint32_t kLongestFarInterval = 2;
// A full solution of a tick takes 9 to 16 sweeps in soft organs.
inline constexpr std::uint32_t kMostFarSweeps = 8;

struct RateLimits {
  step::TickDecisions highest;  // when there is room for all
  // The least. A layer's sweeps should not be fewer than those of the far nodes.
  std::uint32_t touched_sweeps = 2, layer_sweeps = 1, nodes = 200;
  std::uint32_t linger_ticks = 25;
  std::uint32_t far_interval = 1;
  std::uint32_t most_far_sweeps = 0;  // of `extra`; 0: nothing above what was asked for
  double budget_us = 800;             // of a tick's time for its work
};

// These figures of one tick are measured outside it.
struct TickTiming {
  std::uint64_t work_ns = 0;      // what it took, in real time
  std::uint64_t lateness_ns = 0;  // how long after it was due it began
};

class RateController {
 public:
  static constexpr int kLowerEvery = 8, kRaiseEvery = 32;
  static constexpr int kHold = 200, kMaxHold = 3200;
  static constexpr double kLinearWork = 0.3;
  static constexpr double kExtraBelow = 0.75;  // of the budget

  // `highest` passes step::validate.
  explicit RateController(const RateLimits& limits);

  // Returns the decisions for the next tick.
  const step::TickDecisions& decisions() const { return decisions_; }
  // After every tick, with decisions() as they were in it, or less of the queue (DepthChooser).
  void observe(const step::TickReport& report, const TickTiming& timing);

  wire::RateFigures figures() const;
  const CostModel& model() const { return model_; }

 private:
  // A step up or down from what is decided, and the node sweeps that it adds or takes away.
  struct Step {
    step::LayerCounts sweeps{};
    std::uint32_t far_interval = 1;
    std::uint32_t nodes = 0;
    std::uint32_t extra = 0;
    double change = 0;
    bool is_any = false;
  };

  void watch_load(const TickTiming& timing, bool can_lower);
  void remember_peaks(const step::TickReport& report);
  Step next_lower(const step::TickReport& report) const;
  Step next_higher(const step::TickReport& report) const;
  std::uint32_t extra_after(std::uint32_t extra) const;
  std::uint32_t sweeps_of(std::size_t layer, std::uint32_t extra) const {
    return extra > 0 ? 2 * extra : sweeps_[layer];
  }
  // Node sweeps that another `extra` adds, of layers with so many nodes.
  template <typename Nodes>
  double change_by(std::uint32_t extra, const Nodes& layer_nodes) const;
  void lower_extra(const step::TickReport& report);
  void lower(const step::TickReport& report);
  void raise(const step::TickReport& report);
  void apply(const Step& step);
  double budget_us() const { return limits_.budget_us * budget_share_; }

  const RateLimits limits_;
  const step::LayerCounts highest_sweeps_;
  step::LayerCounts lowest_sweeps_{};
  std::uint32_t lowest_nodes_ = 0, longest_interval_ = 1;

  CostModel model_;
  step::LayerCounts sweeps_{};
  std::uint32_t nodes_ = 0, far_interval_ = 1, extra_ = 0;  // extra: f, 0 for none
  step::TickDecisions decisions_;
  double predicted_us_ = 0;
  std::array<double, step::kSweepLayers> peak_layer_nodes_{};
  double peak_queue_nodes_ = 0;
  double far_work_ = 0;               // of all far nodes in a tick, in node sweeps
  std::uint32_t far_sweeps_ = 1;      // that this stands for
  double load_ = 0, late_share_ = 0;  // means over about 256 and 64 ticks
  double budget_share_ = 1;
  int since_lower_ = 1'000'000, since_raise_ = 1'000'000;  // ticks
  int room_ticks_ = 0, hold_ = kHold;
  bool is_pressed_ = false;   // by load or lateness
  bool is_too_much_ = false;  // the least exceeds the budget
  std::uint64_t lowered_ = 0, raised_ = 0;
};

}  // namespace trocar::control
