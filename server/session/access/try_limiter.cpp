#include "server/session/access/try_limiter.h"

#include <algorithm>

#include "common/intake/room.h"

namespace trocar::access {
namespace {

constexpr int kMostDoublings = 6;  // 2^6 s is above the longest wait

}  // namespace

std::uint64_t TryLimiter::seconds_to_wait(const std::string& address, std::uint64_t now_ns) {
  const auto found = addresses_.find(intake::counted_as(address));
  if (found != addresses_.end() && now_ns < found->second.allowed_ns)
    return (found->second.allowed_ns - now_ns + kSecondNs - 1) / kSecondNs;
  const bool is_same_second = now_ns - second_begin_ns_ < kSecondNs;
  return is_same_second && wrong_in_second_ >= kMostPerSecond ? 1 : 0;
}

void TryLimiter::record_wrong_try(const std::string& address, std::uint64_t now_ns) {
  if (now_ns - second_begin_ns_ >= kSecondNs) {
    second_begin_ns_ = now_ns;
    wrong_in_second_ = 0;
  }
  ++wrong_in_second_;
  forget_old(now_ns);
  auto& record = addresses_[intake::counted_as(address)];
  ++record.wrong_tries;
  record.last_ns = now_ns;
  if (record.wrong_tries < kFreeTries) return;
  const int doublings = std::min(record.wrong_tries - kFreeTries, kMostDoublings);
  const auto wait = std::min(std::uint64_t{1} << doublings, kLongestWaitSeconds);
  record.allowed_ns = now_ns + wait * kSecondNs;
}

void TryLimiter::forget_old(std::uint64_t now_ns) {
  std::erase_if(addresses_, [now_ns](const auto& entry) {
    return now_ns - entry.second.last_ns > kForgetSeconds * kSecondNs;
  });
  if (addresses_.size() < kMostAddresses) return;
  const auto quietest = std::ranges::min_element(
      addresses_, {}, [](const auto& entry) { return entry.second.last_ns; });
  addresses_.erase(quietest);
}

}  // namespace trocar::access
