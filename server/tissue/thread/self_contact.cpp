#include "server/tissue/thread/self_contact.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace trocar::thread {
namespace {

constexpr double kMarginM = 1e-4;      // beyond contact and motion, a pair is still looked at
constexpr double kMostMotionM = 1e-3;  // of a pair in a step that is looked ahead
// Planes lag behind what turns about each other by a step, so knots without friction would tremble:
// across the plane, motion within a step is resisted by so much of the contact's own stiffness
// there.
constexpr double kCalming = 1;
constexpr double kParallel = 0.9;               // threads whose directions differ less
constexpr double kSlackM = 4e-3;                // of the list
constexpr double kMostDriftM = 0.35 * kSlackM;  // of a node, before it is made anew
// Middles of segments that are nearer are surely in the list.
constexpr double kNearM = kContactM + kSlackM + 1.1 * kSegmentM - 2 * kMostDriftM;
constexpr double kLongestM = 1.1 * kSegmentM;

Vec3d at(const std::vector<Vec3d>& x, std::uint32_t segment, double part) {
  return x[segment] * (1 - part) + x[segment + 1] * part;
}

// The direction of thread as it is along a smooth curve: that of a segment jumps at its ends, and
// what slides over a corner would be held back there.
Vec3d tangent(const std::vector<Vec3d>& x, const std::vector<std::uint8_t>& is_joined,
              std::uint32_t i, double part) {
  const bool has_before = i > 0 && is_joined[i - 1] != 0, has_after = is_joined[i + 1] != 0;
  const Vec3d own = x[i + 1] - x[i];
  const Vec3d a = normalized(has_before ? x[i + 1] - x[i - 1] : own, {1, 0, 0});
  const Vec3d b = normalized(has_after ? x[i + 2] - x[i] : own, {1, 0, 0});
  return normalized(a * (1 - part) + b * part, {1, 0, 0});
}

// Across both threads.
Vec3d across(const Vec3d& apart_m, const Vec3d& one, const Vec3d& other) {
  const Vec3d straight = normalized(apart_m, {0, 1, 0});
  Vec3d normal = straight - one * dot(one, straight);
  const Vec3d beside = normalized(other - one * dot(one, other), {0, 0, 0});
  if (std::abs(dot(one, other)) < kParallel) normal -= beside * dot(beside, normal);
  return dot(normal, straight) > 0.5 ? normalized(normal, straight) : straight;
}

}  // namespace

