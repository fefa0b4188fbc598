#include "server/organs/mesh/places.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <numeric>

#include "common/math/box.h"

namespace trocar::mesh {
namespace {

constexpr double kMaxSize_m = 2.0;
constexpr double kFar_m = 10;  // worth a warning: a body frame is nearer

// Organs are 20 mm to 500 mm wide.
const char* other_unit(double width) {
  if (width > kMaxSize_m * 1000) return "scale it, or give the unit with --unit m, cm or mm";
  if (width > 50)
    return "if the file is in millimetres, import it with trocar-organ import --unit mm";
  if (width > 20)
    return "if the file is in millimetres or centimetres, import it with trocar-organ import "
           "--unit mm or cm";
  return "if the file is in centimetres, import it with trocar-organ import --unit cm";
}

}  // namespace

Result<Centring> centre(std::span<Vec3d> positions, Unit unit, const std::string& things) {
  trocar::Box<double> box;
  for (const Vec3d& p : positions) box.include(p);
  const Vec3d size = box.most - box.least;
  const double largest = std::max({size.x, size.y, size.z});
  char text[200];
  if (largest > kMaxSize_m) {
    std::snprintf(text, sizeof text, "is %.4g m wide, larger than 2 m: %s", largest,
                  unit == Unit::Metre ? other_unit(largest)
                                      : "scale it, or give the unit with --unit m, cm or mm");
    return Error{ErrorCode::BadFile, text};
  }
  if (largest == 0) return Error{ErrorCode::BadFile, "all " + things + " are at the same position"};
  Centring done{box.least + size * 0.5, {}};
  for (Vec3d& p : positions) p -= done.offset_m;
  if (length(done.offset_m) <= kFar_m) return done;
  std::snprintf(text, sizeof text, "centred: it was at (%.3f, %.3f, %.3f) m, far from the origin",
                done.offset_m.x, done.offset_m.y, done.offset_m.z);
  done.warning = text;
  return done;
}

Welding weld(std::span<const Vec3d> positions) {
  std::vector<std::uint32_t> order(positions.size());
  std::iota(order.begin(), order.end(), std::uint32_t{0});
  const auto key = [&](std::uint32_t i) {
    const Vec3d& p = positions[i];
    return std::array{p.x, p.y, p.z};
  };
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const auto ka = key(a), kb = key(b);
    return ka != kb ? ka < kb : a < b;
  });
  Welding done;
  done.first.resize(order.size());
  done.keep.assign(order.size(), 1);
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && positions[order[i]] == positions[order[i - 1]];
    done.first[order[i]] = same ? done.first[order[i - 1]] : order[i];
    done.keep[order[i]] = !same;
    done.welded += same;
  }
  return done;
}

}  // namespace trocar::mesh
