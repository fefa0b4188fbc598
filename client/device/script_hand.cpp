#include "client/device/script_hand.h"

#include <string>
#include <utility>

namespace trocar::device {

Result<ScriptHand> ScriptHand::make(tool::Script script, std::span<const Vec3f> rest_positions,
                                    std::span<const tool::SurfaceTriangle> triangles) {
  std::vector<tool::AnchorPoint> anchors(script.tools.size());
  for (std::size_t t = 0; t < script.tools.size(); ++t) {
    const auto& tool = script.tools[t];
    const std::string where = script.source + ": key tool[" + std::to_string(t) + "]";
    if (tool.anchor) {
      auto found = tool::find_anchor(*tool.anchor, rest_positions, triangles);
      if (!found) return Error{found.error().code, where + ".anchor: " + found.error().message};
      anchors[t] = *found;
    }
    for (std::size_t k = 0; k < tool.keys.size(); ++k) {
      const auto sample = tool::sample(tool, tool.keys[k].time_s, anchors[t]);
      if (!(length(sample.world_from_tool.position) <= tool::kScriptReachLimit))
        return Error{ErrorCode::BadFile,
                     where + ".key[" + std::to_string(k) +
                         "].position_mm: is more than 2000 mm from the centre of this organ, "
                         "move it nearer"};
    }
  }
  return ScriptHand(std::move(script), std::move(anchors));
}

std::vector<tool::ToolShape> ScriptHand::shapes() const {
  std::vector<tool::ToolShape> shapes;
  for (const auto& tool : script_.tools) shapes.push_back(tool.shape);
  return shapes;
}

tool::ToolSample ScriptHand::sample(std::size_t tool, double seconds) const {
  TROCAR_ASSERT(tool < script_.tools.size());
  return tool::sample(script_.tools[tool], seconds, anchors_[tool]);
}

}  // namespace trocar::device
