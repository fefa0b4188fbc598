#pragma once

// The state of an arm as CRTK has it, and the commands that change it:
//
//   DISABLED --enable--> ENABLED --pause--> PAUSED      home: from DISABLED and ENABLED, busy until
//       ^ \----home----/ ^  \ <---resume---/            the arm is there, then homed
//       |                |
//       +--- disable, from all; enable, from FAULT too, once the fault has gone
//
// A servo command moves the arm while it is ENABLED, homed and not busy.

#include <string_view>

#include "common/base/result.h"

namespace trocar::crtk {

enum class State { Disabled, Enabled, Paused, Fault };
const char* name_of(State state);  // as CRTK writes it

struct OperatingState {
  State state = State::Disabled;
  bool is_homed = false;
  bool is_busy = false;

  // Follows enable, disable, pause, resume, home or unhome. `fault`: what is wrong with the arm
  // now; empty: nothing is. An error says why the command changed nothing.
  Status follow(std::string_view command, std::string_view fault);
  void fail() { *this = {State::Fault, is_homed, false}; }
  void finish_homing() { is_busy = false, is_homed = true; }
  bool can_move() const { return state == State::Enabled && is_homed && !is_busy; }

  bool operator==(const OperatingState&) const = default;
};

}  // namespace trocar::crtk
