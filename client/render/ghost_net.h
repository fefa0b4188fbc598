#pragma once

// Another solution of the surface, as a net over it: blue where it is where the tissue is, yellow
// at 0.25 mm from it, red from 1 mm on. Faint where tissue hides it. Needs a current context for
// its whole life. Thread: render thread.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "client/render/camera.h"
#include "client/render/gl.h"
#include "client/render/shader.h"

namespace trocar::render {

class GhostNet {
 public:
  GhostNet();
  ~GhostNet();
  GhostNet(const GhostNet&) = delete;
  GhostNet& operator=(const GhostNet&) = delete;

  // tissue, ghost: m, as many.
  void draw(std::span<const Vec3f> tissue, std::span<const Vec3f> ghost,
            std::span<const std::array<std::uint32_t, 3>> triangles, const Matrix4& clip_from_world,
            const Vec3f& eye);

 private:
  struct Vertex {
    Vec3f position;
    float apart_m = 0;
  };

  Shader shader_;
  GLuint array_ = 0, vertex_buffer_ = 0, index_buffer_ = 0;
  std::vector<Vertex> vertices_;
};

}  // namespace trocar::render
