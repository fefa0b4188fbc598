#include "server/organs/picture/organ_picture.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/math/vec3.h"
#include "server/organs/surface/triangle_tree.h"

namespace trocar::picture {
namespace {

constexpr int kView = 440, kMargin = 24, kBarHeight = 6;
constexpr Colour kGround{255, 255, 255}, kInk{30, 30, 30};
// The organ's own colour, then those of its regions, told apart by the colour blind (Okabe, Ito).
constexpr Colour kRegionColours[] = {{204, 121, 110}, {0, 158, 115},  {86, 180, 233},
                                     {230, 159, 0},   {0, 114, 178},  {240, 228, 66},
                                     {213, 94, 0},    {204, 121, 167}};
constexpr double kHeldShade = 0.45, kEdgeShade = 0.72;
constexpr double kEdgePixels = 0.8;

struct View {
  Vec3d right, up, toward;  // the eye
};
constexpr View kViews[] = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                           {{0, 0, -1}, {0, 1, 0}, {1, 0, 0}},
                           {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}}};

// One triangle as it is drawn.
struct Face {
  Vec3d corners[3];  // m
  std::uint16_t region = 0;
  bool is_held = false, has_edges = true;
  const std::array<std::int32_t, 2>* texture[3] = {};  // places in the picture; null: none
};

