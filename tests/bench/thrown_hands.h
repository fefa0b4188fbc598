#pragma once

// Hands that do what none does: each is thrown to a random place in or around the organ, at most so
// far from the one before, with its shaft anyhow.

#include <algorithm>
#include <array>

#include "common/base/ids.h"
#include "common/math/box.h"
#include "common/math/frame.h"
#include "tests/support/random.h"

namespace trocar::bench {

class ThrownHands {
 public:
  ThrownHands(const Box<float>& organ, float far_m) : box_(organ), far_m_(far_m) {
    box_.grow(kBeyond_m);
    places_.fill((box_.least + box_.most) * 0.5f);
  }

  Pose next(ToolSlot tool) {
    const auto within = [this](float least, float most) {
      return least + (most - least) * static_cast<float>(random_.unit());
    };
    Vec3f& place = places_[tool.value];
    const Vec3f wanted{within(box_.least.x, box_.most.x), within(box_.least.y, box_.most.y),
                       within(box_.least.z, box_.most.z)};
    const float way = length(wanted - place);
    place += (wanted - place) * std::min(1.0f, far_m_ / std::max(way, 1e-6f));
    const Vec3f shaft{within(-1, 1), within(-1, 1), within(-1, 1)};
    return {place, rotation_from_z(normalized(shaft, Vec3f{0, 1, 0}))};
  }

 private:
  static constexpr float kBeyond_m = 0.01f;

  Box<float> box_;
  float far_m_;
  testing::Random random_{7};
  std::array<Vec3f, kMaxTools> places_;
};

}  // namespace trocar::bench
