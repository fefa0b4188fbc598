#include "server/organs/dicom/slices.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace trocar::dicom {
namespace {

constexpr double kTolerance = 0.02;  // of a spacing, or of a pixel
constexpr double kSame_mm = 1e-3;    // heights that differ by less are one
constexpr double kMissing = 16, kAlwaysMissing = 64;

Error error(const std::string& text) {
  return {ErrorCode::BadFile, text};
}

}  // namespace

Result<SliceGrid> arrange_slices(const std::vector<Vec3d>& places, const Vec3d& right,
                                 const Vec3d& down, std::optional<double> spacing, bool may_miss) {
  if (places.empty()) return error("it has no slice");
  const Vec3d across = cross(right, down);
  if (!(length(across) > 0) || !is_finite(across))
    return error("ImageOrientationPatient or PixelSpacing gives no plane");
  const Vec3d up = across / length(across);
  std::vector<double> heights;
  for (const Vec3d& place : places) {
    if (!is_finite(place)) return error("ImagePositionPatient is not finite");
    heights.push_back(dot(place, up));
  }
  std::vector<double> levels = heights;
  std::ranges::sort(levels);
  levels.erase(std::unique(levels.begin(), levels.end(),
                           [](double a, double b) { return b - a < kSame_mm; }),
               levels.end());
  if (levels.size() > 1) {
    double least = levels[1] - levels[0];
    for (std::size_t i = 2; i < levels.size(); ++i)
      least = std::min(least, levels[i] - levels[i - 1]);
    // It is said in some files for slices that overlap, or with few digits.
    const double said = spacing.value_or(least);
    const bool is_told = may_miss && spacing &&
                         std::abs(std::round(least / said) * said - least) <= kTolerance * said &&
                         said < least;
    spacing = is_told ? said : least;
  }
  if (!spacing || !(*spacing > 0))
    return error("it has one slice, and neither SpacingBetweenSlices nor SliceThickness");
  const auto lowest = static_cast<std::size_t>(std::ranges::min_element(heights) - heights.begin());
  const double extent = levels.back() - levels.front();
  // The whole stack gives the step, because places have few digits.
  const double step = levels.size() == 1 ? *spacing : extent / std::round(extent / *spacing);
  const double count = extent / step + 1;
  if (count > (kMissing + 1) * static_cast<double>(levels.size()) + kAlwaysMissing)
    return error(
        fmt::format("its {} slices are spread over {:.0f} positions: most of them are missing",
                    levels.size(), count));
  SliceGrid grid{.origin = places[lowest],
                 .step = up * step,
                 .count = static_cast<int>(std::lround(count)),
                 .slice_of_places = {}};
  const double pixel = std::min(length(right), length(down));
  for (std::size_t i = 0; i < places.size(); ++i) {
    const double at = (heights[i] - levels.front()) / step;
    if (std::abs(at - std::round(at)) > kTolerance)
      return error(fmt::format("its slices are not equally far apart, at {:.3f} mm", heights[i]));
    grid.slice_of_places.push_back(static_cast<int>(std::lround(at)));
    const Vec3d beside = places[i] - grid.origin - grid.step * std::round(at);
    if (length(beside - up * dot(beside, up)) > kTolerance * pixel)
      return error("its slices are not straight above one another: resample it at right angles");
  }
  if (!may_miss && grid.count != static_cast<int>(levels.size()))
    for (std::size_t i = 1; i < levels.size(); ++i)
      if (levels[i] - levels[i - 1] > 1.5 * step)
        return error(fmt::format("a slice is missing between {:.2f} and {:.2f} mm", levels[i - 1],
                                 levels[i]));
  return grid;
}

}  // namespace trocar::dicom
