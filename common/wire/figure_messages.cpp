#include "common/wire/figure_messages.h"

#include <algorithm>
#include <cmath>

#include "proto/wire.pb.h"

namespace trocar::wire {

static_assert(static_cast<int>(RateLevel::Full) == proto::RATE_FULL &&
              static_cast<int>(RateLevel::Reduced) == proto::RATE_REDUCED &&
              static_cast<int>(RateLevel::Overloaded) == proto::RATE_OVERLOADED &&
              kRateLevels == proto::RateLevel_ARRAYSIZE);

namespace {

bool is_sane(float value) {
  return std::isfinite(value) && value >= 0;
}

Error bad(const char* what) {
  return {ErrorCode::BadMessage, std::string("FrameState.") + what};
}

Status read(const proto::RelaxationState& message, RelaxationFigures& figures) {
  figures = {message.energy_j(), message.volume_change(), message.relaxed_share()};
  if (!std::isfinite(figures.energy_j) || !std::isfinite(figures.volume_change) ||
      !std::isfinite(figures.relaxed_share))
    return bad("relaxation: a number is not finite");
  return {};
}

BloodFigures read(const proto::BloodState& message) {
  return {.shed_nl = message.shed_nl(),
          .on_surface_nl = message.on_surface_nl(),
          .dripped_nl = message.dripped_nl(),
          .sucked_nl = message.sucked_nl(),
          .rate_nl_s = message.rate_nl_s(),
          .sources = message.sources(),
          .open_vessels = message.open_vessels()};
}

void write(const BloodFigures& figures, proto::BloodState& message) {
  message.set_shed_nl(figures.shed_nl);
  message.set_on_surface_nl(figures.on_surface_nl);
  message.set_dripped_nl(figures.dripped_nl);
  message.set_sucked_nl(figures.sucked_nl);
  message.set_rate_nl_s(figures.rate_nl_s);
  message.set_sources(figures.sources);
  message.set_open_vessels(figures.open_vessels);
}

Status read(const proto::RateState& message, FrameFigures& figures) {
  auto& layers = figures.solve.layer_sweeps;
  if (message.layer_sweeps_size() > static_cast<int>(layers.size()))
    return bad("rate: there are over 4 layers");
  std::ranges::copy(message.layer_sweeps(), layers.begin());
  figures.near.node_limit = message.node_limit();
  auto& rate = figures.pace.rate;
  if (message.level() > 0 && message.level() < static_cast<int>(kRateLevels))
    rate.level = static_cast<RateLevel>(message.level());
  rate.budget_us = message.budget_us();
  rate.predicted_us = message.predicted_us();
  rate.lowered = message.lowered();
  rate.raised = message.raised();
  rate.time_rate = message.time_rate();
  rate.waiting_tools = message.waiting_tools();
  if (!is_sane(rate.budget_us) || !is_sane(rate.predicted_us) || !is_sane(rate.time_rate))
    return bad("rate: a time is negative or not finite");
  return {};
}

}  // namespace

void write(const PaceFigures& figures, proto::FrameState& message) {
  message.set_tick_cpu_us(figures.tick_median_us);
  message.set_tick_cpu_p99_us(figures.tick_p99_us);
  message.clear_stage_cpu_us();
  for (const float median : figures.stage_median_us) message.add_stage_cpu_us(median);
  message.set_slow_ticks(figures.slow_ticks);
  auto& rate = *message.mutable_rate();
  rate.set_level(static_cast<proto::RateLevel>(figures.rate.level));
  rate.set_budget_us(figures.rate.budget_us);
  rate.set_predicted_us(figures.rate.predicted_us);
  rate.set_lowered(figures.rate.lowered);
  rate.set_raised(figures.rate.raised);
  rate.set_time_rate(figures.rate.time_rate);
  rate.set_waiting_tools(figures.rate.waiting_tools);
}

void write(const FrameFigures& figures, proto::FrameState& message) {
  message.set_active_nodes(figures.near.active_nodes);
  message.set_queue_nodes(figures.near.queue_nodes);
  message.mutable_rate()->set_node_limit(figures.near.node_limit);
  message.set_region_count(figures.near.region_count);
  message.set_sweeps(figures.solve.sweeps);
  message.set_far_sweeps(figures.solve.far_sweeps);
  message.set_far_interval(figures.solve.far_interval);
  message.mutable_rate()->clear_layer_sweeps();
  for (const auto sweeps : figures.solve.layer_sweeps)
    message.mutable_rate()->add_layer_sweeps(sweeps);
  message.set_residual_n(figures.solve.residual_n);
  message.clear_relaxation();
  if (figures.relaxation) {
    auto& relaxation = *message.mutable_relaxation();
    relaxation.set_energy_j(figures.relaxation->energy_j);
    relaxation.set_volume_change(static_cast<float>(figures.relaxation->volume_change));
    relaxation.set_relaxed_share(static_cast<float>(figures.relaxation->relaxed_share));
  }
  message.clear_blood();
  if (figures.blood) write(*figures.blood, *message.mutable_blood());
  message.set_state_hash(figures.state_hash);
  write(figures.pace, message);
}

Result<FrameFigures> read(const proto::FrameState& message) {
  FrameFigures figures;
  figures.near.active_nodes = message.active_nodes();
  figures.near.queue_nodes = message.queue_nodes();
  figures.near.region_count = message.region_count();
  figures.solve.sweeps = message.sweeps();
  figures.solve.far_sweeps = message.far_sweeps();
  figures.solve.far_interval = std::max(1u, message.far_interval());
  figures.solve.residual_n = message.residual_n();
  figures.state_hash = message.state_hash();
  auto& pace = figures.pace;
  pace.tick_median_us = message.tick_cpu_us();
  pace.tick_p99_us = message.tick_cpu_p99_us();
  pace.slow_ticks = message.slow_ticks();
  const auto& stages = message.stage_cpu_us();
  std::copy_n(stages.begin(), std::min<std::size_t>(kStageCount, stages.size()),
              pace.stage_median_us.begin());
  if (message.has_relaxation())
    if (auto s = read(message.relaxation(), figures.relaxation.emplace()); !s) return s.error();
  if (message.has_blood()) figures.blood = read(message.blood());
  if (message.has_rate())
    if (auto s = read(message.rate(), figures); !s) return s.error();
  return figures;
}

}  // namespace trocar::wire
