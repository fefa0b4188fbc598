#pragma once

// gnuplot as a child process: a script on its standard input, its standard output as the answer.
// Files in memory stand for pipes, so that neither side can wait for the other. Any thread.

#include <string>

#include "common/base/result.h"

namespace trocar::plot {

// Error: the program cannot be started (ResourceMissing) or ends with a failure; the message has
// the first line it complained with.
Result<std::string> run_gnuplot(const std::string& program, const std::string& script);

}  // namespace trocar::plot
