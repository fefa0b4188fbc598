#include "client/replay/aligned_time.h"

#include <algorithm>
#include <limits>

namespace trocar::replay {
namespace {

constexpr std::uint32_t kOver = std::numeric_limits<std::uint32_t>::max();

struct Begin {
  std::uint32_t number = 0;
  std::string name, title;
  Tick tick = 0;
};

// Returns the beginnings of stages by number. A stage that comes again forgets those from it
// on.
std::vector<Begin> begins_of(std::span<const RecordedStage> stages) {
  std::vector<Begin> begins;
  for (const auto& [tick, stage] : stages) {
    if (stage.stages() == 0) continue;
    const std::uint32_t number = stage.is_over() ? kOver : stage.stage();
    const bool is_same = !begins.empty() && begins.back().number == number &&
                         (number == kOver || stage.begin_tick() <= begins.back().tick);
    if (is_same) continue;
    while (!begins.empty() && begins.back().number >= number) begins.pop_back();
    begins.push_back({number, stage.is_over() ? "" : stage.name(), stage.title(), tick});
  }
  return begins;
}

}  // namespace

void AlignedTime::add(const std::array<Tick, kPair>& begin, const std::array<Tick, kPair>& end) {
  parts_.push_back({last_, begin, end});
  last_ += std::max(end[0] - begin[0], end[1] - begin[1]);
}

AlignedTime AlignedTime::from_start(const Spans& spans) {
  AlignedTime time;
  time.add({spans[0].first, spans[1].first}, {spans[0].last, spans[1].last});
  return time;
}

std::optional<AlignedTime> AlignedTime::by_stage(const Spans& spans, const Stages& stages) {
  const std::array begins{begins_of(stages[0]), begins_of(stages[1])};
  AlignedTime time;
  std::array<Tick, kPair> from{spans[0].first, spans[1].first};
  bool has_stage = false;
  for (const Begin& first : begins[0]) {
    const auto second = std::ranges::find_if(begins[1], [&](const Begin& other) {
      return other.number == first.number && other.name == first.name && other.title == first.title;
    });
    if (second == begins[1].end()) continue;
    // A recording that goes on from another begins within a stage.
    const std::array at{std::clamp(first.tick, from[0], spans[0].last),
                        std::clamp(second->tick, from[1], spans[1].last)};
    time.add(from, at);
    from = at;
    has_stage = has_stage || first.number != kOver;
  }
  if (!has_stage) return std::nullopt;
  time.add(from, {spans[0].last, spans[1].last});
  return time;
}

AlignedTime::Place AlignedTime::place_in(std::size_t recording, Tick time) const {
  auto part = std::ranges::upper_bound(parts_, time, {}, &Part::time);
  if (part != parts_.begin()) --part;
  const Tick begin = part->begin[recording], end = part->end[recording];
  const Tick in_part = time - std::min(time, part->time);
  if (part + 1 == parts_.end() && in_part == end - begin) return {end, false, false};
  if (in_part < end - begin) return {begin + in_part, false, false};
  // Before the next stage begins.
  const bool has_ended = end == parts_.back().end[recording];
  return {has_ended || end == begin ? end : end - 1, true, has_ended};
}

Tick AlignedTime::time_of(std::size_t recording, Tick tick) const {
  for (const Part& part : parts_) {
    if (tick >= part.end[recording] && &part != &parts_.back()) continue;
    const Tick begin = part.begin[recording], end = std::max(part.end[recording], begin);
    return part.time + (std::clamp(tick, begin, end) - begin);
  }
  return last_;
}

}  // namespace trocar::replay
