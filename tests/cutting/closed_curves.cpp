#include "tests/cutting/closed_curves.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace trocar::cutting::testing {
namespace {

constexpr double kBeyond_m = 0.004;  // a hand goes so far beyond where it began
constexpr int kStopTicks = 100;

struct Point {
  double x, y;
};
Point operator+(Point a, Point b) {
  return {a.x + b.x, a.y + b.y};
}
Point operator*(Point a, double by) {
  return {a.x * by, a.y * by};
}
Point operator-(Point a, Point b) {
  return {a.x - b.x, a.y - b.y};
}
double distance(Point a, Point b) {
  return std::hypot(a.x - b.x, a.y - b.y);
}
using Line = std::vector<Point>;  // of places where the direction changes

double area(const Line& line) {
  double sum = 0;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const auto &a = line[i], &b = line[(i + 1) % line.size()];
    sum += a.x * b.y - a.y * b.x;
  }
  return std::abs(sum) / 2;
}

class Hand {
 public:
  Hand(double half_m, double step_m, Point tilt)
      : reach_(1.5 * half_m), step_(step_m), tilt_(tilt) {}

  void turn_round() { reach_ = -reach_; }
  // Along a line, with a stop at each of its corners.
  Path draw(const Line& line, int stop_ticks) const {
    Path path{edge(line.front())};
    for (std::size_t i = 0; i + 1 < line.size(); ++i) {
      const int steps =
          std::max(1, static_cast<int>(std::ceil(distance(line[i], line[i + 1]) / step_)));
      for (int s = 1; s <= steps; ++s)
        path.push_back(edge(line[i] + (line[i + 1] - line[i]) * (double(s) / steps)));
      for (int s = 0; s < stop_ticks && i + 2 < line.size(); ++s) path.push_back(path.back());
    }
    return path;
  }

 private:
  Edge edge(Point p) const {
    const Vec3d at{p.x, p.y, 0}, along{tilt_.x, tilt_.y, 1};
    return {at - along * reach_, at + along * reach_};
  }

  double reach_, step_;
  Point tilt_;
};

// Corners in order about a centre, none of them too near to the next.
Line polygon(double half_m, double h, trocar::testing::Random& random) {
  for (;;) {
    const double radius = half_m * random.between(0.35, 0.75), slack = 0.85 * half_m - radius;
    const Point centre{random.between(-slack, slack), random.between(-slack, slack)};
    std::vector<double> angles(3 + random.below(4));
    for (auto& angle : angles) angle = random.between(0, 2 * M_PI);
    std::sort(angles.begin(), angles.end());
    Line line;
    for (const double angle : angles)
      line.push_back(centre + Point{std::cos(angle), std::sin(angle)} * radius);
    double least = 2 * radius;
    for (std::size_t i = 0; i < line.size(); ++i)
      least = std::min(least, distance(line[i], line[(i + 1) % line.size()]));
    if (least > 1.2 * h && area(line) > 4 * h * h) return line;
  }
}

// From the middle of its first side round to where it began, and a little beyond.
Line closed(const Line& corners) {
  const Point begin = (corners[0] + corners[1]) * 0.5;
  const Point on = (corners[1] - begin) * (kBeyond_m / distance(corners[1], begin));
  Line line{begin};
  for (std::size_t i = 1; i <= corners.size(); ++i) line.push_back(corners[i % corners.size()]);
  line.push_back(begin + on);
  return line;
}

// Two lines that overlap a little at both of their ends.
std::array<Line, 2> halves(const Line& corners) {
  const auto n = corners.size();
  const auto beyond = [](Point from, Point to) {
    return to + (to - from) * (kBeyond_m / distance(from, to));
  };
  const Point a = (corners[0] + corners[1]) * 0.5;
  const auto half = n / 2 + 1;
  const Point b = (corners[half - 1] + corners[half % n]) * 0.5;
  Line first{beyond(corners[1], a)}, second{beyond(corners[half % n], b)};
  for (std::size_t i = 1; i < half; ++i) first.push_back(corners[i]);
  first.push_back(beyond(corners[half - 1], b));
  for (std::size_t i = half; i <= n; ++i) second.push_back(corners[i % n]);
  second.push_back(beyond(corners[0], a));
  return {first, second};
}

Line circle(double half_m, trocar::testing::Random& random, double& inside) {
  const double a = half_m * random.between(0.3, 0.6), b = a * random.between(0.6, 1);
  const double slack = 0.85 * half_m - a;
  const Point centre{random.between(-slack, slack), random.between(-slack, slack)};
  const double beyond = kBeyond_m / a;
  Line line;
  for (double angle = 0; angle < 2 * M_PI + beyond; angle += 0.05)
    line.push_back(centre + Point{a * std::cos(angle), b * std::sin(angle)});
  inside = M_PI * a * b;
  return line;
}

