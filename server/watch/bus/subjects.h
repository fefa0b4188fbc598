#pragma once

// Under which subjects of a bus a session is found. NAME is given by people, the same to who
// publishes the session and to who takes it.
//
//   trocar.session.NAME.stream   published: what everybody is told, in order (piece.h)
//   trocar.session.NAME.ask      asked: for all that there is, for the clock, and who watches
//   trocar.session.NAME.to.ID    answered: to the one who asked

#include <string>

namespace trocar::bus {

// 1 to 64 letters, digits, hyphens and underscores.
bool is_session_name(const std::string& name);

struct Subjects {
  explicit Subjects(const std::string& session);

  // For answers to `id`, which is hexadecimal.
  std::string answers_to(const std::string& id) const { return answers + id; }
  // True for one that answers_to() makes: nobody has answers sent elsewhere.
  bool is_for_answers(const std::string& subject) const;

  std::string stream, ask, answers;
};

}  // namespace trocar::bus
