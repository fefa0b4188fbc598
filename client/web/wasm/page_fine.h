#pragma once

// The organ's fine surface, as the page draws it: the one of the native client
// (client/embedding/embedded_surface.h), in arrays that a graphics processor takes.
//
// Outside data: a surface or a picture that cannot be drawn is left out, and fault() says why in
// one line; the organ is then drawn by the surface of its mesh. Bounds: those of wire::FineSurface,
// and kMostPartVertices more. Thread: the page's only one.

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/embedding/embedded_surface.h"
#include "common/base/bytes.h"
#include "common/wire/fine_surface.h"

namespace trocar::wasm {

// A colour over the tissue, weighted by its opacity `a`; 0 to 1.
struct PageTint {
  float r = 0, g = 0, b = 0, a = 0;
  PageTint operator+(const PageTint& o) const { return {r + o.r, g + o.g, b + o.b, a + o.a}; }
  PageTint operator*(float s) const { return {r * s, g * s, b * s, a * s}; }
  bool operator==(const PageTint&) const = default;
};
using Bytes4 = std::array<std::uint8_t, 4>;
// The colour itself, and its opacity.
Bytes4 bytes_of(const PageTint& tint);

class PageFine {
 public:
  // Forgets everything.
  void restart();
  // Takes a part, as a session sends them.
  void take(const proto::FineSurfacePart& part);
  // Takes a proto::FineSurface, as a recording's organ has it.
  void take_whole(BytesView message);

  // Takes over the coarse surface as it is, if it has changed since the last call.
  void follow(const embedding::CoarseShape& coarse, std::uint64_t topology_version);
  // Moves it with the coarse vertices, m; tints and depths of blood, m, are theirs.
  void update(std::span<const Vec3f> positions, std::span<const PageTint> tints,
              std::span<const float> blood);

  // True once an update has filled what follows.
  bool is_shown() const { return surface_ && lips_.size() == surface_->vertex_count(); }
  const embedding::EmbeddedSurface& surface() const { return *surface_; }
  // Change with the vertices and triangles there are, and with where they are and how they look.
  std::uint64_t geometry_version() const { return geometry_version_; }
  std::uint64_t motion_version() const { return motion_version_; }
  std::span<const std::array<float, 4>> rest() const { return rest_; }  // x, y, z, rim
  std::span<const std::array<float, 2>> texture() const { return texture_; }
  std::span<const std::array<std::int8_t, 4>> lips() const { return lips_; }
  std::span<const Bytes4> overlay() const { return overlay_; }
  // Returns the file's bytes; empty: there is none.
  const std::string& picture() const { return picture_; }
  // Changes with the picture alone, so that no cut makes anybody unpack it again.
  std::uint64_t picture_version() const { return picture_version_; }
  const std::string& fault() const { return fault_; }  // one line, or empty

 private:
  void show(wire::FineSurface surface);
  void refuse(const std::string& why);

  wire::FineSurfaceAssembler parts_;
  std::optional<embedding::EmbeddedSurface> surface_;
  wire::FineSurface source_;  // the picture is not in it
  std::string picture_, fault_;
  std::uint64_t topology_version_ = 0, geometry_version_ = 0, motion_version_ = 0;
  std::uint64_t picture_version_ = 0;
  std::vector<std::array<float, 4>> rest_;
  std::vector<std::array<float, 2>> texture_;
  std::vector<std::array<std::int8_t, 4>> lips_;
  std::vector<Bytes4> overlay_;
  std::vector<PageTint> coarse_tints_, tints_;  // coarse: of the last update, as are the depths
  std::vector<float> coarse_blood_, blood_;
};

}  // namespace trocar::wasm
