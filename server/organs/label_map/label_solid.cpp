#include "server/organs/label_map/label_solid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <set>

namespace trocar::label_map {
namespace {

constexpr int kMargin = 4;  // voxels around the solid
constexpr std::uint64_t kMaxVoxels = std::uint64_t{1} << 26;
constexpr double kLargestShare = 0.9;
constexpr double kDepth = 0.1;         // voxels from the surface from which on it is inside
constexpr double kLeastInside = 0.05;  // share of a solid's voxels
constexpr float kFar = 1e20f;

// Squared distances to the nearest zero along one line of samples a step apart: the lower envelope
// of parabolas.
class LineTransform {
 public:
  void run(float* values, std::size_t count, std::size_t stride, double step) {
    in_.resize(count);
    place_.resize(count);
    bound_.resize(count + 1);
    for (std::size_t i = 0; i < count; ++i) in_[i] = values[i * stride];
    std::size_t k = 0;
    const auto meet = [&](std::size_t q, std::size_t v) {
      const double a = static_cast<double>(q) * step, b = static_cast<double>(v) * step;
      return ((in_[q] + a * a) - (in_[v] + b * b)) / (2 * (a - b));
    };
    constexpr double kInfinite = std::numeric_limits<double>::infinity();
    place_[0] = 0, bound_[0] = -kInfinite, bound_[1] = kInfinite;
    for (std::size_t q = 1; q < count; ++q) {
      double s = meet(q, place_[k]);
      while (k > 0 && s <= bound_[k]) s = meet(q, place_[--k]);
      place_[++k] = q, bound_[k] = s, bound_[k + 1] = kInfinite;
    }
    k = 0;
    for (std::size_t q = 0; q < count; ++q) {
      const double x = static_cast<double>(q) * step;
      while (bound_[k + 1] < x) ++k;
      const double d = x - static_cast<double>(place_[k]) * step;
      values[q * stride] = static_cast<float>(std::min(d * d + in_[place_[k]], double{kFar}));
    }
  }

