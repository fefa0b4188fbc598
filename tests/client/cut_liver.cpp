#include "tests/client/cut_liver.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "common/tool/script.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/step/simulation.h"

namespace trocar::testing {
void operate_on_liver(const Visit& visit) {
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
  for (Tick tick = 1; tick <= last; ++tick) {
    hands::TickInputs inputs;
    if (tick == 1) inputs.joins.push_back(join);
    for (std::size_t t = 0; t < script->tools.size() && tick % 8 == 1; ++t)
      inputs.samples.push_back(
          {tool_slot({0}, static_cast<int>(t)),
           tool::sample(script->tools[t], static_cast<double>(tick) * 1e-3, anchors[t])});
    simulation.tick(inputs, {});
    if (const auto frame = simulation.pop_frame()) visit(simulation.layout(), *frame);
  }
}

namespace {

CutLiver make_cut_liver() {
  CutLiver cut;
  operate_on_liver([&](const wire::SurfaceLayout& layout, const step::PublishedFrame& frame) {
    cut.layout = layout;
    cut.positions.clear();
    for (const auto& q : frame.surface) cut.positions.push_back(wire::to_metres(q));
  });
  cut.positions.resize(cut.layout.vertex_count());
  for (std::size_t i = 0; i < cut.positions.size(); ++i) {
    cut.rest.push_back(wire::to_metres(cut.layout.rest_quanta[i]));
    cut.positions[i] += cut.rest[i];
  }
  for (std::size_t i = 0; i < cut.layout.triangles.size(); ++i) {
    const auto& t = cut.layout.triangles[i];
    cut.triangles.push_back({});
    if (cut.layout.has_triangle(TriangleIndex(i)))
      cut.triangles.back() = {t[0].value, t[1].value, t[2].value};
  }
  return cut;
}

}  // namespace

const CutLiver& cut_liver() {
  static const CutLiver kCut = make_cut_liver();
  return kCut;
}

}  // namespace trocar::testing
