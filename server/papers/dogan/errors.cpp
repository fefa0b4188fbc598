#include "server/papers/dogan/errors.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace trocar::dogan {

Errors errors_of(std::vector<double> values) {
  if (values.empty()) return {};
  std::ranges::sort(values);
  const double count = static_cast<double>(values.size());
  const auto high = static_cast<std::size_t>(std::ceil(0.95 * count)) - 1;
  return {std::accumulate(values.begin(), values.end(), 0.0) / count, values[high], values.back()};
}

}  // namespace trocar::dogan
