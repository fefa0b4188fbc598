#include "server/tissue/hands/claims.h"

#include <algorithm>
#include <utility>

#include "common/base/assert.h"

namespace trocar::hands {

using tool::Verb;

ClaimTable::ClaimTable(std::size_t node_count) : owners_(node_count) {
  waiting_.reserve(kMaxTools);
}

float ClaimTable::strength(ToolSlot tool, Tick tick) const {
  const Claim& c = claim(tool);
  if (c.phase == ClaimPhase::Held) return 1.0f;
  if (c.phase != ClaimPhase::Ramping) return 0.0f;
  const Tick elapsed = tick - c.ramp_start_tick;
  if (elapsed >= c.ramp_ticks) return 0.0f;
  return 1.0f - static_cast<float>(elapsed) / static_cast<float>(c.ramp_ticks);
}

void ClaimTable::release_core(ToolSlot tool) {
  std::replace(owners_.begin(), owners_.end(), tool, ToolSlot{});
}

void ClaimTable::release_node(ToolSlot tool, NodeIndex node) {
  if (owners_[node.value] == tool) owners_[node.value] = ToolSlot{};
}

void ClaimTable::slip_off(ToolSlot tool, Tick tick, std::vector<ClaimEvent>& events) {
  Claim& c = claims_[tool.value];
  const bool was_held = c.phase == ClaimPhase::Held;
  if (was_held) events.push_back({tick, tool, c.verb, ClaimOutcome::Slipped, {}});
  release_core(tool);
  c = was_held ? Claim{.phase = ClaimPhase::Spent, .verb = c.verb} : Claim{};
}

void ClaimTable::start_ramp(ToolSlot tool, Tick tick, Tick ramp_ticks) {
  release_core(tool);
  Claim& c = claims_[tool.value];
  c.phase = ClaimPhase::Ramping;
  c.ramp_start_tick = tick;
  c.ramp_ticks = static_cast<std::uint32_t>(ramp_ticks);
}

void ClaimTable::leave(ToolSlot tool, Tick tick) {
  Claim& c = claims_[tool.value];
  if (c.phase == ClaimPhase::Held && c.verb == Verb::Grasp) {
    start_ramp(tool, tick, kTakeoverRampTicks);
  } else if (c.phase != ClaimPhase::Ramping) {
    if (c.verb == Verb::Cut) release_core(tool);
    c = Claim{};
  }
}

void ClaimTable::update(Tick tick, std::span<const ClaimRequest> requests,
                        std::vector<ClaimEvent>& events) {
  for (auto& c : claims_)
    if (c.phase == ClaimPhase::Ramping && tick - c.ramp_start_tick >= c.ramp_ticks) c = Claim{};

  // Ends first, so that what is freed in this tick can be granted in it.
  for (const auto& request : requests) {
    Claim& c = claims_[request.tool.value];
    const bool verb_ended = request.verb != c.verb;
    const Tick silent = tick - request.last_sample_tick;
    if (c.phase == ClaimPhase::Held && verb_ended) {
      events.push_back({tick, request.tool, c.verb, ClaimOutcome::Released, {}});
      release_core(request.tool);
      c = Claim{};
    } else if ((c.phase == ClaimPhase::Wanted || c.phase == ClaimPhase::Spent) && verb_ended) {
      c = Claim{};
    } else if (c.phase == ClaimPhase::Held && c.verb == Verb::Grasp && silent > kAbandonTicks) {
      events.push_back({tick, request.tool, c.verb, ClaimOutcome::Expired, {}});
      start_ramp(request.tool, tick, kAbandonRampTicks);
    } else if (c.phase == ClaimPhase::Held && c.verb != Verb::Grasp && silent > kLeaseTicks) {
      events.push_back({tick, request.tool, c.verb, ClaimOutcome::Expired, {}});
      start_ramp(request.tool, tick, kTakeoverRampTicks);
    }
  }

  waiting_.clear();
  for (const auto& request : requests) {
    Claim& c = claims_[request.tool.value];
    const bool is_open = c.phase == ClaimPhase::None || c.phase == ClaimPhase::Wanted ||
                         (c.phase == ClaimPhase::Held && c.verb == Verb::Cut);
    // A tool that has fallen silent asks for nothing: its last word is too old.
    if (!is_open || tick - request.last_sample_tick > kLeaseTicks) continue;
    if (request.verb == Verb::Push) {
      c = Claim{.phase = ClaimPhase::Held, .verb = Verb::Push};
      events.push_back({tick, request.tool, Verb::Push, ClaimOutcome::Granted, {}});
    } else if (request.verb != Verb::None) {
      if (c.phase == ClaimPhase::None)
        c = Claim{.phase = ClaimPhase::Wanted, .verb = request.verb, .first_refusal_tick = tick};
      waiting_.push_back(&request);
    }
  }
  std::sort(waiting_.begin(), waiting_.end(), [this](const auto* a, const auto* b) {
    const Tick ta = claim(a->tool).first_refusal_tick, tb = claim(b->tool).first_refusal_tick;
    return ta != tb ? ta < tb : a->tool < b->tool;
  });
  for (const auto* request : waiting_) {
    if (request->verb == Verb::Grasp)
      decide_grasp(tick, *request, requests, events);
    else
      decide_cut(tick, *request, requests, events);
  }
}

// All of the core or nothing: every holder must have fallen silent before any is taken over.
ToolSlot ClaimTable::holder_of(Tick tick, const ClaimRequest& request,
                               std::span<const ClaimRequest> requests) const {
  for (const auto node : request.core) {
    const auto holder = owner(node);
    if (!holder.is_valid() || holder == request.tool) continue;
    const auto it = std::ranges::find(requests, holder, &ClaimRequest::tool);
    const bool is_silent = it == requests.end() || tick - it->last_sample_tick > kLeaseTicks;
    if (!is_silent) return holder;
  }
  return {};
}

void ClaimTable::hand_over(ToolSlot from, ToolSlot to, Tick tick, std::vector<ClaimEvent>& events) {
  const auto other = [&](ToolSlot tool) { return tool == from ? to : tool == to ? from : tool; };
  for (const auto tool : {from, to}) {
    Claim& c = claims_[tool.value];
    if (c.verb == Verb::Cut) {
      release_core(tool);
      if (c.phase == ClaimPhase::Held)
        events.push_back({tick, tool, Verb::Cut, ClaimOutcome::Released, {}});
      c = {};
    } else if (c.phase == ClaimPhase::Held) {
      events.push_back({tick, tool, c.verb, ClaimOutcome::Released, {}});
      events.push_back({tick, other(tool), c.verb, ClaimOutcome::Granted, {}});
    }
  }
  std::swap(claims_[from.value], claims_[to.value]);
  for (auto& owner : owners_) owner = other(owner);
  for (auto& claim : claims_) claim.last_holder = other(claim.last_holder);
}

void ClaimTable::let_go(const ClaimTable& before) {
  std::ranges::fill(owners_, ToolSlot{});
  for (std::size_t tool = 0; tool < claims_.size(); ++tool) {
    const Claim& c = before.claims_[tool];
    const bool has_worked = c.phase == ClaimPhase::Held || c.phase == ClaimPhase::Spent;
    claims_[tool] = has_worked && c.verb != Verb::Push
                        ? Claim{.phase = ClaimPhase::Spent, .verb = c.verb}
                        : Claim{};
  }
}

void ClaimTable::take_over(Tick tick, const ClaimRequest& request,
                           std::vector<ClaimEvent>& events) {
  for (const auto node : request.core) {
    const auto holder = owner(node);
    if (!holder.is_valid() || holder == request.tool) continue;
    events.push_back({tick, holder, claim(holder).verb, ClaimOutcome::TakenOver, request.tool});
    start_ramp(holder, tick, kTakeoverRampTicks);
  }
  for (const auto node : request.core) owners_[node.value] = request.tool;
}

void ClaimTable::decide_grasp(Tick tick, const ClaimRequest& request,
                              std::span<const ClaimRequest> requests,
                              std::vector<ClaimEvent>& events) {
  if (request.core.empty() && request.thread.holder.is_valid())
    return refuse(tick, request, ClaimOutcome::RefusedHeld, request.thread.holder, events);
  if (request.core.empty() && !request.thread.is_held)
    return refuse(tick, request, ClaimOutcome::RefusedNothingInReach, {}, events);
  if (const auto holder = holder_of(tick, request, requests); holder.is_valid())
    return refuse(tick, request, ClaimOutcome::RefusedHeld, holder, events);
  take_over(tick, request, events);
  claims_[request.tool.value] = Claim{.phase = ClaimPhase::Held, .verb = Verb::Grasp};
  events.push_back({tick, request.tool, Verb::Grasp, ClaimOutcome::Granted, {}});
}

// The core is that of this tick. A blade in the air has none and may go on.
void ClaimTable::decide_cut(Tick tick, const ClaimRequest& request,
                            std::span<const ClaimRequest> requests,
                            std::vector<ClaimEvent>& events) {
  Claim& c = claims_[request.tool.value];
  release_core(request.tool);
  if (const auto holder = holder_of(tick, request, requests); holder.is_valid()) {
    if (c.phase == ClaimPhase::Held)
      c = Claim{.phase = ClaimPhase::Wanted, .verb = Verb::Cut, .first_refusal_tick = tick};
    return refuse(tick, request, ClaimOutcome::RefusedHeld, holder, events);
  }
  take_over(tick, request, events);
  if (c.phase == ClaimPhase::Held) return;
  c = Claim{.phase = ClaimPhase::Held, .verb = Verb::Cut};
  events.push_back({tick, request.tool, Verb::Cut, ClaimOutcome::Granted, {}});
}

void ClaimTable::refuse(Tick tick, const ClaimRequest& request, ClaimOutcome outcome,
                        ToolSlot holder, std::vector<ClaimEvent>& events) {
  Claim& c = claims_[request.tool.value];
  if (c.last_refusal != outcome || c.last_holder != holder)
    events.push_back({tick, request.tool, request.verb, outcome, holder});
  c.last_refusal = outcome;
  c.last_holder = holder;
}

void ClaimTable::visit_state(world::StateArchive& archive) {
  archive.fixed_array(owners_);
  for (auto& c : claims_) {
    archive.value(c.phase);
    archive.value(c.verb);
    archive.value(c.last_refusal);
    archive.value(c.last_holder);
    archive.value(c.first_refusal_tick);
    archive.value(c.ramp_start_tick);
    archive.value(c.ramp_ticks);
    if (archive.is_reading() && (c.phase > ClaimPhase::Spent || c.verb > Verb::Cut)) archive.fail();
  }
  if (!archive.is_reading()) return;
  for (const auto owner : owners_)
    if (owner != ToolSlot{} && !owner.is_valid()) archive.fail();
}

}  // namespace trocar::hands
