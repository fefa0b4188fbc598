#include "client/embedding/turned_frames.h"

namespace trocar::embedding {
namespace {

Turn frame_of(const Vec3f& a, const Vec3f& b, const Vec3f& c) {
  const Vec3f z = normalized(cross(b - a, c - a) * 1e6f, Vec3f{0, 0, 1});
  const Vec3f x = normalized((b - a) * 1e3f, Vec3f{1, 0, 0});
  return {x, cross(z, x), z};
}

// A rotation near to the matrix: its columns made square to each other, the longest change spread
// by beginning with the cross products (each column is compared with the other two).
Turn rotation_near(const Turn& m) {
  Vec3f x = normalized(m.x, Vec3f{1, 0, 0}), y = normalized(m.y, Vec3f{0, 1, 0}),
        z = normalized(m.z, Vec3f{0, 0, 1});
  // Two steps towards the polar factor: each takes the mean of a column and the cross product of
  // the others, which are equal in a rotation.
  for (int i = 0; i < 2; ++i) {
    const Vec3f next_x = x + cross(y, z), next_y = y + cross(z, x), next_z = z + cross(x, y);
    x = normalized(next_x, x), y = normalized(next_y, y), z = normalized(next_z, z);
  }
  x = normalized(x - z * dot(x, z), Vec3f{1, 0, 0});
  return {x, cross(z, x), z};
}

}  // namespace

void TurnedFrames::build(std::span<const Vec3f> rest, std::span<const TriangleCorners> triangles,
                         std::span<const std::uint32_t> faces) {
  rest_frames_.clear();
  areas_.clear();
  for (const std::uint32_t face : faces) {
    const auto& [a, b, c] = triangles[face];
    rest_frames_.push_back(frame_of(rest[a], rest[b], rest[c]));
    areas_.push_back(length(cross(rest[b] - rest[a], rest[c] - rest[a])) * 1e6f);
  }
  turns_.assign(rest.size(), Turn{});
}

void TurnedFrames::update(std::span<const Vec3f> positions,
                          std::span<const TriangleCorners> triangles,
                          std::span<const std::uint32_t> faces) {
  constexpr Vec3f kNone{};
  turns_.assign(positions.size(), Turn{kNone, kNone, kNone});
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const auto& [a, b, c] = triangles[faces[i]];
    const Turn now = frame_of(positions[a], positions[b], positions[c]);
    const Turn& rest = rest_frames_[i];
    // now rest^T, whose column k is the sum of the columns of now by row k of rest.
    const auto column = [&](float x, float y, float z) {
      return (now.x * x + now.y * y + now.z * z) * areas_[i];
    };
    const Turn turn{column(rest.x.x, rest.y.x, rest.z.x), column(rest.x.y, rest.y.y, rest.z.y),
                    column(rest.x.z, rest.y.z, rest.z.z)};
    for (const std::uint32_t v : {a, b, c}) {
      turns_[v].x += turn.x;
      turns_[v].y += turn.y;
      turns_[v].z += turn.z;
    }
  }
  for (Turn& turn : turns_)
    turn = turn.x == kNone && turn.y == kNone ? Turn{} : rotation_near(turn);
}

}  // namespace trocar::embedding
