#include "server/tissue/thread/thread_step.h"

#include <algorithm>

namespace trocar::thread {
namespace {

constexpr double kTickSeconds = 1e-3;
constexpr double kMostMoveM = 2e-3;  // of a node in a Newton step
// Contacts that come and go from one Newton step to the next would let it go round in a circle:
// from the third on each is at most this part of the one before.
constexpr double kShrinks = 0.5;
constexpr double kUnforeseenM = 2e-5;
constexpr std::uint8_t kBreakTicks = 5;  // a shorter peak may be one of numbers alone
constexpr double kCutReachM = 1e-3;      // an edge parts thread this near

bool is_solid(const ToolNow& tool) {
  return tool.verb != tool::Verb::Cut;  // a blade that cuts presses nothing
}

Capsule capsule_of(const Pose& pose, const tool::ToolShape& shape) {
  const Vec3d along = to_double(rotate(pose.orientation, {0, 0, 1}));
  const double radius = shape.radius_m, shaft = std::max(0.0, shape.length_m - 2 * radius);
  const Vec3d from = to_double(pose.position) + along * radius;
  return {from, from + along * shaft};
}

void part(std::size_t i, Threads& threads) {
  threads.is_joined[i] = 0;
  threads.tensions_n[i] = 0;
}

}  // namespace

ThreadStep::ThreadStep(const Rules& rules)
    : elasticity_(rules), solids_(rules), grips_(rules), solver_(kMostTouching), begun_(rules) {
  tool_solids_.reserve(kMaxTools);
}

// A tool that has appeared has not moved.
void ThreadStep::note_poses(std::span<const ToolNow> tools, Threads& threads, bool is_begin) const {
  if (!is_begin) std::ranges::fill(threads.has_pose, std::uint8_t{0});
  for (const auto& tool : tools) {
    auto& has = threads.has_pose[tool.tool.value];
    if (is_begin && has != 0) continue;
    threads.tool_poses[tool.tool.value] = tool.pose;
    has = 1;
  }
}

void ThreadStep::place_tools(std::span<const ToolNow> tools, const Threads& threads, double from,
                             double to) {
  tool_solids_.clear();
  for (const auto& tool : tools) {
    if (!is_solid(tool)) continue;
    const auto& was = threads.tool_poses[tool.tool.value];
    const auto pose_at = [&](double part) {
      return capsule_of(part_of_way(was, tool.pose, static_cast<float>(part)), tool.shape);
    };
    tool_solids_.push_back({pose_at(from), pose_at(to), static_cast<double>(tool.shape.radius_m),
                            kThreadFriction, 0, tool.tool});
  }
}

void ThreadStep::newton(Threads& threads, ThreadReport& report) {
  auto& x = threads.places_m;
  double before_m = 0;
  for (int k = 0; k < kMostNewtonSteps; ++k) {
    solver_.begin(x.size());
    elasticity_.add(threads, solver_);
    grips_.add(threads, solver_);
    solids_.add(elasticity_, threads, solver_);
    self_contact_.add(threads, solver_);
    solver_.solve();
    ++report.newton_steps;
    report.kept_nodes = std::max(report.kept_nodes, solver_.kept_nodes());
    double largest = 0;
    for (std::size_t i = 0; i < x.size(); ++i)
      largest = std::max(largest, length_squared(solver_.solution(i)));
    const double move_m = std::sqrt(largest);
    if (!std::isfinite(move_m)) {
      report.is_restored = true;
      return;
    }
    const double most_m = std::min(kMostMoveM, k > 1 ? kShrinks * before_m : kMostMoveM);
    before_m = std::min(move_m, most_m);
    elasticity_.move(solver_, before_m / std::max(move_m, before_m), threads);
    if (move_m < kToleranceM) return;
    // Segments that were not going to meet by themselves may do so now.
    if (k == 0 && move_m > kUnforeseenM) self_contact_.find(elasticity_, threads);
  }
}

void ThreadStep::step(Threads& threads, ThreadReport& report) {
  ++report.steps;
  solids_.find(tool_solids_, elasticity_, threads);
  self_contact_.begin(threads);
  self_contact_.find(elasticity_, threads);
  report.dropped_pairs = std::max(report.dropped_pairs, self_contact_.dropped());
  newton(threads, report);
  if (report.is_restored ||
      !std::ranges::all_of(threads.places_m, [](auto& p) { return is_finite(p); })) {
    report.is_restored = true;
    elasticity_.undo(threads);
    return;
  }
  elasticity_.end(threads);
  solids_.end(elasticity_, threads);
  self_contact_.end(threads);
  grips_.end(threads);
}

// An edge parts the segment nearest to it, one in a tick.
std::uint32_t ThreadStep::cut(std::span<const ToolNow> tools, Threads& threads) const {
  std::uint32_t count = 0;
  for (const auto& tool : tools) {
    if (tool.verb != tool::Verb::Cut || !tool.can_cut || !(tool.shape.edge_m > 0)) continue;
    double least = kCutReachM * kCutReachM;
    std::size_t nearest = threads.node_count();
    for (std::size_t i = 0; i + 1 < threads.node_count(); ++i) {
      if (threads.is_joined[i] == 0) continue;
      const Vec3d &a = threads.places_m[i], &b = threads.places_m[i + 1];
      const auto [s, t] = SelfContact::nearest(a, b, tool.edge_m[0], tool.edge_m[1]);
      const Vec3d apart = a + (b - a) * s - tool.edge_m[0] - (tool.edge_m[1] - tool.edge_m[0]) * t;
      if (!(length_squared(apart) < least)) continue;
      least = length_squared(apart);
      nearest = i;
    }
    if (nearest == threads.node_count()) continue;
    part(nearest, threads);
    ++count;
  }
  return count;
}

std::uint32_t ThreadStep::part_broken(Threads& threads) const {
  std::uint32_t count = 0;
  for (std::size_t i = 0; i < threads.node_count(); ++i) {
    auto& ticks = threads.overloaded[i];
    if (!(threads.tensions_n[i] > elasticity_.figures().breaks_n[i])) {
      ticks = 0;
    } else if (++ticks == kBreakTicks) {
      part(i, threads);
      ticks = 0;
      ++count;
    }
  }
  return count;
}

void ThreadStep::sum_pulls(std::span<const ToolNow> tools) {
  pulls_.fill({});
  const auto add = [&](ToolSlot slot, const Vec3d& force_n, const Vec3d& at_m) {
    const auto tool =
        std::find_if(tools.begin(), tools.end(), [&](auto& now) { return now.tool == slot; });
    auto& pull = pulls_[slot.value];
    pull.force_n += force_n;
    pull.torque_nm += cross(at_m - to_double(tool->pose.position), force_n);
  };
  for (const auto& pull : grips_.pulls()) add(pull.tool, pull.force_n, pull.at_m);
  for (const auto& push : solids_.pushes()) add(push.tool, push.force_n, push.at_m);
}

void ThreadStep::run_steps(int steps, std::span<const ToolNow> tools, double time_s,
                           Threads& threads, ThreadReport& report) {
  for (int k = 1; k <= steps && !report.is_restored; ++k) {
    const double part = static_cast<double>(k) / steps;
    elasticity_.begin(kTickSeconds / steps, threads);
    place_tools(tools, threads, static_cast<double>(k - 1) / steps, part);
    grips_.begin(tools, part, time_s - kTickSeconds * (1 - part), threads);
    step(threads, report);
  }
}

ThreadReport ThreadStep::run(std::span<const ToolNow> tools, double time_s, Threads& threads) {
  ThreadReport report;
  note_poses(tools, threads, true);
  report.cut = cut(tools, threads);
  grips_.close_and_open(tools, threads);
  const int steps = self_contact_.steps_needed(threads, kTickSeconds);
  begun_ = threads;
  run_steps(steps, tools, time_s, threads, report);
  // Pairs were faster than they looked: once more, in shorter steps.
  const int needed = self_contact_.steps_needed(threads, kTickSeconds);
  if (needed > steps && !report.is_restored) {
    threads = begun_;
    run_steps(needed, tools, time_s, threads, report);
  }
  report.broken = part_broken(threads);
  sum_pulls(tools);
  note_poses(tools, threads, false);
  return report;
}

}  // namespace trocar::thread
