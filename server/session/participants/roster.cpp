#include "server/session/participants/roster.h"

#include <algorithm>
#include <array>
#include <charconv>

#include "common/base/printable.h"
#include "common/intake/room.h"
#include "server/session/participants/look_alike.h"

namespace trocar::participants {
namespace {

constexpr std::size_t kMaxNameBytes = 32;

// Who has asked for a name finds the other one in the list.
std::string called(std::string_view name, const Participant& other) {
  const auto whole = "somebody called " + other.name;
  return other.name == name ? whole : whole + ", which looks like " + std::string(name) + ",";
}

std::string print_mm(float mm) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), mm);
  return {text.data(), end.ptr};
}

}  // namespace

int places_for(Role role, const Places& places) {
  if (role == Role::Observer) return intake::places_for_observers(places.watchers);
  return (places.watchers + 1) / 2;
}

int places_alike(Role role, const Places& places) {
  return role == Role::Observer ? (places.watchers + 1) / 2 : (places.watchers + 3) / 4;
}

bool is_valid_name(std::string_view name) {
  if (name.empty() || name.size() > kMaxNameBytes) return false;
  if (name.front() == ' ' || name.back() == ' ') return false;
  return is_printable(name);
}

Roster::Roster(const std::vector<Participant>& present) {
  for (const auto& participant : present)
    if (participant.slot.is_valid()) slots_[participant.slot.value] = participant;
}

Status Roster::check_shape(const tool::ToolShape& shape) const {
  if (!tool::is_valid(shape))
    return Error{ErrorCode::Refused,
                 "tools: a radius is 0.5 to 50 mm, a length 10 to 1000 mm, a reach 1 to 50 mm, an "
                 "edge_m 1 to 200 mm or 0, a grip_n 0.1 to 100 or 0"};
  if (shape.edge_m * 1e3f > places_.longest_edge_mm)
    return Error{ErrorCode::Refused,
                 "tools: edge_m is " + print_mm(shape.edge_m * 1e3f) + " mm, longer than the " +
                     print_mm(places_.longest_edge_mm) +
                     " mm that this session allows: take a shorter blade, or start the server "
                     "with a longer --longest-edge"};
  return {};
}

Status Roster::change_tool(ParticipantSlot slot, std::size_t number, const tool::ToolShape& shape) {
  auto& who = slots_[slot.value];
  if (!who || number >= who->tools.size())
    return Error{ErrorCode::Refused, "tools: there is no tool " + std::to_string(number)};
  if (auto checked = check_shape(shape); !checked) return checked;
  who->tools[number] = shape;
  return {};
}

Result<Participant> Roster::join(std::string_view name, Role role,
                                 std::vector<tool::ToolShape> tools, JoinRefusal& refusal) {
  const auto refuse = [&refusal](JoinRefusal why, std::string message) {
    refusal = why;
    return Error{ErrorCode::Refused, std::move(message)};
  };
  if (!is_valid_name(name)) return refuse(JoinRefusal::NameInvalid, kNameRule);
  if (!wire::rights_of(role).may_have_tools && !tools.empty())
    return refuse(JoinRefusal::ToolsInvalid,
                  "tools: " + wire::one_of(role) + " watches and has none");
  if (tools.size() > static_cast<std::size_t>(places_.tools))
    return refuse(JoinRefusal::ToolsInvalid, "tools: " + std::to_string(tools.size()) +
                                                 " are too many, at most " +
                                                 std::to_string(places_.tools));
  for (const auto& shape : tools)
    if (auto checked = check_shape(shape); !checked)
      return refuse(JoinRefusal::ToolsInvalid, checked.error().message);
  if (const auto* other = find_alike(name))
    return refuse(JoinRefusal::NameTaken,
                  "name: " + called(name, *other) +
                      (other->is_away ? " has lost the connection, and the seat is kept for a while"
                                      : " is here already") +
                      ", choose another with --name");
  if (has_tools(role) && tools.empty()) tools.emplace_back();

  const bool has_hands = !tools.empty();
  const auto first = slots_.begin() + (has_hands ? 0 : kMaxHands);
  const auto last = first + (has_hands ? places_.hands : places_.watchers);
  const auto free = std::find_if(first, last, [](const auto& slot) { return !slot; });
  const auto alike =
      std::count_if(first, last, [role](const auto& slot) { return slot && slot->role == role; });
  const int places = has_hands ? places_.hands : places_for(role, places_);
  if (free == last || alike >= places)
    return refuse(JoinRefusal::Full,
                  "full: all " + std::to_string(places) +
                      (has_hands                ? " seats with tools are taken, join as "
                                                  "observer or come back"
                       : role == Role::Observer ? " seats for watchers are taken, come back later"
                                                : " seats for instructors are taken, join as "
                                                  "observer or come back later"));
  const auto index = static_cast<std::uint8_t>(free - slots_.begin());
  *free = Participant{
      .slot = {index}, .name = std::string(name), .role = role, .tools = std::move(tools)};
  return **free;
}

void Roster::restore(Participant who) {
  if (who.slot.is_valid()) slots_[who.slot.value] = std::move(who);
}

void Roster::leave(ParticipantSlot slot) {
  if (slot.is_valid()) slots_[slot.value].reset();
}

const Participant* Roster::find(ParticipantSlot slot) const {
  return slot.is_valid() && slots_[slot.value] ? &*slots_[slot.value] : nullptr;
}

const Participant* Roster::find(std::string_view name) const {
  for (const auto& slot : slots_)
    if (slot && slot->name == name) return &*slot;
  return nullptr;
}

const Participant* Roster::find_alike(std::string_view name) const {
  if (const auto* same = find(name)) return same;
  for (const auto& slot : slots_)
    if (slot && look_alike(slot->name, name)) return &*slot;
  return nullptr;
}

void Roster::set_away(ParticipantSlot slot, bool is_away) {
  if (slot.is_valid() && slots_[slot.value]) slots_[slot.value]->is_away = is_away;
}

void Roster::set_frozen_by(ParticipantSlot slot, std::string who) {
  if (slot.is_valid() && slots_[slot.value]) slots_[slot.value]->frozen_by = std::move(who);
}

void Roster::set_relayed(ParticipantSlot slot, std::uint32_t watchers) {
  if (slot.is_valid() && slots_[slot.value]) slots_[slot.value]->relayed = watchers;
}

void Roster::set_lent(ToolSlot tool, bool is_lent) {
  const auto owner = tool.owner();
  if (!owner.is_valid() || !slots_[owner.value]) return;
  const auto bit = static_cast<std::uint8_t>(1u << tool.number());
  auto& lent = slots_[owner.value]->lent_tools;
  lent = static_cast<std::uint8_t>(is_lent ? lent | bit : lent & ~bit);
}

void Roster::set_leader(ParticipantSlot slot) {
  for (auto& participant : slots_)
    if (participant) participant->leads_view = participant->slot == slot;
}

Status Roster::rename(ParticipantSlot slot, std::string_view name) {
  if (!is_valid_name(name)) return Error{ErrorCode::Refused, kNameRule};
  for (const auto& other : slots_)
    if (other && other->slot != slot && look_alike(other->name, name))
      return Error{ErrorCode::Refused, "name: " + called(name, *other) + " is here already"};
  if (slot.is_valid() && slots_[slot.value]) slots_[slot.value]->name = name;
  return {};
}

std::vector<Participant> Roster::list() const {
  std::vector<Participant> present;
  for (const auto& slot : slots_)
    if (slot) present.push_back(*slot);
  return present;
}

}  // namespace trocar::participants
