#include "client/haptics/wake_statistics.h"

#include <algorithm>
#include <cmath>

namespace trocar::haptics {
namespace {

constexpr double kBinsToOctave = 8;

}  // namespace

void WakeStatistics::add(double late_us) {
  const double bin = std::floor(kBinsToOctave * std::log2(std::max(late_us, 1.0)));
  ++bins_[std::min(static_cast<std::size_t>(bin), kBins - 1)];
  ++count_;
  worst_us_ = std::max(worst_us_, late_us);
}

double WakeStatistics::quantile_us(double share) const {
  if (count_ == 0) return 0;
  const auto wanted = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(count_)));
  std::uint64_t seen = 0;
  std::size_t bin = 0;
  for (; bin + 1 < kBins; ++bin) {
    seen += bins_[bin];
    if (seen >= std::max<std::uint64_t>(wanted, 1)) break;
  }
  return std::exp2(static_cast<double>(bin + 1) / kBinsToOctave);
}

}  // namespace trocar::haptics
