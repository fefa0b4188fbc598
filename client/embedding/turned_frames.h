#pragma once

// How the coarse surface has turned at each of its vertices, from its pose at rest: the rotations
// of the triangles around it, averaged by area and made a rotation again. At rest each is the
// identity, and after a rigid motion that motion's rotation, whatever triangles are there: so what
// hangs on the surface neither jumps when a triangle is split nor when its neighbour is cut off.
//
// Cost linear in the triangles, no allocation once they have ceased to grow. Thread: render thread.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "client/embedding/face_grid.h"
#include "common/math/vec3.h"

namespace trocar::embedding {

// The columns of a 3 x 3 matrix.
struct Turn {
  Vec3f x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
  Vec3f operator*(const Vec3f& v) const { return x * v.x + y * v.y + z * v.z; }
};

class TurnedFrames {
 public:
  // `faces`: numbers of the triangles of the outside.
  void build(std::span<const Vec3f> rest, std::span<const TriangleCorners> triangles,
             std::span<const std::uint32_t> faces);
  // `positions` m, as many as `rest` had. `triangles` and `faces` as they were in build().
  void update(std::span<const Vec3f> positions, std::span<const TriangleCorners> triangles,
              std::span<const std::uint32_t> faces);
  // Per vertex; the identity where no face of the outside is.
  const std::vector<Turn>& turns() const { return turns_; }

 private:
  std::vector<Turn> rest_frames_;  // per face: its edge, across it, its normal
  std::vector<float> areas_;       // per face, at rest
  std::vector<Turn> turns_;
};

}  // namespace trocar::embedding
