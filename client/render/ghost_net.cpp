#include "client/render/ghost_net.h"

#include <cstddef>

#include "client/render/shader_sources.h"
#include "common/base/assert.h"

namespace trocar::render {
namespace {

constexpr float kStrength = 0.55f, kHiddenStrength = 0.10f;

}  // namespace

GhostNet::GhostNet() : shader_(kGhostVertexSource, kGhostFragmentSource) {
  glGenVertexArrays(1, &array_);
  glGenBuffers(1, &vertex_buffer_);
  glGenBuffers(1, &index_buffer_);
  glBindVertexArray(array_);
  glBindBuffer(GL_ARRAY_BUFFER, vertex_buffer_);
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, index_buffer_);
  glVertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, sizeof(Vertex), nullptr);
  glVertexAttribPointer(1, 1, GL_FLOAT, GL_FALSE, sizeof(Vertex),
                        reinterpret_cast<const void*>(offsetof(Vertex, apart_m)));
  glEnableVertexAttribArray(0);
  glEnableVertexAttribArray(1);
  glBindVertexArray(0);
}

GhostNet::~GhostNet() {
  glDeleteBuffers(1, &index_buffer_);
  glDeleteBuffers(1, &vertex_buffer_);
  glDeleteVertexArrays(1, &array_);
}

void GhostNet::draw(std::span<const Vec3f> tissue, std::span<const Vec3f> ghost,
                    std::span<const std::array<std::uint32_t, 3>> triangles,
                    const Matrix4& clip_from_world, const Vec3f& eye) {
  TROCAR_ASSERT(tissue.size() == ghost.size());
  vertices_.clear();
  for (std::size_t i = 0; i < ghost.size(); ++i)
    vertices_.push_back({ghost[i], length(ghost[i] - tissue[i])});
  glBindVertexArray(array_);
  glBindBuffer(GL_ARRAY_BUFFER, vertex_buffer_);
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(vertices_.size() * sizeof(Vertex)),
               vertices_.data(), GL_STREAM_DRAW);
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(triangles.size_bytes()),
               triangles.data(), GL_STREAM_DRAW);
  shader_.use();
  shader_.set("clip_from_world", clip_from_world);
  shader_.set("eye", eye);
  glEnable(GL_BLEND);
  glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
  glEnable(GL_CULL_FACE);
  glDepthMask(GL_FALSE);
  glPolygonMode(GL_FRONT_AND_BACK, GL_LINE);
  for (const bool is_hidden : {true, false}) {
    glDepthFunc(is_hidden ? GL_GREATER : GL_LEQUAL);
    shader_.set("strength", is_hidden ? kHiddenStrength : kStrength);
    glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(3 * triangles.size()), GL_UNSIGNED_INT,
                   nullptr);
  }
  glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
  glDepthFunc(GL_LESS);
  glDepthMask(GL_TRUE);
  glDisable(GL_CULL_FACE);
  glDisable(GL_BLEND);
  glBindVertexArray(0);
}

}  // namespace trocar::render
