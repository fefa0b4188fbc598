#include "client/render/scene_renderer.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

#include "client/render/field_source.h"
#include "client/render/fine_layer.h"
#include "client/render/gl.h"
#include "client/render/organ_shaders.h"
#include "client/render/organ_vertex.h"
#include "client/render/shader.h"
#include "client/render/shader_sources.h"
#include "client/shape/blood_film.h"
#include "client/shape/instrument_mesh.h"
#include "client/shape/smooth_surface.h"
#include "common/wire/blood_codec.h"

namespace trocar::render {

using namespace shape;

namespace {

constexpr float kDrawingGlow = 0.8f;  // lines are seen in the shadow, too
constexpr int kMaxShadows = 8;
constexpr float kOverlayStrength = 0.50f;
constexpr float kFirmHoldStrength = 0.95f, kTouchStrength = 0.60f;
constexpr float kOverlayFadeSeconds = 0.12f;
// The light of an endoscope does not reach far.
constexpr float kScopeHazeFreeMetres = 0.05f, kScopeHazePerMetre = 4.0f;
constexpr float kScopeLampMetres = 0.07f;  // over which it falls to half
constexpr float kNearMetres = 0.30f;       // from what one looks at: then small detail is seen
constexpr float kHazePerMiddle = 0.55f;    // over the distance of what one looks at
constexpr std::size_t kTriangleBudgetSoftware = 24'000, kTriangleBudget = 100'000;

Tint tint_of(Colour c) {
  const auto linear = [](std::uint8_t v) {
    const float x = static_cast<float>(v) / 255;
    return x * x;
  };
  return {linear(c.r), linear(c.g), linear(c.b), 1};
}

struct RestVertex {
  Vec3f position;
  float rim_and_part = 0;  // as the shader says
};

Matrix4 matrix_of(const Pose& pose) {
  const Vec3f x = rotate(pose.orientation, {1, 0, 0}), y = rotate(pose.orientation, {0, 1, 0}),
              z = rotate(pose.orientation, {0, 0, 1}), p = pose.position;
  return {x.x, x.y, x.z, 0, y.x, y.y, y.z, 0, z.x, z.y, z.z, 0, p.x, p.y, p.z, 1};
}

// Jaw in the tool frame: turned about z by half a turn for the lower one, opened about its hinge.
Matrix4 jaw_matrix(float hinge, float opening, bool is_lower) {
  const float c = std::cos(opening), s = std::sin(opening), turn = is_lower ? -1.0f : 1.0f;
  // Rotation about x through (0, 0, hinge) that lifts the nose (z < hinge) towards +y.
  const Matrix4 opened = {1, 0, 0, 0, 0, c, s, 0, 0, -s, c, 0, 0, s * hinge, hinge - c * hinge, 1};
  const Matrix4 turned = {turn, 0, 0, 0, 0, turn, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  return multiply(turned, opened);
}

const void* offset(std::size_t bytes) {
  return reinterpret_cast<const void*>(bytes);
}

struct VertexArray {
  GLuint array = 0, buffer = 0;

  VertexArray() {
    glGenVertexArrays(1, &array);
    glGenBuffers(1, &buffer);
  }
  ~VertexArray() {
    glDeleteBuffers(1, &buffer);
    glDeleteVertexArrays(1, &array);
  }
  VertexArray(const VertexArray&) = delete;
  VertexArray& operator=(const VertexArray&) = delete;
};

struct Target {
  Size size;
  int samples = 0;
  GLuint framebuffer = 0, colour = 0, depth = 0;

  // True if it was made anew.
  bool resize(Size wanted) {
    if (framebuffer != 0 && wanted.width == size.width && wanted.height == size.height)
      return false;
    release();
    size = wanted;
    glGenRenderbuffers(1, &colour);
    glBindRenderbuffer(GL_RENDERBUFFER, colour);
    glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, GL_RGBA8, size.width, size.height);
    glGenRenderbuffers(1, &depth);
    glBindRenderbuffer(GL_RENDERBUFFER, depth);
    glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, GL_DEPTH_COMPONENT24, size.width,
                                     size.height);
    glGenFramebuffers(1, &framebuffer);
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, colour);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth);
    return true;
  }
  void release() {
    glDeleteFramebuffers(1, &framebuffer);
    glDeleteRenderbuffers(1, &colour);
    glDeleteRenderbuffers(1, &depth);
    framebuffer = colour = depth = 0;
  }
};

