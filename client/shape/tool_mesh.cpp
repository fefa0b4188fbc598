#include "client/shape/tool_mesh.h"

#include <algorithm>
#include <cmath>

#include "client/shape/revolved.h"

namespace trocar::shape {

Colour colour_of_slot(int slot) {
  static constexpr std::array<Colour, 16> kColours = {{{64, 186, 255},
                                                       {255, 136, 26},
                                                       {112, 224, 112},
                                                       {232, 116, 236},
                                                       {255, 112, 98},
                                                       {74, 226, 206},
                                                       {240, 226, 84},
                                                       {150, 140, 255},
                                                       {255, 150, 190},
                                                       {170, 220, 60},
                                                       {60, 140, 230},
                                                       {230, 130, 40},
                                                       {120, 200, 160},
                                                       {200, 90, 160},
                                                       {200, 200, 210},
                                                       {190, 150, 110}}};
  return kColours[static_cast<std::size_t>(slot) % kColours.size()];
}

Colour colour_of_pointer(int slot) {
  static constexpr std::array<Colour, 4> kColours = {
      {{255, 255, 255}, {255, 240, 120}, {150, 255, 220}, {255, 190, 240}}};
  return kColours[static_cast<std::size_t>(slot) % kColours.size()];
}

Colour colour_of_region(int region) {
  static constexpr std::array<Colour, 6> kColours = {{{0, 205, 255},
                                                      {255, 170, 20},
                                                      {120, 110, 255},
                                                      {255, 70, 200},
                                                      {120, 255, 60},
                                                      {255, 255, 120}}};
  return kColours[static_cast<std::size_t>(std::max(region - 1, 0)) % kColours.size()];
}

float jaw_length(const tool::ToolShape& shape) {
  return shape.radius_m * 4.2f;
}

MeshVertices make_shaft(const tool::ToolShape& shape, Colour colour) {
  const float r = shape.radius_m, hinge = jaw_length(shape);
  const float end = std::max(shape.length_m, hinge + 12 * r);
  const float grip = std::max(end - 0.09f, hinge + 9 * r);
  const Material ring = plastic(colour);
  const ProfilePoint profile[] = {{hinge - 0.7f * r, 0, kDarkSteel},
                                  {hinge - 0.7f * r, 0.66f * r, kDarkSteel},
                                  {hinge + 0.6f * r, 0.80f * r, kDarkSteel},
                                  {hinge + 0.8f * r, 0.98f * r, ring},
                                  {hinge + 4.4f * r, 0.98f * r, ring},
                                  {hinge + 4.6f * r, 0.82f * r, kSteel},
                                  {grip, 0.82f * r, kSteel},
                                  {grip + 0.3f * r, 1.3f * r, ring},
                                  {grip + 2.2f * r, 1.5f * r, ring},
                                  {end - r, 1.6f * r, kGrip},
                                  {end, 1.2f * r, kGrip},
                                  {end, 0, kGrip}};
  MeshVertices out;
  revolve(profile, 28, 0, 2 * kPi, out);
  return out;
}

MeshVertices make_jaw(const tool::ToolShape& shape) {
  const float r = shape.radius_m, hinge = jaw_length(shape);
  std::vector<ProfilePoint> profile;
  constexpr int kRings = 8;
  for (int i = 0; i <= kRings; ++i) {  // the nose: a quarter circle around the tip
    const float a = 0.5f * kPi * static_cast<float>(i) / kRings;
    profile.push_back({-r * std::cos(a), r * std::sin(a), kSteel, true});
  }
  profile.push_back({1.9f * r, r, kSteel, true});
  profile.push_back({hinge, 0.74f * r, kSteel});
  MeshVertices out;
  revolve(profile, 14, 0, kPi, out);
  // The gripping face, y = 0, with teeth as bands of light and dark steel.
  const Vec3f down{0, -1, 0};
  for (std::size_t band = 1; band < profile.size(); ++band) {
    const auto& a = profile[band - 1];
    const auto& b = profile[band];
    const Material material = band % 2 == 0 ? kSteel : kDarkSteel;
    const MeshVertex p{{-a.radius, 0, a.z}, down, material}, q{{a.radius, 0, a.z}, down, material};
    const MeshVertex s{{b.radius, 0, b.z}, down, material}, t{{-b.radius, 0, b.z}, down, material};
    out.insert(out.end(), {p, q, s, p, s, t});
  }
  return out;
}

MeshVertices make_blade(const tool::ToolShape& shape, Colour colour) {
  const float r = shape.radius_m, w = shape.half_width_m;
  const float far_end = std::max(shape.length_m - r, r + 1e-4f);
  // Outline of the core with, at each point, its outward direction in the (x, z) plane.
  struct Edge {
    float x, z, nx, nz;
  };
  std::vector<Edge> outline;
  constexpr int kCornerSteps = 6, kRings = 8;
  const std::array<Edge, 4> corners = {
      {{w, r, 1, -1}, {w, far_end, 1, 1}, {-w, far_end, -1, 1}, {-w, r, -1, -1}}};
  for (std::size_t i = 0; i < corners.size(); ++i)
    for (int step = 0; step <= kCornerSteps; ++step) {
      const float angle =
          kPi / 2 *
          (static_cast<float>(i) - 1 + static_cast<float>(step) / static_cast<float>(kCornerSteps));
      outline.push_back({corners[i].x, corners[i].z, std::cos(angle), std::sin(angle)});
    }
  // The rings go around the rim from the lower face to the upper one.
  const auto vertex = [&](const Edge& e, int ring) {
    const float a = kPi * (static_cast<float>(ring) / kRings - 0.5f);
    const Vec3f n{e.nx * std::cos(a), std::sin(a), e.nz * std::cos(a)};
    return MeshVertex{Vec3f{e.x, 0, e.z} + n * r, n, kSteel};
  };
  MeshVertices out;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Edge &a = outline[i], &b = outline[(i + 1) % outline.size()];
    for (int ring = 0; ring < kRings; ++ring) {
      const auto p = vertex(a, ring), q = vertex(a, ring + 1);
      const auto s = vertex(b, ring + 1), t = vertex(b, ring);
      out.insert(out.end(), {p, q, s, p, s, t});
    }
  }
  for (const float side : {-1.0f, 1.0f}) {
    const Vec3f n{0, side, 0};
    const MeshVertex p{{-w, side * r, r}, n, kSteel}, q{{w, side * r, r}, n, kSteel};
    const MeshVertex s{{w, side * r, far_end}, n, kSteel}, t{{-w, side * r, far_end}, n, kSteel};
    if (side > 0)
      out.insert(out.end(), {p, s, q, p, t, s});
    else
      out.insert(out.end(), {p, q, s, p, s, t});
  }
  // Adds a round neck and grip beyond the blade, for the eye only.
  const float neck = std::clamp(0.3f * w, 0.0025f, 0.006f), end = far_end + r;
  const Material ring = plastic(colour);
  const ProfilePoint profile[] = {
      {end - 0.4f * r, 0, kSteel},         {end - 0.4f * r, neck, kSteel},
      {end + 0.010f, 0.7f * neck, kSteel}, {end + 0.012f, 0.9f * neck, ring},
      {end + 0.030f, 0.9f * neck, ring},   {end + 0.032f, 0.7f * neck, kSteel},
      {end + 0.080f, 0.7f * neck, kSteel}, {end + 0.084f, 1.1f * neck, ring},
      {end + 0.150f, 1.2f * neck, kGrip},  {end + 0.150f, 0, kGrip}};
  revolve(profile, 20, 0, 2 * kPi, out);
  return out;
}

MeshVertices make_ghost(float length, Colour colour) {
  constexpr float kThread = 0.0005f, kBall = 0.0022f;
  const Material m = plastic(colour);
  std::vector<ProfilePoint> profile = {{0, 0, m}, {0, kThread, m}, {length, kThread, m}};
  constexpr int kRings = 8;
  for (int i = 0; i <= kRings; ++i) {
    const float a = kPi * (static_cast<float>(i) / kRings - 0.5f);
    profile.push_back({length + kBall * std::sin(a), kBall * std::cos(a), m, true});
  }
  MeshVertices out;
  revolve(profile, 12, 0, 2 * kPi, out);
  return out;
}

MeshVertices make_arrow(float length, float radius, Colour colour) {
  const float head = std::min(length * 0.6f, radius * 5.5f);
  const Material m = plastic(colour);
  const ProfilePoint profile[] = {{0, 0, m},
                                  {0, radius, m},
                                  {length - head, radius, m},
                                  {length - head, radius * 2.5f, m},
                                  {length, 0, m}};
  MeshVertices out;
  revolve(profile, 18, 0, 2 * kPi, out);
  return out;
}

}  // namespace trocar::shape
