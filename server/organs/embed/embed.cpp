#include "server/organs/embed/embed.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "common/image/image.h"
#include "common/wire/picture_size.h"
#include "server/organs/surface/triangle_tree.h"

namespace trocar::embed {
namespace {

constexpr double kFarthest_m = 1.9;  // from the origin, within what a message may say

double mean_edge(const mesh::TetMesh& mesh) {
  double sum = 0;
  for (const auto& t : mesh.boundary_triangles)
    for (std::size_t k = 0; k < 3; ++k)
      sum += length(mesh.rest_positions[t[(k + 1) % 3].value] - mesh.rest_positions[t[k].value]);
  return sum / static_cast<double>(3 * mesh.boundary_triangles.size());
}

std::array<std::int32_t, 2> texture_quanta(const std::array<double, 2>& place) {
  const auto quantum = [](double c) {
    return static_cast<std::int32_t>(
        std::lround(std::clamp(c, -16.0, 16.0) / wire::kTextureQuantum));
  };
  return {quantum(place[0]), quantum(place[1])};
}

// Gives each place on the grid, and in a picture, one vertex.
class Vertices {
 public:
  explicit Vertices(wire::FineSurface& surface) : surface_(surface) {}
  std::uint32_t at(const std::array<std::int32_t, 3>& place,
                   const std::array<std::int32_t, 2>* texture) {
    const std::array<std::int32_t, 5> key{place[0], place[1], place[2],
                                          texture != nullptr ? (*texture)[0] : 0,
                                          texture != nullptr ? (*texture)[1] : 0};
    const auto [known, is_new] =
        known_.try_emplace(key, static_cast<std::uint32_t>(surface_.quanta.size()));
    if (is_new) {
      surface_.quanta.push_back(place);
      if (texture != nullptr) surface_.texture.push_back(*texture);
    }
    return known->second;
  }

