#pragma once

// Logging for life cycle and trouble, never from inside a tick. Levels by reader: error = data or
// session lost, warn = degraded, info = life cycle, debug = per event. Lines go to stderr, as
// many as bounded_sink.h lets through.

#include <spdlog/spdlog.h>

#include <string_view>

#include "common/base/result.h"

namespace trocar::log {

using spdlog::debug;
using spdlog::error;
using spdlog::info;
using spdlog::warn;

// Sets pattern, sink and level; `level` is one of error, warn, info, debug, off.
Status configure(std::string_view program, std::string_view level);

}  // namespace trocar::log
