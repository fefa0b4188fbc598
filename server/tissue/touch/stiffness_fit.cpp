#include "server/tissue/touch/stiffness_fit.h"

#include "common/math/symmetric.h"

namespace trocar::touch {
namespace {

constexpr float kForgotten = 0.004f;  // per tick: a quarter of a second
// Motions of much less than 50 micrometres leave the guess.
constexpr float kNoise = 2.5e-9f;  // m^2

Vec3f column(const SymMat3f& m, int i) {
  if (i == 0) return {m.xx, m.xy, m.xz};
  if (i == 1) return {m.xy, m.yy, m.yz};
  return {m.xz, m.yz, m.zz};
}

}  // namespace

void StiffnessFit::add(const Vec3f& at_m, const Vec3f& force_n) {
  auto& reading = readings_[count_ % kSpan];
  if (count_++ >= kSpan) {
    const Vec3f dx = at_m - reading.at, df = force_n - reading.force;
    const auto keep = [](float& sum, float value) { sum += kForgotten * (value - sum); };
    keep(moved_.xx, dx.x * dx.x), keep(moved_.xy, dx.x * dx.y), keep(moved_.xz, dx.x * dx.z);
    keep(moved_.yy, dx.y * dx.y), keep(moved_.yz, dx.y * dx.z), keep(moved_.zz, dx.z * dx.z);
    rows_[0] += (dx * -df.x - rows_[0]) * kForgotten;
    rows_[1] += (dx * -df.y - rows_[1]) * kForgotten;
    rows_[2] += (dx * -df.z - rows_[2]) * kForgotten;
  }
  reading = {at_m, force_n};
}

SymMat3f StiffnessFit::stiffness(const SymMat3f& guess) const {
  SymMat3f moved = moved_;
  moved.add_identity(kNoise);
  // Row by row: K (dx dx^T + noise) = -dF dx^T + noise guess.
  std::array<Vec3f, 3> k;
  for (int i = 0; i < 3; ++i) {
    const auto row = static_cast<std::size_t>(i);
    k[row] = solve_positive_definite(moved, rows_[row] + column(guess, i) * kNoise);
  }
  const auto across = [&](double a, double b) { return 0.5 * (a + b); };
  const auto positive = positive_part({.xx = double(k[0].x),
                                       .xy = across(double(k[0].y), double(k[1].x)),
                                       .xz = across(double(k[0].z), double(k[2].x)),
                                       .yy = double(k[1].y),
                                       .yz = across(double(k[1].z), double(k[2].y)),
                                       .zz = double(k[2].z)});
  const auto f = [](double value) { return static_cast<float>(value); };
  return {f(positive.xx), f(positive.xy), f(positive.xz),
          f(positive.yy), f(positive.yz), f(positive.zz)};
}

}  // namespace trocar::touch