Line eight(double half_m, trocar::testing::Random& random) {
  const double a = half_m * random.between(0.6, 0.75), turn = random.between(0, M_PI);
  Line line;
  for (double s = 0.3; s < 0.3 + 2 * M_PI + 0.15; s += 0.04) {
    const double x = a * std::sin(s), y = a * std::sin(s) * std::cos(s) * 1.4;
    line.push_back(
        {x * std::cos(turn) - y * std::sin(turn), x * std::sin(turn) + y * std::cos(turn)});
  }
  return line;
}

Line wedge(double half_m, double h, trocar::testing::Random& random, double& inside) {
  for (;;) {
    const Point tip{random.between(-0.5, 0.5) * half_m, random.between(-0.7, 0.3) * half_m};
    const double left = random.between(-0.9, 0.9) * half_m,
                 right = random.between(-0.9, 0.9) * half_m;
    inside = std::abs(right - left) * (half_m - tip.y) / 2;
    if (right - left < 2.5 * h || half_m - tip.y < 2.5 * h) continue;
    const auto out = [&](double x) {
      return tip + (Point{x, half_m} - tip) * (1 + 2 * h / distance({x, half_m}, tip));
    };
    return {out(left), tip, out(right)};
  }
}

}  // namespace

const char* name_of(CurveKind kind) {
  constexpr std::array<const char*, kCurveKinds> kNames{"polygon",   "circle",     "eight", "wedge",
                                                        "two hands", "both sides", "swift"};
  return kNames[static_cast<std::size_t>(kind)];
}

ClosedCurve random_curve(CurveKind kind, double half_m, double h, trocar::testing::Random& random) {
  ClosedCurve curve;
  curve.kind = kind;
  const double most_tilt = std::tan(10 * M_PI / 180);
  Hand hand(half_m, h * std::pow(10, random.between(-1.7, -0.5)),
            {random.between(-most_tilt, most_tilt), random.between(-most_tilt, most_tilt)});
  switch (kind) {
    case CurveKind::Polygon:
    case CurveKind::Swift: {
      const auto line = polygon(half_m, h, random);
      curve.inside_m2 = area(line);
      curve.rounds = {{hand.draw(closed(line), kind == CurveKind::Polygon ? kStopTicks : 0)}};
      break;
    }
    case CurveKind::Circle:
      curve.rounds = {{hand.draw(circle(half_m, random, curve.inside_m2), 0)}};
      break;
    case CurveKind::Eight:
      curve.rounds = {{hand.draw(eight(half_m, random), 0)}};
      curve.pieces = 3;
      break;
    case CurveKind::Wedge:
      curve.rounds = {{hand.draw(wedge(half_m, h, random, curve.inside_m2), kStopTicks)}};
      break;
    case CurveKind::TwoHands:
    case CurveKind::BothSides: {
      const auto line = polygon(half_m, h, random);
      curve.inside_m2 = area(line);
      const auto [first, second] = halves(line);
      const auto path = hand.draw(first, kStopTicks);
      if (kind == CurveKind::TwoHands) {
        curve.rounds = {{path, hand.draw(second, kStopTicks)}};
      } else {
        hand.turn_round();
        curve.rounds = {{path}, {hand.draw(second, kStopTicks)}};
      }
      break;
    }
  }
  return curve;
}

std::string draw(CutOrgan& organ, const ClosedCurve& curve) {
  for (const auto& paths : curve.rounds) {
    std::size_t longest = 0;
    for (const auto& path : paths) longest = std::max(longest, path.size());
    for (std::size_t tick = 0; tick < longest; ++tick) {
      for (std::uint32_t blade = 0; blade < paths.size(); ++blade)
        if (tick < paths[blade].size() && !organ.cutter().move(blade, paths[blade][tick]))
          return "a blade was refused";
      organ.tick();
    }
    for (std::uint32_t blade = 0; blade < paths.size(); ++blade) organ.cutter().lift(blade);
    organ.run_until_idle();
  }
  if (auto wrong = organ.check(); !wrong.empty()) return wrong;
  const auto pieces = find_pieces(organ.topology()).count;
  if (pieces < curve.pieces)
    return fmt::format("{} pieces instead of {}, {:.0f} mm2 wait", pieces, curve.pieces,
                       organ.total().waiting_area_m2 * 1e6);
  return {};
}

std::vector<std::string> draw_many(double jitter, std::uint64_t curves) {
  const auto organ = box_organ(8, 8, 8, 0.005, jitter);
  std::vector<std::string> faults;
  for (std::uint64_t seed = 0; seed < curves; ++seed) {
    trocar::testing::Random random(seed);
    CutOrgan box(organ);
    const auto kind = static_cast<CurveKind>(seed % kCurveKinds);
    const auto curve = random_curve(kind, 0.02, box.cutter().mean_h(), random);
    if (const auto wrong = draw(box, curve); !wrong.empty())
      faults.push_back(fmt::format("{}, seed {}: {}", name_of(kind), seed, wrong));
  }
  return faults;
}

}  // namespace trocar::cutting::testing
