#pragma once

// These texts say what the server's rate controller does: in words for somebody who learns to
// operate, in figures for somebody who knows the simulator. Nothing is drawn here.

#include <string>

#include "common/wire/figures.h"

namespace trocar::ui {

inline constexpr float kSlowTimeRate = 0.98f;  // below this a person is told

enum class RateTone : std::uint8_t { Calm, Notice, Warning };

struct RateText {
  std::string level;               // "full detail", "less detail far from the tools", ...
  std::string sweeps;              // "4 near the tools, then 3, 2, 1"; empty: not told
  std::string load;                // "612 of 800 us": planned and allowed; empty: no budget is kept
  std::string changes;             // "12 down, 11 up"; empty: no controller
  std::string banner;              // empty unless time is slowed: one line, for a banner
  RateTone tone = RateTone::Calm;  // of the level
};
RateText describe(const wire::FrameFigures& figures);

// The same words as those of the page.
std::string slow_text(float time_rate);

// "1,553"
std::string with_thousands(std::uint64_t value);

}  // namespace trocar::ui
