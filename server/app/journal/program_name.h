#pragma once

namespace trocar::app {

inline constexpr const char* kProgram = "trocar-journal";  // as messages begin

}  // namespace trocar::app
