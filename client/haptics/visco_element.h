#pragma once

// Tissue makes this of an elastic force f over time, in one direction or three:
//
//   M = (1 - sum g) f + sum h + sum q
//   h_i <- e_i h_i + g_i c_i (f - f_old),   e_i = exp(-dt / tau_i), c_i = (1 - e_i) tau_i / dt
//   q_j <- (q_j + kappa_j k (x - x_old)) / (1 + dt / tau_j)
//
// h: shares of the force that relax (a Prony series, exact for a force that is linear in a step).
// q: damping of what gives way within milliseconds, driven by the motion times the stiffness.

#include <array>

#include "common/wire/haptic_patch.h"

namespace trocar::haptics {

// The factors of a law for steps of one length.
class ViscoSteps {
 public:
  static constexpr std::size_t kMaxTerms = wire::HapticLaw::kMaxTerms;

  ViscoSteps() = default;
  ViscoSteps(const wire::HapticLaw& law, double dt_s);

  double dt_s() const { return dt_s_; }
  // Returns the force at once of a step of the motion, over the elastic one.
  double at_once() const { return at_once_; }

 private:
  template <typename Value>
  friend class ViscoElement;

  struct Relaxation {
    double keep = 0, take = 0, share = 0;  // e, g c, g
  };
  struct Fast {
    double keep = 1, take = 0;  // 1 / (1 + dt / tau), kappa / (1 + dt / tau)
  };
  double dt_s_ = 0, rest_ = 1, at_once_ = 1;
  std::array<Relaxation, kMaxTerms> relaxation_;
  std::array<Fast, kMaxTerms> fast_;
};

// The share of a step's elastic force that is left after `seconds`.
double relaxed_share(const wire::HapticLaw& law, double seconds);

// Value is double or Vec3d.
template <typename Value>
class ViscoElement {
 public:
  void reset() { *this = {}; }

  // `motion_force`: the stiffness times the motion since the last step.
  Value step(const ViscoSteps& steps, const Value& elastic, const Value& motion_force) {
    Value force = elastic * steps.rest_;
    const Value growth = elastic - elastic_;
    for (std::size_t i = 0; i < relaxing_.size(); ++i) {
      relaxing_[i] = relaxing_[i] * steps.relaxation_[i].keep + growth * steps.relaxation_[i].take;
      force += relaxing_[i];
    }
    for (std::size_t i = 0; i < fast_.size(); ++i) {
      fast_[i] = fast_[i] * steps.fast_[i].keep + motion_force * steps.fast_[i].take;
      force += fast_[i];
    }
    elastic_ = elastic;
    return force;
  }

  // Undoes a part of the motion as if it had never been: `elastic` is the stiffness times it.
  void take_back(const ViscoSteps& steps, const Value& elastic) {
    elastic_ = elastic_ - elastic;
    for (std::size_t i = 0; i < relaxing_.size(); ++i)
      relaxing_[i] = relaxing_[i] - elastic * steps.relaxation_[i].share;
    for (std::size_t i = 0; i < fast_.size(); ++i)
      fast_[i] = fast_[i] - elastic * steps.fast_[i].take;
  }

  // Replaces each state by what `change` makes of it.
  template <typename Change>
  void change_states(const Change& change) {
    elastic_ = change(elastic_);
    for (auto& h : relaxing_) h = change(h);
    for (auto& q : fast_) q = change(q);
  }

 private:
  Value elastic_{};
  std::array<Value, ViscoSteps::kMaxTerms> relaxing_{}, fast_{};
};

}  // namespace trocar::haptics
