#include "server/watch/bus/subjects.h"

#include <algorithm>

namespace trocar::bus {
namespace {

constexpr std::size_t kMostNameBytes = 64, kMostIdBytes = 32;

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

}  // namespace

bool is_session_name(const std::string& name) {
  const auto is_fine = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || is_digit(c) || c == '-' || c == '_';
  };
  return !name.empty() && name.size() <= kMostNameBytes && std::ranges::all_of(name, is_fine);
}

Subjects::Subjects(const std::string& session)
    : stream("trocar.session." + session + ".stream"),
      ask("trocar.session." + session + ".ask"),
      answers("trocar.session." + session + ".to.") {}

bool Subjects::is_for_answers(const std::string& subject) const {
  if (!subject.starts_with(answers)) return false;
  const auto id = subject.substr(answers.size());
  return !id.empty() && id.size() <= kMostIdBytes &&
         std::ranges::all_of(id, [](char c) { return is_digit(c) || (c >= 'a' && c <= 'f'); });
}

}  // namespace trocar::bus
