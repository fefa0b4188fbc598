#include "server/tissue/thread/threads.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace trocar::thread {

Threads::Threads(const Rules& rules)
    : was_closed(kMaxTools, 0), tool_poses(kMaxTools), has_pose(kMaxTools, 0) {
  for (const auto& rule : rules.threads) {
    const auto nodes = nodes_along(rule.path_m);
    places_m.insert(places_m.end(), nodes.begin(), nodes.end());
    is_joined.resize(places_m.size(), 1);
    is_joined.back() = 0;
  }
  velocities_m_s.resize(node_count());
  tensions_n.resize(node_count());
  touched.resize(node_count(), kTouchesNothing);
  creeps_m.resize(node_count());
  overloaded.resize(node_count());
}

void Threads::let_go(const Threads& now) {
  holds = {};
  was_closed = now.was_closed;
  tool_poses = now.tool_poses;
  has_pose = now.has_pose;
}

void Threads::hand_over(ToolSlot from, ToolSlot to) {
  for (auto& tool : holds.tools) tool = tool == from ? to : tool == to ? from : tool;
  std::swap(was_closed[from.value], was_closed[to.value]);
  std::swap(tool_poses[from.value], tool_poses[to.value]);
  std::swap(has_pose[from.value], has_pose[to.value]);
}

void Threads::visit_state(world::StateArchive& archive) {
  archive.fixed_array(places_m);
  archive.fixed_array(velocities_m_s);
  archive.fixed_array(tensions_n);
  archive.fixed_array(is_joined);
  archive.fixed_array(touched);
  archive.fixed_array(creeps_m);
  archive.fixed_array(overloaded);
  archive.sized_array(pairs.first, kMostPairs);
  archive.sized_array(pairs.second, kMostPairs);
  archive.sized_array(pairs.place_first, kMostPairs);
  archive.sized_array(pairs.place_second, kMostPairs);
  archive.sized_array(pairs.press_n, kMostPairs);
  archive.sized_array(pairs.creeps_m, kMostPairs);
  archive.sized_array(holds.nodes, kMostHeld);
  archive.sized_array(holds.tools, kMostHeld);
  archive.sized_array(holds.offsets_m, kMostHeld);
  archive.fixed_array(was_closed);
  archive.fixed_array(tool_poses);
  archive.fixed_array(has_pose);
  if (archive.is_reading() && archive.ok() && !is_whole()) archive.fail();
}

// Returns whether what was read could have come about.
bool Threads::is_whole() const {
  const auto count = pairs.first.size(), held = holds.nodes.size(), nodes = node_count();
  const bool has_sizes = pairs.second.size() == count && pairs.place_first.size() == count &&
                         pairs.place_second.size() == count && pairs.press_n.size() == count &&
                         pairs.creeps_m.size() == count && holds.tools.size() == held &&
                         holds.offsets_m.size() == held && held <= nodes;
  const auto begins_segment = [&](auto node) { return node + std::size_t{1} < nodes; };
  const auto is_part = [](double part) { return part >= 0 && part <= 1; };
  const auto are_finite = [](const std::vector<Vec3d>& all) {
    return std::ranges::all_of(all, [](const Vec3d& one) { return is_finite(one); });
  };
  const auto are_numbers = [](const std::vector<double>& all) {
    return std::ranges::all_of(all, [](double one) { return std::isfinite(one); });
  };
  return has_sizes && are_finite(places_m) && are_finite(velocities_m_s) && are_finite(creeps_m) &&
         are_numbers(tensions_n) && are_finite(pairs.creeps_m) && are_numbers(pairs.press_n) &&
         are_finite(holds.offsets_m) && std::ranges::all_of(pairs.place_first, is_part) &&
         std::ranges::all_of(pairs.place_second, is_part) &&
         std::ranges::all_of(pairs.first, begins_segment) &&
         std::ranges::all_of(pairs.second, begins_segment) && is_joined.back() == 0 &&
         std::ranges::all_of(holds.nodes, [&](auto node) { return node < nodes; }) &&
         std::ranges::all_of(holds.tools, [](auto tool) { return tool.is_valid(); });
}

}  // namespace trocar::thread
