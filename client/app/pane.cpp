#include "client/app/pane.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "client/device/ray_pick.h"
#include "client/shape/ribbon.h"
#include "client/shape/thread_mesh.h"

namespace trocar::app {
namespace {

constexpr shape::Colour kLessonColour{240, 228, 66};
constexpr float kFittingAspect = 1.3f;     // of a picture that an organ fits into
constexpr float kLineHalfWidth = 0.0009f;  // m, as in a browser
constexpr double kAimingZoom = 1.5;        // who starts as near wants to see the wound
constexpr float kAimSeconds = 0.4f;
constexpr std::size_t kWoundTriangles = 64;  // the newest ones are the wound that is worked at

}  // namespace

const replica::Participant* owner_of(const replica::Replica& replica, ToolSlot slot) {
  return replica.told().find_participant(slot.owner());
}

tool::ToolShape shape_of(const replica::Replica& replica, ToolSlot slot) {
  const auto* owner = owner_of(replica, slot);
  const auto number = static_cast<std::size_t>(slot.number());
  return owner != nullptr && number < owner->tools.size() ? owner->tools[number]
                                                          : tool::ToolShape{};
}

Pane::Pane(const render::GlContext& context, std::string sees_with)
    : region_{0, 0, context.size()}, renderer_(context), sees_with_(std::move(sees_with)) {}

bool Pane::update(const replica::Replica& replica, const StartView& view, std::uint64_t now_ns) {
  now_ns_ = now_ns;
  surface_.update(replica, now_ns);
  if (!surface_.is_valid() || is_framed_) return false;
  frame_camera(replica, view);
  is_framed_ = true;
  return true;
}

void Pane::frame_camera(const replica::Replica& replica, const StartView& view) {
  const auto& rest = replica.topology().rest_positions;
  if (rest.empty()) return;
  Vec3f low = rest.front(), high = low;
  for (const Vec3f& p : rest) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  camera_.frame((low + high) * 0.5f, length(high - low) * 0.5f);
  constexpr float kRadians = std::numbers::pi_v<float> / 180;
  camera_.orbit(static_cast<float>(view.yaw_deg) * kRadians,
                static_cast<float>(view.pitch_deg) * kRadians);
  camera_.zoom(static_cast<float>(1 / view.zoom));
  // A narrow picture sees all of it from farther away.
  const float aspect =
      static_cast<float>(region_.size.width) / static_cast<float>(std::max(region_.size.height, 1));
  if (aspect < kFittingAspect) camera_.zoom(kFittingAspect / std::max(aspect, 0.2f));
  aims_ = view.zoom >= kAimingZoom;
  aim(replica, 1);
}

std::optional<Vec3f> Pane::worked_wound(const replica::Replica& replica) const {
  const auto& topology = replica.topology();
  const auto& at = surface_.positions();
  if (at.size() != topology.rest_positions.size()) return std::nullopt;
  Vec3f sum;
  std::size_t count = 0;
  for (std::size_t i = topology.is_wound.size(); i-- > 0 && count < kWoundTriangles;) {
    const auto& [a, b, c] = topology.triangles[i];
    if (topology.is_wound[i] == 0 || a == b) continue;
    sum += (at[a] + at[b] + at[c]) * (1.0f / 3);
    ++count;
  }
  if (count == 0) return std::nullopt;
  return sum * (1 / static_cast<float>(count));
}

void Pane::aim(const replica::Replica& replica, float share) {
  if (!aims_) return;
  if (const auto wound = worked_wound(replica))
    camera_.aim_at(camera_.centre() + (*wound - camera_.centre()) * share);
}

void Pane::move_camera(const replica::Replica& replica, const device::PointerInput& input,
                       float seconds) {
  const bool zooms = (input.control && input.wheel != 0) || input.zoom_in != input.zoom_out;
  if (zooms || input.right || input.middle) aims_ = false;
  std::optional<Vec3f> focus;
  if (zooms && surface_.positions().size() == replica.topology().rest_positions.size()) {
    const auto view = camera_.rays(size());
    const Vec3f ray = view.ray_through(input.x - static_cast<float>(region_.left), input.y);
    const auto t = device::pick(surface_.positions(), replica.topology().triangles, view.eye, ray);
    focus = t ? view.eye + ray * *t : worked_wound(replica);
  }
  camera_.update(input, size(), seconds, focus);
}

render::SceneTool Pane::scene_tool(const replica::Replica& replica, const replica::Tool& tool,
                                   const Hands& hands) const {
  render::SceneTool shown;
  shown.slot = tool.slot;
  shown.world_from_tool = tool.world_from_proxy;
  shown.hand_position = tool.world_from_tool.position;
  shown.shape = shape_of(replica, tool.slot);
  shown.verb = tool.verb;
  shown.has_claim = tool.has_claim;
  shown.is_silent = tool.is_silent;
  shown.force_n = tool.force_n;
  // A person sees the own hand where it is, not where it was a round trip ago, and the tool as far
  // from it as tissue last kept it.
  const device::MouseTool* mouse = hands.mouse_tool(tool.slot.number());
  // A tool that is held still, or lent, is not where its hand is.
  const auto* own = replica.told().find_participant(replica.own_slot());
  const bool follows_hand = own == nullptr || (own->frozen_by.empty() &&
                                               (own->lent_tools >> tool.slot.number() & 1u) == 0);
  if (follows_hand && mouse != nullptr && mouse->is_valid() &&
      tool.slot.owner() == replica.own_slot()) {
    const Pose hand = mouse->current().world_from_tool;
    const Vec3f held_back = tool.world_from_proxy.position - tool.world_from_tool.position;
    shown.world_from_tool = {hand.position + held_back, hand.orientation};
    shown.hand_position = hand.position;
    shown.verb = mouse->current().verb;
  }
  return shown;
}

std::vector<render::Hold> Pane::holds(const replica::Replica& replica, bool shows_holds) {
  if (held_history_ != replica.history_version()) held_.clear();
  held_history_ = replica.history_version();
  std::vector<tool::ToolShape> shapes;
  for (const auto& tool : surface_.tools()) shapes.push_back(shape_of(replica, tool.slot));
  // Kept up to date while hidden too: which tissue a grasp took is seen when it takes it.
  held_.update(surface_.positions(), surface_.tools(), shapes);
  std::vector<render::Hold> holds;
  if (!shows_holds) return holds;
  for (const auto& holding : held_.holdings()) holds.push_back({holding.owner, holding.is_grasp});
  return holds;
}

std::optional<Vec3f> Pane::lesson_target(const replica::Replica& replica) {
  if (!replica.told().lesson() || replica.newest() == nullptr) return std::nullopt;
  return replica.told().lesson()->target_m(replica.newest()->tick);
}

void Pane::add_lines(const replica::Replica& replica) {
  lines_.update(replica, scene_.positions);
  meshes_.drawing.clear();
  for (const auto& line : lines_.lines()) {
    std::vector<shape::RibbonPoint> points;
    for (const auto& point : line.points) points.push_back({point.position, point.normal});
    shape::add_ribbon(points, kLineHalfWidth, shape::colour_of_pointer(line.participant.value),
                      meshes_.drawing);
  }
  scene_.drawing = meshes_.drawing;
}

void Pane::make_scene(const replica::Replica& replica, const Hands& hands, const Look& look) {
  scene_ = {};
  scene_.seconds = look.seconds;
  scene_.shows_regions = look.overlays.regions;
  scene_.shows_arrows = look.overlays.arrows;
  if (surface_.is_valid()) {
    scene_.topology_version = replica.topology_version();
    scene_.organ_name = replica.topology().organ_name;
    scene_.held_vertices = replica.topology().fixed_vertices;
    scene_.rest_positions = replica.topology().rest_positions;
    scene_.triangles = replica.topology().triangles;
    scene_.is_wound = replica.topology().is_wound;
    scene_.fine_surface = replica.fine_surface();
    scene_.positions = surface_.positions();
    scene_.regions = surface_.regions();
    scene_.blood = surface_.blood();
    scene_.holds = holds(replica, look.overlays.holds);
    for (const replica::Tool& tool : surface_.tools())
      scene_.tools.push_back(scene_tool(replica, tool, hands));
    add_lines(replica);
    meshes_.threads.clear();
    shape::add_threads(surface_.threads(), surface_.thread_places(), meshes_.threads);
    scene_.threads = meshes_.threads;
    for (const replica::Pointer& pointer : replica.told().pointers(now_ns_))
      scene_.pointers.push_back(
          {pointer.position_m, shape::colour_of_pointer(pointer.participant.value)});
    if (const auto target = lesson_target(replica))
      scene_.pointers.push_back({*target, kLessonColour});
    measured_.update(replica.topology(), replica.topology_version(), scene_.positions);
  }
  aim(replica, 1 - std::exp(-look.seconds / kAimSeconds));
  find_lent_view(replica, look.is_recording);
  lent_.apply(scene_, camera_, look.is_recording);
  camera_.keep_clear(scene_.positions, scene_.triangles, size());
}

void Pane::find_lent_view(const replica::Replica& replica, bool is_recording) {
  if (sees_with_.empty()) return;
  for (const auto& shown : scene_.tools) {
    const auto* owner = owner_of(replica, shown.slot);
    if (owner == nullptr || owner->name != sees_with_) continue;
    if (!is_recording && !tool::is_endoscope(shown.shape.form)) continue;
    lent_.choose(shown.slot);
    sees_with_.clear();
    return;
  }
}

void Pane::draw(render::Quality quality) {
  renderer_.draw(scene_, camera_, region_, quality);
}

bool Pane::measure_at(const replica::Replica& replica, float x, float y) {
  const auto& topology = replica.topology();
  if (!surface_.is_valid() || surface_.positions().size() != topology.rest_positions.size())
    return false;
  const auto view = camera_.rays(size());
  const auto place = device::pick_place(surface_.positions(), topology.triangles, view.eye,
                                        view.ray_through(x, y));
  if (!place) return false;
  measured_.add(place->triangle, place->weight, topology);
  return true;
}

ui::HudRuler Pane::ruler() const {
  ui::HudRuler ruler;
  const auto left = static_cast<float>(region_.left);
  for (const auto& place : measured_.positions()) {
    if (!place) continue;
    if (const auto at = camera_.project(*place, size()))
      ruler.ends.push_back({at->x + left, at->y});
  }
  const auto metres = measured_.distance_m();
  if (!metres) return ruler;
  char text[32];
  std::snprintf(text, sizeof text, "%.1f mm", static_cast<double>(*metres) * 1e3);
  ruler.text = text;
  return ruler;
}

std::vector<ui::HudLabel> Pane::labels(const replica::Replica& replica, bool shows_own) const {
  std::vector<ui::HudLabel> labels;
  const auto left = static_cast<float>(region_.left);
  for (const render::SceneTool& tool : scene_.tools) {
    const auto* owner = owner_of(replica, tool.slot);
    const Vec3f collar = tool.world_from_tool.apply({0, 0, tool.shape.radius_m * 7});
    const auto at = camera_.project(collar, size());
    if (owner == nullptr || !at) continue;
    if (!shows_own && owner->slot == replica.own_slot()) continue;
    char force[32] = "";
    if (length(tool.force_n) >= render::kMinArrowNewton)
      std::snprintf(force, sizeof force, "  %.2f N", static_cast<double>(length(tool.force_n)));
    labels.push_back(
        {at->x + left, at->y, owner->name + force, shape::colour_of_slot(tool.slot.owner().value)});
  }
  for (const replica::Pointer& pointer : replica.told().pointers(now_ns_)) {
    const auto* owner = replica.told().find_participant(pointer.participant);
    const auto at = camera_.project(pointer.position_m, size());
    if (owner == nullptr || !at) continue;
    labels.push_back({at->x + left, at->y, owner->name + " points here",
                      shape::colour_of_pointer(pointer.participant.value)});
  }
  return labels;
}

}  // namespace trocar::app