std::string lit(const char* head, const char* fragment_source) {
  return std::string(head) + kLightingSource + fragment_source;
}

void blit(GLuint from, GLuint to, Size size, const Region& region) {
  glBindFramebuffer(GL_READ_FRAMEBUFFER, from);
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, to);
  const bool is_same = size.width == region.size.width && size.height == region.size.height;
  glBlitFramebuffer(0, 0, size.width, size.height, region.left, region.bottom,
                    region.left + region.size.width, region.bottom + region.size.height,
                    GL_COLOR_BUFFER_BIT, is_same ? GL_NEAREST : GL_LINEAR);
}

Size scaled(Size size, float share) {
  const auto part = [share](int side) {
    return std::max(1, static_cast<int>(std::lround(static_cast<float>(side) * share)));
  };
  return {part(size.width), part(size.height)};
}

}  // namespace

std::optional<Vec3f> arrow_end(const Vec3f& tip, const Vec3f& force_n) {
  const float newton = length(force_n);
  if (!(newton >= kMinArrowNewton)) return std::nullopt;
  return tip + force_n * (std::min(newton * kArrowMetresPerNewton, kMaxArrowMetres) / newton);
}

struct SceneRenderer::Parts {
  OrganShaders organ;
  Shader tool{kToolVertexSource, lit(kFineHead, kToolFragmentSource).c_str()};
  Shader field{kFieldVertexSource, lit(kPlainHead, kFieldFragmentSource).c_str()};
  Shader scope_mask{kFieldVertexSource, kScopeMaskSource};
  FineLayer fine;
  VertexArray organ_array, tool_array, field_array;
  GLuint rest_buffer = 0, index_buffer = 0;
  Target sharp, plain;  // with and without samples
  Target backdrop;      // the field alone, drawn when the view changes
  Matrix4 backdrop_view{};
  std::array<Vec3f, 2> backdrop_organ;
  Vec3f organ_centre, organ_size;  // of the field's cloth: as its shader says
  Size size;
  bool is_software = false;
  std::string renderer_name;

  std::uint64_t topology_version = 0;
  SmoothSurface surface;
  std::vector<Tint> tints;  // coarse vertices keep their fading state, the others follow
  std::size_t tinted = 0;   // coarse vertices from here on are new: they do not fade in
  std::vector<RestVertex> rest_vertices;
  std::vector<float> rim_distances;
  BloodFilm film;
  std::vector<OrganVertex> vertices;
  std::array<float, kMaxTools> jaw_openings{};

  explicit Parts(const GlContext& context);
  ~Parts();
  void load_topology(const SceneView& scene);
  void upload_organ(const SceneView& scene);
  void fade_tints(const SceneView& scene);
  void set_lights(const Shader& shader, const OrbitCamera& camera) const;
  void draw_field(const OrbitCamera& camera);
  void draw_backdrop(const OrbitCamera& camera);
  void draw_scope_mask();
  void measure_organ(std::span<const Vec3f> rest_positions);
  void draw_organ(const SceneView& scene, const OrbitCamera& camera, Detail detail);
  void draw_triangles(std::size_t first, std::size_t end) const;
  void light_organ(const Shader& shader, const SceneView& scene, const OrbitCamera& camera) const;
  void draw_tools(const SceneView& scene, const OrbitCamera& camera);
  void draw_tool(const SceneTool& shown, float seconds);
  void draw_ghost(const SceneTool& shown);
  void draw_arrow(const SceneTool& shown);
  void draw_pointer(const ScenePointer& shown, const OrbitCamera& camera);
  // First faintly without the depth test, so that it shows through tissue, then where in front.
  void draw_through(const MeshVertices& mesh, const Matrix4& world_from_model, float faint,
                    float dim);
  void draw_mesh(std::span<const MeshVertex> mesh, const Matrix4& world_from_model, float glow,
                 float dim);
};

