#pragma once

// The materials that a hand has met: their laws, and what was learned about them. One is in use; at
// first it stands in for a law that has not come.

#include <array>

#include "common/wire/haptic_patch.h"

namespace trocar::haptics {

class MetMaterials {
 public:
  struct Material {
    wire::HapticLaw law;
    bool is_known = false;
    double slope = 1;
    double expected_slope = 1;  // by what the server said of the place before it was touched
    bool is_felt = false;       // since then
  };

  // A new law may take an old one's number; of more than kLaws the oldest goes. Returns whether the
  // law in use is another now.
  bool take(const wire::HapticLaw& law);
  // Uses the law of this number from now on. Returns whether that is another one, and has come.
  bool use(std::uint32_t law_number);
  Material& now() { return materials_[now_]; }
  const Material& now() const { return materials_[now_]; }

 private:
  static constexpr std::size_t kLaws = 8;

  std::array<Material, kLaws + 1> materials_;
  std::size_t now_ = kLaws, next_ = 0;
};

}  // namespace trocar::haptics
