#pragma once

#include <string>
#include <vector>

#include "common/base/result.h"

namespace trocar::app {

// A file that an option of a command asks for.
struct Output {
  std::string option;  // such as "--html"
  std::string path;    // empty: not asked for
};

// Call before any work is done. Errors (Usage): one of them is a recording or an organ, which would
// be lost, or two are the same file.
Status check_outputs(const std::vector<Output>& outputs);

}  // namespace trocar::app