double largest_half(const mesh::TetMesh& mesh) {
  double half = 0;
  for (const Vec3d& p : mesh.rest_positions)
    half = std::max({half, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
  return half;
}

Colour shaded(const Colour& colour, double light) {
  Colour out;
  for (std::size_t i = 0; i < 3; ++i)
    out[i] = static_cast<std::uint8_t>(std::clamp(colour[i] * light, 0.0, 255.0));
  return out;
}

class Drawer {
 public:
  Drawer(const mesh::TetMesh& mesh, const std::vector<std::uint16_t>& regions,
         const std::vector<std::uint8_t>& held, const image::Image& painted)
      : mesh_(mesh), regions_(regions), held_(held), painted_(painted) {
    picture_.width = 3 * kView;
    picture_.height = kView + 2 * kMargin;
    const auto pixels =
        static_cast<std::size_t>(picture_.width) * static_cast<std::size_t>(picture_.height);
    picture_.pixels.assign(pixels, kGround);
    depth_.assign(pixels, -std::numeric_limits<double>::infinity());
    pixels_per_m_ = (kView / 2 - kMargin) / largest_half(mesh);
  }

  Picture run(const wire::FineSurface& fine) {
    if (fine.empty())
      for (const auto& triangle : mesh_.boundary_triangles) draw(face_of(triangle));
    else
      draw(fine);
    const int length = static_cast<int>(scale_bar_m(mesh_) * pixels_per_m_);
    for (int y = 0; y < kBarHeight; ++y)
      for (int x = 0; x < length; ++x)
        picture_.at(kMargin + x, picture_.height - kMargin - y) = kInk;
    return std::move(picture_);
  }

 private:
  Face face_of(const mesh::Triangle& triangle) const {
    Face face{.region = std::numeric_limits<std::uint16_t>::max(), .is_held = true};
    for (std::size_t i = 0; i < 3; ++i) {
      const auto node = triangle[i].value;
      face.corners[i] = mesh_.rest_positions[node];
      face.is_held = face.is_held && held_[node] != 0;
      face.region = std::min(face.region, regions_[node]);
    }
    return face;
  }

  void draw(const wire::FineSurface& fine) {
    const surface::TriangleTree tree(mesh_.rest_positions, mesh_.boundary_triangles);
    for (const auto& triangle : fine.triangles) {
      Vec3d corners[3], middle;
      for (std::size_t i = 0; i < 3; ++i) {
        corners[i] = to_double(fine.position_m(triangle[i]));
        middle += corners[i] / 3;
      }
      Face face = face_of(mesh_.boundary_triangles[tree.nearest(middle).triangle]);
      face.has_edges = false;
      for (std::size_t i = 0; i < 3; ++i) {
        face.corners[i] = corners[i];
        if (!fine.texture.empty() && !painted_.pixels.empty())
          face.texture[i] = &fine.texture[triangle[i]];
      }
      draw(face);
    }
  }

  void draw(const Face& face) {
    for (int v = 0; v < 3; ++v) draw(kViews[v], v * kView, face);
  }

  // The colour at a place of the face, by the weights of its corners.
  Colour colour_at(const Face& face, const double (&weight)[3]) const {
    const Colour own = kRegionColours[face.region % std::size(kRegionColours)];
    if (face.texture[0] == nullptr) return own;
    double place[2] = {};
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t k = 0; k < 2; ++k)
        place[k] += weight[i] * (*face.texture[i])[k] * wire::kTextureQuantum;
    // The picture is repeated beyond its edges; v runs upward.
    const auto pixel = [](double share, int count) {
      return std::clamp(static_cast<int>((share - std::floor(share)) * count), 0, count - 1);
    };
    const auto& painted =
        painted_.at(pixel(place[0], painted_.width), pixel(1 - place[1], painted_.height));
    Colour colour;
    for (std::size_t i = 0; i < 3; ++i)
      colour[i] =
          face.region == 0 ? painted[i] : static_cast<std::uint8_t>((painted[i] + own[i]) / 2);
    return colour;
  }

  void draw(const View& view, int left, const Face& face) {
    double x[3], y[3], z[3];
    const auto& p = face.corners;
    for (std::size_t i = 0; i < 3; ++i) {
      x[i] = left + kView / 2.0 + dot(p[i], view.right) * pixels_per_m_;
      y[i] = kView / 2.0 - dot(p[i], view.up) * pixels_per_m_;
      z[i] = dot(p[i], view.toward);
    }
    const Vec3d normal = normalized(cross(p[1] - p[0], p[2] - p[0]), {});
    const double facing = dot(normal, view.toward);
    if (facing <= 0) return;
    const double area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
    if (area == 0) return;
    // Light comes from the eye and a little from above.
    const double light = (0.35 + 0.55 * facing + 0.1 * std::max(dot(normal, view.up), 0.0)) *
                         (face.is_held ? kHeldShade : 1);
    const auto clamp_to = [](double value, int low, int high) {
      return std::clamp(static_cast<int>(std::floor(value)), low, high);
    };
    const int x0 = clamp_to(std::min({x[0], x[1], x[2]}), left, left + kView - 1),
              x1 = clamp_to(std::max({x[0], x[1], x[2]}) + 1, left, left + kView - 1),
              y0 = clamp_to(std::min({y[0], y[1], y[2]}), 0, picture_.height - 1),
              y1 = clamp_to(std::max({y[0], y[1], y[2]}) + 1, 0, picture_.height - 1);
    for (int row = y0; row <= y1; ++row)
      for (int column = x0; column <= x1; ++column) {
        const double px = column + 0.5, py = row + 0.5;
        double weight[3], least = 1e9;
        for (int i = 0; i < 3; ++i) {
          const int j = (i + 1) % 3, k = (i + 2) % 3;
          weight[i] = ((x[j] - px) * (y[k] - py) - (x[k] - px) * (y[j] - py)) / area;
          // The pixel is so far from that edge.
          least =
              std::min(least, weight[i] * std::abs(area) / std::hypot(x[k] - x[j], y[k] - y[j]));
        }
        if (weight[0] < 0 || weight[1] < 0 || weight[2] < 0) continue;
        const double depth = weight[0] * z[0] + weight[1] * z[1] + weight[2] * z[2];
        const auto at = static_cast<std::size_t>(row) * static_cast<std::size_t>(picture_.width) +
                        static_cast<std::size_t>(column);
        if (depth <= depth_[at]) continue;
        depth_[at] = depth;
        const bool is_edge = face.has_edges && least < kEdgePixels;
        picture_.pixels[at] = shaded(colour_at(face, weight), is_edge ? light * kEdgeShade : light);
      }
  }

  const mesh::TetMesh& mesh_;
  const std::vector<std::uint16_t>& regions_;
  const std::vector<std::uint8_t>& held_;
  const image::Image& painted_;
  Picture picture_;
  std::vector<double> depth_;  // m, towards the eye
  double pixels_per_m_ = 1;
};

}  // namespace

Picture draw_organ(const mesh::TetMesh& mesh, const std::vector<std::uint16_t>& region_of_node,
                   const std::vector<std::uint8_t>& is_held, const wire::FineSurface& fine,
                   const image::Image& painted) {
  return Drawer(mesh, region_of_node, is_held, painted).run(fine);
}

double scale_bar_m(const mesh::TetMesh& mesh) {
  // It is at most half as long as the organ.
  const double longest = largest_half(mesh);
  double length = 1e-6;
  for (double power = 1e-6; power < 10; power *= 10)
    for (const double digit : {1.0, 2.0, 5.0})
      if (digit * power <= longest) length = digit * power;
  return length;
}

}  // namespace trocar::picture
