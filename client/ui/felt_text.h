#pragma once

// These texts say what a device does at 1 kHz, for somebody who wants to know how far its forces
// can be trusted. Nothing is drawn here.

#include <array>
#include <cstdint>
#include <string>

#include "common/wire/hand_report.h"

namespace trocar::ui {

struct FeltHandFigures {
  std::string device;
  bool has_priority = false;  // real-time, of its loop
  double rate_hz = 0;
  double late_median_us = 0, late_95_us = 0, late_99_us = 0;
  std::uint64_t overruns = 0;
  double answer_age_ms = 0, echo_ms = 0;  // since the newest came; from a pose to its answer
  double hand_n = 0, server_n = 0;
  double motion_scale = 1, force_scale = 1;
  std::array<std::uint64_t, wire::kHandLimits> limited{};  // steps that each safeguard changed
};

struct FeltHandText {
  std::string loop;        // "1000 per second, 2 too long"; says so without priority
  std::string lateness;    // "21 us median, 30 us p95, 45 us p99"
  std::string answers;     // "12 ms old, 38 ms after their pose"
  std::string force;       // "0.42 N in the hand, 0.44 N by the server"
  std::string scale;       // "motion x 1.5, force x 1"
  std::string safeguards;  // "ramp 0.25 s, slew 0.012 s", "none so far"
};
FeltHandText describe(const FeltHandFigures& figures);

}  // namespace trocar::ui
