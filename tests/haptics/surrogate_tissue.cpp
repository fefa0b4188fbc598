#include "tests/haptics/surrogate_tissue.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trocar::haptics::testing {
namespace {

constexpr double kContact_n_m = 3000;
constexpr double kMass_kg = 2e-4;
constexpr double kLinear_m = 2e-4;
constexpr double kFigureDepth_m = 0.0066;

struct Factors {
  double keep, take, fast_keep;
};
Factors factors(const TissueFigures& figures, std::size_t i) {
  const double keep = std::exp(-kDt_s / figures.relaxation_s[i]);
  return {keep, figures.share[i] * (1 - keep) * figures.relaxation_s[i] / kDt_s,
          1 / (1 + kDt_s / figures.fast_s[i])};
}

}  // namespace

SurrogateTissue::SurrogateTissue(const TissueFigures& figures)
    : figures_(figures),
      coefficient_(figures.stiffness_n_m /
                   (figures.exponent * std::pow(kFigureDepth_m, figures.exponent - 1))) {}

double SurrogateTissue::elastic_force_n(double depth_m) const {
  if (depth_m < kLinear_m) return elastic_stiffness_n_m(depth_m) * depth_m;
  return scale * coefficient_ * std::pow(depth_m, figures_.exponent);
}

double SurrogateTissue::elastic_stiffness_n_m(double depth_m) const {
  const double p = figures_.exponent;
  if (depth_m < kLinear_m) return scale * coefficient_ * std::pow(kLinear_m, p - 1);
  return scale * coefficient_ * p * std::pow(depth_m, p - 1);
}

Vec3d SurrogateTissue::surface_under(const Vec3d& tip_m) const {
  const double wave = 2 * std::numbers::pi / figures_.bump_length_m;
  return {tip_m.x, tip_m.y, lift_m + figures_.bump_m * std::sin(wave * tip_m.x)};
}

Vec3d SurrogateTissue::normal_at(const Vec3d& tip_m) const {
  const double wave = 2 * std::numbers::pi / figures_.bump_length_m;
  return normalized(Vec3d{-figures_.bump_m * wave * std::cos(wave * tip_m.x), 0, 1}, {0, 0, 1});
}

void SurrogateTissue::set_grasped(bool grasped, const Vec3d& tip_m) {
  if (grasped && !is_grasped_) {
    grip_m_ = {tip_m.x, tip_m.y, tip_m.z + along_.place};
    anchor_m_ = tip_m - across_.place;
  }
  is_grasped_ = grasped;
}

template <typename Value>
void SurrogateTissue::commit(Element<Value>& element, const Value& place, const Value& elastic,
                             double stiffness) {
  for (std::size_t i = 0; i < 2; ++i) {
    const Factors f = factors(figures_, i);
    element.relaxing[i] = element.relaxing[i] * f.keep + (elastic - element.elastic) * f.take;
    element.fast[i] =
        (element.fast[i] + (place - element.place) * (figures_.fast_share[i] * stiffness)) *
        f.fast_keep;
  }
  element.elastic = elastic;
  element.speed = (place - element.place) / kDt_s;
  element.place = place;
}

double SurrogateTissue::step_along(double depth_m) {
  Element<double>& e = along_;
  if (is_refused) return kContact_n_m * std::max(0.0, depth_m - e.place);
  const double stiffness = elastic_stiffness_n_m(std::max(e.place, 0.0));
  double x = e.place;
  for (int iteration = 0; iteration < 6; ++iteration) {
    const double elastic = elastic_force_n(x), slope = elastic_stiffness_n_m(x);
    double rest = 1;
    double force = kMass_kg * ((x - e.place) / kDt_s - e.speed) / kDt_s;
    double gradient = kMass_kg / kDt_s / kDt_s;
    for (std::size_t i = 0; i < 2; ++i) {
      const Factors f = factors(figures_, i);
      rest -= figures_.share[i];
      force += f.keep * e.relaxing[i] + f.take * (elastic - e.elastic);
      force += (e.fast[i] + figures_.fast_share[i] * stiffness * (x - e.place)) * f.fast_keep;
      gradient += f.take * slope + figures_.fast_share[i] * stiffness * f.fast_keep;
    }
    force += rest * elastic;
    gradient += rest * slope;
    const double contact = is_grasped_ || depth_m > x ? kContact_n_m : 0;
    x -= (force - contact * (depth_m - x)) / (gradient + contact);
  }
  const double pressed = is_grasped_ || depth_m > x ? kContact_n_m * (depth_m - x) : 0;
  commit(e, x, elastic_force_n(x), stiffness);
  return pressed;
}

