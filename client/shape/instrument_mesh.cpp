#include "client/shape/instrument_mesh.h"

#include "client/shape/revolved.h"

namespace trocar::shape {
namespace {

struct PlatePoint {
  float y, z;
};

// A plate in the yz plane; the outline is convex, and goes round as y turns towards z.
void add_plate(std::span<const PlatePoint> outline, float half_thickness, const Material& material,
               MeshVertices& out) {
  const auto at = [&](const PlatePoint& p, float side) {
    return Vec3f{side * half_thickness, p.y, p.z};
  };
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const PlatePoint &p = outline[i], &q = outline[(i + 1) % outline.size()];
    const Vec3f out_of = normalized(Vec3f{0, q.z - p.z, p.y - q.y}, {0, 1, 0});
    const auto vertex = [&](const Vec3f& place, const Vec3f& normal) {
      return MeshVertex{place, normal, material};
    };
    const auto a = vertex(at(p, -1), out_of), b = vertex(at(p, 1), out_of);
    const auto c = vertex(at(q, 1), out_of), d = vertex(at(q, -1), out_of);
    out.insert(out.end(), {a, d, c, a, c, b});
    if (i == 0 || i + 1 == outline.size()) continue;
    for (const float side : {1.0f, -1.0f}) {
      const Vec3f normal{side, 0, 0};
      const auto first = vertex(at(outline[0], side), normal);
      const auto second = vertex(at(side > 0 ? p : q, side), normal);
      const auto third = vertex(at(side > 0 ? q : p, side), normal);
      out.insert(out.end(), {first, second, third});
    }
  }
}

// A shaft of the tool's width from `from_m` on, with a ring in the holder's colour and a grip.
void add_shaft(const tool::ToolShape& shape, float from_m, float radius_m, Colour colour,
               MeshVertices& out) {
  const float r = radius_m;
  const float end = std::max(shape.length_m, from_m + 16 * r);
  const float grip = std::max(end - 0.09f, from_m + 12 * r);
  const Material ring = plastic(colour);
  const ProfilePoint profile[] = {{from_m, 0, kDarkSteel},
                                  {from_m, 0.8f * r, kDarkSteel},
                                  {from_m + 1.5f * r, r, kDarkSteel},
                                  {from_m + 5.5f * r, r, ring},
                                  {from_m + 5.7f * r, 0.85f * r, kSteel},
                                  {grip, 0.85f * r, kSteel},
                                  {grip + 0.3f * r, 1.4f * r, ring},
                                  {grip + 2.2f * r, 1.7f * r, ring},
                                  {end - r, 1.8f * r, kGrip},
                                  {end, 1.3f * r, kGrip},
                                  {end, 0, kGrip}};
  revolve(profile, 24, 0, 2 * kPi, out);
}

// A tip of a revolved profile, on a shaft from there on.
InstrumentMesh revolved(std::span<const ProfilePoint> profile, const tool::ToolShape& shape,
                        float shaft_from_m, float shaft_radius_m, Colour colour) {
  InstrumentMesh mesh;
  revolve(profile, 24, 0, 2 * kPi, mesh.body);
  add_shaft(shape, shaft_from_m, shaft_radius_m, colour, mesh.body);
  return mesh;
}

InstrumentMesh make_probe(const tool::ToolShape& shape, Colour colour) {
  const float r = shape.radius_m;
  std::vector<ProfilePoint> profile;
  constexpr int kRings = 14;
  for (int i = 0; i <= kRings; ++i) {
    const float a = 0.85f * kPi * static_cast<float>(i) / kRings;
    profile.push_back({-r * std::cos(a), r * std::sin(a), kSteel, true});
  }
  const float neck = profile.back().radius;
  profile.push_back({4 * r, neck, kSteel});
  return revolved(profile, shape, 4 * r, std::max(0.7f * r, neck), colour);
}

InstrumentMesh make_scissors(const tool::ToolShape& shape, Colour colour) {
  const float r = shape.radius_m, length = shape.edge_m;
  InstrumentMesh mesh{.body = {}, .jaw = {}, .hinge_m = length};
  const std::array<PlatePoint, 6> blade{{{0, 0},
                                         {0.35f * r, 0.02f * length},
                                         {0.8f * r, 0.35f * length},
                                         {1.1f * r, length},
                                         {0.5f * r, length + 1.6f * r},
                                         {0, length}}};
  add_plate(blade, 0.35f * r, kSteel, mesh.jaw);
  add_shaft(shape, length - 0.5f * r, 1.25f * r, colour, mesh.body);
  return mesh;
}

// The edge is on the axis; the blade's back is behind it.
InstrumentMesh make_scalpel(const tool::ToolShape& shape, Colour colour) {
  const float length = shape.edge_m, back = std::min(0.3f * length, 0.007f);
  InstrumentMesh mesh;
  const std::array<PlatePoint, 5> blade{{{0, 0},
                                         {0.55f * back, 0.1f * length},
                                         {back, 0.4f * length},
                                         {back, 1.3f * length},
                                         {0, length}}};
  add_plate(blade, 0.0004f, kSteel, mesh.body);
  add_shaft(shape, 1.1f * length, 0.5f * back, colour, mesh.body);
  return mesh;
}

// A wire that bends from the shaft to the side, into the energised edge.
InstrumentMesh make_hook(const tool::ToolShape& shape, Colour colour) {
  const float r = shape.radius_m, wire = 0.35f * r, foot = shape.edge_m;
  const float from = std::max(4 * r, 1.2f * foot);
  InstrumentMesh mesh;
  const ProfilePoint stem[] = {{-wire, 0, kSteel}, {-wire, wire, kSteel}, {from, wire, kSteel}};
  revolve(stem, 12, 0, 2 * kPi, mesh.body);
  constexpr Material kHot = {224, 150, 84, 200};
  const ProfilePoint side[] = {{0, wire, kHot}, {foot, wire, kHot}, {foot, 0, kHot}};
  MeshVertices along;
  revolve(side, 12, 0, 2 * kPi, along);
  for (auto& vertex : along)
    for (Vec3f* const v : {&vertex.position, &vertex.normal}) *v = {v->x, v->z, -v->y};
  mesh.body.insert(mesh.body.end(), along.begin(), along.end());
  add_shaft(shape, from, r, colour, mesh.body);
  return mesh;
}

// A tube with glass in its end, around it the ring that the light comes from.
InstrumentMesh make_endoscope(const tool::ToolShape& shape, Colour colour) {
  const float r = shape.radius_m;
  constexpr Material kGlass = {18, 22, 40, 120}, kLight = {250, 246, 224, 0};
  const ProfilePoint front[] = {{-r, 0, kGlass},         {-r, 0.55f * r, kGlass},
                                {-r, 0.55f * r, kLight}, {-r, 0.85f * r, kLight},
                                {-r, 0.85f * r, kSteel}, {-0.9f * r, r, kSteel},
                                {0.5f * r, r, kSteel}};
  return revolved(front, shape, 0.4f * r, r, colour);
}

// A tube whose end is open, with holes around it.
InstrumentMesh make_suction(const tool::ToolShape& shape, Colour colour) {
  const float r = shape.radius_m;
  constexpr Material kHole = {14, 10, 12, 0};
  const ProfilePoint front[] = {{3 * r, 0, kHole},
                                {-0.6f * r, 0.62f * r, kHole},
                                {-r, 0.72f * r, kSteel},
                                {-0.9f * r, r, kSteel},
                                {0.2f * r, r, kSteel},
                                {0.2f * r, 0.97f * r, kHole},
                                {0.7f * r, 0.97f * r, kHole},
                                {0.7f * r, r, kSteel},
                                {1.6f * r, r, kSteel},
                                {1.6f * r, 0.97f * r, kHole},
                                {2.1f * r, 0.97f * r, kHole},
                                {2.1f * r, r, kSteel},
                                {4 * r, r, kSteel}};
  return revolved(front, shape, 3.9f * r, r, colour);
}

// A hot ball sits on a thin neck.
InstrumentMesh make_coagulator(const tool::ToolShape& shape, Colour colour) {
  const float r = shape.radius_m;
  constexpr Material kHot = {224, 150, 84, 200};
  std::vector<ProfilePoint> profile;
  constexpr int kRings = 12;
  for (int i = 0; i <= kRings; ++i) {
    const float a = 0.9f * kPi * static_cast<float>(i) / kRings;
    profile.push_back({-r * std::cos(a), r * std::sin(a), kHot, true});
  }
  profile.push_back({3 * r, 0.35f * r, kSteel});
  return revolved(profile, shape, 3 * r, 0.8f * r, colour);
}

}  // namespace

