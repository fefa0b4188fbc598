#pragma once

// The film of blood on the surface, the same in the window and on the page: how deep it stands on
// each vertex that is drawn.
//
//   sum over vertices of depth * area = sum over coarse vertices of level * area,   area at rest
//
// A coarse vertex on the rim of a wound is drawn twice, and its blood is shared out. The wound
// fills first: the outside has of it what stands on the outside around, for what bleeds at an upper
// lip runs down into the wound. Then each triangle evens out what its corners have, some times
// over, so that no border shows the triangles. Both keep the sum.
//
// build() and spread(): linear in the triangles; no allocation once they have ceased to grow.
// Thread: render thread.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "client/shape/smooth_surface.h"

namespace trocar::shape {

// The shader takes this as 1. A film that is deeper is drawn as this; the wire has none.
inline constexpr float kDeepestFilmMetres = 0.0051f;

class BloodFilm {
 public:
  // Takes over the surface; `rest`: where its coarse vertices are at rest, m.
  void build(const SmoothSurface& surface, std::span<const Vec3f> rest);
  // `levels`: depth at each coarse vertex in steps of `level_m`; of another size (a session that
  // does not bleed): all is dry.
  void spread(const SmoothSurface& surface, std::span<const float> levels, float level_m);

  const std::vector<float>& depths() const { return depths_; }  // m, per vertex of the surface
  const std::vector<float>& areas() const { return areas_; }    // m^2 at rest, likewise
  // Returns how much blood is drawn, m^3.
  double volume_m3() const;
  bool is_dry() const { return is_dry_; }

 private:
  void share_out(const SmoothSurface& surface, std::span<const float> levels, float level_m);
  void even_out(const SmoothSurface& surface);

  std::vector<float> triangle_areas_;  // m^2 at rest, of the coarse triangles
  std::size_t parts_ = 1;              // drawn triangles for each of them
  std::vector<float> areas_;         // m^2 at rest, per vertex: a third of the triangles around it
  std::vector<float> coarse_areas_;  // likewise, of coarse triangles and vertices
  std::vector<float> depths_, volumes_;
  std::vector<float> around_;          // depths on the outside around a rim vertex, summed
  std::vector<std::uint32_t> counts_;  // how many of them
  bool is_dry_ = true;
};

// Returns what the organ's shader takes as `lip`, in bytes that stand for -1 to 1: a unit vector,
// and the cube root of a film's depth.
std::array<std::int8_t, 4> lip_bytes(const Vec3f& lip, float depth_m);

}  // namespace trocar::shape
