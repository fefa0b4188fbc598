#pragma once

// A role says what a participant may do, and has the name that people read and write. The numbers
// are those of proto::Role.

#include <array>
#include <cstdint>
#include <string>

namespace trocar::wire {

enum class Role : std::uint8_t {
  Unknown = 0,  // of a participant whose role this program does not know
  Surgeon = 1,
  Assistant = 2,
  Instructor = 3,
  Observer = 4
};

// A role's rights. The server checks them; a client looks here to offer only what it may do.
struct Rights {
  bool has_tools = false;
  bool may_have_tools = false;  // brings instruments if it wishes, and then has a place for them
  bool may_mark = false;        // marks the organ, and returns it to the mark
  bool may_point = false;       // shows everybody a place, and draws on the surface
  bool may_teach = false;       // freezes tools, takes claims, puts people out: see TeachAction
  std::uint8_t admitted = 0;    // roles that a join code for this one lets in, a bit each

  constexpr bool admits(Role role) const {
    return (admitted >> static_cast<unsigned>(role) & 1u) != 0;
  }
};
constexpr std::uint8_t bit_of(Role role) {
  return static_cast<std::uint8_t>(1u << static_cast<unsigned>(role));
}

struct NamedRole {
  Role role = Role::Unknown;
  const char* name = "";
  Rights rights;
};

// The one table of who may do what: all roles that can be chosen, with their rights. A code admits
// its own role and those that may do no more, and an observer everywhere.
inline constexpr std::array<NamedRole, 4> kRoles{
    {{Role::Surgeon,
      "surgeon",
      {.has_tools = true,
       .may_have_tools = true,
       .may_mark = false,
       .may_point = false,
       .may_teach = false,
       .admitted = bit_of(Role::Surgeon) | bit_of(Role::Assistant) | bit_of(Role::Observer)}},
     {Role::Assistant,
      "assistant",
      {.has_tools = true,
       .may_have_tools = true,
       .may_mark = false,
       .may_point = false,
       .may_teach = false,
       .admitted = bit_of(Role::Assistant) | bit_of(Role::Observer)}},
     {Role::Instructor,
      "instructor",
      {.has_tools = false,
       .may_have_tools = true,
       .may_mark = true,
       .may_point = true,
       .may_teach = true,
       .admitted = bit_of(Role::Instructor) | bit_of(Role::Observer)}},
     {Role::Observer,
      "observer",
      {.has_tools = false,
       .may_have_tools = false,
       .may_mark = false,
       .may_point = false,
       .may_teach = false,
       .admitted = bit_of(Role::Observer)}}}};

// None, for a role that is none of kRoles.
constexpr Rights rights_of(Role role) {
  for (const auto& known : kRoles)
    if (known.role == role) return known.rights;
  return {};
}
constexpr bool has_tools(Role role) {
  return rights_of(role).has_tools;
}
// "unknown role" if it is none of kRoles.
const char* name_of(Role role);
// Returns "a surgeon", "an observer".
std::string one_of(Role role);
// From the wire; Unknown if it is none of kRoles.
Role role_of(int number);
// "surgeon (1), assistant (2), ...": for messages.
std::string list_roles();

}  // namespace trocar::wire
