#include "client/shape/ribbon.h"

namespace trocar::shape {
namespace {

// Above the flat triangles: the surface that is drawn is rounder than they are.
constexpr float kLiftMetres = 0.0008f, kOutlineLiftMetres = 0.0005f;
constexpr float kOutlineWidth = 1.7f;  // of the line's
constexpr Colour kOutline{8, 11, 14};
constexpr float kPartedMetres = 0.030f;

bool is_joined(const RibbonPoint& a, const RibbonPoint& b) {
  const Vec3f none{};
  return !(a.normal == none) && !(b.normal == none) &&
         length(b.position - a.position) < kPartedMetres;
}

void add_bands(std::span<const RibbonPoint> points, float half_width, float lift, Colour colour,
               MeshVertices& out) {
  const std::array<std::uint8_t, 4> material{colour.r, colour.g, colour.b, 0};
  const auto place = [lift](const RibbonPoint& p) { return p.position + p.normal * lift; };
  // A band from a to b, longer by half its width at both ends, so that bends have no holes.
  const auto add_band = [&](const RibbonPoint& a, const RibbonPoint& b, const Vec3f& along) {
    const auto corner = [&](const RibbonPoint& p, float forward, float aside) {
      const Vec3f side = normalized(cross(p.normal, along), Vec3f{1, 0, 0});
      return MeshVertex{place(p) + along * (forward * half_width) + side * (aside * half_width),
                        p.normal, material};
    };
    const auto p = corner(a, -1, -1), q = corner(b, 1, -1), s = corner(b, 1, 1),
               t = corner(a, -1, 1);
    out.insert(out.end(), {p, q, s, p, s, t});
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool has_before = i > 0 && is_joined(points[i - 1], points[i]);
    const bool has_after = i + 1 < points.size() && is_joined(points[i], points[i + 1]);
    if (has_after) {
      const Vec3f way = points[i + 1].position - points[i].position;
      add_band(points[i], points[i + 1], normalized(way, Vec3f{1, 0, 0}));
    } else if (!has_before && !(points[i].normal == Vec3f{})) {
      const Vec3f any = cross(points[i].normal, Vec3f{0.36f, 0.48f, 0.8f});
      add_band(points[i], points[i], normalized(any, Vec3f{1, 0, 0}));
    }
  }
}

}  // namespace

void add_ribbon(std::span<const RibbonPoint> points, float half_width, Colour colour,
                MeshVertices& out) {
  add_bands(points, kOutlineWidth * half_width, kOutlineLiftMetres, kOutline, out);
  add_bands(points, half_width, kLiftMetres, colour, out);
}

}  // namespace trocar::shape