SelfContact::SelfContact() {
  list_.reserve(16'384);
  candidates_.reserve(4096);
  order_.reserve(4096);
  planes_.reserve(kMostPairs);
}

SelfContact::Nearest SelfContact::nearest(const Vec3d& a, const Vec3d& a_end, const Vec3d& b,
                                          const Vec3d& b_end) {
  const Vec3d da = a_end - a, db = b_end - b, r = a - b;
  const double aa = dot(da, da), bb = dot(db, db), ab = dot(da, db);
  const double ar = dot(da, r), br = dot(db, r);
  const double determinant = aa * bb - ab * ab;
  double s =
      determinant > 1e-9 * aa * bb ? std::clamp((ab * br - ar * bb) / determinant, 0.0, 1.0) : 0.5;
  double t = (ab * s + br) / bb;
  if (t < 0) {
    t = 0;
    s = std::clamp(-ar / aa, 0.0, 1.0);
  } else if (t > 1) {
    t = 1;
    s = std::clamp((ab - ar) / aa, 0.0, 1.0);
  }
  return {s, t};
}

void SelfContact::list_from(std::uint32_t first, double reach_m) {
  const auto segments = static_cast<std::uint32_t>(middles_.size());
  for (auto second = first + static_cast<std::uint32_t>(kApart); second < segments; ++second) {
    const double distance_m = length(middles_[first] - middles_[second]);
    if (distance_m < reach_m) {
      list_.push_back({first, second});
      continue;
    }
    // Along the same thread middles come nearer by a segment's length at a time.
    const auto skipped = static_cast<std::uint32_t>((distance_m - reach_m) / kLongestM);
    second = std::min(second + std::max(skipped, 1u) - 1, chain_end_[second]);
  }
}

void SelfContact::refresh_list(const std::vector<Vec3d>& x, const Threads& threads) {
  bool is_old = listed_at_.size() != x.size();
  for (std::size_t i = 0; !is_old && i < x.size(); ++i)
    is_old = length_squared(x[i] - listed_at_[i]) > kMostDriftM * kMostDriftM;
  if (!is_old) return;
  listed_at_ = x;
  list_.clear();
  middles_.resize(x.size() - 1);
  chain_end_.resize(x.size() - 1);
  auto end = static_cast<std::uint32_t>(x.size() - 1);
  for (std::size_t i = x.size() - 1; i-- > 0;) {
    middles_[i] = (x[i] + x[i + 1]) * 0.5;
    if (threads.is_joined[i] == 0) end = static_cast<std::uint32_t>(i);
    chain_end_[i] = end;
  }
  for (std::uint32_t i = 0; i < middles_.size(); ++i)
    if (threads.is_joined[i] != 0) list_from(i, kContactM + kSlackM + kLongestM);
  std::erase_if(list_, [&](const Listed& pair) { return threads.is_joined[pair.second] == 0; });
}

int SelfContact::steps_needed(const Threads& threads, double tick_s) {
  const auto& x = threads.places_m;
  refresh_list(x, threads);
  const auto& v = threads.velocities_m_s;
  double fastest = 0;
  for (const auto& [i, j] : list_) {
    const Vec3d apart = x[i] + x[i + 1] - x[j] - x[j + 1];
    if (length_squared(apart) > 4 * kNearM * kNearM) continue;
    fastest = std::max(fastest, length_squared(v[i] + v[i + 1] - v[j] - v[j + 1]));
  }
  const double steps = 0.5 * std::sqrt(fastest) * tick_s / (0.5 * kContactM);
  return std::clamp(static_cast<int>(std::min(steps, 1e3)) + 1, 1, kMostSteps);
}

void SelfContact::gather(const Elasticity& elasticity, const Threads& threads) {
  const auto& x0 = elasticity.before();
  const auto& x = threads.places_m;
  refresh_list(x0, threads);
  candidates_.clear();
  const auto moved = [&](std::uint32_t i) {
    return std::sqrt(std::max(length_squared(x[i] - x0[i]), length_squared(x[i + 1] - x0[i + 1])));
  };
  for (const auto& [i, j] : list_) {
    if (threads.is_joined[i] == 0 || threads.is_joined[j] == 0) continue;
    const Vec3d middles = x0[i] + x0[i + 1] - x0[j] - x0[j + 1];
    const double reach_m = kContactM + kMarginM + std::min(moved(i) + moved(j), kMostMotionM);
    if (length_squared(middles) > 4 * kNearM * kNearM) continue;
    const auto [s, t] = nearest(x0[i], x0[i + 1], x0[j], x0[j + 1]);
    // A place at the end of a segment is the next one's, where that is there.
    const bool is_next_first = s >= 1 && threads.is_joined[i + 1] != 0 && i + 1 + kApart <= j;
    const bool is_next_second = t >= 1 && j + 1 < x.size() - 1 && threads.is_joined[j + 1] != 0;
    if (is_next_first || is_next_second) continue;
    const Vec3d apart = at(x0, i, s) - at(x0, j, t);
    const double distance = length(apart);
    if (distance <= reach_m) candidates_.push_back({i, j, s, t, apart, distance});
  }
}

// Pairs that overlap least are dropped first.
void SelfContact::drop_beyond_limits() {
  dropped_ = 0;
  is_touching_.assign(listed_at_.size(), 0);
  order_.resize(candidates_.size());
  std::iota(order_.begin(), order_.end(), 0u);
  const auto nearer = [&](std::uint32_t a, std::uint32_t b) {
    const double da = candidates_[a].distance_m, db = candidates_[b].distance_m;
    return da != db ? da < db : a < b;
  };
  std::sort(order_.begin(), order_.end(), nearer);
  std::size_t touching = 0, kept = 0;
  for (const auto k : order_) {
    auto& pair = candidates_[k];
    std::size_t more = 0;
    for (const auto node : {pair.first, pair.first + 1, pair.second, pair.second + 1})
      more += is_touching_[node] == 0 ? 1 : 0;
    if (kept == kMostPairs || touching + more > kMostTouching) {
      pair.distance_m = -1;
      ++dropped_;
      continue;
    }
    for (const auto node : {pair.first, pair.first + 1, pair.second, pair.second + 1})
      is_touching_[node] = 1;
    touching += more;
    ++kept;
  }
  std::erase_if(candidates_, [](const Candidate& pair) { return pair.distance_m < 0; });
}

// A contact that has slid to the next segment takes its friction along.
void SelfContact::take_over_friction(Pairs& now) const {
  const auto& before = before_;
  for (std::size_t k = 0; k < now.first.size(); ++k) {
    double best = 1;
    for (std::size_t o = 0; o < before.first.size(); ++o) {
      if (!(before.press_n[o] > 0)) continue;
      const auto far = [](std::uint32_t a, double s, std::uint32_t b, double t) {
        return std::abs(static_cast<double>(a) + s - static_cast<double>(b) - t);
      };
      const double away =
          far(before.first[o], before.place_first[o], now.first[k], now.place_first[k]) +
          far(before.second[o], before.place_second[o], now.second[k], now.place_second[k]);
      if (!(away < best)) continue;
      best = away;
      now.creeps_m[k] = before.creeps_m[o];
    }
    const auto& normal = planes_[k].normal;
    now.creeps_m[k] -= normal * dot(normal, now.creeps_m[k]);
  }
}

void SelfContact::begin(const Threads& threads) {
  before_ = threads.pairs;
}

void SelfContact::find(const Elasticity& elasticity, Threads& threads) {
  const auto& friction = elasticity.figures().self_friction;
  gather(elasticity, threads);
  drop_beyond_limits();
  auto& pairs = threads.pairs;
  const auto count = candidates_.size();
  pairs.first.resize(count), pairs.second.resize(count);
  pairs.place_first.resize(count), pairs.place_second.resize(count);
  pairs.press_n.assign(count, 0.0);
  pairs.creeps_m.assign(count, Vec3d{});
  planes_.resize(count);
  for (std::size_t k = 0; k < count; ++k) {
    const auto& pair = candidates_[k];
    pairs.first[k] = pair.first, pairs.second[k] = pair.second;
    pairs.place_first[k] = pair.place_first, pairs.place_second[k] = pair.place_second;
    const auto& x0 = elasticity.before();
    const auto& joined = threads.is_joined;
    const Vec3d normal = across(pair.apart_m, tangent(x0, joined, pair.first, pair.place_first),
                                tangent(x0, joined, pair.second, pair.place_second));
    planes_[k] = {normal, pair.apart_m, std::max(friction[pair.first], friction[pair.second])};
  }
  take_over_friction(pairs);
}

Vec3d SelfContact::apart_now(const Pairs& pairs, std::size_t k, const Threads& threads) const {
  return at(threads.places_m, pairs.first[k], pairs.place_first[k]) -
         at(threads.places_m, pairs.second[k], pairs.place_second[k]);
}

void SelfContact::add(const Threads& threads, ChainSolver& solver) const {
  const auto& pairs = threads.pairs;
  for (std::size_t k = 0; k < planes_.size(); ++k) {
    const auto& plane = planes_[k];
    const Vec3d apart = apart_now(pairs, k, threads);
    const double gap_m = dot(plane.normal, apart) - kContactM;
    if (gap_m >= 0) continue;
    const Vec3d moved = apart - plane.apart_m;
    auto rubbed = rub(plane.normal, -kPressN_m * gap_m, plane.friction, pairs.creeps_m[k] + moved);
    const double calming_n_m = kCalming * rubbed.press_n / kContactM;
    rubbed.force_n -= (moved - plane.normal * dot(plane.normal, moved)) * calming_n_m;
    rubbed.stiffness += uniaxial(plane.normal, 0, calming_n_m);
    const std::size_t nodes[4] = {pairs.first[k], pairs.first[k] + 1u, pairs.second[k],
                                  pairs.second[k] + 1u};
    const double shares[4] = {1 - pairs.place_first[k], pairs.place_first[k],
                              pairs.place_second[k] - 1, -pairs.place_second[k]};
    const Column force = to_column(rubbed.force_n);
    for (std::size_t a = 0; a < 4; ++a) {
      solver.add_right(nodes[a], force * all_lanes(shares[a]));
      for (std::size_t b = a; b < 4; ++b)
        solver.add(nodes[a], nodes[b], rubbed.stiffness * (shares[a] * shares[b]));
    }
  }
}

void SelfContact::end(Threads& threads) const {
  auto& pairs = threads.pairs;
  for (std::size_t k = 0; k < planes_.size(); ++k) {
    const auto& plane = planes_[k];
    const Vec3d apart = apart_now(pairs, k, threads);
    const double gap_m = dot(plane.normal, apart) - kContactM;
    pairs.press_n[k] = kPressN_m * std::max(0.0, -gap_m);
    pairs.creeps_m[k] = held_slip(plane.normal, pairs.press_n[k], plane.friction,
                                  pairs.creeps_m[k] + apart - plane.apart_m);
  }
}

}  // namespace trocar::thread
