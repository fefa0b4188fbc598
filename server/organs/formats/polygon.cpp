#include "server/organs/formats/polygon.h"

#include <algorithm>
#include <numeric>

namespace trocar::formats {
namespace {

constexpr double kRounding = 1e-12;  // of the face's area

// The corners of a face, seen from its outside.
class Polygon {
 public:
  Polygon(std::span<const std::int64_t> corners, const std::vector<Vec3d>& positions)
      : corners_(corners), positions_(positions) {
    for (std::size_t i = 2; i < corners.size(); ++i)
      normal_ = normal_ + cross(at(i - 1) - at(0), at(i) - at(0));
  }

  // Returns the area of the least triangle around corner 0. Areas are doubled, seen along the
  // face's normal and multiplied by its length; those of turned triangles are below 0.
  double least_area() const {
    double least = whole();
    for (std::size_t i = 2; i < corners_.size(); ++i) least = std::min(least, area(0, i - 1, i));
    return least;
  }
  double whole() const { return dot(normal_, normal_); }

  // Returns nothing if at some point no corner can be cut off.
  std::vector<PolygonCut> clip_ears() const {
    std::vector<PolygonCut> cuts;
    std::vector<std::size_t> left(corners_.size());
    std::iota(left.begin(), left.end(), std::size_t{0});
    std::size_t i = 0, failed = 0;
    while (left.size() > 3) {
      const std::size_t n = left.size();
      i %= n;
      const PolygonCut ear{left[(i + n - 1) % n], left[i], left[(i + 1) % n]};
      if (is_ear(ear, left)) {
        cuts.push_back(ear);
        left.erase(left.begin() + static_cast<std::ptrdiff_t>(i));
        failed = 0;
      } else if (++failed == n) {
        return {};
      }
      ++i;  // behind an ear its neighbour is spared once, so that ears do not get thin
    }
    cuts.push_back({left[0], left[1], left[2]});
    return area(left[0], left[1], left[2]) >= -kRounding * whole() ? cuts
                                                                   : std::vector<PolygonCut>();
  }

 private:
  const Vec3d& at(std::size_t i) const { return positions_[static_cast<std::size_t>(corners_[i])]; }
  double area(std::size_t a, std::size_t b, std::size_t c) const {
    return dot(cross(at(b) - at(a), at(c) - at(a)), normal_);
  }
  bool is_ear(const PolygonCut& ear, const std::vector<std::size_t>& left) const {
    const std::size_t a = ear[0], b = ear[1], c = ear[2];
    if (!(area(a, b, c) > kRounding * whole())) return false;
    return std::ranges::none_of(left, [&](std::size_t other) {
      const Vec3d& p = at(other);
      if (p == at(a) || p == at(b) || p == at(c)) return false;
      return area(a, b, other) >= 0 && area(b, c, other) >= 0 && area(c, a, other) >= 0;
    });
  }

  std::span<const std::int64_t> corners_;
  const std::vector<Vec3d>& positions_;
  Vec3d normal_;  // twice the face's area long
};

// Returns nothing for a face that is to be cut around its first corner.
Result<std::vector<PolygonCut>> cut_concave(std::span<const std::int64_t> corners,
                                            const std::vector<Vec3d>& positions) {
  const Polygon polygon(corners, positions);
  const double least = polygon.least_area(), rounding = kRounding * polygon.whole();
  if (least > rounding) return std::vector<PolygonCut>();
  if (corners.size() <= kMaxConcaveCorners) return polygon.clip_ears();
  if (least >= -rounding) return std::vector<PolygonCut>();
  return Error{ErrorCode::BadFile, "is concave and has " + std::to_string(corners.size()) +
                                       " corners, may have " + std::to_string(kMaxConcaveCorners) +
                                       ": save it as triangles"};
}

}  // namespace

Status add_polygon(std::span<const std::int64_t> corners, std::int64_t number,
                   surface::RawSurface& surface, std::vector<PolygonCut>* cuts) {
  const std::string face = "face " + std::to_string(number);
  if (corners.size() < 3)
    return Error{ErrorCode::BadFile,
                 face + " has " + std::to_string(corners.size()) + " corners, must have 3 or more"};
  const auto count = static_cast<std::int64_t>(surface.positions.size());
  for (const std::int64_t corner : corners)
    if (corner < 0 || corner >= count)
      return Error{ErrorCode::BadFile, face + " refers to vertex " + std::to_string(corner + 1) +
                                           ", the file has " + std::to_string(count)};
  const auto add = [&](const PolygonCut& cut) {
    auto& triangle = surface.triangles.emplace_back();
    for (std::size_t k = 0; k < 3; ++k)
      triangle[k] = NodeIndex(static_cast<std::uint32_t>(corners[cut[k]]));
    surface.face_numbers.push_back(number);
    if (cuts != nullptr) cuts->push_back(cut);
  };
  if (corners.size() > 3) {
    const auto ears = cut_concave(corners, surface.positions);
    if (!ears) return Error{ErrorCode::BadFile, face + " " + ears.error().message};
    for (const PolygonCut& ear : *ears) add(ear);
    if (!ears->empty()) return {};
  }
  for (std::size_t i = 2; i < corners.size(); ++i) add({0, i - 1, i});
  return {};
}

}  // namespace trocar::formats
