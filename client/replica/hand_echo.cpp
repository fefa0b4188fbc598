#include "client/replica/hand_echo.h"

#include <algorithm>
#include <cmath>

namespace trocar::replica {
namespace {

// The nearer one of two close lines counts, even if it is that of a second later.
constexpr double kNsPerMeterBeside = 1e13;

}  // namespace

void HandEcho::note_sent(const Vec3f& position_m, std::uint64_t now_ns) {
  sent_.push_back({position_m, now_ns});
  while (now_ns - sent_.front().ns > kKeptNs) sent_.pop_front();
}

std::optional<double> HandEcho::observe_ms(const Vec3f& shown_m, std::uint64_t likely_ns,
                                           std::uint64_t now_ns) {
  if (last_shown_m_ && *last_shown_m_ == shown_m) return std::nullopt;
  last_shown_m_ = shown_m;
  const auto likely = static_cast<double>(likely_ns);
  std::optional<double> left_ns;
  double least = 0;
  for (std::size_t i = 1; i < sent_.size(); ++i) {
    const auto &a = sent_[i - 1], &b = sent_[i];
    const Vec3f way = b.position_m - a.position_m;
    const float along_m = length(way), seconds = static_cast<float>(b.ns - a.ns) * 1e-9f;
    if (along_m < kLeastSpeed_m_s * seconds || along_m == 0) continue;
    const float share =
        std::clamp(dot(shown_m - a.position_m, way) / (along_m * along_m), 0.0f, 1.0f);
    const float beside_m = length(shown_m - a.position_m - way * share);
    if (beside_m > kNear_m) continue;
    const double ns =
        static_cast<double>(a.ns) + static_cast<double>(share) * static_cast<double>(b.ns - a.ns);
    const double unlikeliness =
        std::abs(ns - likely) + static_cast<double>(beside_m) * kNsPerMeterBeside;
    if (left_ns && unlikeliness > least) continue;
    left_ns = ns;
    least = unlikeliness;
  }
  if (!left_ns) return std::nullopt;
  return (static_cast<double>(now_ns) - *left_ns) * 1e-6;
}

}  // namespace trocar::replica
