#include "client/haptics/visco_element.h"

#include <cmath>

namespace trocar::haptics {

ViscoSteps::ViscoSteps(const wire::HapticLaw& law, double dt_s) : dt_s_(dt_s) {
  for (std::size_t i = 0; i < kMaxTerms; ++i) {
    const double share = law.relaxation[i].share, time_s = law.relaxation[i].time_s;
    const double keep = std::exp(-dt_s / time_s);
    relaxation_[i] = {keep, share * (1 - keep) * time_s / dt_s, share};
    rest_ -= share;
  }
  for (std::size_t i = 0; i < kMaxTerms; ++i) {
    const double keep = 1 / (1 + dt_s / law.fast[i].time_s);
    fast_[i] = {keep, keep * law.fast[i].share};
    at_once_ += fast_[i].take;
  }
}

double relaxed_share(const wire::HapticLaw& law, double seconds) {
  double share = 1;
  for (const auto& term : law.relaxation)
    share -= term.share * (1 - std::exp(-seconds / term.time_s));
  for (const auto& term : law.fast) share += term.share * std::exp(-seconds / term.time_s);
  return share;
}

}  // namespace trocar::haptics
