#pragma once

// The fine surface of an organ on the graphics card: it takes the place of the outside of the
// coarse one (client/embedding). Needs a current OpenGL context for its whole life. Thread: render
// thread.

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "client/embedding/embedded_surface.h"
#include "client/render/image_texture.h"
#include "client/render/organ_vertex.h"
#include "common/wire/fine_surface.h"

namespace trocar::render {

class FineLayer {
 public:
  FineLayer();
  ~FineLayer();
  FineLayer(const FineLayer&) = delete;
  FineLayer& operator=(const FineLayer&) = delete;

  // Takes over the fine surface and the coarse one as they are; a null pointer: there is none.
  // Nothing is done if neither has changed since the last call.
  void follow(const std::shared_ptr<const wire::FineSurface>& fine,
              const embedding::CoarseShape& coarse, std::uint64_t topology_version);
  bool is_shown() const { return surface_.has_value(); }
  // Moves it with the coarse vertices, m; tints and depths of blood, m, are theirs. Nothing goes to
  // the card if all are as they were.
  void upload(std::span<const Vec3f> positions, std::span<const Tint> tints,
              std::span<const float> blood);
  unsigned picture() const { return picture_.name(); }  // 0: it has none
  // With the organ's shader in use.
  void draw() const;
  std::size_t triangle_count() const { return surface_ ? surface_->triangles().size() : 0; }

 private:
  // Does not move; the layout is the shader's.
  struct RestVertex {
    Vec3f position;
    float rim = 0;
    std::array<float, 2> texture{};
  };

  std::shared_ptr<const wire::FineSurface> source_;
  std::uint64_t topology_version_ = 0;
  std::optional<embedding::EmbeddedSurface> surface_;
  ImageTexture picture_;
  std::vector<RestVertex> rest_;
  std::vector<OrganVertex> vertices_;
  std::vector<Tint> coarse_tints_;  // of the last upload, as are the depths
  std::vector<float> coarse_blood_;
  std::vector<Tint> tints_;
  std::vector<float> blood_;
  GLuint array_ = 0, buffer_ = 0, rest_buffer_ = 0, index_buffer_ = 0;
};

}  // namespace trocar::render
