#pragma once

// The report of a session as a page: one HTML file with its plots and pictures in it, that a
// browser shows and prints. It loads nothing and has no script.

#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/session/assessment/assessment.h"
#include "server/session/assessment/figures.h"

namespace trocar::assessment {

// A picture shows a moment, as PNG.
struct Picture {
  Tick tick = 0;
  std::string png;
};

// Errors: a plot cannot be drawn.
Result<std::string> report_of(const Assessment& session, const std::vector<Standing>& standings,
                              const std::vector<Picture>& pictures);

// How points and times went on from session to session, by lesson and by who took part.
Result<std::string> learning_report_of(const std::vector<Assessment>& sessions);

}  // namespace trocar::assessment
