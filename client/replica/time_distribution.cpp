#include "client/replica/time_distribution.h"

#include <algorithm>
#include <cmath>

namespace trocar::replica {
namespace {

constexpr std::size_t kBins = 20'000;

}  // namespace

void TimeDistribution::add(double milliseconds) {
  if (bins_.empty()) bins_.resize(kBins);
  const double clamped = std::clamp(milliseconds, 0.0, static_cast<double>(kBins - 1));
  ++bins_[static_cast<std::size_t>(clamped)];
  ++count_;
}

double TimeDistribution::quantile_ms(double share) const {
  if (count_ == 0) return 0;
  const auto wanted = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(count_)));
  std::uint64_t seen = 0;
  std::size_t bin = 0;
  for (; bin + 1 < bins_.size(); ++bin) {
    seen += bins_[bin];
    if (seen >= std::max<std::uint64_t>(wanted, 1)) break;
  }
  return static_cast<double>(bin) + 0.5;
}

}  // namespace trocar::replica
