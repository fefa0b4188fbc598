#include "client/replica/held_tissue.h"

#include <algorithm>

namespace trocar::replica {
namespace {

// The distance is from the surface of the solid: a capsule, or with a half width a flat blade.
float distance_to(const Vec3f& p, const Pose& world_from_tool, const tool::ToolShape& shape) {
  const Vec3f q = world_from_tool.apply_inverse(p);
  const float far_end = std::max(shape.length_m - shape.radius_m, shape.radius_m);
  const Vec3f core{std::clamp(q.x, -shape.half_width_m, shape.half_width_m), 0,
                   std::clamp(q.z, shape.radius_m, far_end)};
  return length(q - core) - shape.radius_m;
}

}  // namespace

void HeldTissue::clear() {
  for (Grasp& grasp : grasps_) grasp = {};
  holdings_.clear();
}

void HeldTissue::update(std::span<const Vec3f> positions, std::span<const Tool> tools,
                        std::span<const tool::ToolShape> shapes) {
  if (holdings_.size() > positions.size()) clear();  // where a blade cuts it only grows
  holdings_.assign(positions.size(), Holding{});
  std::array<bool, kMaxTools> is_grasping{};
  for (std::size_t t = 0; t < tools.size() && t < shapes.size(); ++t) {
    const Tool& tool = tools[t];
    if (!tool.slot.is_valid() || !tool.has_claim) continue;
    const std::uint8_t owner = tool.slot.owner().value;
    if (tool.verb == tool::Verb::Push) {
      for (std::size_t i = 0; i < positions.size(); ++i)
        if (holdings_[i].owner == kHeldByNobody &&
            distance_to(positions[i], tool.world_from_proxy, shapes[t]) < kTouchMargin_m)
          holdings_[i] = {owner, false};
    } else if (tool.verb == tool::Verb::Grasp) {
      is_grasping[tool.slot.value] = true;
      Grasp& grasp = grasps_[tool.slot.value];
      const Vec3f tip = tool.world_from_tool.position;
      const float reach = shapes[t].reach_m, lost = kLostBeyond * reach;
      if (!grasp.is_held) {
        grasp.is_held = true;
        for (std::uint32_t i = 0; i < positions.size(); ++i)
          if (length_squared(positions[i] - tip) <= reach * reach) grasp.vertices.push_back(i);
      }
      std::erase_if(grasp.vertices, [&](std::uint32_t i) {
        return length_squared(positions[i] - tip) > lost * lost;
      });
      for (const std::uint32_t i : grasp.vertices) holdings_[i] = {owner, true};
    }
  }
  for (std::size_t i = 0; i < grasps_.size(); ++i)
    if (!is_grasping[i]) grasps_[i] = {};
}

}  // namespace trocar::replica
