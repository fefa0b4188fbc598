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

struct NamedRole {
  Role role = Role::Unknown;
  const char* name = "";
};

// All that can be chosen.
inline constexpr std::array<NamedRole, 4> kRoles{{{Role::Surgeon, "surgeon"},
                                                  {Role::Assistant, "assistant"},
                                                  {Role::Instructor, "instructor"},
                                                  {Role::Observer, "observer"}}};

inline bool has_tools(Role role) {
  return role == Role::Surgeon || role == Role::Assistant;
}
// "unknown role" if it is none of kRoles.
const char* name_of(Role role);
// From the wire; Unknown if it is none of kRoles.
Role role_of(int number);
// "surgeon (1), assistant (2), ...": for messages.
std::string list_roles();

}  // namespace trocar::wire
