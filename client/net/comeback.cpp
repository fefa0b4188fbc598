#include "client/net/comeback.h"

#include <algorithm>

namespace trocar::net {
namespace {

constexpr std::size_t kMostTokenBytes = 64;
constexpr std::uint32_t kMostKeptSeconds = 3600;

double seconds_between(std::uint64_t from_ns, std::uint64_t to_ns) {
  return to_ns > from_ns ? static_cast<double>(to_ns - from_ns) * 1e-9 : 0.0;
}

}  // namespace

void Comeback::allow(const std::string& token, std::uint32_t kept_seconds) {
  const bool is_offered = !token.empty() && token.size() <= kMostTokenBytes;
  token_ = is_offered ? token : std::string();
  kept_ns_ =
      is_offered ? std::min(kept_seconds, kMostKeptSeconds) * std::uint64_t{1'000'000'000} : 0;
}

void Comeback::begin(std::uint64_t now_ns) {
  if (is_away()) return;
  pause_.restart();
  deadline_ns_ = now_ns + kept_ns_;
  away_since_ns_ = now_ns;
}

void Comeback::end(std::uint64_t now_ns) {
  if (!is_away()) return;
  longest_ns_ = std::max(longest_ns_.load(), now_ns - away_since_ns_);
  ++returns_;
  away_since_ns_ = 0;
}

std::chrono::nanoseconds Comeback::next_pause(std::uint64_t now_ns) {
  const std::uint64_t left_ns = is_over(now_ns) ? 0 : deadline_ns_ - now_ns;
  return std::min(pause_.next(), std::chrono::nanoseconds(left_ns));
}

Comeback::Figures Comeback::figures(std::uint64_t now_ns) const {
  Figures figures{.returns = returns_, .longest_seconds = static_cast<double>(longest_ns_) * 1e-9};
  if (const std::uint64_t since = away_since_ns_; since != 0) {
    figures.away_seconds = seconds_between(since, now_ns);
    figures.left_seconds = seconds_between(now_ns, deadline_ns_);
    figures.longest_seconds = std::max(figures.longest_seconds, figures.away_seconds);
  }
  return figures;
}

}  // namespace trocar::net
