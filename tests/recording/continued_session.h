#pragma once

// A session whose server was killed, and another one that went on with it: the inputs are those of
// a session without a crash, so that the parts together have to say what that one says.

#include <string>

#include "common/base/tick.h"

namespace trocar::recording::testing {

// Writes the first `share` of the bytes of `whole` to `part`.
void cut_off(const std::string& whole, double share, const std::string& part);

// Goes on with `part` as a server does, with the inputs that `whole` has after it, up to `until`.
void go_on(const std::string& part, const std::string& whole, const std::string& next, Tick until);

// Goes on without the people, who may not come back: their tools leave, and nobody is listed.
void go_on_alone(const std::string& part, const std::string& whole, const std::string& next,
                 Tick until);

}  // namespace trocar::recording::testing
