// The solver's schedule: which nodes each sweep of a step goes over, and how far it over-relaxes.

#include <algorithm>
#include <limits>

#include "common/base/assert.h"
#include "server/tissue/dynamics/block_descent.h"

namespace trocar::dynamics {
namespace {

// Far groups next to one another take turns together, so that memory is read in runs.
constexpr std::uint32_t kPhaseGroups = 16;
constexpr std::uint32_t kFewSweeps = 3;
constexpr float kMaxOverRelaxationFewSweeps = 1.3f;

}  // namespace

void BlockDescent::plan_step(std::span<const NodeIndex> near, const SolveSettings& settings,
                             Tick tick, std::span<const NodeIndex> held) {
  const auto& groups = tissue_.groups();
  for (auto* plan : {&near_, &far_, &far_swept_, &last_, &begun_}) plan->clear();
  for (const auto node : near) near_.add(groups, node);
  near_.finish(groups);
  far_interval_ = settings.far_interval;
  if (settings.far_sweeps > 0)
    for (Group g = 0; g < free_.size(); ++g) {
      const auto lanes = static_cast<std::uint8_t>(free_[g] & ~near_.lanes[g]);
      far_.add(g, lanes);
      if (!is_slow(g) || (g / kPhaseGroups + tick) % far_interval_ == 0) far_swept_.add(g, lanes);
    }
  far_swept_.finish(groups);
  if (settings.far_sweeps > 0) {
    for (const auto g : near_.groups) last_.add(g, near_.lanes[g]);
    for (const auto g : far_swept_.groups) last_.add(g, far_swept_.lanes[g]);
    last_.finish(groups);
  }
  for (const auto g : near_.groups) begun_.add(g, 0xff);
  for (const auto g : is_far_linear_ ? all_groups_ : far_.groups) begun_.add(g, 0xff);
  for (const auto node : held) begun_.add(groups.slot_of(node) / kLanes, 0xff);
  for (const auto g : begun_.groups) begun_stamp_[g] = current_;
}

void BlockDescent::plan_bands(std::span<const NodeIndex> near, std::span<const SweepBand> bands) {
  TROCAR_ASSERT(bands.size() <= kMaxSweepBands);
  for (std::size_t b = 0; b + 1 < bands.size(); ++b) {
    bands_[b].clear();
    for (const auto node : near.first(bands[b].end)) bands_[b].add(tissue_.groups(), node);
    bands_[b].finish(tissue_.groups());
  }
}

const SweepPlan& BlockDescent::plan_of(std::uint32_t left, std::span<const SweepBand> bands) const {
  for (std::size_t b = 0; b + 1 < bands.size(); ++b)
    if (bands[b + 1].sweeps < left) return bands_[b];
  return near_;
}

void BlockDescent::schedule_sweeps(const SolveSettings& settings) {
  schedule_.clear();
  const auto has_few = [&](std::uint32_t left) {
    return settings.sweeps < kFewSweeps ||
           std::ranges::any_of(settings.bands, [left](const SweepBand& band) {
             return band.sweeps >= left && band.sweeps < kFewSweeps;
           });
  };
  for (auto left = settings.sweeps; left > 0; --left) {
    const bool ends_far = left == 1 && settings.far_sweeps > 0;
    for (std::uint32_t far = 1; ends_far && far < settings.far_sweeps; ++far)
      schedule_.push_back({.plan = &far_swept_});
    const SweepPlan& near = plan_of(left, settings.bands);
    // The last sweep is one for all: a group with near and far nodes costs no more than near ones.
    schedule_.push_back(
        {.plan = ends_far ? &last_ : &near,
         .near_nodes = near.node_count,
         .max_over_relaxation =
             has_few(left) ? kMaxOverRelaxationFewSweeps : std::numeric_limits<float>::infinity(),
         .is_near = true,
         .corrects_far = settings.far_solver != nullptr && left <= settings.corrections});
  }
}

}  // namespace trocar::dynamics
