#include "tests/control/virtual_machine.h"

#include <algorithm>

namespace trocar::control::testing {
namespace {

constexpr double kTickUs = static_cast<double>(kTickNanoseconds) * 1e-3;

// Returns what the tissue's side of a tick would report.
step::TickReport report_of(const Machine& machine, int contacts, const step::TickDecisions& d,
                           Tick tick) {
  step::TickReport report;
  report.tick = tick;
  const auto sweeps = step::sweeps_of_layers(d);
  const auto count = static_cast<std::uint32_t>(contacts);
  report.contact.nodes = machine.contact_nodes[0] * count;
  std::uint32_t room = std::max(d.node_limit, report.contact.nodes), far = machine.far_nodes;
  for (std::size_t layer = 0; layer < step::kSweepLayers; ++layer) {
    const auto nodes = std::min(room, machine.contact_nodes[layer] * count);
    room -= nodes;
    far -= nodes;
    report.solve.layer_nodes[layer] = nodes;
    report.near.queue_nodes += nodes;
    report.near.active_nodes += nodes;
    report.solve.node_sweeps += std::uint64_t{nodes} * sweeps[layer];
  }
  report.solve.figures.far_interval = d.far_interval;
  report.solve.figures.far_sweeps = std::max(1u, d.far_sweeps);
  report.solve.far_node_sweeps =
      std::uint64_t{far} * report.solve.figures.far_sweeps / d.far_interval;
  report.solve.node_sweeps += report.solve.far_node_sweeps;
  return report;
}

std::uint64_t ns_of(double us) {
  return static_cast<std::uint64_t>(us * 1e3);
}

}  // namespace

RateLimits roomy_limits() {
  RateLimits limits;
  limits.highest.node_limit = 6000;
  return limits;
}

std::vector<Row> run_virtual(const Machine& machine, const Load& load, Tick ticks,
                             const RateLimits& limits, bool is_controlled) {
  RateController controller(limits);
  app::Pacer pacer(0);
  std::vector<Row> rows;
  std::uint64_t now_ns = 0;
  std::uint32_t random = 12345;
  for (Tick tick = 1; tick <= ticks; ++tick) {
    now_ns = std::max(now_ns, pacer.due_ns());
    const auto lateness_ns = now_ns - pacer.due_ns();
    pacer.begin_tick(now_ns);
    const auto decisions = is_controlled ? controller.decisions() : limits.highest;
    const int contacts = load.contacts(tick);
    auto report = report_of(machine, contacts, decisions, tick);
    random = random * 1664525u + 1013904223u;
    const double noise =
        1 + machine.noise * (static_cast<double>(random >> 8) / static_cast<double>(1u << 23) - 1);
    const double solve_us = machine.per_sweep_us * static_cast<double>(report.solve.node_sweeps);
    const double slowness = load.slowness(tick);
    const double work_us = (machine.fixed_us + solve_us) * noise * slowness + load.spike_us(tick);
    report.stage_cpu_ns[static_cast<std::size_t>(step::Stage::Solve)] =
        static_cast<std::uint32_t>(solve_us * 1e3);
    report.stage_cpu_ns[static_cast<std::size_t>(step::Stage::Queue)] =
        static_cast<std::uint32_t>(machine.fixed_us * 1e3);
    controller.observe(report, {ns_of(work_us), lateness_ns});
    const auto figures = controller.figures();
    rows.push_back({.tick = tick,
                    .contacts = contacts,
                    .sweeps = step::sweeps_of_layers(decisions),
                    .layer_nodes = report.solve.layer_nodes,
                    .node_limit = decisions.node_limit,
                    .queue_nodes = report.near.queue_nodes,
                    .contact_nodes = report.contact.nodes,
                    .node_sweeps = static_cast<double>(report.solve.node_sweeps),
                    .work_us = work_us,
                    .predicted_us = static_cast<double>(figures.predicted_us),
                    .budget_us = static_cast<double>(figures.budget_us),
                    .time_us = static_cast<double>(now_ns) * 1e-3,
                    .slow_ticks = pacer.slow_ticks(),
                    .level = figures.level,
                    .decisions = decisions});
    now_ns += ns_of(work_us + machine.between_us);
  }
  return rows;
}

double kept_share(const std::vector<Row>& rows, Tick from, Tick to) {
  const auto kept = std::count_if(rows.begin() + static_cast<std::ptrdiff_t>(from),
                                  rows.begin() + static_cast<std::ptrdiff_t>(to),
                                  [](const Row& row) { return row.work_us <= kTickUs; });
  return static_cast<double>(kept) / static_cast<double>(to - from);
}

double amount(const Row& row) {
  double sum = 1e-5 * row.node_limit;
  for (const auto sweeps : row.sweeps) sum += sweeps;
  return sum;
}

int direction_changes(const std::vector<Row>& rows, Tick from, Tick to) {
  int changes = 0, direction = 0;
  for (auto i = from + 1; i < to; ++i) {
    const double step = amount(rows[i]) - amount(rows[i - 1]);
    const int now = step > 0 ? 1 : (step < 0 ? -1 : direction);
    if (direction != 0 && now != direction) ++changes;
    direction = now;
  }
  return changes;
}

}  // namespace trocar::control::testing
