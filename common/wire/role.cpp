#include "common/wire/role.h"

#include <string_view>

#include "proto/wire.pb.h"

namespace trocar::wire {

static_assert(static_cast<int>(Role::Surgeon) == proto::ROLE_SURGEON);
static_assert(static_cast<int>(Role::Assistant) == proto::ROLE_ASSISTANT);
static_assert(static_cast<int>(Role::Instructor) == proto::ROLE_INSTRUCTOR);
static_assert(static_cast<int>(Role::Observer) == proto::ROLE_OBSERVER);
static_assert(kRoles.size() + 1 == proto::Role_ARRAYSIZE);

const char* name_of(Role role) {
  for (const auto& known : kRoles)
    if (known.role == role) return known.name;
  return "unknown role";
}

std::string one_of(Role role) {
  const std::string name = name_of(role);
  return (std::string_view("aeiou").find(name[0]) == std::string_view::npos ? "a " : "an ") + name;
}

Role role_of(int number) {
  for (const auto& known : kRoles)
    if (static_cast<int>(known.role) == number) return known.role;
  return Role::Unknown;
}

std::string list_roles() {
  std::string text;
  for (const auto& known : kRoles)
    text += std::string(text.empty() ? "" : ", ") + known.name + " (" +
            std::to_string(static_cast<int>(known.role)) + ")";
  return text;
}

}  // namespace trocar::wire
