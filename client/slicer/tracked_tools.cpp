#include "client/slicer/tracked_tools.h"

#include <fmt/format.h>

#include <algorithm>

#include "client/replica/client_messages.h"

namespace trocar::slicer {
namespace {

constexpr std::uint64_t kSampleNs = 4'000'000, kKeepAliveNs = 40'000'000;

tool::Verb first_verb(const tool::ToolShape& shape) {
  const auto verb = tool::main_verb(shape);
  return verb == tool::Verb::Push ? verb : tool::Verb::None;
}

std::optional<tool::Verb> verb_of(const std::string& word) {
  for (int i = 0; i < tool::kVerbCount; ++i)
    if (const auto verb = static_cast<tool::Verb>(i); word == tool::name_of(verb)) return verb;
  return std::nullopt;
}

}  // namespace

TrackedTools::TrackedTools(std::span<const TrackedTool> tools) {
  for (const auto& tool : tools) held_.push_back({.tool = tool});
  begin_anew();
}

std::vector<tool::ToolShape> TrackedTools::shapes() const {
  std::vector<tool::ToolShape> shapes;
  for (const auto& held : held_) shapes.push_back(held.tool.shape);
  return shapes;
}

bool TrackedTools::has(const std::string& device) const {
  return std::any_of(held_.begin(), held_.end(),
                     [&](const Held& held) { return held.tool.device == device; });
}

void TrackedTools::begin_anew() {
  for (auto& held : held_) {
    held.sample.verb = first_verb(held.tool.shape);
    held.has_place = held.has_news = false;
  }
}

Result<TrackedTools::Held*> TrackedTools::take(const std::string& device, PeerId peer) {
  const auto held = std::find_if(held_.begin(), held_.end(),
                                 [&](const Held& each) { return each.tool.device == device; });
  if (held == held_.end())
    return Error{ErrorCode::Refused, "holds no instrument: --hold says which devices do"};
  if (held->holder.value_or(peer) != peer)
    return Error{ErrorCode::Refused, "another peer holds this instrument, until it goes"};
  // Its first verb again, where the last holder's letting go is still to be sent.
  if (!held->holder) held->sample.verb = first_verb(held->tool.shape);
  held->holder = peer;
  return &*held;
}

Status TrackedTools::move(const std::string& device, PeerId peer, const Transform& transform,
                          const Frames& frames) {
  const auto pose = frames.from_ras(transform);
  if (!pose) return pose.error();
  const auto held = take(device, peer);
  if (!held) return held.error();
  (*held)->sample.world_from_tool = *pose;
  (*held)->has_place = (*held)->has_news = true;
  return {};
}

Status TrackedTools::use(const std::string& device, PeerId peer, const std::string& word) {
  const auto verb = verb_of(word);
  if (!verb)
    return Error{ErrorCode::BadMessage, "'" + word + "' is none of none, push, grasp, cut"};
  const auto held = take(device, peer);
  if (!held) return held.error();
  if (tool::possible((*held)->tool.shape, *verb) != *verb)
    return Error{ErrorCode::Refused, fmt::format("this instrument cannot {}", word)};
  (*held)->sample.verb = *verb;
  (*held)->has_news = (*held)->has_place;
  return {};
}

void TrackedTools::let_go(PeerId peer) {
  for (auto& held : held_) {
    if (held.holder != peer) continue;
    held.holder.reset();
    held.sample.verb = tool::Verb::None;
    held.has_news = held.has_place;
  }
}

void TrackedTools::send_due(replica::SessionSource& source, std::uint64_t now_ns) {
  for (std::size_t i = 0; i < held_.size(); ++i) {
    auto& held = held_[i];
    const auto since_ns = now_ns - held.sent_ns;
    const bool is_due = held.has_news ? since_ns >= kSampleNs
                                      : held.holder && held.has_place && since_ns >= kKeepAliveNs;
    if (!is_due) continue;
    // The next one says more, where this one finds no room.
    replica::send_tool_sample(source, static_cast<std::uint32_t>(i), ++sequence_, held.sample);
    held.sent_ns = now_ns;
    held.has_news = false;
    if (!held.holder) {
      held.has_place = false;
      held.sample.verb = first_verb(held.tool.shape);
    }
  }
}

}  // namespace trocar::slicer
