#pragma once

// The experiments with sessions that a local reduction moves; listed in experiments.cpp.

#include "tests/validation/lab.h"

namespace trocar::validation {

void run_live_reduction_sessions(const Lab& lab, Section& section);
void run_live_reduction_hand_over(const Lab& lab, Section& section);
void run_live_reduction_estimate(const Lab& lab, Section& section);
void run_live_reduction_sizes(const Lab& lab, Section& section);

}  // namespace trocar::validation
