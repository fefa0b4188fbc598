#include "server/tissue/cutting/stroke.h"

#include <algorithm>

namespace trocar::cutting {
namespace {

// Motion shorter than this share of h is no motion, however long it takes.
constexpr double kRest_h = 0.01;

template <typename T>
T& at(std::vector<T>& dense, std::uint32_t index) {
  if (index >= dense.size()) dense.resize(index + 1);
  return dense[index];
}

BladeEdge edge_of(std::span<const Vec3d> points) {
  BladeEdge edge;
  edge.count = static_cast<std::uint32_t>(points.size());
  std::copy(points.begin(), points.end(), edge.points.begin());
  return edge;
}

Vec3d mean_motion(const BladeEdge& from, const BladeEdge& to) {
  Vec3d sum;
  for (std::uint32_t i = 0; i < to.count; ++i) sum += to.points[i] - from.points[i];
  return sum / to.count;
}

}  // namespace

BladeMotion::Verdict BladeMotion::move(std::span<const Vec3d> points, double h,
                                       const Settings& settings) {
  if (!is_blade(points)) return Verdict::Refused;
  const auto edge = edge_of(points);
  if (now_.count == 0) {
    anchor_ = now_ = edge;
    return Verdict::Accepted;
  }
  if (edge.count != now_.count ||
      longest_motion(anchor_, edge) > settings.most_pieces_of_motion * settings.piece_h * h)
    return Verdict::Appeared;
  now_ = edge;
  ticks_ = std::min(ticks_ + 1, settings.collect_ticks);
  const double motion = longest_motion(anchor_, now_);
  // A blade that turns has to go a little before it is known where to.
  const bool is_turning = dot(mean_motion(anchor_, now_), heading_) < 0;
  const bool is_due = motion > settings.collect_h * h ||
                      (ticks_ == settings.collect_ticks &&
                       motion > (is_turning ? settings.least_turn_h : kRest_h) * h);
  // A blade too far ahead of the cutting goes on collecting.
  if (is_due && strips() < settings.most_pieces_of_motion) add_strips(h, settings);
  return Verdict::Accepted;
}

void BladeMotion::carry(const std::array<Vec3d, 2>& moved) {
  const auto carry_edge = [&](BladeEdge& edge) {
    for (std::uint32_t i = 0; i < edge.count; ++i)
      edge.points[i] += moved[0] + (moved[1] - moved[0]) * (i / (edge.count - 1.0));
  };
  carry_edge(anchor_);
  for (std::size_t s = next_; s < strips_.size(); ++s) {
    carry_edge(strips_[s].from);
    carry_edge(strips_[s].to);
  }
}

void BladeMotion::finish(double h, const Settings& settings) {
  if (now_.count > 0 && longest_motion(anchor_, now_) > kRest_h * h) add_strips(h, settings);
}

void BladeMotion::add_strips(double h, const Settings& settings) {
  // h may have become smaller since the blade moved.
  const double pieces =
      std::clamp(std::ceil(longest_motion(anchor_, now_) / (settings.piece_h * h)), 1.0,
                 static_cast<double>(settings.most_pieces_of_motion));
  for (double i = 0; i < pieces; ++i) {
    strips_.push_back(
        {between(anchor_, now_, i / pieces), between(anchor_, now_, (i + 1) / pieces), is_first_});
    is_first_ = false;
  }
  heading_ = mean_motion(anchor_, now_);
  anchor_ = now_;
  ticks_ = 0;
}

void BladeMotion::pop() {
  if (++next_ < strips_.size()) return;
  strips_.clear();
  next_ = 0;
}

void BladeMotion::clear() {
  strips_.clear();
  next_ = 0;
  anchor_.count = now_.count = 0;
  heading_ = {};
  ticks_ = 0;
  is_first_ = true;
}

void Stroke::label(NodeIndex node) {
  auto& label = at(labels_, node.value);
  if (label != 0) return;
  label = 1;
  labelled_.push_back(node);
  fresh.push_back(node);
}

void Stroke::remove_label(NodeIndex node) {
  labels_[node.value] = 0;
  std::erase(labelled_, node);
  std::erase(fresh, node);
}

void Stroke::remove_from_wound(NodeIndex node, int side) {
  labels_[node.value] = 0;
  std::erase(labelled_, node);
  forget_height(node);
  measure(node, {0, static_cast<double>(side)});
}

void Stroke::forget_height(NodeIndex node) {
  if (height(node).nearest_squared < 0) return;
  heights_[node.value] = {};
  std::erase(measured_, node);
}

bool Stroke::measure(NodeIndex node, const Height& height) {
  const double known = this->height(node).nearest_squared;
  return (known < 0 || known > height.nearest_squared) && measure_again(node, height);
}

bool Stroke::measure_again(NodeIndex node, const Height& height) {
  auto& own = at(heights_, node.value);
  const bool is_new = own.nearest_squared < 0;
  if (is_new) measured_.push_back(node);
  const bool has_turned = is_new || (own.height < 0) != (height.height < 0);
  own = height;
  if (has_turned) fresh.push_back(node);
  return has_turned;
}

void Stroke::decide(TetIndex tet, int side) {
  auto& own = at(sides_, tet.value);
  if (own == side) return;
  if (own == 0) sided_.push_back(tet);
  if (side == 0) std::erase(sided_, tet);
  own = static_cast<std::int8_t>(side);
}

void Stroke::inherit(TetIndex parent, TetIndex child) {
  if (const int own = side(parent); own != 0) decide(child, own);
}

void Stroke::inherit(NodeIndex original, NodeIndex copy) {
  if (is_labelled(original)) label(copy);
  if (const auto own = height(original); own.nearest_squared >= 0) measure(copy, own);
}

void Stroke::clear() {
  for (const auto node : labelled_) labels_[node.value] = 0;
  for (const auto node : measured_) heights_[node.value] = {};
  for (const auto tet : sided_) sides_[tet.value] = 0;
  labelled_.clear();
  measured_.clear();
  sided_.clear();
  waiting.clear();
  fresh.clear();
  patch.clear();
  motion.clear();
  sides_before = sides = {};
  path.clear();
  repairs = 0;
  way = 0;
  is_active = has_ended = false;
}

}  // namespace trocar::cutting