 private:
  wire::FineSurface& surface_;
  std::map<std::array<std::int32_t, 5>, std::uint32_t> known_;
};

using Place = std::array<std::int32_t, 3>;  // on the grid

Vec3d metres(const Place& place) {
  return Vec3d{double(place[0]), double(place[1]), double(place[2])} * wire::kFineQuantumMetres;
}

Vec3d position(const wire::FineSurface& surface, std::uint32_t vertex) {
  return metres(surface.quanta[vertex]);
}

Vec3d normal(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  return cross(b - a, c - a);
}

Vec3d normal(const wire::FineSurface& surface, const std::array<std::uint32_t, 3>& t) {
  return normal(position(surface, t[0]), position(surface, t[1]), position(surface, t[2]));
}

Error bad(const EmbedOptions& options, const std::string& what) {
  return {ErrorCode::BadFile, options.name + ": " + what};
}

// Clients read the size from the header and unpack the rest: both are tried here. The picture is
// within the limits of image::decode() once its header is.
Status check_picture(const surface::RawSurface& raw, const EmbedOptions& options) {
  const std::string& picture = options.picture;
  if (picture.empty()) return {};
  const bool is_own = options.picture_name.empty();
  const auto refuse = [&](const std::string& what) {
    return Error{ErrorCode::BadFile, (is_own ? options.name + ": its picture " + what
                                             : options.picture_name + ": " + what)};
  };
  if (raw.corner_texture.empty())
    return bad(options, "has no texture coordinates for " +
                            (is_own ? "its picture" : "the picture " + options.picture_name));
  if (picture.size() > wire::kMaxFinePictureBytes)
    return refuse(fmt::format("has {} bytes, a picture may have {}: make it smaller",
                              picture.size(), wire::kMaxFinePictureBytes));
  const auto size = wire::picture_size(picture);
  if (!size) return refuse("is neither PNG nor JPEG, or its header is broken");
  const auto [width, height] = *size;
  if (std::min(width, height) == 0 || std::max(width, height) > wire::kMostFinePictureSide)
    return refuse(fmt::format("has {} x {} pixels, may have 1 to {} along a side", width, height,
                              wire::kMostFinePictureSide));
  const auto decoded = image::decode(picture);
  if (!decoded)
    return refuse("cannot be unpacked (" + decoded.error().message +
                  "): save it again as PNG or JPEG");
  if (static_cast<std::size_t>(decoded->width) == width &&
      static_cast<std::size_t>(decoded->height) == height)
    return {};
  return refuse(fmt::format("says {} x {} pixels and has {} x {}: save it again as PNG or JPEG",
                            width, height, decoded->width, decoded->height));
}

// Turns from right, front and head or left, back and head to left, head and front, and back.
Vec3d to_left_head_front(surface::Axes axes, const Vec3d& p) {
  if (axes == surface::Axes::Ras) return {-p.x, p.z, p.y};
  return axes == surface::Axes::Lps ? Vec3d{p.x, p.z, -p.y} : p;
}
Vec3d from_left_head_front(surface::Axes axes, const Vec3d& p) {
  if (axes == surface::Axes::Ras) return {-p.x, p.z, p.y};
  return axes == surface::Axes::Lps ? Vec3d{p.x, -p.z, p.y} : p;
}
Vec3d turned(surface::Axes from, surface::Axes to, const Vec3d& p) {
  const bool is_said = from != surface::Axes::Unsaid && to != surface::Axes::Unsaid;
  return is_said ? from_left_head_front(to, to_left_head_front(from, p)) : p;
}

// Compares with the mesh: how far away, and which way it looks.
Status fit(const mesh::TetMesh& mesh, const EmbedOptions& options, EmbeddedFine& result) {
  const surface::TriangleTree tree(mesh.rest_positions, mesh.boundary_triangles);
  const double edge = mean_edge(mesh), most = kMostEdgesAway * edge;
  auto& surface = result.surface;
  std::vector<Vec3d> outward;
  Vec3d worst;
  std::size_t beyond = 0;
  for (std::uint32_t v = 0; v < surface.quanta.size(); ++v) {
    const Vec3d p = position(surface, v);
    const auto near = tree.nearest(p);
    const double away = std::sqrt(near.distance_squared);
    beyond += away > most;
    if (away > result.farthest_m) result.farthest_m = away, worst = p;
    const auto& t = mesh.boundary_triangles[near.triangle];
    const Vec3d a = mesh.rest_positions[t[0].value];
    outward.push_back(
        cross(mesh.rest_positions[t[1].value] - a, mesh.rest_positions[t[2].value] - a));
  }
  const double share = static_cast<double>(beyond) / static_cast<double>(surface.quanta.size());
  if (share > kMostBeyond || result.farthest_m > kMostEdgesBeyond * edge) {
    const auto in_file = [&](double c) {
      return std::round(c / options.unit_m * 1e6) / 1e6 + 0.0;  // no minus before zero
    };
    const Vec3d place = turned(options.organ_axes, options.axes, worst + options.offset_m);
    return bad(options,
               fmt::format("the vertex at {:.5g} {:.5g} {:.5g} is {:.2f} mm from the surface of "
                           "the mesh, and {} of {} vertices are more than {:.2f} mm, half of its "
                           "mean edge: is it the same organ, in the same unit and position? A mesh "
                           "that is finer or coarser fits otherwise (--nodes)",
                           in_file(place.x), in_file(place.y), in_file(place.z),
                           1e3 * result.farthest_m, beyond, surface.quanta.size(), 1e3 * most));
  }
  if (beyond > 0)
    result.warnings.push_back(fmt::format(
        "{} of {} vertices are more than {:.2f} mm from the surface of the mesh, {:.2f} "
        "mm at most: it lacks what is so thin, which rides on what is nearest and is "
        "not felt",
        beyond, surface.quanta.size(), 1e3 * most, 1e3 * result.farthest_m));
  double agrees = 0;
  for (const auto& t : surface.triangles) agrees += dot(normal(surface, t), outward[t[0]]);
  if (agrees < 0) {
    for (auto& t : surface.triangles) std::swap(t[1], t[2]);
    result.warnings.push_back("the fine surface looked inward, all of its triangles were turned");
  }
  return {};
}

}  // namespace

Result<EmbeddedFine> embed(const surface::RawSurface& raw, const mesh::TetMesh& mesh,
                           const EmbedOptions& options) {
  if (mesh.boundary_triangles.empty()) return bad(options, "the organ has no surface to ride on");
  if (raw.triangles.size() > wire::kMaxFineTriangles)
    return bad(options, fmt::format("has {} triangles, a fine surface may have {}",
                                    raw.triangles.size(), wire::kMaxFineTriangles));
  if (!raw.texture_fault.empty()) return Error{ErrorCode::BadFile, raw.texture_fault};
  if (Status fits = check_picture(raw, options); !fits.ok()) return fits.error();
  EmbeddedFine result;
  result.surface.picture = options.picture;
  Vertices vertices(result.surface);
  const double unit = options.unit_m;
  std::size_t dropped = 0;
  for (std::size_t i = 0; i < raw.triangles.size(); ++i) {
    std::array<Place, 3> places{};
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3d at =
          turned(options.axes, options.organ_axes, raw.positions[raw.triangles[i][k].value]);
      const Vec3d p = at * unit - options.offset_m;
      if (!is_finite(p) || std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) > kFarthest_m)
        return bad(options, fmt::format("face {}: a corner is more than 1.9 m from the organ's "
                                        "centre: is it in the same unit?",
                                        raw.face_numbers[i]));
      places[k] = wire::fine_quanta(p);
    }
    if (!(length(normal(metres(places[0]), metres(places[1]), metres(places[2]))) > 0)) {
      ++dropped;
      continue;
    }
    auto& corners = result.surface.triangles.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      std::array<std::int32_t, 2> texture{};
      if (!raw.corner_texture.empty()) texture = texture_quanta(raw.corner_texture[i][k]);
      corners[k] = vertices.at(places[k], raw.corner_texture.empty() ? nullptr : &texture);
    }
  }
  if (dropped > 0)
    result.warnings.push_back(fmt::format("dropped {} triangles without an area", dropped));
  if (result.surface.triangles.empty()) return bad(options, "has no triangles to embed");
  if (result.surface.quanta.size() > wire::kMaxFineVertices)
    return bad(options,
               fmt::format("has {} vertices that differ in position or texture coordinates, a fine "
                           "surface may have {}",
                           result.surface.quanta.size(), wire::kMaxFineVertices));
  if (Status valid = wire::validate(result.surface); !valid.ok())
    return bad(options, valid.error().message);
  if (Status fits = fit(mesh, options, result); !fits.ok()) return fits.error();
  return result;
}

void carry(const mesh::TetMesh& before, std::span<const Vec3d> now, wire::FineSurface& surface) {
  if (surface.empty()) return;
  const surface::TriangleTree tree(before.rest_positions, before.boundary_triangles);
  for (std::uint32_t v = 0; v < surface.quanta.size(); ++v) {
    const Vec3d p = position(surface, v);
    const auto near = tree.nearest(p);
    const auto& t = before.boundary_triangles[near.triangle];
    const auto& rest = before.rest_positions;
    const Vec3d a = rest[t[0].value], b = rest[t[1].value], c = rest[t[2].value];
    const Vec3d n = cross(b - a, c - a);
    const double whole = std::max(dot(n, n), 1e-30);
    const double of_b = dot(cross(near.point - a, c - a), n) / whole,
                 of_c = dot(cross(b - a, near.point - a), n) / whole;
    const auto moved = [&](NodeIndex node) { return now[node.value] - rest[node.value]; };
    surface.quanta[v] = wire::fine_quanta(p + moved(t[0]) * (1 - of_b - of_c) + moved(t[1]) * of_b +
                                          moved(t[2]) * of_c);
  }
}

}  // namespace trocar::embed
