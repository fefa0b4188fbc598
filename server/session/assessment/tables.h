#pragma once

// Assessments as text for people, and as CSV, JSON and xAPI statements for other programs.

#include <string>
#include <vector>

#include "server/session/assessment/assessment.h"
#include "server/session/assessment/figures.h"

namespace trocar::assessment {

// Returns "2026-11-27T14:03:20Z".
std::string iso_time(std::uint64_t utc_ns);

// "12.3 ml of tissue were strained beyond 30 %, ...", a line each.
std::vector<std::string> lines_of(const StrainDamage& strain);
std::string summary_of(const Assessment& session, const std::vector<Standing>& standings);
// Returns a row for each figure: file, lesson, stage, person, tool, measure, value.
std::string csv_of(const std::vector<Assessment>& sessions);
std::string json_of(const Assessment& session, const std::vector<Standing>& standings);
// Returns an array of statements of the Experience API (IEEE 9274.1.1, 1.0.3), one for each person
// with a tool and each stage: passed or failed, with score and duration. `home_page`: the address
// of the system that knows the people's names; activities lie below it. The same recording gives
// the same statement ids.
std::string xapi_of(const std::vector<Assessment>& sessions, const std::string& home_page);

}  // namespace trocar::assessment
