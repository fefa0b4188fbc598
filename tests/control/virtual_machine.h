#pragma once

// A session without tissue and without a clock: contacts with layers of given sizes, a machine that
// takes fixed_us + per_sweep_us x node sweeps for a tick (times a speed, plus spikes), the real
// Pacer and RateController on virtual time.

#include <cstdint>
#include <functional>
#include <vector>

#include "server/app/server/pacer.h"
#include "server/session/control/rate_controller.h"

namespace trocar::control::testing {

struct Machine {
  double fixed_us = 90;
  double per_sweep_us = 0.02;
  double noise = 0.03;     // uniform, +- this share
  double between_us = 15;  // outside the tick, of the loop
  std::uint32_t far_nodes = 9000;
  // Per contact: touched nodes, layers 1, 2, 3 and deeper.
  step::LayerCounts contact_nodes{14, 45, 95, 170};
};

struct Load {
  std::function<int(Tick)> contacts = [](Tick) { return 1; };
  std::function<double(Tick)> slowness = [](Tick) { return 1.0; };  // factor of the cost
  std::function<double(Tick)> spike_us = [](Tick) { return 0.0; };  // added
};

struct Row {
  Tick tick = 0;
  int contacts = 0;
  step::LayerCounts sweeps{}, layer_nodes{};
  std::uint32_t node_limit = 0, queue_nodes = 0, contact_nodes = 0;
  double node_sweeps = 0, work_us = 0, predicted_us = 0, budget_us = 0;
  double time_us = 0;  // virtual, when the tick began
  std::uint64_t slow_ticks = 0;
  wire::RateLevel level = wire::RateLevel::Full;
  step::TickDecisions decisions;
};

// Limits that nothing but time reaches.
RateLimits roomy_limits();

// Without control, decisions stay as `limits.highest`.
std::vector<Row> run_virtual(const Machine& machine, const Load& load, Tick ticks,
                             const RateLimits& limits, bool is_controlled = true);

// Ticks of rows [from, to) that took no longer than a tick's time, as a share.
double kept_share(const std::vector<Row>& rows, Tick from, Tick to);
// How often decisions change from going up to going down or the reverse.
int direction_changes(const std::vector<Row>& rows, Tick from, Tick to);
// Sweeps of all layers and the node limit as one number that only decisions move.
double amount(const Row& row);

}  // namespace trocar::control::testing
