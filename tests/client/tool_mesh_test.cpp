#include "client/shape/instrument_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/tool/instrument.h"

namespace trocar::shape {
namespace {

// How far p is from the surface of the solid that the simulation uses for a blade.
float off_surface(const Vec3f& p, const tool::ToolShape& shape) {
  const Vec3f core{std::clamp(p.x, -shape.half_width_m, shape.half_width_m), 0,
                   std::clamp(p.z, shape.radius_m, shape.length_m - shape.radius_m)};
  return std::abs(length(p - core) - shape.radius_m);
}

TEST(ToolMesh, ABladeIsTheSolidOfTheSimulation) {
  const tool::ToolShape shape{.radius_m = 0.002f, .length_m = 0.07f, .half_width_m = 0.016f};
  const MeshVertices mesh = make_blade(shape, {});
  ASSERT_EQ(mesh.size() % 3, 0u);
  Vec3f low = mesh.front().position, high = low;
  std::size_t on_blade = 0;
  for (std::size_t i = 0; i < mesh.size(); i += 3) {
    const Vec3f a = mesh[i].position, b = mesh[i + 1].position, c = mesh[i + 2].position;
    if (std::max({a.z, b.z, c.z}) > shape.length_m - shape.radius_m + 1e-5f) continue;
    ++on_blade;
    for (const Vec3f& p : {a, b, c}) {
      EXPECT_LT(off_surface(p, shape), 1e-5f);
      low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    }
    const Vec3f face = cross(b - a, c - a);
    if (length(face) > 1e-12f) {
      EXPECT_GT(dot(face, mesh[i].normal), 0) << i;
    }
  }
  EXPECT_GT(on_blade, 20u);
  EXPECT_NEAR(low.z, 0, 1e-6);
  EXPECT_NEAR(high.x, shape.half_width_m + shape.radius_m, 1e-6);
  EXPECT_NEAR(low.x, -high.x, 1e-6);
  EXPECT_NEAR(high.y, shape.radius_m, 1e-6);
}

TEST(ToolMesh, EachInstrumentHasItsFacesOutside) {
  for (const auto& instrument : tool::instruments()) {
    const auto mesh = make_instrument(instrument.shape, {});
    ASSERT_FALSE(mesh.body.empty()) << instrument.name;
    for (const auto* part : {&mesh.body, &mesh.jaw}) {
      ASSERT_EQ(part->size() % 3, 0u);
      for (std::size_t i = 0; i < part->size(); i += 3) {
        const auto* const v = &(*part)[i];
        const Vec3f face = cross(v[1].position - v[0].position, v[2].position - v[0].position);
        if (length(face) < 1e-12f) continue;
        EXPECT_GT(dot(face, v[0].normal + v[1].normal + v[2].normal), 0)
            << instrument.name << ", triangle " << i / 3;
      }
    }
  }
}

TEST(ToolMesh, WhatCutsIsWhereTheSimulationHasIt) {
  const auto extent = [](const MeshVertices& mesh, float Vec3f::*axis) {
    float most = -1;
    for (const auto& vertex : mesh) most = std::max(most, vertex.position.*axis);
    return most;
  };
  const auto& hook = tool::find_instrument("hook")->shape;
  EXPECT_NEAR(extent(make_instrument(hook, {}).body, &Vec3f::y), hook.edge_m, 0.002f);
  const auto scissors = make_instrument(tool::find_instrument("scissors")->shape, {});
  EXPECT_FLOAT_EQ(scissors.hinge_m, 0.02f);
  EXPECT_EQ(jaw_motion(tool::Form::Scissors, tool::Verb::Cut, true).opening, 0);
  // Each blade is turned by so much: its tip is a quarter of its length from the axis.
  EXPECT_NEAR(std::tan(jaw_motion(tool::Form::Scissors, tool::Verb::None, false).opening), 0.25f,
              0.001f);
}

TEST(ToolMesh, AGhostReachesFromTheToolToTheHand) {
  const MeshVertices mesh = make_ghost(0.03f, {});
  const auto [first, last] =
      std::ranges::minmax(mesh, {}, [](const MeshVertex& vertex) { return vertex.position.z; });
  EXPECT_NEAR(first.position.z, 0, 1e-6);
  EXPECT_GT(last.position.z, 0.03f);
  EXPECT_LT(last.position.z, 0.04f);
}

}  // namespace
}  // namespace trocar::shape
