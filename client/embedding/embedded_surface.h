#pragma once

// A fine surface that rides on the coarse one: an embedded surface, bound once, moved by what it is
// bound to.
//
//   fine vertex = place on the coarse surface + offset,   offset turned as the coarse surface is
//
// The place is the nearest one at rest, and its triangle's corners carry it. The offset is what is
// left of the way, as a vector: along the interpolated normal alone it would depend on which
// triangles are there, and the surface would jump when a cut splits them (turned_frames.h). So the
// surface at rest is exact, whatever was cut, and a rigid motion of the coarse surface is one of
// the fine surface.
//
// A fine triangle is whole while all around it goes on: its corners ride, each on its own face.
// It is parted where a rim of a wound passes, along the coarse faces under it (parting.h), and each
// part rides on one face. What the surface is follows from the coarse one as it is now and from
// nothing before, so who joins late sees the same. A skirt joins a rim of the fine surface with
// that of the coarse one, where the wall of the wound begins.
//
//   vertices:   [fine, as given][of parts and skirts]
//   triangles:  [whole][parts][skirts]
//
// follow(): cost linear in both surfaces, with a small factor: all triangles are listed anew, but
// only those near what has changed are bound and parted. update(): linear in both, too: each fine
// vertex is looked at, and those whose carriers have moved are moved. Neither allocates once the
// surfaces have ceased to grow. Thread: render thread.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "client/embedding/face_grid.h"
#include "client/embedding/parting.h"
#include "client/embedding/turned_frames.h"
#include "common/math/vec3.h"

namespace trocar::embedding {

// Beyond so many vertices of parts and skirts, fine triangles stay whole: long cuts take thousands,
// and a server that means harm could make them any number.
inline constexpr std::size_t kMostPartVertices = 200'000;

struct FineShape {
  std::vector<Vec3f> positions;               // at rest, m
  std::vector<TriangleCorners> triangles;     // outward, valid
  std::vector<std::array<float, 2>> texture;  // none, or per vertex
};

// The coarse surface at rest: triangles by number, of equal corners where there is none; is_wound
// per triangle, or none.
struct CoarseShape {
  std::span<const Vec3f> rest;
  std::span<const TriangleCorners> triangles;
  std::span<const std::uint8_t> is_wound;
};

class EmbeddedSurface {
 public:
  // This of a vertex does not move.
  struct Look {
    Vec3f rest;     // m
    float rim = 0;  // 0; -1 on a rim; 1 on a skirt
    std::array<float, 2> texture{};
  };

  explicit EmbeddedSurface(FineShape shape);

  // Takes over the coarse surface as it is. Call update() before what is drawn is read.
  void follow(const CoarseShape& coarse);
  // `positions` m, of the coarse vertices.
  void update(std::span<const Vec3f> positions);

  std::span<const TriangleCorners> triangles() const { return triangles_; }
  std::size_t skirt_count() const { return skirts_; }          // of triangles, the last ones
  std::size_t parted_count() const { return parted_.size(); }  // fine triangles that are in parts
  std::span<const Vec3f> positions() const { return positions_; }
  std::span<const Vec3f> normals() const { return normals_; }
  std::span<const Look> looks() const { return looks_; }
  std::size_t vertex_count() const { return vertices_.size(); }
  // Coarse vertices that carry a vertex; kNoFace thrice: it lies between two others.
  TriangleCorners carriers(std::size_t vertex) const {
    const Vertex& v = vertices_[vertex];
    return v.is_between() ? TriangleCorners{kNoFace, kNoFace, kNoFace} : v.corner;
  }
  std::size_t moved_count() const { return moved_count_; }  // vertices in the last update()
  float farthest_m() const { return farthest_m_; }          // of a vertex from its place

  // Values of coarse vertices, as those of fine ones.
  template <typename T>
  void spread(std::span<const T> coarse, std::vector<T>& fine) const {
    fine.clear();
    for (const Vertex& v : vertices_)
      if (v.is_between())
        fine.push_back(fine[v.corner[0]] * v.weight[0] + fine[v.corner[1]] * v.weight[1]);
      else
        fine.push_back(coarse[v.corner[0]] * v.weight[0] + coarse[v.corner[1]] * v.weight[1] +
                       coarse[v.corner[2]] * v.weight[2]);
  }

