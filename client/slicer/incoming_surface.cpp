#include <fmt/format.h>

#include <cmath>

#include "client/slicer/big_endian.h"
#include "client/slicer/incoming.h"

namespace trocar::slicer {
namespace {

// One kind of a surface's cells: how many the header says, and in how many bytes.
struct Cells {
  std::uint32_t count = 0, bytes = 0;
};

class SurfaceReader {
 public:
  explicit SurfaceReader(const Header& header) : header_(header) {}

  Status read_points(BigEndian& in, std::uint32_t count) {
    if (count == 0 || count > kMostSurfacePoints)
      return wrong(header_,
                   fmt::format("npoints is {}, allowed are 1 to {}", count, kMostSurfacePoints));
    BigEndian numbers(in.take(12 * std::uint64_t{count}));
    if (!in.ok()) return wrong(header_, fmt::format("npoints is {}, the body is shorter", count));
    for (std::uint32_t i = 0; i < count; ++i) {
      Vec3f p;
      for (float* number : {&p.x, &p.y, &p.z}) *number = numbers.read<float>();
      if (!is_finite(p)) return wrong(header_, fmt::format("point {} is not finite", i));
      mesh_.points_mm.push_back(p);
    }
    return {};
  }

  // `is_strip`: each three in a row are a triangle, every other one turned.
  Status read_cells(BigEndian& in, const Cells& cells, const char* name, bool is_strip) {
    BigEndian numbers(in.take(cells.bytes));
    if (!in.ok())
      return wrong(header_, fmt::format("size_{} is {}, the body is shorter", name, cells.bytes));
    for (std::uint32_t i = 0; i < cells.count; ++i) {
      const auto corners = numbers.read<std::uint32_t>();
      if (!numbers.ok() || corners < 3 || corners > numbers.remaining() / 4)
        return wrong(header_, fmt::format("{} {} has {} corners, and {} bytes are left", name, i,
                                          corners, numbers.remaining()));
      std::array<std::uint32_t, 3> triangle{};
      for (std::uint32_t k = 0; k < corners; ++k) {
        const auto point = numbers.read<std::uint32_t>();
        if (point >= mesh_.points_mm.size())
          return wrong(header_, fmt::format("{} {} names point {}, there are {}", name, i, point,
                                            mesh_.points_mm.size()));
        if (is_strip && k >= 3) triangle = {triangle[1], triangle[2], point};
        if (!is_strip && k >= 3) triangle = {triangle[0], triangle[2], point};
        if (k < 3) triangle[k] = point;
        if (k < 2) continue;
        if (mesh_.triangles.size() == kMostSurfaceTriangles)
          return wrong(header_, fmt::format("has more than {} triangles: decimate it",
                                            kMostSurfaceTriangles));
        mesh_.triangles.push_back(
            is_strip && k % 2 == 1 ? std::array{triangle[1], triangle[0], triangle[2]} : triangle);
      }
    }
    return {};
  }

  Result<SurfaceMesh> take() {
    if (mesh_.triangles.empty()) return wrong(header_, "has no polygons");
    return std::move(mesh_);
  }

 private:
  const Header& header_;
  SurfaceMesh mesh_;
};

}  // namespace

Result<SurfaceMesh> read_surface(const Header& header, BytesView content) {
  BigEndian in(content);
  const auto points = in.read<std::uint32_t>();
  std::array<Cells, 4> cells;  // vertices, lines, polygons, strips
  for (auto& kind : cells) {
    kind.count = in.read<std::uint32_t>();
    kind.bytes = in.read<std::uint32_t>();
  }
  in.skip(sizeof(std::uint32_t));  // attributes
  if (!in.ok())
    return wrong(header, fmt::format("has {} bytes, its header has {}", content.size(),
                                     kSurfaceHeaderBytes));
  SurfaceReader reader(header);
  if (const auto read = reader.read_points(in, points); !read) return read.error();
  in.skip(std::uint64_t{cells[0].bytes} + cells[1].bytes);
  if (!in.ok()) return wrong(header, "size_vertices and size_lines are more than the body");
  if (const auto read = reader.read_cells(in, cells[2], "polygons", false); !read)
    return read.error();
  if (const auto read = reader.read_cells(in, cells[3], "triangle_strips", true); !read)
    return read.error();
  return reader.take();
}

}  // namespace trocar::slicer
