#include "client/shape/ribbon.h"

namespace trocar::shape {
namespace {

// Above the flat triangles: the surface that is drawn is rounder than they are. A dark band below
// the line makes it stand out from a highlight.
constexpr float kLiftMetres = 0.0009f, kBorderLiftMetres = 0.0007f;
constexpr float kBorderWidths = 1.7f;
constexpr Colour kBorder{12, 12, 16};
constexpr float kPartedMetres = 0.030f;

bool is_joined(const RibbonPoint& a, const RibbonPoint& b) {
  const Vec3f none{};
  return !(a.normal == none) && !(b.normal == none) &&
         length(b.position - a.position) < kPartedMetres;
}

struct Band {
  float half_width, lift;  // m
  Colour colour;
};

void add_bands(std::span<const RibbonPoint> points, const Band& band, MeshVertices& out) {
  const std::array<std::uint8_t, 4> material{band.colour.r, band.colour.g, band.colour.b, 0};
  const auto place = [&](const RibbonPoint& p) { return p.position + p.normal * band.lift; };
  // A band from a to b, longer by half its width at both ends, so that bends have no holes.
  const auto add_band = [&](const RibbonPoint& a, const RibbonPoint& b, const Vec3f& along) {
    const auto corner = [&](const RibbonPoint& p, float forward, float aside) {
      const Vec3f side = normalized(cross(p.normal, along), Vec3f{1, 0, 0});
      return MeshVertex{
          place(p) + along * (forward * band.half_width) + side * (aside * band.half_width),
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
  add_bands(points, {half_width * kBorderWidths, kBorderLiftMetres, kBorder}, out);
  add_bands(points, {half_width, kLiftMetres, colour}, out);
}

}  // namespace trocar::shape
