#pragma once

// Draws one picture of the session: background, organ, tools, force arrows. Needs a current OpenGL
// 3.3 core context for its whole life. Draws into a multisampled buffer of its own (a
// software rasteriser gets a plain one, at half the time) and resolves that into the context's
// framebuffer.
// Thread: render thread.

#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "client/render/camera.h"
#include "client/shape/tool_mesh.h"
#include "common/base/ids.h"
#include "common/math/frame.h"
#include "common/tool/tool.h"
#include "common/wire/fine_surface.h"

namespace trocar::render {

inline constexpr float kArrowMetresPerNewton = 0.020f;  // 20 mm per N
inline constexpr float kMaxArrowMetres = 0.10f;
inline constexpr float kMinArrowNewton = 0.05f;  // smaller forces are not drawn

inline constexpr float kGhostMetres = 0.001f;  // hand and tool farther apart are joined by a line

struct SceneTool {
  ToolSlot slot;
  Pose world_from_tool;  // where it is drawn: where the tissue lets it be
  Vec3f hand_position;   // where the hand has its tip
  tool::ToolShape shape;
  tool::Verb verb = tool::Verb::None;
  bool has_claim = false;
  bool is_silent = false;
  Vec3f force_n;  // of the tissue on the tool
};

// A part of the surface that a participant holds (or, fainter, touches); nobody: kNoHolder.
inline constexpr std::uint8_t kNoHolder = 0xff;
struct Hold {
  std::uint8_t owner = kNoHolder;
  bool is_firm = false;
};

// A place that somebody shows: a bright arrow ends there.
struct ScenePointer {
  Vec3f position;
  shape::Colour colour;
};

struct SceneView {
  std::uint64_t topology_version = 0;  // changes when rest positions and triangles do
  std::string_view organ_name;         // says what it looks like (shape/tissue_look.h)
  std::span<const Vec3f> rest_positions;
  std::span<const std::array<std::uint32_t, 3>>
      triangles;                                 // those with equal corners are not drawn
  std::span<const std::uint8_t> is_wound;        // per triangle: shows the inside; may be empty
  std::span<const std::uint32_t> held_vertices;  // that never move; may be empty
  std::shared_ptr<const wire::FineSurface> fine_surface;  // drawn instead of the outside; or null
  std::span<const Vec3f> positions;        // m, as many as rest_positions; empty: no organ yet
  std::span<const std::uint16_t> regions;  // per vertex; may be empty
  std::span<const float> blood;            // per vertex: levels (wire/blood_codec.h); may be empty
  std::vector<Hold> holds;                 // per vertex; empty: not shown
  bool shows_regions = true, shows_arrows = true;
  std::vector<SceneTool> tools;
  std::vector<ScenePointer> pointers;
  std::span<const shape::MeshVertex> drawing;  // in the world frame; lies on the surface
  std::span<const shape::MeshVertex> threads;  // in the world frame, with pegs
  float seconds = 0;                           // since the last picture
};

// A part of the context's framebuffer, pixels, from the lower left corner.
struct Region {
  int left = 0, bottom = 0;
  Size size;
};

// Live: with samples only where a graphics processor does it. Best: always, for a picture to keep.
enum class Quality : std::uint8_t { Live, Best };

class SceneRenderer {
 public:
  explicit SceneRenderer(const GlContext& context);
  ~SceneRenderer();

  // Draws live pictures in software with this share of the pixels along a side, more than 0, at
  // most 1.
  void set_fineness(float share) { fineness_ = share; }
  // Into this part of the context's framebuffer.
  void draw(const SceneView& scene, const OrbitCamera& camera, const Region& region,
            Quality quality = Quality::Live);
  // Says what limits the picture, for --log-level debug: renderer, samples, triangles drawn.
  std::string description() const;

 private:
  struct Parts;
  const GlContext& context_;
  float fineness_ = 1;
  std::unique_ptr<Parts> parts_;
};

// Returns where an arrow for this force ends, from the tip; none if it is too small to draw.
std::optional<Vec3f> arrow_end(const Vec3f& tip, const Vec3f& force_n);

}  // namespace trocar::render
