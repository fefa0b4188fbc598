#include "server/session/access/try_limiter.h"

#include <arpa/inet.h>

#include <algorithm>
#include <array>
#include <cstring>

namespace trocar::access {
namespace {

constexpr int kMostDoublings = 6;  // 2^6 s is above the longest wait

}  // namespace

std::string counted_as(const std::string& address) {
  in6_addr parsed{};
  const auto text = address.substr(0, address.find('%'));
  if (::inet_pton(AF_INET6, text.c_str(), &parsed) != 1) return address;
  std::array<char, INET6_ADDRSTRLEN> out{};
  if (IN6_IS_ADDR_V4MAPPED(&parsed))
    return ::inet_ntop(AF_INET, parsed.s6_addr + 12, out.data(), out.size());
  std::memset(parsed.s6_addr + 8, 0, 8);
  return std::string(::inet_ntop(AF_INET6, &parsed, out.data(), out.size())) + "/64";
}

std::uint64_t TryLimiter::seconds_to_wait(const std::string& address, std::uint64_t now_ns) {
  const auto found = addresses_.find(counted_as(address));
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
  auto& record = addresses_[counted_as(address)];
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
