#pragma once

// A surface that a formula gives: y over a square of x and z, seen from above.

#include <cstdint>
#include <vector>

#include "common/wire/surface_layout.h"

namespace trocar::bleeding::testing {

struct HeightField {
  static constexpr std::uint32_t kSide = 21;  // vertices
  static constexpr double kSpacingM = 0.004;

  static std::uint32_t at(std::uint32_t column, std::uint32_t row) { return row * kSide + column; }
  static constexpr std::uint32_t kMiddle = (kSide / 2) * kSide + kSide / 2;

  // height(x, z) in m, x and z from the middle. is_upside_down: it is seen from below.
  template <typename Height>
  explicit HeightField(const Height& height, bool is_upside_down = false) {
    std::vector<Vec3d> rest;
    const double middle = kSpacingM * (kSide / 2);
    for (std::uint32_t row = 0; row < kSide; ++row)
      for (std::uint32_t column = 0; column < kSide; ++column) {
        const double x = kSpacingM * column - middle, z = kSpacingM * row - middle;
        rest.push_back({x, height(x, z), z});
      }
    layout.rest_quanta = wire::quantise_rest(rest);
    const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
      if (is_upside_down) std::swap(b, c);
      layout.triangles.push_back({VertexIndex(a), VertexIndex(b), VertexIndex(c)});
      layout.is_wound.push_back(0);
    };
    for (std::uint32_t row = 0; row + 1 < kSide; ++row)
      for (std::uint32_t column = 0; column + 1 < kSide; ++column) {
        const auto a = at(column, row), b = at(column + 1, row);
        const auto c = at(column, row + 1), d = at(column + 1, row + 1);
        add(a, c, b);
        add(b, c, d);
      }
    layout.triangle_sum = layout.compute_triangle_sum();
    displacements.resize(rest.size());
  }

  wire::SurfaceLayout layout;
  wire::QuantisedSurface displacements;  // zeros
};

}  // namespace trocar::bleeding::testing
