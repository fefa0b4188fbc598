#include "client/haptics/met_materials.h"

#include <algorithm>

namespace trocar::haptics {
namespace {

bool is_same(const wire::HapticLaw& a, const wire::HapticLaw& b) {
  const auto is_same_term = [](const wire::HapticLaw::Term& c, const wire::HapticLaw::Term& d) {
    return c.share == d.share && c.time_s == d.time_s;
  };
  return a.exponent == b.exponent && a.youngs_modulus_pa == b.youngs_modulus_pa &&
         a.poisson_ratio == b.poisson_ratio &&
         std::ranges::equal(a.relaxation, b.relaxation, is_same_term) &&
         std::ranges::equal(a.fast, b.fast, is_same_term);
}

}  // namespace

bool MetMaterials::take(const wire::HapticLaw& law) {
  for (std::size_t i = 0; i < kLaws; ++i) {
    Material& material = materials_[i];
    if (!material.is_known || material.law.number != law.number) continue;
    if (is_same(material.law, law)) return false;
    material = {law, true, 1};
    return i == now_;
  }
  if (next_ == now_) next_ = (next_ + 1) % kLaws;
  materials_[next_] = {law, true, 1};
  next_ = (next_ + 1) % kLaws;
  return false;
}

bool MetMaterials::use(std::uint32_t law_number) {
  if (now().is_known && now().law.number == law_number) return false;
  for (std::size_t i = 0; i < kLaws; ++i) {
    if (!materials_[i].is_known || materials_[i].law.number != law_number) continue;
    now_ = i;
    return true;
  }
  return false;  // its law has not come yet
}

}  // namespace trocar::haptics
