#include "server/tissue/blades/edge_force.h"

#include <algorithm>
#include <cmath>

#include "common/base/tick.h"

namespace trocar::blades {
namespace {

using cutting::kEdgeParts;

// The weight of the newest tick in the tip's smoothed velocity.
constexpr float kNewest = 0.05f;
// A part's heading follows over this way (h_u).
constexpr float kHeading_m = 0.003f;
// The heading of a part that is slower than kSlow_m_s fades, by up to kFade in a tick. One that is
// shorter than kLeastHeading is none.
constexpr float kSlow_m_s = 0.0005f, kFade = 0.01f, kLeastHeading = 1e-3f, kMostHeading = 1.001f;
constexpr float kMostForce_n = 30;
// These bound the state whatever the material, and what a snapshot may say.
constexpr float kMostOwed_j = 10, kMostCut_n = 1e7f, kMostShare = 4, kMostSpeed_m_s = 10;
// A row of elements opens when the cut, which goes 0.3 of them ahead of the edge, has passed it
// whole. So in the mean the wound is this many elements ahead of the edge (e_0; 0 to -0.25 were
// measured), give or take a half. The force changes by kGain (k) for each element of way owed.
constexpr float kLead = -0.1f, kGain = 0.4f, kMostOwed = 4;
// Less and less is felt, and then nothing, where so many elements of way are overpaid.
constexpr float kFadeFrom = -1.25f, kFadeTo = -1.75f;
constexpr float kLeastElement_j = 1e-12f;
// The force follows over so many elements of way (h_s / h); in air, what is owed is forgotten so.
constexpr float kSmooth = 0.5f, kForget = 4;
// Part of an element's way that has opened is forgotten over so many where no more follows.
constexpr float kDoubt = 2;
// A blade that turns back knows of nothing whole ahead after this way.
constexpr float kTurnBack_m = 0.001f;
// Each of the friction springs bears 1 N at 4 mm.
constexpr float kFriction_n_m = 250;

Vec3f at(const EdgeEnds& ends, std::size_t part) {
  const float share = (static_cast<float>(part) + 0.5f) / kEdgeParts;
  return ends[0] + (ends[1] - ends[0]) * share;
}

Vec3f across(const Vec3f& v, const Vec3f& axis) {
  return v - axis * dot(v, axis);
}

// Returns c(e).
float share_at(float elements_owed) {
  const float e = std::clamp(elements_owed, kFadeTo, kMostOwed);
  const float fade = std::min(1.0f, (e - kFadeTo) / (kFadeFrom - kFadeTo));
  return fade * (1 + kGain * (e - kLead));
}

// Returns how far a part has gone across the edge, m.
float turn(Vec3f& heading, const Vec3f& way) {
  const float way_m = length(way);
  if (way_m > 0) heading += (way / way_m - heading) * std::min(1.0f, way_m / kHeading_m);
  const float speed = way_m / kTickSeconds;
  if (speed < kSlow_m_s) heading = heading * (1 - kFade * (1 - speed / kSlow_m_s));
  if (length(heading) < kLeastHeading) heading = {};
  return way_m;
}

// A spring of one stiffness, whatever it may bear: its energy changes by its length alone.
Vec3f friction_n(Vec3f& held, const Vec3f& moved, float most_n) {
  if (!(most_n > 0)) return held = {};
  held += moved;
  const float pull = kFriction_n_m * length(held);
  if (pull > most_n) held = held * (most_n / pull);
  return held * -kFriction_n_m;
}

}  // namespace

void EdgeForce::look(const cutting::EdgeResistance& resistance, double breadth_m) {
  float cut_n = 0, last_cut_n = 0;
  for (std::size_t i = 0; i < kEdgeParts; ++i) {
    auto& part = parts_[i];
    last_cut_n += part.next_cut_n;
    part.next_cut_n = std::min(static_cast<float>(resistance.cut_n[i]), kMostCut_n);
    cut_n += part.next_cut_n;
    part.next_grip_n =
        std::min(static_cast<float>(resistance.friction_n_m[i] * breadth_m), kMostForce_n);
  }
  for (std::size_t end = 0; end < 2; ++end)
    tissue_m_[end] = to_float(resistance.tissue_m_s[end]) * kTickSeconds;
  if (last_cut_n == 0 && cut_n > 0)
    whole_ = share_ = std::min(1.0f, static_cast<float>(resistance.whole_cut_n) / cut_n);
  steps_left_ = kLookEvery;
}

void EdgeForce::follow_look() {
  if (steps_left_ == 0) return;
  const auto step = [&](float& value, float next) {
    value = steps_left_ == 1 ? next : value + (next - value) / static_cast<float>(steps_left_);
  };
  for (auto& part : parts_) {
    step(part.cut_n, part.next_cut_n);
    step(part.grip_n, part.next_grip_n);
  }
  --steps_left_;
}

Wrench EdgeForce::move(const EdgeEnds& ends, float opened_j, float h_m) {
  const EdgeEnds moved{ends[0] - ends_[0] - tissue_m_[0], ends[1] - ends_[1] - tissue_m_[1]};
  ends_ = ends;
  velocity_ += (moved[0] / kTickSeconds - velocity_) * kNewest;
  follow_look();
  const Vec3f axis = normalized(ends[1] - ends[0], {});
  Sums sums;
  for (const auto& part : parts_) sums.cut_n += part.cut_n;
  const float share = sums.cut_n * share_ > kMostForce_n ? kMostForce_n / sums.cut_n : share_;
  Wrench felt;
  for (std::size_t i = 0; i < kEdgeParts; ++i) {
    auto& part = parts_[i];
    const Vec3f way = at(moved, i);
    sums.swept_j += part.cut_n * turn(part.heading, across(way, axis));
    Vec3f force = across(part.heading, axis) * (-share * part.cut_n);
    sums.paid_j -= dot(force, way);
    force += friction_n(part.held, way, part.grip_n);
    felt.force_n += force;
    felt.torque_nm += cross(at(ends, i) - ends[0], force);
  }
  speed_m_s_ =
      sums.cut_n > 0 ? std::min(sums.swept_j / sums.cut_n / kTickSeconds, kMostSpeed_m_s) : 0;
  follow_work(sums, opened_j, length(moved[0]), h_m);
  return felt;
}

void EdgeForce::follow_work(const Sums& sums, float opened_j, float moved_m, float h_m) {
  owed_j_ = std::clamp(owed_j_ + opened_j - sums.paid_j, -kMostOwed_j, kMostOwed_j);
  if (!(sums.cut_n > 0)) {
    owed_j_ -= owed_j_ * std::min(1.0f, moved_m / (kForget * h_m));
    return;
  }
  const float element_j = std::max(sums.cut_n * h_m, kLeastElement_j);
  const float way_m = sums.swept_j / sums.cut_n;
  if (sums.paid_j < 0) {
    const float back = std::min(1.0f, way_m / kTurnBack_m);
    whole_ -= whole_ * back;
    share_ -= share_ * back;
  }
  if (whole_ < 1) whole_ -= whole_ * std::min(1.0f, way_m / (kDoubt * h_m));
  whole_ = std::min(1.0f, whole_ + opened_j / element_j);
  const float wanted = whole_ * share_at(owed_j_ / element_j);
  share_ += (wanted - share_) * std::min(1.0f, way_m / (kSmooth * h_m));
}

float EdgeForce::cutting_n() const {
  float cut_n = 0;
  for (const auto& part : parts_) cut_n += part.cut_n;
  return std::min(cut_n * share_, kMostForce_n);
}

float EdgeForce::most_friction_n() const {
  float grip_n = 0;
  for (const auto& part : parts_) grip_n += part.grip_n;
  return std::min(grip_n, kMostForce_n);
}

void EdgeForce::rest(const EdgeEnds& ends) {
  *this = EdgeForce(ends);
}

void EdgeForce::visit_state(world::StateArchive& archive) {
  const auto number = [&](float& value, float least, float most) {
    archive.value(value);
    if (archive.is_reading() && !(value >= least && value <= most)) archive.fail();
  };
  const auto vector = [&](Vec3f& value) {
    archive.value(value);
    if (archive.is_reading() && !is_finite(value)) archive.fail();
  };
  for (auto& end : ends_) vector(end);
  vector(velocity_);
  number(speed_m_s_, 0, kMostSpeed_m_s);
  for (auto& part : parts_) {
    for (auto* const cut_n : {&part.cut_n, &part.next_cut_n}) number(*cut_n, 0, kMostCut_n);
    for (auto* const grip_n : {&part.grip_n, &part.next_grip_n}) number(*grip_n, 0, kMostForce_n);
    for (auto* const along : {&part.heading.x, &part.heading.y, &part.heading.z})
      number(*along, -kMostHeading, kMostHeading);
    vector(part.held);
  }
  for (auto& end : tissue_m_) vector(end);
  archive.value(steps_left_);
  if (archive.is_reading() && steps_left_ > kLookEvery) archive.fail();
  number(owed_j_, -kMostOwed_j, kMostOwed_j);
  number(whole_, 0, 1);
  number(share_, 0, kMostShare);
}

}  // namespace trocar::blades