SceneRenderer::Parts::Parts(const GlContext& context)
    : is_software(context.is_software()), renderer_name(context.renderer_name()) {
  GLint most = 0;
  glGetIntegerv(GL_MAX_SAMPLES, &most);
  sharp.samples = std::min(4, static_cast<int>(most));
  plain.samples = 0;

  glBindVertexArray(organ_array.array);
  glBindBuffer(GL_ARRAY_BUFFER, organ_array.buffer);
  describe_organ_vertices();
  glGenBuffers(1, &rest_buffer);
  glBindBuffer(GL_ARRAY_BUFFER, rest_buffer);
  glVertexAttribPointer(3, 4, GL_FLOAT, GL_FALSE, sizeof(RestVertex), offset(0));
  glEnableVertexAttribArray(3);
  glGenBuffers(1, &index_buffer);
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, index_buffer);

  glBindVertexArray(tool_array.array);
  glBindBuffer(GL_ARRAY_BUFFER, tool_array.buffer);
  constexpr GLsizei kToolStride = sizeof(MeshVertex);
  glVertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, kToolStride, offset(0));
  glVertexAttribPointer(1, 3, GL_FLOAT, GL_FALSE, kToolStride,
                        offset(offsetof(MeshVertex, normal)));
  glVertexAttribPointer(2, 4, GL_UNSIGNED_BYTE, GL_TRUE, kToolStride,
                        offset(offsetof(MeshVertex, material)));
  for (GLuint i = 0; i < 3; ++i) glEnableVertexAttribArray(i);
  glBindVertexArray(0);
}

SceneRenderer::Parts::~Parts() {
  for (Target* target : {&sharp, &plain, &backdrop}) target->release();
  glDeleteBuffers(1, &rest_buffer);
  glDeleteBuffers(1, &index_buffer);
}

void SceneRenderer::Parts::load_topology(const SceneView& scene) {
  // At every change of a surface that is being cut: linear, in memory that is there already.
  const std::size_t known =
      topology_version == 0 ? scene.rest_positions.size()
                            : std::min(surface.coarse_vertex_count(), scene.rest_positions.size());
  topology_version = scene.topology_version;
  surface.build(scene.rest_positions.size(), scene.triangles, scene.is_wound,
                is_software ? kTriangleBudgetSoftware : kTriangleBudget);
  surface.smooth_borders(scene.rest_positions);
  surface.update(scene.rest_positions);
  tints.resize(known);
  tints.resize(surface.vertex_count());
  tinted = known;
  vertices.resize(surface.vertex_count());
  rest_vertices.resize(surface.vertex_count());
  surface.measure_rim(kDeepMetres, rim_distances);
  const TissueLook& look = look_of(scene.organ_name);
  organ.take_look(look);
  std::vector<float> parts(surface.vertex_count());
  const auto coarse_parts =
      parts_of(look, scene.rest_positions.size(), scene.triangles, scene.held_vertices);
  std::ranges::copy(coarse_parts, parts.begin());
  surface.extend_values(parts);  // between two of one part there is that part
  for (std::size_t i = 0; i < rest_vertices.size(); ++i)
    rest_vertices[i] = {surface.positions()[i],
                        4 * parts[i] + rim_of(rim_distances[i], surface.is_wound()[i] != 0)};
  film.build(surface, scene.rest_positions);
  measure_organ(scene.rest_positions);
  const auto bytes = [](std::size_t count, std::size_t each) {
    return static_cast<GLsizeiptr>(count * each);
  };
  glBindBuffer(GL_ARRAY_BUFFER, rest_buffer);
  glBufferData(GL_ARRAY_BUFFER, bytes(rest_vertices.size(), sizeof(RestVertex)),
               rest_vertices.data(), GL_DYNAMIC_DRAW);
  glBindVertexArray(organ_array.array);
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, bytes(surface.triangles().size(), sizeof(TriangleCorners)),
               surface.triangles().data(), GL_DYNAMIC_DRAW);
}

