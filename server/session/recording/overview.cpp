#include "server/session/recording/overview.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/session/replication/messages.h"

namespace trocar::recording {
namespace {

constexpr Tick kChangePeriod = 1000;
constexpr std::uint32_t kHasClaim = 8;
constexpr std::size_t kEventOverhead = 16;  // a bound of what an entry takes besides its message

template <typename Whole>
Whole scaled(float value, double by) {
  constexpr double kMost = 2e9;
  return static_cast<Whole>(
      std::llround(std::clamp(static_cast<double>(value) * by, -kMost, kMost)));
}

}  // namespace

OverviewBuilder::OverviewBuilder(Tick begin) {
  begin_at(begin);
}

void OverviewBuilder::begin_at(Tick tick) {
  overview_.Clear();
  overview_.set_first_tick(tick);
  overview_.set_bin_ticks(kBinTicks);
  bin_end_ = tick + kBinTicks;
  index_of_.fill(-1);
  event_bytes_ = 0;
}

void OverviewBuilder::skip_to(Tick tick) {
  begin_at(tick);
  last_tip_.fill(std::nullopt);
}

bool OverviewBuilder::has_room(std::size_t bytes) {
  if (event_bytes_ + bytes + kEventOverhead <= kMostEventBytes) {
    event_bytes_ += bytes + kEventOverhead;
    return true;
  }
  overview_.set_left_out(overview_.left_out() + 1);
  return false;
}

void OverviewBuilder::add_presence(Tick tick, const proto::Participants& present) {
  if (!has_room(present.ByteSizeLong())) return;
  auto& presence = *overview_.add_presence();
  presence.set_tick(tick);
  *presence.mutable_participants() = present;
}

void OverviewBuilder::add_gap(const proto::JournalGap& gap) {
  if (has_room(gap.ByteSizeLong())) *overview_.add_gap() = gap;
}

void OverviewBuilder::add_lesson(const proto::TeachEvent& event) {
  if (has_room(event.ByteSizeLong())) *overview_.add_lesson() = event;
}

void OverviewBuilder::add_stage(Tick tick, const proto::LessonStage& stage) {
  if (!has_room(stage.ByteSizeLong())) return;
  auto& entry = *overview_.add_stage();
  entry.set_tick(tick);
  *entry.mutable_stage() = stage;
}

void OverviewBuilder::add_claim(const proto::ClaimEvent& event) {
  if (has_room(event.ByteSizeLong())) *overview_.add_claim() = event;
}

void OverviewBuilder::add_change(Tick tick) {
  if ((last_change_ && tick - *last_change_ < kChangePeriod) || !has_room(0)) return;
  overview_.add_change_tick(tick);
  last_change_ = tick;
}

void OverviewBuilder::add_frame(const step::PublishedFrame& frame,
                                const participants::Roster& roster) {
  for (const auto& event : frame.claim_events) {
    proto::ClaimEvent message;
    replication::describe(event, roster, message);
    add_claim(message);
  }
  if (frame.change || frame.new_layout) add_change(frame.tick);
  std::vector<ToolMoment> tools;
  tools.reserve(frame.tools.size());
  for (const auto& tool : frame.tools)
    tools.push_back({.tool = tool.tool,
                     .verb = static_cast<std::uint32_t>(tool.verb),
                     .has_claim = tool.has_claim,
                     .force_n = tool.force_n,
                     .tip = tool.world_from_proxy.position});
  add_tools(frame.tick, tools);
}

void OverviewBuilder::add_tools(Tick tick, std::span<const ToolMoment> tools) {
  std::array<std::optional<Vec3f>, kMaxTools> tips;
  for (const auto& tool : tools) {
    auto found = std::ranges::find(bin_tools_, tool.tool, &BinTool::tool);
    if (found == bin_tools_.end()) found = bin_tools_.insert(found, {.tool = tool.tool});
    found->state = 1 + tool.verb + (tool.has_claim ? kHasClaim : 0);
    found->force_n = std::max(found->force_n, length(tool.force_n));
    found->tip = tool.tip;
    if (const auto& before = last_tip_[tool.tool.value])
      found->path_m += length(tool.tip - *before);
    tips[tool.tool.value] = tool.tip;
  }
  last_tip_ = tips;
  if (tick >= bin_end_) close_bin();
}

void OverviewBuilder::close_bin() {
  const auto bins = static_cast<int>(overview_.bins());
  for (const auto& tool : bin_tools_) {
    int& index = index_of_[tool.tool.value];
    auto& last = last_um_[tool.tool.value];
    if (index < 0) {
      index = overview_.tool_size();
      last = {};
      auto& entry = *overview_.add_tool();
      entry.set_tool(tool.tool.value);
    }
    auto& entry = *overview_.mutable_tool(index);
    // Bins in which it was not there hold zeros.
    while (entry.state_size() < bins) {
      entry.add_state(0);
      entry.add_force_mn(0);
      entry.add_x_um(0);
      entry.add_y_um(0);
      entry.add_z_um(0);
      entry.add_path_um(0);
    }
    const std::array<std::int32_t, 3> at{scaled<std::int32_t>(tool.tip.x, 1e6),
                                         scaled<std::int32_t>(tool.tip.y, 1e6),
                                         scaled<std::int32_t>(tool.tip.z, 1e6)};
    entry.add_state(tool.state);
    entry.add_force_mn(scaled<std::uint32_t>(tool.force_n, 1e3));
    entry.add_x_um(at[0] - last[0]);
    entry.add_y_um(at[1] - last[1]);
    entry.add_z_um(at[2] - last[2]);
    entry.add_path_um(scaled<std::uint32_t>(tool.path_m, 1e6));
    last = at;
  }
  bin_tools_.clear();
  bin_end_ += kBinTicks;
  overview_.set_bins(overview_.bins() + 1);
}

proto::Overview OverviewBuilder::take() {
  if (!bin_tools_.empty()) close_bin();
  proto::Overview taken;
  taken.Swap(&overview_);
  begin_at(bin_end_ - kBinTicks);
  return taken;
}

}  // namespace trocar::recording
