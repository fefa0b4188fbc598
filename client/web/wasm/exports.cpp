// The functions that JavaScript calls, client/web/page/src/replica.ts: numbers and places in the
// module's memory. A page has one model.

#include <cmath>

#include "client/shape/noise.h"
#include "client/shape/thread_mesh.h"
#include "client/web/wasm/page_hand.h"
#include "client/web/wasm/page_model.h"

#ifdef __wasm__
#define TROCAR_EXPORT(name) extern "C" __attribute__((export_name(#name), used))
#else
#define TROCAR_EXPORT(name) extern "C"
#endif

namespace trocar::wasm {
namespace {

// A message is at most this large; the page asks for no more room.
constexpr std::size_t kMostInput = 16 * 1024 * 1024 + 4;

Bytes input_bytes;
std::vector<std::uint8_t> noise_texels;
shape::MeshVertices thread_mesh;

PageModel& model() {
  static PageModel the_model;
  return the_model;
}

PageHands& hands() {
  static PageHands the_hands;
  return the_hands;
}

BytesView input_view(std::size_t bytes) {
  return BytesView(input_bytes).first(std::min(bytes, input_bytes.size()));
}

tool::ToolShape shape_of(float radius_m, float length_m, float half_width_m, float edge_m,
                         std::uint32_t form) {
  tool::ToolShape shape;
  shape.radius_m = radius_m;
  shape.length_m = length_m;
  shape.half_width_m = half_width_m;
  shape.edge_m = edge_m;
  shape.form = static_cast<tool::Form>(form);
  return shape;
}

shape::Colour colour_of(std::uint32_t rgb) {
  return {static_cast<std::uint8_t>(rgb >> 16), static_cast<std::uint8_t>(rgb >> 8),
          static_cast<std::uint8_t>(rgb)};
}

std::size_t mesh_count = 0;
std::array<float, 11> lens_figures{};
std::array<float, 2> clear_figures{};
shape::LookFigures look_figures;

const void* hand_out(const shape::MeshVertices& mesh) {
  mesh_count = mesh.size();
  return mesh.data();
}

}  // namespace

TROCAR_EXPORT(restart) void trocar_restart() {
  model().restart();
}
// Null: a message of that size is refused.
TROCAR_EXPORT(input) std::uint8_t* trocar_input(std::size_t bytes) {
  if (bytes > kMostInput) return nullptr;
  if (input_bytes.size() <= bytes) input_bytes.resize(bytes + 1);  // a message may be empty
  return input_bytes.data();
}
TROCAR_EXPORT(receive) int trocar_receive(std::size_t bytes, double now_ms) {
  return model().receive(input_view(bytes), now_ms);
}
TROCAR_EXPORT(receive_bare)
int trocar_receive_bare(std::uint32_t field, std::size_t bytes, double now_ms) {
  return model().receive_bare(field, input_view(bytes), now_ms);
}
TROCAR_EXPORT(error) const char* trocar_error() {
  return model().error().c_str();
}
TROCAR_EXPORT(outbox) const std::uint8_t* trocar_outbox() {
  return model().outbox().data();
}
TROCAR_EXPORT(outbox_size) std::size_t trocar_outbox_size() {
  return model().outbox().size();
}
TROCAR_EXPORT(outbox_clear) void trocar_outbox_clear() {
  model().clear_outbox();
}

TROCAR_EXPORT(frames) double trocar_frames() {
  return static_cast<double>(model().replica().counters().frames);
}
TROCAR_EXPORT(mismatches) double trocar_mismatches() {
  const auto& counters = model().replica().counters();
  return static_cast<double>(counters.crc_mismatches + counters.base_mismatches +
                             counters.change_mismatches);
}
TROCAR_EXPORT(surface_crc) std::uint32_t trocar_surface_crc() {
  return model().replica().surface_crc();
}
TROCAR_EXPORT(own_crc) std::uint32_t trocar_own_crc() {
  return model().own_crc();
}
TROCAR_EXPORT(is_in_step) int trocar_is_in_step() {
  return model().replica().sync_state() == replica::SyncState::InStep;
}
TROCAR_EXPORT(newest_tick) double trocar_newest_tick() {
  const auto* newest = model().replica().newest();
  return newest == nullptr ? -1 : static_cast<double>(newest->tick);
}
TROCAR_EXPORT(newest_frame) double trocar_newest_frame() {
  const auto* newest = model().replica().newest();
  return newest == nullptr ? -1 : static_cast<double>(newest->frame);
}
// The server's clock when it published the newest frame, us; 0: unknown.
TROCAR_EXPORT(newest_server_us) double trocar_newest_server_us() {
  const auto* newest = model().replica().newest();
  return newest == nullptr ? 0 : static_cast<double>(newest->server_time_us);
}
TROCAR_EXPORT(shown_tick) double trocar_shown_tick() {
  return model().shown().tick();
}

TROCAR_EXPORT(update) int trocar_update(double now_ms, std::size_t triangle_budget, int overlay) {
  return model().update(now_ms, triangle_budget, static_cast<Overlay>(overlay));
}
TROCAR_EXPORT(geometry_version) double trocar_geometry_version() {
  return static_cast<double>(model().geometry_version());
}
TROCAR_EXPORT(vertices) std::size_t trocar_vertices() {
  return model().surface().vertex_count();
}
TROCAR_EXPORT(coarse_vertices) std::size_t trocar_coarse_vertices() {
  return model().surface().coarse_vertex_count();
}
TROCAR_EXPORT(triangles) std::size_t trocar_triangles() {
  return model().surface().triangles().size();
}
TROCAR_EXPORT(triangles_at) const void* trocar_triangles_at() {
  return model().surface().triangles().data();
}
TROCAR_EXPORT(positions_at) const void* trocar_positions_at() {
  return model().surface().positions().data();
}
TROCAR_EXPORT(normals_at) const void* trocar_normals_at() {
  return model().surface().normals().data();
}
TROCAR_EXPORT(lips_at) const void* trocar_lips_at() {
  return model().lips().data();
}
TROCAR_EXPORT(rest_at) const void* trocar_rest_at() {
  return model().rest().data();
}
TROCAR_EXPORT(overlay_at) const void* trocar_overlay_at() {
  return model().overlay().data();
}
// Counts the triangles of the outside, which are the first ones.
TROCAR_EXPORT(outer_triangles) std::size_t trocar_outer_triangles() {
  return model().surface().outer_triangle_count();
}

// These are of the fine surface. A FineSurface of a recording's organ, as input.
TROCAR_EXPORT(receive_fine_surface) void trocar_receive_fine_surface(std::size_t bytes) {
  model().receive_fine_surface(input_view(bytes));
}
TROCAR_EXPORT(fine_is_shown) int trocar_fine_is_shown() {
  return model().fine().is_shown();
}
TROCAR_EXPORT(fine_fault) const char* trocar_fine_fault() {
  return model().fine().fault().c_str();
}
TROCAR_EXPORT(fine_geometry_version) double trocar_fine_geometry_version() {
  return static_cast<double>(model().fine().geometry_version());
}
TROCAR_EXPORT(fine_motion_version) double trocar_fine_motion_version() {
  return static_cast<double>(model().fine().motion_version());
}
TROCAR_EXPORT(fine_vertices) std::size_t trocar_fine_vertices() {
  return model().fine().surface().vertex_count();
}
TROCAR_EXPORT(fine_parted) std::size_t trocar_fine_parted() {
  return model().fine().surface().parted_count();
}
TROCAR_EXPORT(fine_triangles) std::size_t trocar_fine_triangles() {
  return model().fine().surface().triangles().size();
}
TROCAR_EXPORT(fine_triangles_at) const void* trocar_fine_triangles_at() {
  return model().fine().surface().triangles().data();
}
TROCAR_EXPORT(fine_positions_at) const void* trocar_fine_positions_at() {
  return model().fine().surface().positions().data();
}
TROCAR_EXPORT(fine_normals_at) const void* trocar_fine_normals_at() {
  return model().fine().surface().normals().data();
}
TROCAR_EXPORT(fine_lips_at) const void* trocar_fine_lips_at() {
  return model().fine().lips().data();
}
TROCAR_EXPORT(fine_overlay_at) const void* trocar_fine_overlay_at() {
  return model().fine().overlay().data();
}
TROCAR_EXPORT(fine_rest_at) const void* trocar_fine_rest_at() {
  return model().fine().rest().data();
}
TROCAR_EXPORT(fine_texture_at) const void* trocar_fine_texture_at() {
  return model().fine().texture().data();
}
TROCAR_EXPORT(fine_picture_at) const void* trocar_fine_picture_at() {
  return model().fine().picture().data();
}
TROCAR_EXPORT(fine_picture_version) double trocar_fine_picture_version() {
  return static_cast<double>(model().fine().picture_version());
}
TROCAR_EXPORT(fine_picture_bytes) std::size_t trocar_fine_picture_bytes() {
  return model().fine().picture().size();
}

// Null: the session does not bleed. Else the numbers of PageBlood.
TROCAR_EXPORT(blood) const void* trocar_blood() {
  return model().blood();
}
// Bits of tools, by their slots.
TROCAR_EXPORT(waiting_tools) std::uint32_t trocar_waiting_tools() {
  return model().waiting_tools();
}
TROCAR_EXPORT(tools) std::size_t trocar_tools() {
  return model().tools().size();
}
TROCAR_EXPORT(tools_at) const void* trocar_tools_at() {
  return model().tools().data();
}
TROCAR_EXPORT(pointers) std::size_t trocar_pointers() {
  return model().pointers().size();
}
TROCAR_EXPORT(pointers_at) const void* trocar_pointers_at() {
  return model().pointers().data();
}

// These are of the hands of a person at the page, 0 right and 1 left.
TROCAR_EXPORT(hand_take)
void trocar_hand_take(int hand, float radius_m, float length_m, float half_width_m, float edge_m,
                      float grip_n, std::uint32_t form) {
  auto shape = shape_of(radius_m, length_m, half_width_m, edge_m, form);
  shape.grip_n = grip_n;
  hands().take(hand, shape);
}
// Floats of a PageHandInput, to be written before the two calls below.
TROCAR_EXPORT(hand_input) void* trocar_hand_input() {
  return &hands().input();
}
TROCAR_EXPORT(hand_switch) void trocar_hand_switch(int hand) {
  hands().switch_to(hand);
}
TROCAR_EXPORT(hand_update) void trocar_hand_update(float seconds) {
  hands().update(model().surface().positions(), model().surface().triangles(), seconds);
}
// Floats of a PageHandSample; null: the pointer was not over the picture yet.
TROCAR_EXPORT(hand_sample) const void* trocar_hand_sample(int hand, double now_ms) {
  return hands().sample(hand, now_ms);
}

TROCAR_EXPORT(lesson_target) const float* trocar_lesson_target() {
  return model().lesson_target();
}
// Vertices of all that is drawn; then mesh_vertices() says how many.
TROCAR_EXPORT(drawing_at) const void* trocar_drawing_at() {
  return hand_out(model().drawing());
}
// Surgical thread is told likewise, with its pegs.
TROCAR_EXPORT(threads_at) const void* trocar_threads_at() {
  thread_mesh.clear();
  shape::add_threads(model().shown().threads(), model().shown().thread_places(), thread_mesh);
  return hand_out(thread_mesh);
}
TROCAR_EXPORT(attach) const float* trocar_attach(float x, float y, float z) {
  return model().attach({x, y, z});
}

// Colours are 0xrrggbb; each of the three gives a place of MeshVertex, mesh_vertices() how many.
TROCAR_EXPORT(make_tool)
const void* trocar_make_tool(float radius_m, float length_m, float half_width_m, float edge_m,
                             std::uint32_t form, std::uint32_t colour) {
  return hand_out(model().make_tool(shape_of(radius_m, length_m, half_width_m, edge_m, form),
                                    colour_of(colour)));
}
// These are of the tool that was made last: what moves about its hinge, and how far that is from
// the tip, m.
TROCAR_EXPORT(jaw) const void* trocar_jaw() {
  return hand_out(model().jaw());
}
TROCAR_EXPORT(hinge) float trocar_hinge() {
  return model().hinge_m();
}
// See shape::jaw_motion.
TROCAR_EXPORT(jaw_opening)
float trocar_jaw_opening(std::uint32_t form, std::uint32_t verb, bool has_claim) {
  return shape::jaw_motion(static_cast<tool::Form>(form), static_cast<tool::Verb>(verb), has_claim)
      .opening;
}
TROCAR_EXPORT(jaw_seconds)
float trocar_jaw_seconds(std::uint32_t form, std::uint32_t verb, bool has_claim) {
  return shape::jaw_motion(static_cast<tool::Form>(form), static_cast<tool::Verb>(verb), has_claim)
      .seconds;
}
// Eye, forward and up, the tangent of half the angle of view, and 1 if it is an endoscope.
TROCAR_EXPORT(lens) const float* trocar_lens(int slot, float radius_m, std::uint32_t form) {
  tool::ToolShape shape;
  shape.radius_m = radius_m;
  shape.form = static_cast<tool::Form>(form);
  const auto lens = model().lens_of(static_cast<std::uint8_t>(slot), shape);
  lens_figures = {lens.eye.x,
                  lens.eye.y,
                  lens.eye.z,
                  lens.forward.x,
                  lens.forward.y,
                  lens.forward.z,
                  lens.up.x,
                  lens.up.y,
                  lens.up.z,
                  lens.tan_half_height,
                  lens.is_endoscope ? 1.0f : 0.0f};
  return lens_figures.data();
}
// By how much an eye has to step back out of tissue, m, and how far tissue is then at least. Its
// direction: an angle from z towards x, and one upwards.
TROCAR_EXPORT(clear_eye)
const float* trocar_clear_eye(float x, float y, float z, float yaw, float pitch, bool is_lens) {
  const Vec3f forward{std::sin(yaw) * std::cos(pitch), std::sin(pitch),
                      std::cos(yaw) * std::cos(pitch)};
  const auto clear = model().clear_eye({x, y, z}, forward, is_lens);
  clear_figures = {clear.back_m, clear.nearest_m};
  return clear_figures.data();
}
TROCAR_EXPORT(make_arrow)
const void* trocar_make_arrow(float length_m, float radius_m, std::uint32_t colour) {
  return hand_out(model().make_arrow(length_m, radius_m, colour_of(colour)));
}
TROCAR_EXPORT(make_hand_line)
const void* trocar_make_hand_line(float length_m, std::uint32_t colour) {
  return hand_out(model().make_hand_line(length_m, colour_of(colour)));
}
TROCAR_EXPORT(mesh_vertices) std::size_t trocar_mesh_vertices() {
  return mesh_count;
}
TROCAR_EXPORT(slot_colour) std::uint32_t trocar_slot_colour(int slot) {
  const auto colour = shape::colour_of_slot(slot < 0 ? 0 : slot);
  return static_cast<std::uint32_t>(colour.r) << 16 | static_cast<std::uint32_t>(colour.g) << 8 |
         colour.b;
}
TROCAR_EXPORT(pointer_colour) std::uint32_t trocar_pointer_colour(int slot) {
  const auto colour = shape::colour_of_pointer(slot < 0 ? 0 : slot);
  return static_cast<std::uint32_t>(colour.r) << 16 | static_cast<std::uint32_t>(colour.g) << 8 |
         colour.b;
}
// Returns shape::LookFigures of the outside, or of the inside, as floats.
TROCAR_EXPORT(look) const void* trocar_look(bool is_inside) {
  const auto& look = model().look();
  look_figures = is_inside ? shape::inside_figures(look) : shape::outside_figures(look);
  return &look_figures;
}
TROCAR_EXPORT(lobules) const std::uint8_t* trocar_lobules(int size) {
  noise_texels = shape::make_lobule_noise(size);
  return noise_texels.data();
}
TROCAR_EXPORT(noise) const std::uint8_t* trocar_noise(int size) {
  noise_texels = shape::make_tissue_noise(size);
  return noise_texels.data();
}

}  // namespace trocar::wasm