InstrumentMesh make_instrument(const tool::ToolShape& shape, Colour colour) {
  switch (shape.form) {
    case tool::Form::Probe:
      return make_probe(shape, colour);
    case tool::Form::Scissors:
      return make_scissors(shape, colour);
    case tool::Form::Scalpel:
      return make_scalpel(shape, colour);
    case tool::Form::Hook:
      return make_hook(shape, colour);
    case tool::Form::Endoscope:
    case tool::Form::Endoscope30:
      return make_endoscope(shape, colour);
    case tool::Form::Suction:
      return make_suction(shape, colour);
    case tool::Form::Coagulator:
      return make_coagulator(shape, colour);
    default:
      break;
  }
  if (shape.half_width_m > 0) return {.body = make_blade(shape, colour), .jaw = {}};
  return {.body = make_shaft(shape, colour), .jaw = make_jaw(shape), .hinge_m = jaw_length(shape)};
}

JawMotion jaw_motion(tool::Form form, tool::Verb verb, bool has_claim) {
  constexpr float kOpenJaws = 0.34f, kHoldingJaws = 0.12f, kOpenScissors = 0.245f;
  if (form == tool::Form::Scissors)
    return verb == tool::Verb::Cut ? JawMotion{0, 0.12f} : JawMotion{kOpenScissors, 0.06f};
  if (verb != tool::Verb::Grasp) return {};
  return {has_claim ? kHoldingJaws : kOpenJaws};
}

}  // namespace trocar::shape
