#pragma once

// This keeps what the start screen asked for until the next time, in the user's configuration
// folder.

#include <optional>
#include <string>

#include "client/replica/replica.h"

namespace trocar::app {

struct Person {
  std::string name;
  replica::Role role = replica::Role::Surgeon;
};

// Nothing: nothing was kept yet, or it cannot be read.
std::optional<Person> remembered_person();
// It logs where it cannot be kept, and goes on.
void remember(const Person& person);

// This keeps the points of one's own best attempt at a lesson, of any session so far.
class BestPoints {
 public:
  // To be called often; keeps what a lesson with one's own tools has ended with, once.
  void note(const replica::Replica& replica);
  // Returns those of attempts before the one that note() has seen end; nothing: there was none.
  std::optional<float> before() const { return before_; }

 private:
  std::optional<Tick> noted_;  // begin of the last stage of the attempt that is kept
  std::optional<float> before_;
};

}  // namespace trocar::app
