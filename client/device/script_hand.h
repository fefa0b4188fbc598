#pragma once

// A hand that follows a script: each anchored tool is put on the organ's surface at rest once, then
// every moment gives one reading per tool, like a device would. Knows no clock and no network.
//
// Immutable after make(); any thread may sample.

#include <span>
#include <vector>

#include "common/base/result.h"
#include "common/tool/script.h"
#include "common/tool/tool.h"

namespace trocar::device {

class ScriptHand {
 public:
  // `rest_positions`: m, world frame, per surface vertex. Error if an anchor cannot be found or a
  // key would lie more than kScriptReachLimit from the origin on this organ.
  static Result<ScriptHand> make(tool::Script script, std::span<const Vec3f> rest_positions,
                                 std::span<const tool::SurfaceTriangle> triangles);

  std::size_t tool_count() const { return script_.tools.size(); }
  std::vector<tool::ToolShape> shapes() const;  // what to offer when joining, per tool
  // `seconds` since the script began, world frame.
  tool::ToolSample sample(std::size_t tool, double seconds) const;

 private:
  ScriptHand(tool::Script script, std::vector<tool::AnchorPoint> anchors)
      : script_(std::move(script)), anchors_(std::move(anchors)) {}

  tool::Script script_;
  std::vector<tool::AnchorPoint> anchors_;  // per tool; unused for a tool without anchor
};

}  // namespace trocar::device
