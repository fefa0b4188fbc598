#include "tests/thread/laid_thread.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/base/checksum.h"

namespace trocar::thread {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kApartM = 1.2e-3;  // of a strand from the middle of a throw
constexpr double kTailM = 50e-3;
constexpr double kPostM = 7e-3;  // radius of the loop as laid

using Path = std::vector<Vec3d>;

// Leads from one throw up to the next, around the outside.
void add_arc(Path& strand, double side, double half_width, double from_y, double to_y) {
  const double r = (to_y - from_y) / 2;
  for (int i = 1; i < 16; ++i) {
    const double angle = -kPi / 2 + kPi * i / 16;
    strand.push_back(
        {side * (half_width + r * std::cos(angle)), (from_y + to_y) / 2 + r * std::sin(angle), 0});
  }
}

// From the left hand over the throws, around the loop, and back to the right hand.
Path knot_path(const std::vector<Throw>& throws) {
  Path left, right;  // strands from the loop upwards, by where they begin
  const double rise = 4.2 * kApartM;
  const double half_width = throws.front().half_turns > 3 ? 6e-3 : 4.5e-3;
  bool is_swapped = false;  // the left one is at the right
  double y = 0;
  for (std::size_t t = 0; t < throws.size(); ++t) {
    const auto [half_turns, hand] = throws[t];
    if (t > 0) {
      add_arc(is_swapped ? left : right, +1, half_width, y - rise + kApartM, y - kApartM);
      add_arc(is_swapped ? right : left, -1, half_width, y - rise + kApartM, y - kApartM);
    }
    for (int i = 0; i <= 60; ++i) {
      const double u = i / 60.0, angle = u * half_turns * kPi, other = half_turns * kPi - angle;
      (is_swapped ? right : left)
          .push_back({half_width * (2 * u - 1), y - kApartM * std::cos(angle),
                      hand * kApartM * std::sin(angle)});
      (is_swapped ? left : right)
          .push_back({half_width * (1 - 2 * u), y + kApartM * std::cos(other),
                      -hand * kApartM * std::sin(other)});
    }
    is_swapped = !is_swapped;
    y += rise;
  }
  const double top = y - rise + kApartM;
  const auto& to_start = is_swapped ? right : left;
  const auto& to_end = is_swapped ? left : right;
  Path path{{-half_width - kTailM, top, 0}};
  path.insert(path.end(), to_start.rbegin(), to_start.rend());
  const double turn = to_start.front().x < 0 ? 1 : -1;
  const double open = std::asin(half_width / kPostM);
  for (int i = 0; i <= 90; ++i) {
    const double angle = kPi / 2 + turn * (open + (2 * kPi - 2 * open) * i / 90.0);
    path.push_back({kPostM * std::cos(angle), -kApartM - kPostM + kPostM * std::sin(angle), 0});
  }
  path.insert(path.end(), to_end.begin(), to_end.end());
  path.push_back({half_width + kTailM, top, 0});
  return path;
}

Rules knot_rules(const std::vector<Throw>& throws, double self_friction) {
  auto rules = rules_of(silk_along(knot_path(throws)));
  rules.threads[0].self_friction = self_friction;
  for (const double side : {-1.0, 1.0}) {
    const Vec3d middle{side * 2.5e-3, -kApartM - kPostM, 0};
    rules.pegs.push_back({middle - Vec3d{0, 0, 0.03}, middle + Vec3d{0, 0, 0.03}, 3e-3, 0});
  }
  return rules;
}

// 0: as seen along z the two do not cross; else which way.
int crossing(const Vec3d& a, const Vec3d& a_end, const Vec3d& b, const Vec3d& b_end) {
  const Vec3d u = a_end - a, v = b_end - b, w = b - a;
  const double area = u.x * v.y - u.y * v.x;
  if (area == 0) return 0;
  const double s = (w.x * v.y - w.y * v.x) / area, t = (w.x * u.y - w.y * u.x) / area;
  if (!(s >= 0 && s < 1 && t >= 0 && t < 1)) return 0;
  const bool is_over = a.z + u.z * s > b.z + v.z * t;
  return (area > 0) == is_over ? 1 : -1;
}

}  // namespace

ThreadRule silk_along(std::vector<Vec3d> path_m) {
  ThreadRule rule;
  rule.name = "silk";
  rule.path_m = std::move(path_m);
  return rule;
}

Rules rules_of(ThreadRule rule) {
  Rules rules;
  rules.threads.push_back(std::move(rule));
  rules.gravity_m_s2 = {};
  return rules;
}

double LaidThread::length_m() const {
  double sum = 0;
  for (std::size_t i = 0; i + 1 < threads.node_count(); ++i)
    sum += length(threads.places_m[i + 1] - threads.places_m[i]);
  return sum;
}

double LaidThread::largest_strain() const {
  double largest = 0;
  for (std::size_t i = 0; i + 1 < threads.node_count(); ++i)
    largest = std::max(
        largest, std::abs(length(threads.places_m[i + 1] - threads.places_m[i]) / kSegmentM - 1));
  return largest;
}