void SceneRenderer::Parts::fade_tints(const SceneView& scene) {
  const float share = 1 - std::exp(-scene.seconds / kOverlayFadeSeconds);
  for (std::size_t i = 0; i < surface.coarse_vertex_count(); ++i) {
    Tint wanted;
    if (i < scene.holds.size() && scene.holds[i].owner != kNoHolder)
      wanted = tint_of(colour_of_slot(scene.holds[i].owner)) *
               (scene.holds[i].is_firm ? kFirmHoldStrength : kTouchStrength);
    else if (scene.shows_regions && i < scene.regions.size() && scene.regions[i] != 0)
      wanted = tint_of(colour_of_region(scene.regions[i])) * kOverlayStrength;
    tints[i] = i < tinted ? tints[i] * (1 - share) + wanted * share : wanted;
  }
  tinted = surface.coarse_vertex_count();
  surface.extend_values(tints);
}

void SceneRenderer::Parts::upload_organ(const SceneView& scene) {
  surface.update(scene.positions);
  fade_tints(scene);
  film.spread(surface, scene.blood, static_cast<float>(wire::kBloodLevelMetres));
  for (std::size_t i = 0; i < vertices.size(); ++i)
    vertices[i] = organ_vertex(surface.positions()[i], surface.normals()[i], tints[i],
                               surface.lips()[i], film.depths()[i]);
  glBindBuffer(GL_ARRAY_BUFFER, organ_array.buffer);
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(vertices.size() * sizeof(OrganVertex)),
               vertices.data(), GL_STREAM_DRAW);
  const std::size_t coarse = surface.coarse_vertex_count();
  fine.upload(scene.positions, std::span(tints).first(coarse),
              std::span(film.depths()).first(coarse));
}

void SceneRenderer::Parts::set_lights(const Shader& shader, const OrbitCamera& camera) const {
  const device::ViewRays view = camera.rays(size);
  shader.set("clip_from_world", camera.clip_from_world(size));
  shader.set("eye", view.eye);
  const auto direction = [&](float right, float up, float back) {
    return normalized(view.right * right + view.up * up - view.forward * back, Vec3f{0, 1, 0});
  };
  const bool is_scope = camera.lens() && camera.lens()->is_endoscope;
  shader.set("key_direction",
             is_scope ? direction(0.05f, 0.12f, 1) : direction(0.42f, 0.88f, 0.55f));
  shader.set("fill_direction", direction(-0.9f, 0.15f, 0.35f));
  shader.set("lamp", is_scope ? kScopeLampMetres : 0.0f);
}

void SceneRenderer::Parts::light_organ(const Shader& shader, const SceneView& scene,
                                       const OrbitCamera& camera) const {
  set_lights(shader, camera);
  const float middle = length(camera.centre() - camera.rays(size).eye);
  if (camera.lens() && camera.lens()->is_endoscope)
    shader.set("haze", kScopeHazeFreeMetres, kScopeHazePerMetre);
  else
    shader.set("haze", middle, kHazePerMiddle / middle);
  std::vector<float> tips, shafts;
  const int shadow_count = std::min(kMaxShadows, static_cast<int>(scene.tools.size()));
  for (int i = 0; i < shadow_count; ++i) {
    const SceneTool& caster = scene.tools[static_cast<std::size_t>(i)];
    const Vec3f p = caster.world_from_tool.position;
    const Vec3f a = rotate(caster.world_from_tool.orientation, {0, 0, 1});
    // A flat tool's shadow is that of a rod of about its width.
    const float width = caster.shape.radius_m + 0.5f * caster.shape.half_width_m;
    tips.insert(tips.end(), {p.x, p.y, p.z, width});
    shafts.insert(shafts.end(), {a.x, a.y, a.z, caster.shape.length_m});
  }
  shader.set("shadow_count", shadow_count);
  shader.set_array("shadow_tip", tips.data(), shadow_count);
  shader.set_array("shadow_shaft", shafts.data(), shadow_count);
}

