#pragma once

// Strokes for campaigns and property tests: what hands do, and what they hardly do. And what of a
// stroke lies inside the organ, to compare the wound with.

#include "tests/cutting/cut_organ.h"

namespace trocar::cutting::testing {

enum class StrokeKind { Straight, Curved, Sawing, Short, Knife, Through, Aligned, Crossing };

class RandomStrokes {
 public:
  RandomStrokes(const organ::Organ& organ, double h, std::uint64_t seed);

  // Sizes follow h. Knife: one end outside, the tip inside, moved sideways; Through: a plane across
  // everything; Aligned: in the plane of a face, along one of its edges, through its nodes;
  // Crossing: as the last Knife or Crossing, but across it; the others somewhere inside.
  Path next(StrokeKind kind);
  StrokeKind any_kind();  // one of the first five
  // Returns what the last path sweeps, each place once: a saw goes to and fro.
  const Path& swept_once() const { return swept_once_; }
  trocar::testing::Random& random() { return random_; }
  // The plane is that of the last path of kind Through.
  Vec3d plane_point() const { return plane_point_; }
  Vec3d plane_normal() const { return plane_normal_; }

 private:
  Vec3d direction();
  Path sweep(const Vec3d& start, Vec3d edge, Vec3d motion, double length, double width,
             double bend);
  Path knife();
  Path through();
  Path sawing(const Vec3d& centre);
  Path aligned();
  Path crossing();

  const mesh::TetMesh& mesh_;
  const double h_;
  const std::vector<Vec3d> normals_;
  trocar::testing::Random random_;
  Vec3d plane_point_, plane_normal_;
  Path knife_;  // the last one
  Path swept_once_;
};

// Point in organ, at rest: through a grid of its tets.
class InsideTest {
 public:
  explicit InsideTest(const mesh::TetMesh& mesh);
  bool contains(const Vec3d& p) const;
  // m^2, by samples `spacing` apart. Swept twice counts twice.
  double swept_area(const Path& path, double spacing) const;
  // m, of what is swept inside: the path's own border, and by the samples where it meets the
  // surface, whose direction is taken to be any (Cauchy and Crofton: pi/4 of the steps).
  double perimeter(const Path& path, double spacing) const;

 private:
  double length_inside(const Vec3d& a, const Vec3d& b, double spacing) const;

  const mesh::TetMesh& mesh_;
  Vec3d low_;
  double cell_;
  std::array<std::size_t, 3> size_;
  std::vector<std::vector<TetIndex>> cells_;
};

}  // namespace trocar::cutting::testing
