#include "server/tissue/thread/grips.h"

#include <algorithm>

namespace trocar::thread {
namespace {

constexpr std::uint32_t kBeside = 2;  // nodes on either side of the one that jaws close on
constexpr double kDrawM = 0.05e-3;    // in a tick
constexpr double kHeldEndN = 1e9;     // a scene's hold does not slip

Vec3d rotated(const Quatf& q, const Vec3d& v) {
  const Vec3d u{q.x, q.y, q.z};
  const Vec3d t = cross(u, v) * 2.0;
  return v + t * static_cast<double>(q.w) + cross(u, t);
}
Vec3d to_world(const Pose& pose, const Vec3d& p) {
  return rotated(pose.orientation, p) + to_double(pose.position);
}
Vec3d to_tool(const Pose& pose, const Vec3d& p) {
  return rotated(conjugate(pose.orientation), p - to_double(pose.position));
}

bool has_jaws(const tool::ToolShape& shape) {
  return shape.grip_n > 0 && shape.form != tool::Form::Clipper;
}

void let_go(std::size_t hold, Holds& holds) {
  const auto at = static_cast<std::ptrdiff_t>(hold);
  holds.nodes.erase(holds.nodes.begin() + at);
  holds.tools.erase(holds.tools.begin() + at);
  holds.offsets_m.erase(holds.offsets_m.begin() + at);
}

void hold(std::uint32_t node, const ToolNow& tool, Threads& threads) {
  if (threads.holds.nodes.size() >= kMostHeld) return;
  threads.holds.nodes.push_back(node);
  threads.holds.tools.push_back(tool.tool);
  threads.holds.offsets_m.push_back(to_tool(tool.pose, threads.places_m[node]));
}

}  // namespace

Grips::Grips(const Rules& rules) {
  std::uint32_t node = 0;
  for (const auto& rule : rules.threads) {
    const auto nodes = nodes_along(rule.path_m);
    const auto last = node + static_cast<std::uint32_t>(nodes.size()) - 1;
    ends_.push_back({node, nodes.front(), rule.start});
    ends_.push_back({last, nodes.back(), rule.end});
    node = last + 1;
  }
  springs_.reserve(kMostHeld + ends_.size());
  poses_.reserve(kMostHeld);
  pulls_.reserve(kMostHeld);
  end_forces_.resize(rules.threads.size());
}

bool Grips::is_held(std::uint32_t node, const Threads& threads) const {
  const auto& nodes = threads.holds.nodes;
  return std::find(nodes.begin(), nodes.end(), node) != nodes.end();
}

void Grips::take(const ToolNow& tool, Threads& threads) const {
  const Vec3d tip = to_double(tool.pose.position);
  const double reach = std::min(kTakesM, static_cast<double>(tool.shape.reach_m));
  double least = reach * reach;
  std::uint32_t nearest = static_cast<std::uint32_t>(threads.node_count());
  for (std::uint32_t i = 0; i < threads.node_count(); ++i) {
    const double distance = length_squared(threads.places_m[i] - tip);
    if (!(distance < least) || is_held(i, threads)) continue;
    least = distance;
    nearest = i;
  }
  if (nearest == threads.node_count()) return;
  std::uint32_t first = nearest, last = nearest;
  for (std::uint32_t k = 0; k < kBeside; ++k) {
    if (first > 0 && threads.is_joined[first - 1] != 0 && !is_held(first - 1, threads)) --first;
    if (threads.is_joined[last] != 0 && !is_held(last + 1, threads)) ++last;
  }
  for (auto i = first; i <= last; ++i) hold(i, tool, threads);
}

void Grips::take_what_slides_in(const ToolNow& tool, Threads& threads) const {
  const Vec3d tip = to_double(tool.pose.position);
  const auto may_take = [&](std::uint32_t node) {
    return !is_held(node, threads) &&
           length_squared(threads.places_m[node] - tip) < kJawsM * kJawsM;
  };
  const auto count = threads.holds.nodes.size();
  for (std::size_t k = 0; k < count; ++k) {
    if (threads.holds.tools[k] != tool.tool) continue;
    const auto node = threads.holds.nodes[k];
    if (threads.is_joined[node] != 0 && may_take(node + 1)) hold(node + 1, tool, threads);
    if (node > 0 && threads.is_joined[node - 1] != 0 && may_take(node - 1))
      hold(node - 1, tool, threads);
  }
}

// The middle of what is held goes to the tip while jaws close.
void Grips::draw_in(const ToolNow& tool, Threads& threads) const {
  auto& holds = threads.holds;
  Vec3d sum;
  double count = 0;
  for (std::size_t k = 0; k < holds.nodes.size(); ++k)
    if (holds.tools[k] == tool.tool) {
      sum += holds.offsets_m[k];
      count += 1;
    }
  const double away = count > 0 ? length(sum / count) : 0;
  if (!(away > 0)) return;
  const Vec3d step = sum / count * (std::min(kDrawM, away) / away);
  for (std::size_t k = 0; k < holds.nodes.size(); ++k)
    if (holds.tools[k] == tool.tool) holds.offsets_m[k] -= step;
}

void Grips::close_and_open(std::span<const ToolNow> tools, Threads& threads) {
  auto& holds = threads.holds;
  std::uint32_t closed = 0;
  for (const auto& tool : tools)
    if (tool.verb == tool::Verb::Grasp && has_jaws(tool.shape)) closed |= 1u << tool.tool.value;
  const auto keeps = [&](std::size_t k) {
    return (closed >> holds.tools[k].value & 1u) != 0 &&
           (threads.was_closed[holds.tools[k].value] < kDrawTicks ||
            length_squared(holds.offsets_m[k]) < kJawsM * kJawsM);
  };
  for (std::size_t k = holds.nodes.size(); k-- > 0;)
    if (!keeps(k)) let_go(k, holds);
  for (std::uint8_t i = 0; i < kMaxTools; ++i)
    if ((closed >> i & 1u) == 0) threads.was_closed[i] = 0;
  for (const auto& tool : tools) {
    if ((closed >> tool.tool.value & 1u) == 0) continue;
    auto& ticks = threads.was_closed[tool.tool.value];
    if (ticks == 0) take(tool, threads);
    if (ticks < kDrawTicks)
      draw_in(tool, threads);
    else
      take_what_slides_in(tool, threads);
    ticks = std::min<std::uint8_t>(kDrawTicks, static_cast<std::uint8_t>(ticks + 1));
  }
}

void Grips::begin(std::span<const ToolNow> tools, double part, double time_s, Threads& threads) {
  time_s_ = time_s;
  springs_.clear();
  poses_.clear();
  pulls_.clear();
  const auto& holds = threads.holds;
  for (std::size_t k = 0; k < holds.nodes.size(); ++k) {
    const auto slot = holds.tools[k];
    const auto& now =
        *std::find_if(tools.begin(), tools.end(), [&](auto& tool) { return tool.tool == slot; });
    const auto held = std::count(holds.tools.begin(), holds.tools.end(), slot);
    poses_.push_back(
        part_of_way(threads.tool_poses[slot.value], now.pose, static_cast<float>(part)));
    springs_.push_back({holds.nodes[k], to_world(poses_.back(), holds.offsets_m[k]),
                        static_cast<double>(now.shape.grip_n) / static_cast<double>(held)});
  }
  for (const auto& end : ends_)
    if (end.rule.is_held)
      springs_.push_back({end.node,
                          end.at_m + end.rule.velocity_m_s * std::min(time_s, end.rule.until_s),
                          kHeldEndN});
  for (const auto& spring : springs_) threads.places_m[spring.node] = spring.target_m;
}

Vec3d Grips::force_n(const Spring& spring, const Threads& threads) {
  const Vec3d away = threads.places_m[spring.node] - spring.target_m;
  const double distance = length(away);
  return away * (kGripN_m * distance > spring.most_n ? spring.most_n / distance : kGripN_m);
}

void Grips::add(const Threads& threads, ChainSolver& solver) const {
  for (const auto& spring : springs_) {
    const double distance = length(threads.places_m[spring.node] - spring.target_m);
    solver.add_right(spring.node, to_column(-force_n(spring, threads)));
    solver.add_diagonal(spring.node,
                        kGripN_m * distance > spring.most_n ? spring.most_n / distance : kGripN_m);
  }
  for (const auto& end : ends_) {
    const double part = time_s_ < end.rule.until_s ? time_s_ / end.rule.until_s : 1;
    solver.add_right(end.node, to_column(end.rule.load_n * part));
  }
}

void Grips::end(Threads& threads) {
  auto& holds = threads.holds;
  pulls_.clear();
  for (std::size_t k = 0; k < holds.nodes.size(); ++k) {
    const auto& spring = springs_[k];
    const Vec3d force = force_n(spring, threads);
    pulls_.push_back({holds.tools[k], force, threads.places_m[spring.node]});
    const Vec3d away = threads.places_m[spring.node] - spring.target_m;
    const double distance = length(away), held = spring.most_n / kGripN_m;
    if (distance <= held) continue;
    const Vec3d target = spring.target_m + away * (1 - held / distance);
    holds.offsets_m[k] = to_tool(poses_[k], target);
  }
  std::size_t spring = holds.nodes.size();
  for (std::size_t e = 0; e < ends_.size(); ++e) {
    auto& forces = end_forces_[e / 2];
    (e % 2 == 0 ? forces.start_n : forces.end_n) =
        ends_[e].rule.is_held ? force_n(springs_[spring++], threads) : Vec3d{};
  }
}

}  // namespace trocar::thread
