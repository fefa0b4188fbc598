#pragma once

// Who is in the session: names, roles, slots. Lives on the I/O strand; the simulation only knows
// which slots have tools.

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/ids.h"
#include "common/base/result.h"
#include "common/tool/tool.h"
#include "common/wire/role.h"

namespace trocar::participants {

using wire::has_tools;
using wire::name_of;
using wire::Role;

struct Participant {
  ParticipantSlot slot;
  std::string name;
  Role role = Role::Observer;
  std::vector<tool::ToolShape> tools;  // 1 or 2 for roles with tools, else none
  bool is_away = false;                // the connection is lost, the place is kept
  std::string frozen_by;               // who keeps the tools where they are; empty: nobody
  bool leads_view = false;             // the view to follow is this one's
  std::uint32_t relayed = 0;           // so many more watch through this one
  std::uint8_t lent_tools = 0;  // a bit each: it moves beside its hand's place, see held_tools.h
};

// How many there are for, at most what ids.h says, and what they may bring.
struct Places {
  int hands = kMaxHands;       // surgeons and assistants
  int watchers = 100;          // instructors and observers
  int tools = kToolsPerHand;   // of each who has some
  float longest_edge_mm = 40;  // of a blade: what it cuts in a tick is in proportion
};

// Returns how many people of a role that watches there may be: observers leave places to who leads,
// and instructors half of all to who looks on.
int places_for(Role role, const Places& places);
// Returns how many of them may come with one code from one address.
int places_alike(Role role, const Places& places);

// 1 to 32 bytes of printable UTF-8 without a space at either end.
bool is_valid_name(std::string_view name);
inline constexpr const char* kNameRule =
    "name: 1 to 32 bytes of printable UTF-8 without a space at either end, please";

enum class JoinRefusal { NameInvalid, NameTaken, Full, ToolsInvalid };

class Roster {
 public:
  explicit Roster(const Places& places = {}) : places_(places) {}
  // The same people in the same slots, e.g. as a journal lists them.
  explicit Roster(const std::vector<Participant>& present);

  // Admits a participant into the lowest free slot of its kind, or says why not. `refusal` is set
  // on error. A name is 1 to 32 bytes of printable UTF-8, and looks like no other; a role with
  // tools that names none gets one default tool; a role without tools may not bring any.
  Result<Participant> join(std::string_view name, Role role, std::vector<tool::ToolShape> tools,
                           JoinRefusal& refusal);
  // The participant takes this instrument; an error: no such tool, or the shape may not be here.
  Status change_tool(ParticipantSlot slot, std::size_t number, const tool::ToolShape& shape);
  // Somebody who had this place at a server before.
  void restore(Participant who);
  void leave(ParticipantSlot slot);
  void set_away(ParticipantSlot slot, bool is_away);
  void set_frozen_by(ParticipantSlot slot, std::string who);
  void set_relayed(ParticipantSlot slot, std::uint32_t watchers);
  void set_lent(ToolSlot tool, bool is_lent);
  // Nobody else leads then; an invalid slot: nobody at all.
  void set_leader(ParticipantSlot slot);
  // An error if the name is not valid, or somebody else has one that looks like it.
  Status rename(ParticipantSlot slot, std::string_view name);

  const Participant* find(ParticipantSlot slot) const;
  const Participant* find(std::string_view name) const;
  std::vector<Participant> list() const;  // by slot

 private:
  const Participant* find_alike(std::string_view name) const;
  Status check_shape(const tool::ToolShape& shape) const;

  Places places_;
  std::array<std::optional<Participant>, kMaxParticipants> slots_;
};

}  // namespace trocar::participants
