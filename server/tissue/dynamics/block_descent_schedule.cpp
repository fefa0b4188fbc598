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
// Near nodes are packed where their groups have so many times as many lanes.
constexpr std::uint64_t kSparseGroups = 2;
constexpr float kMaxOverRelaxationFewSweeps = 1.3f;

}  // namespace

void BlockDescent::plan_step(std::span<const NodeIndex> near, const SolveSettings& settings,
                             Tick tick, const ExternalLoads& loads) {
  const auto& groups = tissue_.groups();
  for (auto* plan : {&near_, &far_, &far_swept_, &cut_swept_, &last_, &begun_}) plan->clear();
  for (auto& band : bands_)
    for (auto* plan : {&band.nodes, &band.kept, &band.packed}) plan->clear();
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
  if (settings.cut_sweeps > settings.far_sweeps)
    for (const auto g : far_swept_.groups)
      cut_swept_.add(g, static_cast<std::uint8_t>(far_swept_.lanes[g] & cut_[g]));
  cut_swept_.finish(groups);
  for (const auto g : near_.groups) begun_.add(g, 0xff);
  for (const auto g : is_far_linear_ ? all_groups_ : far_.groups) begun_.add(g, 0xff);
  for (const auto node : loads.held) begun_.add(groups.slot_of(node) / kLanes, 0xff);
  for (const auto g : begun_.groups) begun_stamp_[g] = current_;
  // A node that is held along an axis is asked for its force by its group.
  // A pack is not worth its copies where energies are cheap to evaluate.
  has_packs_ = linear_far_field_ != nullptr && loads.axis_holds.empty() &&
               near_.groups.size() * kLanes > kSparseGroups * near_.node_count;
}

void BlockDescent::plan_bands(std::span<const NodeIndex> near, std::span<const SweepBand> bands) {
  TROCAR_ASSERT(bands.size() <= kMaxSweepBands);
  const std::size_t count = std::max<std::size_t>(bands.size(), 1);
  for (std::size_t b = 0; b < count; ++b) {
    auto& nodes = bands_[b].nodes;
    for (const auto node : bands.empty() ? near : near.first(bands[b].end))
      nodes.add(tissue_.groups(), node);
    nodes.finish(tissue_.groups());
  }
  if (has_packs_) plan_packs(near, bands);
}

// The last sweep is one for all: a group with near and far nodes costs no more than near ones.
void BlockDescent::plan_last_sweep(const SolveSettings& settings) {
  if (settings.far_sweeps == 0) return;
  const SweepPlan& near = has_packs_ ? last_band(settings.bands).kept : near_;
  for (const auto g : near.groups) last_.add(g, near.lanes[g]);
  for (const auto g : far_swept_.groups) last_.add(g, far_swept_.lanes[g]);
  last_.finish(tissue_.groups());
}

const BlockDescent::NearBand& BlockDescent::band_of(std::uint32_t left,
                                                    std::span<const SweepBand> bands) const {
  for (std::size_t b = 0; b + 1 < bands.size(); ++b)
    if (bands[b + 1].sweeps < left) return bands_[b];
  return last_band(bands);
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
    for (auto far = std::max(settings.far_sweeps, settings.cut_sweeps); ends_far && far > 1; --far)
      schedule_.push_back({.plan = far > settings.far_sweeps ? &cut_swept_ : &far_swept_});
    const NearBand& near = band_of(left, settings.bands);
    schedule_.push_back({.plan = ends_far     ? &last_
                                 : has_packs_ ? &near.kept
                                              : &near.nodes,
                         .packs = has_packs_ ? &near.packed : nullptr,
                         .near_nodes = near.nodes.node_count,
                         .max_over_relaxation = has_few(left)
                                                    ? kMaxOverRelaxationFewSweeps
                                                    : std::numeric_limits<float>::infinity(),
                         .is_near = true});
  }
}

}  // namespace trocar::dynamics