 private:
  static constexpr std::uint32_t kBetween = 0xffffffffu;

  struct Vertex {
    // Coarse vertices; or two fine ones of those given, between which it lies, and kBetween.
    TriangleCorners corner{};
    std::array<float, 3> weight{1, 0, 0};
    Vec3f offset, normal;  // at rest

    bool is_between() const { return corner[2] == kBetween; }
  };
  // Ranges of the parts of one fine triangle.
  struct Parted {
    std::uint32_t triangle = 0;
    std::uint32_t first_vertex = 0, vertices = 0;         // among those of parts
    std::uint32_t first_face = 0, faces = 0, skirts = 0;  // of part_triangles_, skirts last
  };
  class EdgeSet {
   public:
    void clear(std::size_t most);
    void insert(std::uint32_t a, std::uint32_t b);
    bool has(std::uint32_t a, std::uint32_t b) const;

   private:
    std::size_t find(std::uint64_t key) const;
    std::vector<std::uint64_t> slots_;
    unsigned shift_ = 0;
  };

  Parted& begin_parts(std::uint32_t triangle);
  void note_changes(const CoarseShape& coarse);
  void find_affected();
  void add_affected(std::uint32_t triangle);
  void bind(std::uint32_t vertex);
  void keep_unaffected();
  void settle(std::uint32_t triangle);
  void find_faces_under(std::uint32_t triangle, const Vec3f& chart);
  void add_parts(std::uint32_t triangle);
  void add_whole(std::uint32_t triangle, const std::array<Vec3f, 3>& base);
  std::uint32_t add_point(std::uint32_t triangle, const PartPoint& point, std::uint32_t face,
                          bool is_own);
  bool is_on_edge(const PartPoint& point, std::uint32_t face, std::size_t edge) const;
  void add_skirt(std::uint32_t triangle, const Part& part, std::uint32_t face);
  void list_triangles();
  Vec3f normal_of(std::uint32_t face) const;  // at rest, of unit length

  FineShape shape_;
  std::vector<Vec3f> shape_normals_;
  FaceGrid shape_grid_;
  std::vector<std::uint32_t> face_of_;  // per fine vertex: the coarse triangle it rides on
  float farthest_m_ = 0;
  float under_slack_m_ = 0;  // the same whatever was cut

  // This is the coarse surface at rest.
  std::vector<Vec3f> rest_;
  std::vector<TriangleCorners> coarse_;  // the outside, of equal corners where there is none
  std::vector<std::uint32_t> faces_;     // numbers of the outside
  FaceGrid grid_;
  EdgeSet edges_;
  TurnedFrames frames_;

  // While it follows.
  bool is_all_new_ = true;
  std::vector<Box<float>> changed_boxes_;
  std::vector<std::uint8_t> is_affected_;  // per fine triangle
  std::vector<std::uint32_t> affected_, found_, under_;
  std::vector<FaceUnder> faces_under_;
  Parting parting_;
  std::vector<std::uint32_t> part_indices_;  // of the points of one part

  std::vector<std::uint8_t> is_parted_;  // per fine triangle
  std::vector<Parted> parted_, next_parted_;
  std::vector<Vertex> vertices_, next_vertices_;  // next_: of parts alone
  std::vector<Look> looks_, next_looks_;
  // Corners: fine vertices as given, or their number plus a part's vertex, counted from its first.
  std::vector<TriangleCorners> part_triangles_, next_part_triangles_;
  std::vector<TriangleCorners> triangles_;
  std::size_t skirts_ = 0;

  std::vector<Vec3f> positions_, normals_;
  std::vector<Vec3f> shown_;         // coarse positions of the last update()
  std::vector<std::uint8_t> moved_;  // per coarse vertex: it, or a face around it
  std::size_t moved_count_ = 0;
  bool is_stale_ = true;
};

}  // namespace trocar::embedding
