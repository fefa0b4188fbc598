#pragma once

// Lines drawn on the organ, where they are now. A point stands by its place on the surface at rest;
// it is attached to the nearest triangle of the outside there, and moves with that triangle. A cut
// splits triangles, and their points go to the new ones that have their place. Where the tissue was
// taken out, a point is not shown, and the line has a gap.
//
// Thread: render thread.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "client/replica/replica.h"

namespace trocar::replica {

// A place on a triangle: weights of its second and third corner.
struct Attachment {
  std::uint32_t triangle = 0;
  std::array<float, 2> weight{};
  float distance_m = 0;  // of the place from the triangle
};
inline constexpr std::uint32_t kNoTriangle = 0xffffffffu;

// Farther from the surface at rest a point has lost its tissue.
inline constexpr float kLostMetres = 0.004f;

// The nearest outer triangle to `place`, or the nearest of a wound, with corners at `positions`.
// kNoTriangle: there is none.
Attachment attach(const Vec3f& place, const Topology& topology, std::span<const Vec3f> positions,
                  bool in_wound = false);

struct DrawnPoint {
  Vec3f position;  // m
  Vec3f normal;    // of its triangle, outward, of unit length; zero: the point is not shown
};

class DrawnLines {
 public:
  struct Line {
    ParticipantSlot participant;
    std::vector<DrawnPoint> points;
  };
  // `positions`: m, per vertex of the replica's topology.
  void update(const Replica& replica, std::span<const Vec3f> positions);
  std::span<const Line> lines() const { return lines_; }

 private:
  void attach_points(const Replica& replica);

  std::vector<std::vector<Attachment>> attached_;  // as the replica's strokes
  std::vector<Line> lines_;
  std::uint64_t drawing_version_ = 0, topology_version_ = 0, history_version_ = 0;
};

}  // namespace trocar::replica
