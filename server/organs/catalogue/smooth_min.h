#pragma once

#include <algorithm>
#include <cmath>

namespace trocar::catalogue {

// Polynomial smooth minimum: rounds the crease over a width of about k.
inline double smooth_min(double a, double b, double k) {
  const double h = std::max(k - std::abs(a - b), 0.0) / k;
  return std::min(a, b) - h * h * k * 0.25;
}

}  // namespace trocar::catalogue