void SceneRenderer::Parts::draw_triangles(std::size_t first, std::size_t end) const {
  glBindVertexArray(organ_array.array);
  glDrawElements(GL_TRIANGLES, static_cast<GLsizei>((end - first) * 3), GL_UNSIGNED_INT,
                 offset(first * sizeof(TriangleCorners)));
}

void SceneRenderer::Parts::draw_organ(const SceneView& scene, const OrbitCamera& camera,
                                      Detail detail) {
  if (scene.positions.empty() || scene.positions.size() != surface.coarse_vertex_count()) return;
  upload_organ(scene);
  const std::size_t outside = surface.outer_triangle_count(), all = surface.triangles().size();
  glEnable(GL_CULL_FACE);
  const Shader& outer = organ.use(Side::Outside, detail);
  light_organ(outer, scene, camera);
  // The fine surface takes the place of the outside.
  if (fine.is_shown()) {
    outer.set("has_picture", fine.picture() != 0 ? 1 : 0);
    glActiveTexture(GL_TEXTURE1);
    glBindTexture(GL_TEXTURE_2D, fine.picture());
    glActiveTexture(GL_TEXTURE0);
    fine.draw();
  } else {
    draw_triangles(0, outside);
  }
  if (all > outside) {
    light_organ(organ.use(Side::Inside, detail), scene, camera);
    draw_triangles(outside, all);
  }
  // Through gaps one sees backs, which the depth test hides everywhere else.
  organ.backs().use();
  set_lights(organ.backs(), camera);
  glCullFace(GL_FRONT);
  draw_triangles(fine.is_shown() ? outside : 0, all);
  glCullFace(GL_BACK);
  glDisable(GL_CULL_FACE);
}

void SceneRenderer::Parts::draw_mesh(std::span<const MeshVertex> mesh,
                                     const Matrix4& world_from_model, float glow, float dim) {
  tool.set("world_from_model", world_from_model);
  tool.set("glow", glow);
  tool.set("dim", dim);
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(mesh.size() * sizeof(MeshVertex)),
               mesh.data(), GL_STREAM_DRAW);
  glDrawArrays(GL_TRIANGLES, 0, static_cast<GLsizei>(mesh.size()));
}

void SceneRenderer::Parts::draw_tool(const SceneTool& shown, float seconds) {
  const Colour colour = colour_of_slot(shown.slot.owner().value);
  const Matrix4 world = matrix_of(shown.world_from_tool);
  const float dim = shown.is_silent ? 0.45f : 1.0f;
  const InstrumentMesh mesh = make_instrument(shown.shape, colour);
  draw_mesh(mesh.body, world, 0, dim);
  const JawMotion motion = jaw_motion(shown.shape.form, shown.verb, shown.has_claim);
  float& opening = jaw_openings[shown.slot.value % kMaxTools];
  opening += (motion.opening - opening) * (1 - std::exp(-seconds / motion.seconds));
  if (mesh.jaw.empty()) return;
  for (const bool is_lower : {false, true})
    draw_mesh(mesh.jaw, multiply(world, jaw_matrix(mesh.hinge_m, opening, is_lower)), 0, dim);
}

