#pragma once

// The forces of a contact point at displacement d of the point.
//
// Push, with gap g = n . (d - plane), normal force N = min(-k min(0, g), limit_n) and slip
// s = T (d - anchor), T = I - n n^T:
//   energy of the face    k/2 min(0, g)^2, linear in g once N has reached its limit
//   friction              -t s with t = hold_stiffness while |t s| <= mu N, else mu N / |s|
//   (Coulomb's law with a small elastic range, so that resting contact rests)
// Grip, with s = d - anchor:
//   -t s with t = stiffness while |t s| <= limit_n, else limit_n / |s|

#include <algorithm>
#include <cmath>

#include "common/math/vec3.h"
#include "server/tissue/contact/contact_list.h"

namespace trocar::contact {

struct PointLoad {
  Vec3f gradient;               // N; minus the force on the tissue, hence the force on the tool
  float pressed_n = 0;          // N, a push's normal force
  float tangential_secant = 0;  // N/m, secant stiffness across the face, t above
  float normal_secant = 0;      // N/m, secant stiffness along the normal, N / |g|
  Vec3f slip;                   // m, s above
  bool slides = false;
};

inline PointLoad load_at(const ContactPoint& point, const Vec3f& d) {
  PointLoad load;
  load.slip = d - point.anchor;
  float hold = point.stiffness, limit = point.limit_n;
  if (point.kind == ContactPoint::Kind::Push) {
    const float gap = dot(point.normal, d - point.plane);
    if (!(gap < 0)) {
      load.slides = true;
      return load;
    }
    load.pressed_n = std::min(-point.stiffness * gap, point.limit_n);
    load.normal_secant = load.pressed_n / -gap;
    load.gradient = point.normal * -load.pressed_n;
    load.slip -= point.normal * dot(point.normal, load.slip);
    hold = point.hold_stiffness;
    limit = point.friction * load.pressed_n;
  }
  const float distance = length(load.slip);
  load.slides = hold * distance > limit;
  load.tangential_secant = load.slides ? limit / distance : hold;
  load.gradient += load.slip * load.tangential_secant;
  return load;
}

// The block is positive semi-definite, close to the second derivative.
inline void add_block(const ContactPoint& point, const PointLoad& load, float weight,
                      SymMat3f& block) {
  const float share = weight * weight;
  block.add_identity(share * load.tangential_secant);
  if (point.kind == ContactPoint::Kind::Push && load.pressed_n > 0)
    block.add_outer(point.normal, share * (load.normal_secant - load.tangential_secant));
}

}  // namespace trocar::contact
