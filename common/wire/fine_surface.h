#pragma once

// A fine surface rides on the coarse one of an organ's tetrahedra: it is what clients draw, and
// nothing else. It is sent once, at rest; each client binds it to the coarse surface by where that
// is at rest, and moves it with the frames that come anyway (client/embedding). No tick knows it.
//
// Outside data: sizes, limits and indices are checked, and an error is one line that names message
// and field.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/math/vec3.h"

namespace trocar::proto {
class FineSurface;
class FineSurfacePart;
}  // namespace trocar::proto

namespace trocar::wire {

inline constexpr std::size_t kMaxFineTriangles = 200'000, kMaxFineVertices = 300'000;
inline constexpr std::size_t kMaxFinePictureBytes = 4 * 1024 * 1024;
inline constexpr std::size_t kMostFinePictureSide = 2048;  // pixels
inline constexpr std::size_t kFinePartBytes = 32 * 1024;
inline constexpr std::uint32_t kMaxFineParts = 512;
inline constexpr double kFineQuantumMetres = 0.5e-6;
inline constexpr std::int32_t kMaxFineQuanta = 4'000'000;      // 2 m from the origin
inline constexpr double kTextureQuantum = 1.0 / 32768;         // of texture coordinates
inline constexpr std::int32_t kMaxTextureQuanta = 16 * 32768;  // a picture repeats 16 times

struct FineSurface {
  std::vector<std::array<std::int32_t, 3>> quanta;      // per vertex at rest, 0.5 um, organ's frame
  std::vector<std::array<std::uint32_t, 3>> triangles;  // outward
  std::vector<std::array<std::int32_t, 2>> texture;     // none, or per vertex, u and v upward
  std::string picture;                                  // none, or a PNG or JPEG file

  bool empty() const { return triangles.empty(); }
  Vec3f position_m(std::size_t vertex) const;
  bool operator==(const FineSurface&) const = default;
};

// Returns the grid's place next to `position_m`, which must be within 2 m.
std::array<std::int32_t, 3> fine_quanta(const Vec3d& position_m);

Status validate(const FineSurface& surface);

// `message` is empty on entry.
void write(const FineSurface& surface, proto::FineSurface& message);
Result<FineSurface> read(const proto::FineSurface& message);

// Cuts a surface into messages; none for an empty one.
std::vector<proto::FineSurfacePart> parts_of(const FineSurface& surface);

// Tells whether parts follow each other, whatever they hold.
class FinePartOrder {
 public:
  // True: it was the last one. Part 0 begins anew. Error: the part is malformed, or does not
  // follow.
  Result<bool> add(const proto::FineSurfacePart& part);

 private:
  std::uint32_t next_ = 0, parts_ = 0;
};

// Puts parts together. At most 16 MiB of them are kept.
class FineSurfaceAssembler {
 public:
  // True once the surface is whole: take() it. Error: the part is malformed, or does not follow.
  Result<bool> add(const proto::FineSurfacePart& part);
  FineSurface take();

 private:
  FinePartOrder order_;
  std::string bytes_;
  FineSurface surface_;
};

}  // namespace trocar::wire