void SceneRenderer::Parts::draw_through(const MeshVertices& mesh, const Matrix4& world_from_model,
                                        float faint, float dim) {
  glDepthFunc(GL_ALWAYS);
  glEnable(GL_BLEND);
  glBlendColor(0, 0, 0, faint);
  glBlendFunc(GL_CONSTANT_ALPHA, GL_ONE_MINUS_CONSTANT_ALPHA);
  glEnable(GL_CULL_FACE);
  glDepthMask(GL_FALSE);
  draw_mesh(mesh, world_from_model, 1, dim);
  glDepthMask(GL_TRUE);
  glDisable(GL_CULL_FACE);
  glDisable(GL_BLEND);
  glDepthFunc(GL_LESS);
  draw_mesh(mesh, world_from_model, 0.55f, dim);
}

void SceneRenderer::Parts::draw_ghost(const SceneTool& shown) {
  const Vec3f tip = shown.world_from_tool.position;
  const Vec3f to_hand = shown.hand_position - tip;
  const float apart = length(to_hand);
  if (!(apart > kGhostMetres)) return;
  const Pose pose{tip, rotation_from_z(to_hand * (1 / apart))};
  const Colour colour = colour_of_slot(shown.slot.owner().value);
  draw_through(make_ghost(apart, colour), matrix_of(pose), 0.45f, 0.8f);
}

void SceneRenderer::Parts::draw_arrow(const SceneTool& shown) {
  const Vec3f tip = shown.world_from_tool.position;
  const auto end = arrow_end(tip, shown.force_n);
  if (!end) return;
  const Vec3f along = *end - tip;
  const Pose pose{tip, rotation_from_z(normalized(along, Vec3f{0, 0, 1}))};
  const Colour colour = colour_of_slot(shown.slot.owner().value);
  draw_through(make_arrow(length(along), 0.0016f, colour), matrix_of(pose), 0.35f, 1);
}

// It comes from above the place and from before it, as the viewer sees it.
void SceneRenderer::Parts::draw_pointer(const ScenePointer& shown, const OrbitCamera& camera) {
  constexpr float kLength = 0.035f, kRadius = 0.0022f;
  const device::ViewRays view = camera.rays(size);
  const Vec3f along = normalized(view.forward * 0.45f - view.up, Vec3f{0, -1, 0});
  const Pose pose{shown.position - along * kLength, rotation_from_z(along)};
  draw_through(make_arrow(kLength, kRadius, shown.colour), matrix_of(pose), 0.6f, 1);
}

void SceneRenderer::Parts::draw_tools(const SceneView& scene, const OrbitCamera& camera) {
  tool.use();
  set_lights(tool, camera);
  glBindVertexArray(tool_array.array);
  glBindBuffer(GL_ARRAY_BUFFER, tool_array.buffer);
  for (const SceneTool& shown : scene.tools) draw_tool(shown, scene.seconds);
  if (!scene.threads.empty()) draw_mesh(scene.threads, matrix_of(Pose{}), 0, 1);
  for (const SceneTool& shown : scene.tools) draw_ghost(shown);
  if (!scene.drawing.empty()) draw_mesh(scene.drawing, matrix_of(Pose{}), kDrawingGlow, 1);
  for (const ScenePointer& shown : scene.pointers) draw_pointer(shown, camera);
  if (!scene.shows_arrows) return;
  for (const SceneTool& shown : scene.tools) draw_arrow(shown);
}

SceneRenderer::SceneRenderer(const GlContext& context)
    : context_(context), parts_(std::make_unique<Parts>(context)) {}

SceneRenderer::~SceneRenderer() = default;

// The cloth lies where the organ was lowest before anybody touched it.
void SceneRenderer::Parts::measure_organ(std::span<const Vec3f> rest_positions) {
  if (rest_positions.empty()) return;
  Vec3f low = rest_positions.front(), high = low;
  for (const Vec3f& p : rest_positions) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  const Vec3f centre = (low + high) * 0.5f, extent = high - low;
  organ_centre = {centre.x, low.y - 0.1f * extent.y, centre.z};
  organ_size = extent * 0.5f;
}

