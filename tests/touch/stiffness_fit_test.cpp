#include "server/tissue/touch/stiffness_fit.h"

#include <gtest/gtest.h>

#include "common/math/symmetric.h"

namespace trocar::touch {
namespace {

constexpr float kMotion_m = 1e-4f;
const SymMat3f kGuess{100, 0, 0, 100, 0, 100};

TEST(StiffnessFit, IsThatOfASpring) {
  StiffnessFit fit;
  for (int i = 0; i < 2000; ++i) {
    const auto turn = static_cast<float>(i % 3);
    const Vec3f at{0.01f * turn, kMotion_m * static_cast<float>(i), 0.01f * turn * turn};
    fit.add(at, {-300 * at.x, -500 * at.y, -700 * at.z});
  }
  const auto k = fit.stiffness(kGuess);
  EXPECT_NEAR(k.xx, 300, 1);
  EXPECT_NEAR(k.yy, 500, 1);
  EXPECT_NEAR(k.zz, 700, 1);
}

// The force falls while the tool pulls on: a spring that pushed would throw the hand away.
TEST(StiffnessFit, TissueThatTearsHasNone) {
  StiffnessFit fit;
  for (int i = 0; i < 2000; ++i) {
    const float s = kMotion_m * static_cast<float>(i);
    fit.add({s, 2 * s, 0}, {400 * s, 900 * s, 0});
  }
  const auto k = fit.stiffness(kGuess);
  for (const auto& principal : principals_of({k.xx, k.xy, k.xz, k.yy, k.yz, k.zz}))
    EXPECT_GE(principal.value, -1e-3);
  const Vec3f along{1, 2, 0};
  EXPECT_NEAR(dot(along, k * along), 0, 1);
}

}  // namespace
}  // namespace trocar::touch
