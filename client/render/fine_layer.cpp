#include "client/render/fine_layer.h"

#include <algorithm>

#include "client/embedding/fine_shape.h"
#include "common/base/log.h"

namespace trocar::render {
static_assert(wire::kMostFinePictureSide == std::size_t{kMostImageSide});

FineLayer::FineLayer() {
  glGenVertexArrays(1, &array_);
  for (GLuint* buffer : {&buffer_, &rest_buffer_, &index_buffer_}) glGenBuffers(1, buffer);
  glBindVertexArray(array_);
  glBindBuffer(GL_ARRAY_BUFFER, buffer_);
  describe_organ_vertices();
  glBindBuffer(GL_ARRAY_BUFFER, rest_buffer_);
  constexpr GLsizei kStride = sizeof(RestVertex);
  const auto at = [](std::size_t bytes) { return reinterpret_cast<const void*>(bytes); };
  glVertexAttribPointer(3, 4, GL_FLOAT, GL_FALSE, kStride, at(0));
  glVertexAttribPointer(5, 2, GL_FLOAT, GL_FALSE, kStride, at(offsetof(RestVertex, texture)));
  for (const GLuint i : {3u, 5u}) glEnableVertexAttribArray(i);
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, index_buffer_);
  glBindVertexArray(0);
}

FineLayer::~FineLayer() {
  for (GLuint* buffer : {&buffer_, &rest_buffer_, &index_buffer_}) glDeleteBuffers(1, buffer);
  glDeleteVertexArrays(1, &array_);
}

void FineLayer::follow(const std::shared_ptr<const wire::FineSurface>& fine,
                       const embedding::CoarseShape& coarse, std::uint64_t topology_version) {
  const bool is_new = fine != source_;
  if (is_new) {
    source_ = fine;
    surface_.reset();
    picture_.clear();
    if (fine) surface_.emplace(embedding::shape_of(*fine));
    if (fine && !fine->picture.empty())
      if (Status loaded = picture_.load(fine->picture); !loaded.ok())
        log::warn("the organ's picture cannot be shown: {}", loaded.error().message);
  }
  if (!surface_ || (!is_new && topology_version == topology_version_)) return;
  topology_version_ = topology_version;
  surface_->follow(coarse);
  rest_.clear();
  for (const auto& look : surface_->looks()) rest_.push_back({look.rest, look.rim, look.texture});
  glBindBuffer(GL_ARRAY_BUFFER, rest_buffer_);
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(rest_.size() * sizeof(RestVertex)),
               rest_.data(), GL_DYNAMIC_DRAW);
  glBindVertexArray(array_);
  const auto triangles = surface_->triangles();
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(triangles.size_bytes()),
               triangles.data(), GL_DYNAMIC_DRAW);
  glBindVertexArray(0);
}

void FineLayer::upload(std::span<const Vec3f> positions, std::span<const Tint> tints,
                       std::span<const float> blood) {
  if (!surface_) return;
  surface_->update(positions);
  if (surface_->moved_count() == 0 && std::ranges::equal(tints, coarse_tints_) &&
      std::ranges::equal(blood, coarse_blood_))
    return;
  coarse_tints_.assign(tints.begin(), tints.end());
  coarse_blood_.assign(blood.begin(), blood.end());
  surface_->spread(tints, tints_);
  surface_->spread(blood, blood_);
  const auto at = surface_->positions(), normals = surface_->normals();
  vertices_.resize(surface_->vertex_count());
  for (std::size_t i = 0; i < vertices_.size(); ++i)
    vertices_[i] = organ_vertex(at[i], normals[i], tints_[i], normals[i], blood_[i]);
  glBindBuffer(GL_ARRAY_BUFFER, buffer_);
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(vertices_.size() * sizeof(OrganVertex)),
               vertices_.data(), GL_STREAM_DRAW);
}

void FineLayer::draw() const {
  if (!surface_) return;
  glBindVertexArray(array_);
  glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(3 * surface_->triangles().size()),
                 GL_UNSIGNED_INT, nullptr);
}

}  // namespace trocar::render
