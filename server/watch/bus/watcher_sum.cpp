#include "server/watch/bus/watcher_sum.h"

#include <algorithm>

#include "common/wire/session_messages.h"

namespace trocar::bus {
namespace {

constexpr std::uint64_t kTakerNs = 10'000'000'000;
constexpr std::uint64_t kReportNs = 1'100'000'000;  // the server takes one in a second

}  // namespace

void WatcherSum::note_taker(const std::string& taker, std::uint32_t watchers,
                            std::uint64_t now_ns) {
  if (takers_.size() >= kMostTakers && !takers_.contains(taker)) return;
  takers_[taker] = {watchers, now_ns};
}

std::optional<std::uint32_t> WatcherSum::due(std::uint64_t now_ns) {
  std::erase_if(takers_, [&](const auto& one) { return now_ns - one.second.heard_ns > kTakerNs; });
  if (!own_ || now_ns - reported_ns_ < kReportNs) return std::nullopt;
  std::uint64_t sum = *own_;
  for (const auto& [name, taker] : takers_) sum += taker.watchers;
  const auto watchers =
      static_cast<std::uint32_t>(std::min(sum, std::uint64_t{wire::kMostRelayed}));
  if (reported_ == watchers) return std::nullopt;
  reported_ns_ = now_ns;
  return reported_ = watchers;
}

}  // namespace trocar::bus
