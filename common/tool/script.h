#pragma once

// Scripted hands: poses and verbs of one hand's tools over time, read from a TOML file.
// docs/scripts-and-scenarios.md and deploy/scenes/example.toml describe the format; this is the
// same in types. A script is the `[[tool]]` part of a scenario: the other top-level tables are
// reserved.
//
// Frames: a tool without an anchor is in the world frame. A tool with one is relative to a point of
// the organ's surface at rest, so the same script fits any organ:
//
//        origin o---- direction ---->|* anchor          axes: AnchorFrame::World   the world's
//                                  surface                    AnchorFrame::Normal  see AnchorPoint
//
// Units: seconds and metres here, millimetres in the file. Immutable after parsing, so any thread
// may read it. No clock: the caller says what time it is.

#include <array>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/ids.h"
#include "common/base/result.h"
#include "common/math/frame.h"
#include "common/tool/tool.h"

namespace trocar::tool {

inline constexpr double kScriptReachLimit = 2.0;        // m from the origin; also the wire's limit
inline constexpr double kScriptTimeLimit = 86400;       // s
inline constexpr std::size_t kScriptKeyLimit = 10'000;  // keys of one tool
inline constexpr std::size_t kScriptFileLimitBytes = 4u << 20;

enum class AnchorFrame { World, Normal };
enum class AnchorOn {
  Ray,      // where the ray from the origin leaves the organ
  Extreme,  // the surface vertex farthest along the direction: an edge or a tip
};
enum class Ease { Linear, Smooth };

struct ScriptAnchor {
  Vec3f direction;  // unit length, world frame
  AnchorOn on = AnchorOn::Ray;
  AnchorFrame frame = AnchorFrame::World;

  bool operator==(const ScriptAnchor&) const = default;
};

struct ScriptKey {
  double time_s = 0;       // strictly increasing within a tool
  Vec3f position_m;        // of the tip, in the tool's script frame
  Vec3f shaft{0, 0, 1};    // unit length, from the tip back along the shaft, same frame
  Verb verb = Verb::None;  // from this key to the next

  bool operator==(const ScriptKey&) const = default;
};

struct ScriptTool {
  ToolShape shape;
  bool loops = false;  // after the last key, the first again; both have the same pose
  Ease ease = Ease::Smooth;
  std::optional<ScriptAnchor> anchor;
  std::vector<ScriptKey> keys;  // at least one

  bool operator==(const ScriptTool&) const = default;
};

struct Script {
  std::string source;             // file name, for messages
  std::vector<ScriptTool> tools;  // 1 to kToolsPerHand

  bool operator==(const Script&) const = default;
};

// Errors are one line: "file:line: key tool[0].key[2].time_s: what is wrong, what to do".
Result<Script> parse_script(const std::filesystem::path& path);
// `source` stands for the file name in messages.
Result<Script> parse_script_text(std::string_view text, std::string_view source);

// A point of the surface at rest and the axes there: z along the outward normal, x horizontal and
// to the right for somebody who looks at the point from outside, y upwards along the surface. On
// horizontal ground, where that is undefined, x is the world's.
struct AnchorPoint {
  Vec3f position;  // m, world frame
  Vec3f axis_x{1, 0, 0}, axis_y{0, 1, 0},
      axis_z{0, 0, 1};  // world frame, right-handed, unit length

  bool operator==(const AnchorPoint&) const = default;
};

using SurfaceTriangle = std::array<std::uint32_t, 3>;  // vertex numbers, counter-clockwise outside

// AnchorOn::Ray: the farthest of the points where the ray meets a triangle; where it meets none (or
// for AnchorOn::Extreme), the farthest vertex along the direction, the lowest number if several.
// O(triangles). Error: no triangles, or an index out of range.
Result<AnchorPoint> find_anchor(const ScriptAnchor& anchor, std::span<const Vec3f> rest_positions,
                                std::span<const SurfaceTriangle> triangles);

// Pose and verb in the world frame at `seconds` since the script began; before the first key, the
// first key's. For a tool without anchor, pass a default AnchorPoint.
ToolSample sample(const ScriptTool& tool, double seconds, const AnchorPoint& anchor);

}  // namespace trocar::tool
