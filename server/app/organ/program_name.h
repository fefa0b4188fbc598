#pragma once

namespace trocar::app {

inline constexpr const char* kProgram = "trocar-organ";  // as messages begin

}  // namespace trocar::app
