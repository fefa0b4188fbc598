#include "tests/hands/claim_rules.h"

#include <algorithm>

namespace trocar::hands::testing {
namespace {

using tool::Verb;

const ClaimRequest* request_of(ToolSlot tool, std::span<const ClaimRequest> requests) {
  const auto found = std::ranges::find(requests, tool, &ClaimRequest::tool);
  return found == requests.end() ? nullptr : &*found;
}

bool is_living(Tick tick, const ClaimRequest* request) {
  return request != nullptr && tick - request->last_sample_tick <= kLeaseTicks;
}

std::string broken(ToolSlot tool, const char* rule) {
  return "tool " + std::to_string(tool.value) + ": " + rule;
}

bool is_exclusive(const Claim& claim) {
  return claim.phase == ClaimPhase::Held && (claim.verb == Verb::Grasp || claim.verb == Verb::Cut);
}

}  // namespace

std::string ClaimRules::check(Tick tick, const ClaimTable& table, std::size_t node_count,
                              std::span<const ClaimRequest> requests,
                              std::span<const ClaimEvent> events) {
  auto breach = check_owners(table, node_count);
  for (std::uint8_t i = 0; i < kMaxTools && breach.empty(); ++i) {
    const ToolSlot tool{i};
    breach = check_tool(tick, table, tool, request_of(tool, requests), requests);
  }
  if (breach.empty()) breach = count_overtaking(tick, table, requests, events);
  remember(table);
  return breach;
}

std::string ClaimRules::check_owners(const ClaimTable& table, std::size_t node_count) const {
  std::array<bool, kMaxTools> owns{};
  for (std::size_t n = 0; n < node_count; ++n) {
    const auto owner = table.owner(NodeIndex(static_cast<int>(n)));
    if (owner.is_valid() && !is_exclusive(table.claim(owner)))
      return broken(owner, "owns a node without an exclusive claim in effect");
    if (owner.is_valid()) owns[owner.value] = true;
  }
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    const Claim& claim = table.claim(ToolSlot{i});
    if (claim.phase == ClaimPhase::Held && claim.verb == Verb::Grasp && !owns[i])
      return broken(ToolSlot{i}, "holds a grasp of nothing");
  }
  return {};
}

std::string ClaimRules::check_tool(Tick tick, const ClaimTable& table, ToolSlot tool,
                                   const ClaimRequest* request,
                                   std::span<const ClaimRequest> requests) const {
  const Claim& claim = table.claim(tool);
  const Claim& before = before_[tool.value];
  const bool is_held = claim.phase == ClaimPhase::Held;
  if (request == nullptr)
    return is_held || claim.phase == ClaimPhase::Wanted
               ? broken(tool, "holds or waits, but is gone")
               : std::string();
  const Tick silent = tick - request->last_sample_tick;
  if (is_held && silent > (claim.verb == Verb::Grasp ? kAbandonTicks : kLeaseTicks))
    return broken(tool, "holds after its time of silence");
  const bool is_lost = before.phase == ClaimPhase::Held && claim.phase == ClaimPhase::Ramping;
  if (is_lost && request->verb == before.verb && is_living(tick, request))
    return broken(tool, "lost what it held, though it lives");
  if (is_held && request->verb != claim.verb) return broken(tool, "holds what it does not want");
  const bool is_granted = is_held && (before.phase != ClaimPhase::Held || claim.verb == Verb::Cut);
  if (is_granted && is_exclusive(claim) && is_living(tick, request))
    for (const auto node : request->core)
      if (table.owner(node) != tool) return broken(tool, "was granted a part of its core");
  if (claim.phase != ClaimPhase::Wanted || !is_living(tick, request)) return {};

  // Who waits is kept waiting by somebody who lives. A blade that held, and was stopped in this
  // tick, may wait for one that moved away after it was decided.
  const bool is_just_stopped = before.phase == ClaimPhase::Held && claim.verb == Verb::Cut;
  if (is_just_stopped || (claim.verb == Verb::Grasp && request->core.empty())) return {};
  const bool has_holder = std::ranges::any_of(request->core, [&](NodeIndex node) {
    const auto owner = table.owner(node);
    return owner.is_valid() && owner != tool && is_living(tick, request_of(owner, requests));
  });
  return has_holder ? std::string() : broken(tool, "waits, and nobody who lives holds its core");
}

std::string ClaimRules::count_overtaking(Tick tick, const ClaimTable& table,
                                         std::span<const ClaimRequest> requests,
                                         std::span<const ClaimEvent> events) {
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    const ToolSlot tool{i};
    const auto* request = request_of(tool, requests);
    const Claim& claim = table.claim(tool);
    const bool waits_for_one = claim.phase == ClaimPhase::Wanted && claim.verb == Verb::Grasp &&
                               is_living(tick, request) && request->core.size() == 1;
    auto& wait = waits_[i];
    if (!waits_for_one)
      wait = {};
    else if (wait.node != request->core.front() || wait.since != claim.first_refusal_tick)
      wait = {request->core.front(), claim.first_refusal_tick, 0};
  }
  for (const auto& event : events) {
    if (event.outcome != ClaimOutcome::Granted || event.verb != Verb::Grasp) continue;
    const auto* granted = request_of(event.tool, requests);
    for (std::size_t i = 0; granted != nullptr && i < waits_.size(); ++i) {
      auto& wait = waits_[i];
      if (!wait.node.is_valid() || !std::ranges::binary_search(granted->core, wait.node)) continue;
      most_overtaken_ = std::max(most_overtaken_, ++wait.overtaken);
      // Each of the others was at most once before it in the order.
      if (wait.overtaken >= tool_count_)
        return broken(ToolSlot{static_cast<std::uint8_t>(i)}, "was overtaken again and again");
    }
  }
  return {};
}

void ClaimRules::remember(const ClaimTable& table) {
  for (std::uint8_t i = 0; i < kMaxTools; ++i) before_[i] = table.claim(ToolSlot{i});
}

}  // namespace trocar::hands::testing