 private:
  std::vector<double> in_, bound_;
  std::vector<std::size_t> place_;
};

template <typename Visit>
void for_each_line(const std::array<int, 3>& size, int axis, const Visit& visit) {
  const std::array<std::size_t, 3> n{std::size_t(size[0]), std::size_t(size[1]),
                                     std::size_t(size[2])};
  const std::array<std::size_t, 3> stride{1, n[0], n[0] * n[1]};
  const auto a = static_cast<std::size_t>(axis), b = (a + 1) % 3, c = (a + 2) % 3;
  for (std::size_t i = 0; i < n[b]; ++i)
    for (std::size_t j = 0; j < n[c]; ++j) visit(i * stride[b] + j * stride[c], n[a], stride[a]);
}

}  // namespace

Result<LabelSolid> LabelSolid::make(LabelMap map, const std::vector<std::uint16_t>& labels,
                                    const std::string& name) {
  LabelSolid solid(std::move(map));
  if (auto s = solid.crop(labels, name); !s) return s.error();
  if (auto s = solid.keep_largest_body(name); !s) return s.error();
  solid.measure();
  solid.find_distances();
  const double limit =
      -kDepth * std::min({length(solid.map_.steps_m[0]), length(solid.map_.steps_m[1]),
                          length(solid.map_.steps_m[2])});
  const auto inside = std::ranges::count_if(solid.distance_m_, [&](float d) { return d < limit; });
  if (static_cast<double>(inside) * solid.map_.voxel_volume_m3() < kLeastInside * solid.volume_m3_)
    return Error{ErrorCode::BadFile, name + ": " + solid.thinness()};
  return solid;
}

Status LabelSolid::crop(const std::vector<std::uint16_t>& labels, const std::string& name) {
  std::vector<std::uint8_t> belongs(65536, labels.empty());
  belongs[0] = 0;
  for (const auto label : labels) belongs[label] = label != 0;
  std::array<int, 3> low = map_.size, high{-1, -1, -1};
  std::vector<std::uint8_t> is_there(65536, 0);
  for (int k = 0; k < map_.size[2]; ++k)
    for (int j = 0; j < map_.size[1]; ++j)
      for (int i = 0; i < map_.size[0]; ++i) {
        auto& label = map_.labels[map_.index(i, j, k)];
        is_there[label] = 1;
        if (!belongs[label]) {
          label = 0;
          continue;
        }
        const std::array<int, 3> at{i, j, k};
        for (std::size_t d = 0; d < 3; ++d)
          low[d] = std::min(low[d], at[d]), high[d] = std::max(high[d], at[d]);
      }
  for (const auto label : labels)
    if (!is_there[label] || label == 0)
      return Error{ErrorCode::BadFile,
                   name + ": no voxel has label " + std::to_string(label) + " (--labels)"};
  if (high[0] < 0) return Error{ErrorCode::BadFile, name + ": all voxels have label 0"};
  LabelMap cut{{},         {},           map_.origin_m, map_.steps_m, map_.unit_m, map_.orientation,
               map_.names, map_.warnings};
  std::uint64_t count = 1;
  for (std::size_t d = 0; d < 3; ++d) {
    cut.size[d] = high[d] - low[d] + 1 + 2 * kMargin;
    count *= static_cast<std::uint64_t>(cut.size[d]);
    cut.origin_m += map_.steps_m[d] * double(low[d] - kMargin);
  }
  if (count > kMaxVoxels)
    return Error{ErrorCode::BadFile, name +
                                         ": the organ fills more than 67,000,000 voxels: "
                                         "resample it with larger ones"};
  cut.labels.assign(count, 0);
  for (int k = low[2]; k <= high[2]; ++k)
    for (int j = low[1]; j <= high[1]; ++j)
      for (int i = low[0]; i <= high[0]; ++i)
        cut.labels[cut.index(i - low[0] + kMargin, j - low[1] + kMargin, k - low[2] + kMargin)] =
            map_.labels[map_.index(i, j, k)];
  map_ = std::move(cut);
  return {};
}

// Voxels hang together over faces.
Status LabelSolid::keep_largest_body(const std::string& name) {
  std::vector<std::uint32_t> body(map_.labels.size(), 0);
  std::vector<std::size_t> sizes{0}, queue;
  const auto nx = static_cast<std::size_t>(map_.size[0]);
  const std::size_t strides[3] = {1, nx, nx * static_cast<std::size_t>(map_.size[1])};
  for (std::size_t seed = 0; seed < body.size(); ++seed) {
    if (map_.labels[seed] == 0 || body[seed] != 0) continue;
    const auto number = static_cast<std::uint32_t>(sizes.size());
    sizes.push_back(0);
    body[seed] = number;
    queue.assign(1, seed);
    while (!queue.empty()) {
      const auto at = queue.back();
      queue.pop_back();
      ++sizes[number];
      for (const auto stride : strides)
        // The margin keeps neighbours inside the map.
        for (const auto next : {at - stride, at + stride})
          if (map_.labels[next] != 0 && body[next] == 0) {
            body[next] = number;
            queue.push_back(next);
          }
    }
  }
  const auto largest = static_cast<std::uint32_t>(std::ranges::max_element(sizes) - sizes.begin());
  std::size_t all = 0;
  for (const auto size : sizes) all += size;
  if (sizes.size() == 2) return {};
  const double share = static_cast<double>(sizes[largest]) / static_cast<double>(all);
  if (share < kLargestShare)
    return Error{ErrorCode::BadFile, name + ": is " + std::to_string(sizes.size() - 1) +
                                         " separate bodies: choose one structure (--labels)"};
  std::set<std::uint16_t> kept, lost;
  for (std::size_t i = 0; i < body.size(); ++i)
    if (map_.labels[i] != 0) (body[i] == largest ? kept : lost).insert(map_.labels[i]);
  for (std::size_t i = 0; i < body.size(); ++i)
    if (body[i] != largest) map_.labels[i] = 0;
  char text[120];
  std::snprintf(text, sizeof text,
                "dropped %zu separate bodies that have %.2g %% of the volume, %.3g ml",
                sizes.size() - 2, 100 * (1 - share),
                1e6 * static_cast<double>(all - sizes[largest]) * map_.voxel_volume_m3());
  std::string whole;
  for (const auto label : lost)
    if (!kept.contains(label)) whole += (whole.empty() ? "" : ", ") + std::to_string(label);
  map_.warnings.push_back(text +
                          (whole.empty() ? "" : ", and with them all of these labels: " + whole));
  return {};
}

std::string LabelSolid::thinness() const {
  std::size_t thinnest = 0;  // dimension
  for (std::size_t d = 1; d < 3; ++d)
    if (map_.size[d] < map_.size[thinnest]) thinnest = d;
  const bool is_slice = map_.size[thinnest] == 1 + 2 * kMargin;
  char text[160];
  std::snprintf(text, sizeof text,
                "%s%.3g mm thick: it has no inside, whatever the number of nodes; take a map of "
                "thinner voxels",
                is_slice ? "is one slice, " : "is hardly anywhere thicker than a voxel, at most ",
                1e3 * (is_slice ? length(map_.steps_m[thinnest])
                                : std::max({length(map_.steps_m[0]), length(map_.steps_m[1]),
                                            length(map_.steps_m[2])})));
  return text;
}

void LabelSolid::measure() {
  std::map<std::uint16_t, std::size_t> counts;
  const auto nx = static_cast<std::size_t>(map_.size[0]);
  const std::size_t strides[3] = {1, nx, nx * static_cast<std::size_t>(map_.size[1])};
  const double h[3] = {length(map_.steps_m[0]), length(map_.steps_m[1]), length(map_.steps_m[2])};
  for (std::size_t i = 0; i < map_.labels.size(); ++i) {
    if (map_.labels[i] == 0) continue;
    ++counts[map_.labels[i]];
    for (std::size_t d = 0; d < 3; ++d)
      surface_m2_ += ((map_.labels[i - strides[d]] == 0) + (map_.labels[i + strides[d]] == 0)) *
                     (h[(d + 1) % 3] * h[(d + 2) % 3]);
  }
  for (const auto& [label, count] : counts) {
    labels_.push_back(label);
    label_volumes_m3_.push_back(static_cast<double>(count) * map_.voxel_volume_m3());
    volume_m3_ += label_volumes_m3_.back();
  }
}

void LabelSolid::find_distances() {
  const double h[3] = {length(map_.steps_m[0]), length(map_.steps_m[1]), length(map_.steps_m[2])};
  const double half = std::min({h[0], h[1], h[2]}) / 2;
  const auto distances_to = [&](bool inside) {
    std::vector<float> squared(map_.labels.size());
    for (std::size_t i = 0; i < squared.size(); ++i)
      squared[i] = (map_.labels[i] != 0) == inside ? 0 : kFar;
    LineTransform transform;
    for (int axis = 0; axis < 3; ++axis)
      for_each_line(map_.size, axis, [&](std::size_t first, std::size_t count, std::size_t stride) {
        transform.run(squared.data() + first, count, stride, h[axis]);
      });
    return squared;
  };
  distance_m_ = distances_to(true);
  {
    const auto to_outside = distances_to(false);
    for (std::size_t i = 0; i < distance_m_.size(); ++i)
      distance_m_[i] =
          static_cast<float>(map_.labels[i] == 0 ? std::sqrt(double{distance_m_[i]}) - half
                                                 : half - std::sqrt(double{to_outside[i]}));
  }
  std::vector<float> line;
  for (int axis = 0; axis < 3; ++axis)
    for_each_line(map_.size, axis, [&](std::size_t first, std::size_t count, std::size_t stride) {
      line.resize(count);
      for (std::size_t i = 0; i < count; ++i) line[i] = distance_m_[first + i * stride];
      for (std::size_t i = 1; i + 1 < count; ++i)
        distance_m_[first + i * stride] = (line[i - 1] + 2 * line[i] + line[i + 1]) / 4;
    });
}

double LabelSolid::distance(const Vec3d& p) const {
  const Vec3d v = map_.voxel_of(p);
  const std::array<double, 3> at{v.x, v.y, v.z};
  std::array<int, 3> low{};
  std::array<double, 3> share{};
  double beyond_squared = 0;  // of the map, where the nearest value in it is a lower bound
  for (std::size_t d = 0; d < 3; ++d) {
    const double inside = std::clamp(at[d], 0.0, map_.size[d] - 1.0);
    const double beyond = (at[d] - inside) * length(map_.steps_m[d]);
    beyond_squared += beyond * beyond;
    low[d] = std::min(static_cast<int>(inside), map_.size[d] - 2);
    share[d] = inside - low[d];
  }
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    double weight = 1;
    std::array<int, 3> c{};
    for (std::size_t d = 0; d < 3; ++d) {
      const int bit = corner >> d & 1;
      weight *= bit ? share[d] : 1 - share[d];
      c[d] = low[d] + bit;
    }
    sum += weight * distance_m_[map_.index(c[0], c[1], c[2])];
  }
  return sum + std::sqrt(beyond_squared);
}

std::uint16_t LabelSolid::label_at(const Vec3d& p) const {
  const Vec3d v = map_.voxel_of(p);
  const int i = static_cast<int>(std::lround(v.x)), j = static_cast<int>(std::lround(v.y)),
            k = static_cast<int>(std::lround(v.z));
  if (i < 0 || j < 0 || k < 0 || i >= map_.size[0] || j >= map_.size[1] || k >= map_.size[2])
    return 0;
  return map_.labels[map_.index(i, j, k)];
}

mesh::Box LabelSolid::box() const {
  // Corners of the cut map, whose axes may be turned.
  mesh::Box box;
  for (int corner = 0; corner < 8; ++corner) {
    Vec3d p = map_.origin_m;
    for (std::size_t d = 0; d < 3; ++d)
      if (corner >> d & 1) p += map_.steps_m[d] * double(map_.size[d] - 1);
    box.include(p);
  }
  return box;
}

double LabelSolid::volume_of(std::uint16_t label) const {
  const auto at = std::ranges::lower_bound(labels_, label);
  return at == labels_.end() || *at != label
             ? 0
             : label_volumes_m3_[static_cast<std::size_t>(at - labels_.begin())];
}

}  // namespace trocar::label_map
