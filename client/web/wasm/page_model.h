#pragma once

// A page in a browser knows a session by the replica of the native client, and this says what there
// is to draw. Bytes of messages go in; arrays that a graphics processor takes come out.
//
// Outside data: a message that cannot be right is refused, and error() says why. Times are the
// page's clock in ms. Thread: the page's only one. Spans and pointers hold until the next call.

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/replica/drawn_lines.h"
#include "client/replica/held_tissue.h"
#include "client/replica/interpolated_surface.h"
#include "client/replica/replica.h"
#include "client/shape/blood_film.h"
#include "client/shape/clear_eye.h"
#include "client/shape/instrument_mesh.h"
#include "client/shape/lens.h"
#include "client/shape/ribbon.h"
#include "client/shape/smooth_surface.h"
#include "client/shape/tissue_look.h"
#include "client/shape/tool_mesh.h"
#include "client/web/wasm/page_fine.h"
#include "common/base/bytes.h"

namespace trocar::wasm {

enum class Overlay : int { None = 0, Regions = 1, Holds = 2 };

// A tool as the page draws it, in floats: JavaScript reads them as one array.
struct PageTool {
  float slot = 0, verb = 0;
  float has_claim = 0, is_silent = 0, is_inside = 0, contact_nodes = 0;  // 0 or 1, but for the last
  Vec3f tip;          // m, where the tissue lets it be
  Quatf orientation;  // likewise
  Vec3f hand;         // m, where the hand has its tip
  Vec3f force_n;      // of the tissue on the tool, world frame
  Vec3f torque_nm;    // about the tip
  float penetration_m = 0;
};
static_assert(sizeof(PageTool) == 23 * sizeof(float));

struct PagePointer {
  float participant = 0;  // slot
  Vec3f position;         // m
};
static_assert(sizeof(PagePointer) == 4 * sizeof(float));

// These say what has bled so far, from whole nanolitres (wire::BloodFigures).
struct PageBlood {
  double shed_ml = 0, on_surface_ml = 0, dripped_ml = 0, sucked_ml = 0;
  double rate_ml_min = 0;
  double open_vessels = 0;
};
static_assert(sizeof(PageBlood) == 6 * sizeof(double));

class PageModel {
 public:
  PageModel();
  // Forgets everything.
  void restart();

  // Takes one Envelope without its length. False: it is refused, and so is all that follows.
  bool receive(BytesView envelope, double now_ms);
  // Takes a message as a recording stores it, without its Envelope; `field`: its number there.
  bool receive_bare(std::uint32_t field, BytesView message, double now_ms);
  // Takes a proto::FineSurface of a recording's organ. What it is refused for, fine() says.
  void receive_fine_surface(BytesView message) { fine_.take_whole(message); }
  const std::string& error() const { return error_; }
  // Messages for the server, each with its length before it.
  const Bytes& outbox() const { return outbox_; }
  void clear_outbox() { outbox_.clear(); }

  const replica::Replica& replica() const { return *replica_; }
  // CRC-32 of the newest frame, computed anew from what is held; 0 before the first.
  std::uint32_t own_crc() const;
  // Returns what is shown between two frames.
  const replica::InterpolatedSurface& shown() const { return *shown_; }

  // Computes the picture at `now_ns`. At most `triangle_budget` triangles where rounding would make
  // more. False until there is one.
  bool update(double now_ms, std::size_t triangle_budget, Overlay overlay);
  // Changes with the number and the order of vertices and triangles.
  std::uint64_t geometry_version() const { return geometry_version_; }
  const shape::SmoothSurface& surface() const { return smooth_; }
  // It takes the place of the outside, where it is shown.
  const PageFine& fine() const { return fine_; }
  // Says what the organ looks like.
  const shape::TissueLook& look() const { return shape::look_of(replica_->topology().organ_name); }
  // Returns x, y, z at rest, and shape::rim_of with four times the number of the part.
  std::span<const std::array<float, 4>> rest() const { return attributes_.rest; }
  std::span<const std::array<std::uint8_t, 4>> overlay() const { return overlay_; }
  // Returns shape::lip_bytes, with the blood of this moment.
  std::span<const std::array<std::int8_t, 4>> lips() const { return attributes_.lips; }
  // Returns what the newest frame says of blood; null: the session does not bleed.
  const PageBlood* blood() const { return blood_ ? &*blood_ : nullptr; }
  // Returns wire::RateFigures::waiting_tools of the newest frame.
  std::uint32_t waiting_tools() const { return waiting_tools_; }
  std::span<const PageTool> tools() const { return tools_; }
  std::span<const PagePointer> pointers() const { return pointers_; }

  // Returns where the point is that a lesson's hands follow, x, y, z in m; null: there is none.
  const float* lesson_target();
  // All that is drawn on the organ, as one mesh in the world frame.
  const shape::MeshVertices& drawing() const { return drawing_; }
  // The triangle number and the two weights with which the server is told of a place on the
  // picture; null: there is no organ yet.
  const float* attach(const Vec3f& place);

  // Vertices of a tool that is drawn in one piece (a blade), or of its shaft and one jaw.
  const shape::MeshVertices& make_tool(const tool::ToolShape& shape, shape::Colour colour);
  // Returns that of the tool that was made last.
  const shape::MeshVertices& jaw() const { return instrument_.jaw; }
  float hinge_m() const { return instrument_.hinge_m; }
  // The line from a tool to the hand, which the tissue keeps it from.
  const shape::MeshVertices& make_hand_line(float length, shape::Colour colour);
  // Returns how somebody sees with the tool in that slot, where it is shown now.
  shape::Lens lens_of(std::uint8_t slot, const tool::ToolShape& shape) const;
  const shape::MeshVertices& make_arrow(float length, float radius, shape::Colour colour);
  // Keeps an eye out of the tissue as it is shown now.
  shape::ClearEye clear_eye(const Vec3f& eye, const Vec3f& forward, bool is_lens) const;

 private:
  bool accept(const proto::Envelope& envelope, double now_ms, std::size_t bytes);
  void build_surface(std::size_t triangle_budget);
  void update_figures();
  void update_tools();
  void update_overlay(Overlay overlay);
  void update_fine();
  void update_drawing();

  std::optional<replica::Replica> replica_;
  std::optional<replica::InterpolatedSurface> shown_;
  replica::HeldTissue held_;
  std::uint64_t held_history_ = 0;
  shape::SmoothSurface smooth_;
  std::uint64_t built_version_ = 0, geometry_version_ = 0;
  std::size_t built_budget_ = 0;
  // The shader takes these of each vertex.
  struct Attributes {
    std::vector<std::array<float, 4>> rest;
    std::vector<float> rim_distances, parts;
    shape::BloodFilm film;
    std::vector<std::array<std::int8_t, 4>> lips;
  };
  Attributes attributes_;
  std::vector<PageTint> tints_;
  PageFine fine_;
  std::vector<std::array<std::uint8_t, 4>> overlay_;
  std::optional<PageBlood> blood_;
  std::uint32_t waiting_tools_ = 0;
  std::vector<PageTool> tools_;
  std::vector<PagePointer> pointers_;
  replica::DrawnLines lines_;
  std::vector<shape::RibbonPoint> ribbon_;
  std::array<float, 3> attached_{}, target_{};
  shape::MeshVertices mesh_, drawing_;
  shape::InstrumentMesh instrument_;
  Bytes outbox_;
  std::string error_;
};

}  // namespace trocar::wasm