void SurrogateTissue::step_across(const Vec3d& tip_m, const Vec3d& normal, double limit_n) {
  Element<Vec3d>& e = across_;
  const auto in_plane = [&](const Vec3d& v) { return v - normal * dot(v, normal); };
  const double stiffness =
      figures_.across_over_normal * elastic_stiffness_n_m(std::max(along_.place, 0.0));
  // The element resists with slope * place + offset.
  double rest = 1, slope = kMass_kg / kDt_s / kDt_s;
  Vec3d offset = (e.place / kDt_s + e.speed) * (-kMass_kg / kDt_s);
  for (std::size_t i = 0; i < 2; ++i) {
    const Factors f = factors(figures_, i);
    const double fast = figures_.fast_share[i] * stiffness * f.fast_keep;
    rest -= figures_.share[i];
    slope += f.take * stiffness + fast;
    offset +=
        e.relaxing[i] * f.keep - e.elastic * f.take + e.fast[i] * f.fast_keep - e.place * fast;
  }
  slope += rest * stiffness;
  Vec3d place = -offset / slope, pull;
  if (touches_) {
    const double contact = 0.5 * kContact_n_m;
    const Vec3d way = in_plane(tip_m - anchor_m_);
    place = is_refused ? e.place : (way * contact - offset) / (slope + contact);
    pull = (way - place) * contact;
    if (length(pull) > limit_n) {
      pull *= limit_n / length(pull);
      if (!is_refused) place = (pull - offset) / slope;
      anchor_m_ = tip_m - place - pull / contact;
    }
  }
  if (!is_refused) commit(e, place, place * stiffness, stiffness);
  across_force_n_ = -pull;
}

void SurrogateTissue::step(const Vec3d& tip_m) {
  const Vec3d normal = is_grasped_ ? Vec3d{0, 0, 1} : normal_at(tip_m);
  const Vec3d reference = is_grasped_ ? grip_m_ : surface_under(tip_m);
  const double pressed_n = step_along(dot(reference - tip_m, normal));
  const bool touched = touches_;
  touches_ = is_grasped_ || pressed_n > 1e-6;
  if (touches_ && !touched) anchor_m_ = tip_m - across_.place;
  step_across(tip_m, normal, is_grasped_ ? 1e9 : figures_.friction * pressed_n);
  force_n_ = normal * pressed_n + across_force_n_;
}

double SurrogateTissue::slow_share() const {
  double share = 1;
  for (std::size_t i = 0; i < 2; ++i)
    share += -figures_.share[i] * (1 - std::exp(-0.05 / figures_.relaxation_s[i])) +
             figures_.fast_share[i] * std::exp(-0.05 / figures_.fast_s[i]);
  return share;
}

double SurrogateTissue::stiffness_along_n_m() const {
  if (is_refused) return kContact_n_m;
  const double k = elastic_stiffness_n_m(std::max(along_.place, 1e-3)) * slow_share();
  return k * kContact_n_m / (k + kContact_n_m);
}

double SurrogateTissue::stiffness_across_n_m() const {
  if (is_refused) return kContact_n_m / 2;
  const double k = figures_.across_over_normal *
                   elastic_stiffness_n_m(std::max(along_.place, 1e-3)) * slow_share();
  return k * (kContact_n_m / 2) / (k + kContact_n_m / 2);
}

}  // namespace trocar::haptics::testing
