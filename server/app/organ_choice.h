#pragma once

#include <string>

#include "common/base/result.h"
#include "common/scene/organ.h"

namespace trocar::app {

// A built-in organ by name, or an .organ file. Errors: ErrorCode::BadFile.
Result<scene::Organ> load_organ(const std::string& name_or_file);

}  // namespace trocar::app
