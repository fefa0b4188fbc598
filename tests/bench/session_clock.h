#pragma once

// A session's clock, on which a tick takes its CPU time and nothing else takes any, with the
// decisions that a session makes from it. What it decides differs from run to run.

#include "server/app/server/pacer.h"
#include "server/session/control/rate_controller.h"
#include "server/session/control/tool_waits.h"
#include "server/tissue/step/simulation.h"

namespace trocar::bench {

class SessionClock {
 public:
  explicit SessionClock(const step::Simulation& simulation)
      : controller_({.highest = simulation.with_sweeps_for_organ({}),
                     .layer_sweeps = simulation.context().solve.far_plan.with_sweeps(0).sweeps,
                     .most_far_sweeps = control::kMostFarSweeps}) {}

  step::TickDecisions decisions() const {
    auto decisions = controller_.decisions();
    decisions.waiting_tools = waits_.waiting();
    return decisions;
  }
  // Returns by how many ticks simulated time has fallen behind.
  Tick slow_ticks() const { return pacer_.slow_ticks(); }

  // A tick has been made.
  void pass(const step::Simulation& simulation, const step::TickReport& report) {
    now_ns_ = std::max(now_ns_, pacer_.due_ns());
    const auto lateness_ns = now_ns_ - pacer_.due_ns();
    pacer_.begin_tick(now_ns_);
    std::uint64_t work_ns = 0;
    for (const auto ns : report.stage_cpu_ns) work_ns += ns;
    now_ns_ += work_ns;
    controller_.observe(report, {work_ns, lateness_ns});
    waits_.observe(speeds_.read(simulation),
                   static_cast<double>(work_ns) / static_cast<double>(kTickNanoseconds));
  }

 private:
  app::Pacer pacer_{0};
  std::uint64_t now_ns_ = 0;
  control::RateController controller_;
  control::TissueSpeeds speeds_;
  control::ToolWaits waits_;
};

}  // namespace trocar::bench
