#pragma once

// Rows of CSV files as testing machines and spreadsheets write them: cells between commas,
// semicolons or tabs, blanks and quotation marks around them left out.

#include <optional>
#include <string_view>
#include <vector>

namespace trocar::fit {

std::vector<std::string_view> cells_of(std::string_view row);
// Nothing unless all of the text is one finite number.
std::optional<double> number_of(std::string_view text);

}  // namespace trocar::fit
