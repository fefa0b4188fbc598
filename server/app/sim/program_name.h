#pragma once

namespace trocar::app {

inline constexpr const char* kProgram = "trocar-sim";  // as messages begin

}  // namespace trocar::app