std::uint64_t LaidThread::hash() {
  StateHasher hasher;
  auto archive = world::StateArchive::hashing(hasher);
  threads.visit_state(archive);
  return hasher.digest();
}

ToolNow jaws_at(const Vec3d& tip_m, const Vec3d& shaft) {
  ToolNow tool;
  tool.tool = ToolSlot{0};
  tool.shape = {.radius_m = 5e-4f, .length_m = 0.02f, .reach_m = 0.005f, .grip_n = 60};
  tool.verb = tool::Verb::Grasp;
  tool.pose = {to_float(tip_m), rotation_from_z(to_float(shaft))};
  return tool;
}

Rules around_peg(double angle, double friction, double radius_m, double load_n, double speed) {
  constexpr double kOutsideM = 0.22e-3;  // for rounded corners
  constexpr double kBeforeM = 0.06, kAfterM = 0.09, kRisePerRadianM = 0.4e-3;
  const double r = radius_m + kOutsideM;
  Path path{{-kBeforeM, r, 0}};
  const int steps = static_cast<int>(angle / 0.05) + 2;
  for (int i = 0; i <= steps; ++i) {
    const double a = angle * i / steps;
    path.push_back({r * std::sin(a), r * std::cos(a), kRisePerRadianM * a});
  }
  const Vec3d tangent{std::cos(angle), -std::sin(angle), 0};
  path.push_back(path.back() + tangent * kAfterM);
  auto rules = rules_of(silk_along(std::move(path)));
  auto& thread = rules.threads[0];
  thread.self_friction = 0;
  thread.start = {.load_n = {-load_n, 0, 0}, .until_s = 0.2};
  thread.end = {.is_held = true, .velocity_m_s = tangent * speed, .until_s = 1e3};
  rules.pegs.push_back({{0, 0, -0.05}, {0, 0, 0.05}, radius_m, friction});
  return rules;
}

double strain_at_a_jerk() {
  std::vector<Vec3d> path;
  for (int i = 0; i <= 300; ++i) {
    const double angle = kPi * i / 300;
    path.push_back({0.0955 * std::cos(angle), -0.0955 * std::sin(angle), 0});
  }
  auto rules = rules_of(silk_along(path));
  rules.gravity_m_s2 = {0, -9.81, 0};
  rules.threads[0].start.is_held = true;
  rules.threads[0].end = {.is_held = true, .velocity_m_s = {0, 0, 1}, .until_s = 0.1};
  LaidThread laid(rules);
  double largest = 0;
  for (int k = 0; k < 600; ++k) {
    laid.tick();
    largest = std::max(largest, laid.largest_strain());
  }
  return largest;
}

KnotInHands::KnotInHands(const std::vector<Throw>& throws, double self_friction)
    : laid(knot_rules(throws, self_friction)) {
  for (int k = 0; k < 150; ++k) {
    laid.tick();
    std::ranges::fill(laid.threads.velocities_m_s, Vec3d{});
  }
  at_m_[0] = laid.threads.places_m.front();
  at_m_[1] = laid.threads.places_m.back();
  for (int k = 0; k < 2; ++k) {
    hands_[k] = jaws_at(at_m_[k], {k == 0 ? -1.0 : 1.0, 0, 0});
    hands_[k].tool = ToolSlot{static_cast<std::uint8_t>(k)};
  }
}

ThreadReport KnotInHands::pull(double speed, const Vec3d& aside) {
  for (int k = 0; k < 2; ++k) {
    const double side = k == 0 ? -1 : 1;
    at_m_[k] += (Vec3d{side, 0, 0} + aside * side) * (speed * 1e-3);
    hands_[k].pose.position = to_float(at_m_[k]);
  }
  return laid.tick(hands_);
}

double KnotInHands::force_n() const {
  return 0.5 * (length(laid.step.pull(ToolSlot{0}).force_n) +
                length(laid.step.pull(ToolSlot{1}).force_n));
}

double KnotInHands::loop_n() const {
  return 0.5 * (laid.step.force_on_peg_n(0).x - laid.step.force_on_peg_n(1).x);
}

int KnotInHands::signed_crossings() const {
  const auto& x = laid.threads.places_m;
  const auto is_lower = [](const Vec3d& a, const Vec3d& b) { return a.y < b.y; };
  const auto middle =
      static_cast<std::size_t>(std::min_element(x.begin(), x.end(), is_lower) - x.begin());
  int sum = 0;
  for (std::size_t i = 0; i < middle; ++i)
    for (std::size_t j = middle; j + 1 < x.size(); ++j)
      sum += crossing(x[i], x[i + 1], x[j], x[j + 1]);
  return sum;
}

void KnotInHands::take_hands_of(const KnotInHands& other) {
  for (int k = 0; k < 2; ++k) {
    hands_[k] = other.hands_[k];
    at_m_[k] = other.at_m_[k];
  }
  laid.time_s = other.laid.time_s;
}

}  // namespace trocar::thread
