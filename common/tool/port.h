#pragma once

// The port in the body's wall that a tool's shaft passes, on the command line.

#include <string>

#include "common/base/result.h"
#include "common/math/vec3.h"

namespace trocar::tool {

// "X,Y,Z" in mm, up to 2000 each, as m. The error is of --port.
Result<Vec3d> parse_port(const std::string& text);

}  // namespace trocar::tool
