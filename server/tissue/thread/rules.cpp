#include "server/tissue/thread/rules.h"

#include <algorithm>

namespace trocar::thread {
namespace {

constexpr double kFineM = kSegmentM / 4;
constexpr int kSmoothings = 40;  // rounds corners to about 1.5 mm
constexpr double kMostInsideM = 0.05e-3;

// Points at straight distances of `step_m`, from the first on. A last step that is short by
// rounding alone counts.
std::vector<Vec3d> resampled(const std::vector<Vec3d>& path, double step_m) {
  std::vector<Vec3d> points{path.front()};
  std::size_t next = 1;
  for (;;) {
    const Vec3d here = points.back();
    while (next < path.size() && length(path[next] - here) < step_m * (1 - 1e-9)) ++next;
    if (next == path.size()) return points;
    // Within the piece of the path that leaves the sphere around `here`.
    const Vec3d from = path[next - 1] - here, way = path[next] - path[next - 1];
    const double a = dot(way, way), b = dot(from, way), c = dot(from, from) - step_m * step_m;
    const double part = (-b + std::sqrt(std::max(0.0, b * b - a * c))) / a;
    points.push_back(path[next - 1] + way * std::min(part, 1.0));
  }
}

bool is_place(const Vec3d& p) {
  return is_finite(p) && length(p) <= kMostM;
}

Error wrong(const std::string& field, const std::string& what) {
  return {ErrorCode::BadFile, field + ": " + what};
}

Status validate_end(const End& end, const std::string& field) {
  if (!is_finite(end.load_n) || length(end.load_n) > kMostLoadN)
    return wrong(field + ".load_n", "is outside 0 to 50 N");
  if (!is_finite(end.velocity_m_s) || length(end.velocity_m_s) > kMostSpeedM_s)
    return wrong(field + ".velocity_m_s", "is outside 0 to 5 m/s");
  if (!(end.until_s >= 0 && end.until_s <= kMostSeconds))
    return wrong(field + ".until_s", "is outside 0 to 1000000 s");
  if (end.is_held ? end.load_n != Vec3d{} : end.velocity_m_s != Vec3d{})
    return wrong(field, "a held end has a velocity and no load, a free end has a load and none");
  return {};
}

// A thread that begins inside of a peg would be thrown out.
Status validate_outside(const std::vector<Vec3d>& nodes, const std::vector<Peg>& pegs,
                        const std::string& field) {
  for (const auto& node : nodes)
    for (std::size_t i = 0; i < pegs.size(); ++i) {
      const Vec3d axis = pegs[i].to_m - pegs[i].from_m, from = node - pegs[i].from_m;
      const double all = length_squared(axis);
      const double part = all > 0 ? std::clamp(dot(from, axis) / all, 0.0, 1.0) : 0;
      if (length(from - axis * part) < pegs[i].radius_m - kMostInsideM)
        return wrong(field + ".path_m", "passes through peg[" + std::to_string(i) +
                                            "], lay it outside: its corners are rounded by 1 mm");
    }
  return {};
}

Status validate_thread(const ThreadRule& rule, const std::string& field, std::size_t& nodes) {
  if (rule.path_m.size() < 2 || rule.path_m.size() > kMostPathPoints)
    return wrong(field + ".path_m", "has " + std::to_string(rule.path_m.size()) +
                                        " points, write 2 to " + std::to_string(kMostPathPoints));
  if (!std::ranges::all_of(rule.path_m, is_place))
    return wrong(field + ".path_m", "is not within 2 m around the origin");
  double longest = 0;
  for (std::size_t i = 1; i < rule.path_m.size(); ++i)
    longest += length(rule.path_m[i] - rule.path_m[i - 1]);
  if (longest > 2 * static_cast<double>(kMostNodes) * kSegmentM)
    return wrong(field + ".path_m", "is too long, allowed are 1199 mm of all threads together");
  const auto own = nodes_along(rule.path_m).size();
  nodes += own;
  if (own < kLeastNodes) return wrong(field + ".path_m", "is too short, write at least 3 mm");
  if (nodes > kMostNodes)
    return wrong(field + ".path_m", "is too long, allowed are 1199 mm of all threads together");
  if (rule.self_friction && !(*rule.self_friction >= 0 && *rule.self_friction <= 1))
    return wrong(field + ".self_friction", "is outside 0 to 1");
  if (const auto ok = validate_end(rule.start, field + ".start"); !ok.ok()) return ok;
  return validate_end(rule.end, field + ".end");
}

}  // namespace

Suture ThreadRule::suture() const {
  auto suture = suture_of(material, size);
  if (self_friction) suture.self_friction = *self_friction;
  return suture;
}

std::vector<Vec3d> nodes_along(const std::vector<Vec3d>& path_m) {
  auto fine = resampled(path_m, kFineM);
  std::vector<Vec3d> before;
  for (int round = 0; round < kSmoothings; ++round) {
    before = fine;
    for (std::size_t i = 1; i + 1 < fine.size(); ++i)
      fine[i] = (before[i - 1] + before[i] * 2.0 + before[i + 1]) * 0.25;
  }
  return resampled(fine, kSegmentM);
}

Status validate(const Rules& rules) {
  if (rules.threads.empty() || rules.threads.size() > kMostThreads)
    return wrong("thread", "there are " + std::to_string(rules.threads.size()) + ", write 1 to 8");
  if (rules.pegs.size() > kMostPegs)
    return wrong("peg", "there are " + std::to_string(rules.pegs.size()) + ", allowed are 32");
  for (std::size_t i = 0; i < rules.pegs.size(); ++i) {
    const auto& peg = rules.pegs[i];
    const auto field = "peg[" + std::to_string(i) + "]";
    if (!is_place(peg.from_m) || !is_place(peg.to_m))
      return wrong(field + ".from_m, to_m", "are not within 2 m around the origin");
    if (!(peg.radius_m >= kLeastPegRadiusM && peg.radius_m <= kMostPegRadiusM))
      return wrong(field + ".radius_m", "is outside 0.001 to 1 m");
    if (!(peg.friction >= 0 && peg.friction <= 2))
      return wrong(field + ".friction", "is outside 0 to 2");
  }
  std::size_t nodes = 0;
  for (std::size_t i = 0; i < rules.threads.size(); ++i) {
    const auto field = "thread[" + std::to_string(i) + "]";
    if (const auto ok = validate_thread(rules.threads[i], field, nodes); !ok) return ok;
    const auto laid = nodes_along(rules.threads[i].path_m);
    if (const auto ok = validate_outside(laid, rules.pegs, field); !ok) return ok;
  }
  if (rules.floor_y_m && !(std::abs(*rules.floor_y_m) <= kMostM))
    return wrong("floor_y_m", "is outside -2 to 2 m");
  if (!is_finite(rules.gravity_m_s2) || length(rules.gravity_m_s2) > 1000)
    return wrong("gravity_m_s2", "is outside 0 to 1000 m/s^2");
  return {};
}

}  // namespace trocar::thread
