#pragma once

// This keeps what the start screen asked for until the next time, in the user's configuration
// folder.

#include <optional>
#include <string>

#include "client/replica/session_view.h"

namespace trocar::app {

struct Person {
  std::string name;
  replica::Role role = replica::Role::Surgeon;
};

// Nothing: nothing was kept yet, or it cannot be read.
std::optional<Person> remembered_person();
// It logs where it cannot be kept, and goes on.
void remember(const Person& person);

}  // namespace trocar::app
