// This shows what a wound looks like after a real operation, without drawing it: the triangles at
// its rim must be shaded as one smooth lip.
//
// The bounds are what an eye tells apart: facets that meet at less than 30 degrees pass as one
// round surface, which is also where modelling programs cease to smooth. Within one triangle light
// may turn by a right angle, from a wall to the outside; what turns farther glitters. Normals that
// lean away from their triangle are counted, too: walls of two cuts share them at a fold, and the
// shader leans them back.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>

#include "client/shape/smooth_surface.h"
#include "common/tool/script.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/step/simulation.h"

namespace trocar::shape {
namespace {

constexpr float kAcrossTheRim = 30, kWithinATriangle = 90, kFromTheFace = 90;  // degrees

float degrees_between(const Vec3f& a, const Vec3f& b) {
  return std::acos(std::clamp(dot(a, b), -1.0f, 1.0f)) * 180 / std::numbers::pi_v<float>;
}

// The liver after deploy/scenes/eight-cuts.toml, as a client gets it.
struct CutLiver {
  wire::SurfaceLayout layout;
  std::vector<Vec3f> positions;
  std::vector<TriangleCorners> triangles;
};

CutLiver cut_liver() {
  step::Simulation simulation(*catalogue::make_liver());
  const auto script = tool::parse_script(TROCAR_SOURCE_DIR "/deploy/scenes/eight-cuts.toml");
  EXPECT_TRUE(script.ok());
  const auto& mesh = simulation.organ().mesh;
  std::vector<Vec3f> rest;
  for (const auto& p : mesh.rest_positions) rest.push_back(to_float(p));
  std::vector<tool::SurfaceTriangle> surface;
  for (const auto& [a, b, c] : mesh.boundary_triangles)
    surface.push_back({a.value, b.value, c.value});
  hands::HandJoin join{.slot = {0}, .tool_count = static_cast<int>(script->tools.size())};
  std::vector<tool::AnchorPoint> anchors;
  Tick last = 0;
  for (std::size_t t = 0; t < script->tools.size(); ++t) {
    join.shapes[t] = script->tools[t].shape;
    anchors.push_back(*tool::find_anchor(*script->tools[t].anchor, rest, surface));
    last = std::max(last, static_cast<Tick>(script->tools[t].keys.back().time_s * 1e3));
  }
  CutLiver cut;
  for (Tick tick = 1; tick <= last; ++tick) {
    hands::TickInputs inputs;
    if (tick == 1) inputs.joins.push_back(join);
    for (std::size_t t = 0; t < script->tools.size() && tick % 8 == 1; ++t)
      inputs.samples.push_back(
          {tool_slot({0}, static_cast<int>(t)),
           tool::sample(script->tools[t], static_cast<double>(tick) * 1e-3, anchors[t])});
    simulation.tick(inputs, {});
    if (const auto frame = simulation.pop_frame()) {
      cut.positions.clear();
      for (const auto& q : frame->surface) cut.positions.push_back(wire::to_metres(q));
    }
  }
  cut.layout = simulation.layout();
  cut.positions.resize(cut.layout.vertex_count());
  for (std::size_t i = 0; i < cut.positions.size(); ++i)
    cut.positions[i] += wire::to_metres(cut.layout.rest_quanta[i]);
  for (std::size_t i = 0; i < cut.layout.triangles.size(); ++i) {
    const auto& t = cut.layout.triangles[i];
    cut.triangles.push_back({});
    if (cut.layout.has_triangle(TriangleIndex(i)))
      cut.triangles.back() = {t[0].value, t[1].value, t[2].value};
  }
  return cut;
}

struct Jumps {
  int triangles = 0;  // at the rim
  int across = 0, within = 0, turned = 0;
};

Jumps count_jumps(const SmoothSurface& surface) {
  using Point = std::array<float, 3>;
  const auto point = [&](std::uint32_t v) {
    const Vec3f& p = surface.positions()[v];
    return Point{p.x, p.y, p.z};
  };
  // Vertices of either side at one place; at a closed tip there may be several.
  std::map<Point, std::array<std::vector<std::uint32_t>, 2>> places;
  for (const auto& t : surface.triangles())
    for (const auto v : t) {
      auto& side = places[point(v)][surface.is_wound()[v]];
      if (std::ranges::find(side, v) == side.end()) side.push_back(v);
    }
  Jumps jumps;
  for (const auto& t : surface.triangles()) {
    const auto at = [&](std::size_t k) { return surface.positions()[t[k % 3]]; };
    const auto normal = [&](std::size_t k) { return surface.normals()[t[k % 3]]; };
    const Vec3f face = cross(at(1) - at(0), at(2) - at(0));
    bool is_at_rim = false, across = false, within = false, turned = false;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto& others = places[point(t[k])][1 - surface.is_wound()[t[k]]];
      is_at_rim |= !others.empty();
      float nearest = others.empty() ? 0.0f : 180.0f;
      for (const auto other : others)
        nearest = std::min(nearest, degrees_between(surface.lips()[t[k]], surface.lips()[other]));
      across |= nearest > kAcrossTheRim;
      within |= degrees_between(normal(k), normal(k + 1)) > kWithinATriangle;
      turned |= length(face) > 1e-10f &&
                degrees_between(normal(k), normalized(face * 1e6f, normal(k))) > kFromTheFace;
    }
    if (!is_at_rim) continue;
    ++jumps.triangles;
    jumps.across += across, jumps.within += within, jumps.turned += turned;
  }
  return jumps;
}

TEST(WoundLook, EightCutsHaveSmoothLips) {
  const CutLiver cut = cut_liver();
  ASSERT_GT(std::ranges::count(cut.layout.is_wound, 1), 200);
  SmoothSurface surface;
  for (const std::size_t budget : {std::size_t{24'000}, std::size_t{100'000}}) {
    surface.build(cut.positions.size(), cut.triangles, cut.layout.is_wound, budget);
    surface.update(cut.positions);
    const Jumps jumps = count_jumps(surface);
    std::printf("%zu triangles, %d at the rim: %d jump across it, %d within, %d turned\n",
                surface.triangles().size(), jumps.triangles, jumps.across, jumps.within,
                jumps.turned);
    EXPECT_GT(jumps.triangles, 200);
    EXPECT_EQ(jumps.across, 0);
    EXPECT_EQ(jumps.within, 0);
  }
}

}  // namespace
}  // namespace trocar::shape
