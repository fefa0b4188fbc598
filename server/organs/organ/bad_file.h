#pragma once

#include <string>

#include "common/base/result.h"

namespace trocar::organ {

// Returns the error of a file whose content is wrong; readers put the file's name before it.
inline Error bad(const std::string& what) {
  return {ErrorCode::BadFile, what};
}

}  // namespace trocar::organ
