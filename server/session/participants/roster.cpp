#include "server/session/participants/roster.h"

#include <algorithm>

namespace trocar::participants {
namespace {

constexpr std::size_t kMaxNameBytes = 32;

// Length in bytes of the code point at the front of `text`, and its value; 0 if it is not UTF-8
// (truncated, overlong, surrogate or above U+10FFFF).
std::size_t decode_code_point(std::string_view text, std::uint32_t& code_point) {
  const auto lead = static_cast<std::uint8_t>(text.front());
  std::size_t size = 0;
  std::uint32_t smallest = 0;
  if (lead < 0x80) {
    code_point = lead;
    return 1;
  } else if (lead >> 5 == 0x6) {
    size = 2, smallest = 0x80, code_point = lead & 0x1fu;
  } else if (lead >> 4 == 0xe) {
    size = 3, smallest = 0x800, code_point = lead & 0x0fu;
  } else if (lead >> 3 == 0x1e) {
    size = 4, smallest = 0x10000, code_point = lead & 0x07u;
  } else {
    return 0;
  }
  if (text.size() < size) return 0;
  for (std::size_t i = 1; i < size; ++i) {
    const auto byte = static_cast<std::uint8_t>(text[i]);
    if (byte >> 6 != 0x2) return 0;
    code_point = code_point << 6 | (byte & 0x3fu);
  }
  const bool is_surrogate = code_point >= 0xd800 && code_point <= 0xdfff;
  return code_point < smallest || code_point > 0x10ffff || is_surrogate ? 0 : size;
}

// Control and invisible characters, and those that reorder the text around them: a name is shown
// in other people's windows and must look like what it is.
bool is_printable(std::uint32_t c) {
  const bool is_control = c < 0x20 || (c >= 0x7f && c < 0xa0);
  const bool is_format = c == 0xad || c == 0x61c || (c >= 0x200b && c <= 0x200f) ||
                         (c >= 0x2028 && c <= 0x202e) || (c >= 0x2060 && c <= 0x206f) ||
                         c == 0xfeff || (c >= 0xfff0 && c <= 0xfffb);
  const bool is_unassigned = (c & 0xfffe) == 0xfffe || (c >= 0xe000 && c <= 0xf8ff) || c >= 0xe0000;
  return !is_control && !is_format && !is_unassigned;
}

bool is_valid_name(std::string_view name) {
  if (name.empty() || name.size() > kMaxNameBytes) return false;
  if (name.front() == ' ' || name.back() == ' ') return false;
  while (!name.empty()) {
    std::uint32_t code_point = 0;
    const auto size = decode_code_point(name, code_point);
    if (size == 0 || !is_printable(code_point)) return false;
    name.remove_prefix(size);
  }
  return true;
}

}  // namespace

Roster::Roster(const std::vector<Participant>& present) {
  for (const auto& participant : present)
    if (participant.slot.is_valid()) slots_[participant.slot.value] = participant;
}

Result<Participant> Roster::join(std::string_view name, Role role,
                                 std::vector<tool::ToolShape> tools, JoinRefusal& refusal) {
  const auto refuse = [&refusal](JoinRefusal why, std::string message) {
    refusal = why;
    return Error{ErrorCode::Refused, std::move(message)};
  };
  if (!is_valid_name(name))
    return refuse(JoinRefusal::NameInvalid,
                  "name: 1 to 32 bytes of printable UTF-8 without a space at either end, please");
  if (!has_tools(role) && !tools.empty())
    return refuse(JoinRefusal::ToolsInvalid,
                  std::string("tools: an ") + name_of(role) + " watches and has none");
  if (tools.size() > kToolsPerHand)
    return refuse(JoinRefusal::ToolsInvalid,
                  "tools: " + std::to_string(tools.size()) + " are too many, at most 2");
  for (const auto& shape : tools)
    if (!tool::is_valid(shape))
      return refuse(JoinRefusal::ToolsInvalid,
                    "tools: a radius is 0.5 to 50 mm, a length 10 to 1000 mm, a reach 1 to 50 mm");
  for (const auto& other : slots_)
    if (other && other->name == name)
      return refuse(JoinRefusal::NameTaken, "name: somebody called " + std::string(name) +
                                                " is here already, choose another with --name");
  if (has_tools(role) && tools.empty()) tools.emplace_back();

  const auto first = slots_.begin() + (has_tools(role) ? 0 : kMaxHands);
  const auto last = has_tools(role) ? slots_.begin() + kMaxHands : slots_.end();
  const auto free = std::find_if(first, last, [](const auto& slot) { return !slot; });
  if (free == last)
    return refuse(JoinRefusal::Full,
                  has_tools(role)
                      ? "full: all 16 places with tools are taken, join as observer or come back"
                      : "full: all 100 places for watchers are taken, come back later");
  const auto index = static_cast<std::uint8_t>(free - slots_.begin());
  *free = Participant{{index}, std::string(name), role, std::move(tools)};
  return **free;
}

void Roster::leave(ParticipantSlot slot) {
  if (slot.is_valid()) slots_[slot.value].reset();
}

const Participant* Roster::find(ParticipantSlot slot) const {
  return slot.is_valid() && slots_[slot.value] ? &*slots_[slot.value] : nullptr;
}

std::vector<Participant> Roster::list() const {
  std::vector<Participant> present;
  for (const auto& slot : slots_)
    if (slot) present.push_back(*slot);
  return present;
}

}  // namespace trocar::participants
