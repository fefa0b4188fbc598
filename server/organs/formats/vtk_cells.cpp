#include "server/organs/formats/vtk_cells.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/base/assert.h"

namespace trocar::formats {
namespace {

struct VtkKind {
  std::int64_t type;
  std::int64_t corners;  // 0: two or more
};
// These are vertex, line, polyline, triangle and tetrahedron.
constexpr std::int64_t kTetrahedron = 10;
constexpr VtkKind kVtkKinds[] = {{1, 1}, {3, 2}, {4, 0}, {5, 3}, {kTetrahedron, 4}};

const char* unsupported_vtk_name(std::int64_t type) {
  switch (type) {
    case 9:
      return " (quadrangle)";
    case 11:
      return " (voxel)";
    case 12:
      return " (hexahedron)";
    case 13:
      return " (prism)";
    case 14:
      return " (pyramid)";
    case 24:
      return " (tetrahedron of second order)";
    default:
      return "";
  }
}

}  // namespace

bool is_region_name(std::string_view name) {
  static constexpr std::string_view kNames[] = {
      "region",   "regions",     "Region",        "label",         "labels",    "Label", "material",
      "Material", "MaterialIds", "CellEntityIds", "gmsh:physical", "medit:ref", "tag",   "part"};
  return std::ranges::find(kNames, name) != std::end(kNames);
}

void take_regions(const std::vector<double>& numbers, const std::string& data, VtkCells& cells) {
  constexpr double kLargest = 1e15;
  const auto part = std::ranges::find_if_not(numbers, [](double number) {
    return number == std::floor(number) && std::abs(number) <= kLargest;
  });
  if (part != numbers.end())
    cells.left_out.push_back(data + ", which is no whole number in cell " +
                             std::to_string(part - numbers.begin()));
  else
    for (const double number : numbers) cells.regions.push_back(static_cast<std::int64_t>(number));
}

std::string left_out_line(const std::vector<std::string>& data) {
  std::string text;
  for (const auto& one : data) {
    if (text.size() > 200) return text + ", ...";
    text += (text.empty() ? "left out: " : ", ") + one;
  }
  return text;
}

Result<mesh::RawTets> tets_of(VtkCells cells, const std::string& name) {
  const auto error = [&](std::size_t cell, const std::string& what) {
    return Error{ErrorCode::BadFile, name + ": cell " + std::to_string(cell) + " " + what};
  };
  TROCAR_ASSERT(cells.ends.size() == cells.types.size());
  TROCAR_ASSERT(cells.regions.empty() || cells.regions.size() == cells.types.size());
  mesh::RawTets raw;
  raw.positions = std::move(cells.points);
  raw.node_ids.resize(raw.positions.size());
  std::iota(raw.node_ids.begin(), raw.node_ids.end(), std::int64_t{0});
  const auto points = static_cast<std::int64_t>(raw.positions.size());
  std::int64_t begin = 0;
  std::size_t skipped = 0;
  for (std::size_t c = 0; c < cells.types.size(); ++c) {
    const auto type = cells.types[c], count = cells.ends[c] - begin;
    const auto kind = std::ranges::find(kVtkKinds, type, &VtkKind::type);
    if (kind == std::end(kVtkKinds))
      return error(c, "has type " + std::to_string(type) + unsupported_vtk_name(type) +
                          ", which is not supported: mesh with tetrahedra of four nodes (type 10)");
    if (kind->corners == 0 ? count < 2 : count != kind->corners)
      return error(c, "has " + std::to_string(count) + " nodes, its type has " +
                          std::to_string(kind->corners));
    mesh::Tet tet;
    for (std::int64_t i = 0; i < count; ++i) {
      const auto node = cells.corners[static_cast<std::size_t>(begin + i)];
      if (node < 0 || node >= points)
        return error(c, "refers to node " + std::to_string(node) + ", the file has " +
                            std::to_string(points) + ", counted from 0");
      if (type != kTetrahedron) continue;
      tet[static_cast<std::size_t>(i)] = NodeIndex(static_cast<std::uint32_t>(node));
      for (std::int64_t j = 0; j < i; ++j)
        if (tet[static_cast<std::size_t>(j)] == tet[static_cast<std::size_t>(i)])
          return error(c, "uses node " + std::to_string(node) + " twice");
    }
    begin = cells.ends[c];
    if (type != kTetrahedron) {
      ++skipped;
      continue;
    }
    raw.tets.push_back(tet);
    raw.element_ids.push_back(static_cast<std::int64_t>(c));
    if (!cells.regions.empty()) raw.tet_regions.push_back(cells.regions[c]);
  }
  if (skipped > 0)
    raw.left_out.push_back("left out " + std::to_string(skipped) + " points, lines and triangles");
  if (!cells.left_out.empty()) raw.left_out.push_back(left_out_line(cells.left_out));
  return raw;
}

}  // namespace trocar::formats
