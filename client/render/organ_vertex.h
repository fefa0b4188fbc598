#pragma once

// Vertices of the organ as its shader takes them (shader_sources.h), and what is put into them.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "client/render/gl.h"
#include "client/shape/blood_film.h"
#include "common/math/vec3.h"

namespace trocar::render {

// A colour over the tissue, weighted by its opacity `a`; 0 to 1.
struct Tint {
  float r = 0, g = 0, b = 0, a = 0;
  Tint operator+(const Tint& o) const { return {r + o.r, g + o.g, b + o.b, a + o.a}; }
  Tint operator*(float s) const { return {r * s, g * s, b * s, a * s}; }
  bool operator==(const Tint&) const = default;
};

struct OrganVertex {
  Vec3f position, normal;  // m; of unit length
  std::array<std::uint8_t, 4> tint;
  std::array<std::int8_t, 4> lip;  // shape::lip_bytes
};

inline OrganVertex organ_vertex(const Vec3f& position, const Vec3f& normal, const Tint& tint,
                                const Vec3f& lip, float blood_m) {
  const auto byte = [](float v) {
    return static_cast<std::uint8_t>(std::clamp(v, 0.0f, 1.0f) * 255);
  };
  const float whole = tint.a > 1e-3f ? 1 / tint.a : 0.0f;
  return {position,
          normal,
          {byte(tint.r * whole), byte(tint.g * whole), byte(tint.b * whole), byte(tint.a)},
          shape::lip_bytes(lip, blood_m)};
}

// Describes the bound buffer of OrganVertex to the bound vertex array.
inline void describe_organ_vertices() {
  constexpr GLsizei kStride = sizeof(OrganVertex);
  const auto at = [](std::size_t bytes) { return reinterpret_cast<const void*>(bytes); };
  glVertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, kStride, at(0));
  glVertexAttribPointer(1, 3, GL_FLOAT, GL_FALSE, kStride, at(offsetof(OrganVertex, normal)));
  glVertexAttribPointer(2, 4, GL_UNSIGNED_BYTE, GL_TRUE, kStride, at(offsetof(OrganVertex, tint)));
  glVertexAttribPointer(4, 4, GL_BYTE, GL_TRUE, kStride, at(offsetof(OrganVertex, lip)));
  for (const GLuint i : {0u, 1u, 2u, 4u}) glEnableVertexAttribArray(i);
}

}  // namespace trocar::render