void SceneRenderer::Parts::draw_field(const OrbitCamera& camera) {
  const device::ViewRays view = camera.rays(size);
  field.use();
  set_lights(field, camera);
  field.set("forward", view.forward);
  field.set("right", view.right * (view.tan_half_height * view.width / view.height));
  field.set("up", view.up * view.tan_half_height);
  field.set("organ_centre", organ_centre);
  field.set("organ_size", organ_size);
  glBindVertexArray(field_array.array);
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

void SceneRenderer::Parts::draw_scope_mask() {
  scope_mask.use();
  scope_mask.set("forward", Vec3f{});
  scope_mask.set("right", Vec3f{1, 0, 0});
  scope_mask.set("up", Vec3f{0, 1, 0});
  scope_mask.set("aspect", static_cast<float>(size.width) / static_cast<float>(size.height));
  glEnable(GL_BLEND);
  glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
  glBindVertexArray(field_array.array);
  glDrawArrays(GL_TRIANGLES, 0, 3);
  glDisable(GL_BLEND);
}

void SceneRenderer::Parts::draw_backdrop(const OrbitCamera& camera) {
  const Matrix4 view = camera.clip_from_world(size);
  const bool is_new = backdrop.resize(size);
  const std::array place{organ_centre, organ_size};
  if (!is_new && view == backdrop_view && backdrop_organ == place) return;
  backdrop_view = view;
  backdrop_organ = place;
  glBindFramebuffer(GL_FRAMEBUFFER, backdrop.framebuffer);
  draw_field(camera);
}

void SceneRenderer::draw(const SceneView& scene, const OrbitCamera& camera, const Region& region,
                         Quality quality) {
  Parts& parts = *parts_;
  if (region.size.width <= 0 || region.size.height <= 0) return;  // minimised
  const bool is_sharp = quality == Quality::Best || !parts.is_software;
  parts.size = is_sharp ? region.size : scaled(region.size, fineness_);
  const auto [width, height] = parts.size;
  glDisable(GL_BLEND);
  glDisable(GL_SCISSOR_TEST);
  glDisable(GL_DEPTH_TEST);
  glViewport(0, 0, width, height);
  if (scene.topology_version != parts.topology_version) parts.load_topology(scene);
  parts.fine.follow(scene.fine_surface, {scene.rest_positions, scene.triangles, scene.is_wound},
                    scene.topology_version);
  Target& target = is_sharp ? parts.sharp : parts.plain;
  target.resize(parts.size);
  if (is_sharp) {
    glBindFramebuffer(GL_FRAMEBUFFER, target.framebuffer);
    parts.draw_field(camera);
  } else {
    parts.draw_backdrop(camera);
    blit(parts.backdrop.framebuffer, target.framebuffer, parts.size, {0, 0, parts.size});
    glBindFramebuffer(GL_FRAMEBUFFER, target.framebuffer);
  }
  glClear(GL_DEPTH_BUFFER_BIT);
  glEnable(GL_MULTISAMPLE);
  glEnable(GL_DEPTH_TEST);
  const bool is_near =
      camera.lens() || length(camera.centre() - camera.rays(parts.size).eye) < kNearMetres;
  parts.draw_organ(scene, camera,
                   is_sharp  ? Detail::Fine
                   : is_near ? Detail::PlainNear
                             : Detail::Plain);
  parts.draw_tools(scene, camera);
  glDisable(GL_DEPTH_TEST);
  if (camera.lens() && camera.lens()->is_endoscope) parts.draw_scope_mask();
  glBindVertexArray(0);
  blit(target.framebuffer, context_.framebuffer(), parts.size, region);
  glBindFramebuffer(GL_FRAMEBUFFER, context_.framebuffer());
}

std::string SceneRenderer::description() const {
  return parts_->renderer_name + ", " +
         std::to_string(parts_->is_software ? 0 : parts_->sharp.samples) + " samples, " +
         std::to_string(parts_->surface.triangles().size()) + " triangles" +
         (parts_->fine.is_shown() ? ", fine " + std::to_string(parts_->fine.triangle_count()) : "");
}

}  // namespace trocar::render
