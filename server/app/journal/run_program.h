#pragma once

#include <string>
#include <vector>

#include "common/base/result.h"

namespace trocar::app {

// Runs a program to its end, with nothing to read; it says what it likes on standard error, and
// nothing on standard output. Looks for it beside this program first, then on the path. Errors: it
// cannot be started, or it fails; `help`: what somebody then does.
Status run_program(std::vector<std::string> words, const std::string& help);

}  // namespace trocar::app
