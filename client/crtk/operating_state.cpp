#include "client/crtk/operating_state.h"

#include <string>

#include "common/base/printable.h"

namespace trocar::crtk {
namespace {

Error refused(std::string text) {
  return {ErrorCode::Refused, "state_command: " + std::move(text)};
}

}  // namespace

const char* name_of(State state) {
  switch (state) {
    case State::Disabled:
      return "DISABLED";
    case State::Enabled:
      return "ENABLED";
    case State::Paused:
      return "PAUSED";
    case State::Fault:
      break;
  }
  return "FAULT";
}

Status OperatingState::follow(std::string_view command, std::string_view fault) {
  const auto cannot = [&] {
    return refused(std::string(command) + " does not go from " + name_of(state));
  };
  if (command == "disable") {
    *this = {State::Disabled, is_homed, false};
    return {};
  }
  if (command == "unhome") {
    is_homed = is_busy = false;
    return {};
  }
  if (command == "enable" || command == "home") {
    if (!fault.empty()) return refused(std::string(command) + ": " + std::string(fault));
    if (state == State::Paused || (command == "home" && state == State::Fault)) return cannot();
    state = State::Enabled;
    if (command == "home") is_busy = true, is_homed = false;
    return {};
  }
  if (command == "pause") {
    if (state != State::Enabled && state != State::Paused) return cannot();
    state = State::Paused;
    return {};
  }
  if (command == "resume") {
    if (state != State::Enabled && state != State::Paused) return cannot();
    state = State::Enabled;
    return {};
  }
  return refused("'" + printable(std::string(command), 20) +
                 "' is none of enable, disable, pause, resume, home, unhome");
}

}  // namespace trocar::crtk
