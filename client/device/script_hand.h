#pragma once

// A hand that follows a script: each anchored tool is put on the organ's surface at rest once, then
// every moment gives one reading per tool, like a device would. Knows no clock and no network.
//
// Immutable after make(); any thread may sample.

#include <span>
#include <vector>

#include "common/base/result.h"
#include "common/scene/script.h"
#include "common/scene/tool.h"

namespace trocar::device {

class ScriptHand {
 public:
  // `rest_positions`: m, world frame, per surface vertex. Error if an anchor cannot be found or a
  // key would lie more than kScriptReachLimit from the origin on this organ.
  static Result<ScriptHand> make(scene::Script script, std::span<const Vec3f> rest_positions,
                                 std::span<const scene::SurfaceTriangle> triangles);

  std::size_t tool_count() const { return script_.tools.size(); }
  std::vector<scene::ToolShape> shapes() const;  // what to offer when joining, per tool
  // `seconds` since the script began, world frame.
  scene::ToolSample sample(std::size_t tool, double seconds) const;

 private:
  ScriptHand(scene::Script script, std::vector<scene::AnchorPoint> anchors)
      : script_(std::move(script)), anchors_(std::move(anchors)) {}

  scene::Script script_;
  std::vector<scene::AnchorPoint> anchors_;  // per tool; unused for a tool without anchor
};

}  // namespace trocar::device
