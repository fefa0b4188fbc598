#pragma once

// A client says two things: a reading of one of its tools, and a person's wish. What hands feel is
// read here, too.

#include <array>
#include <optional>

#include "client/replica/session_source.h"
#include "common/tool/tool.h"
#include "common/wire/haptic_patch.h"

namespace trocar::replica {

// `tool` is 0 or 1; `sequence` counts up per client; `time_us`: of this client's clock, if a hand
// feels the tool. False if the source dropped it.
bool send_tool_sample(SessionSource& source, std::uint32_t tool, std::uint32_t sequence,
                      const tool::ToolSample& sample, std::uint64_t time_us = 0);

// A server says this to hands that feel. What is not as it may be is left out and counted.
struct HapticNews {
  std::optional<wire::HapticLaw> law;
  std::array<std::optional<wire::HapticPatch>, 2> patches;  // by tool
  std::uint32_t refused = 0;
};
HapticNews haptic_news(const proto::Envelope& message);

// To mark the organ as it is, or to return it to the mark. False if the source dropped it.
bool ask_for_mark(SessionSource& source, bool is_return);
// To be shown the full solution beside a session with a reduction, or no longer. False if the
// source dropped it.
bool ask_for_ghost(SessionSource& source, bool is_wanted);

}  // namespace trocar::replica
