#include "server/fit/csv_row.h"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace trocar::fit {

std::vector<std::string_view> cells_of(std::string_view row) {
  std::vector<std::string_view> cells;
  for (;;) {
    const auto end = std::min(row.find_first_of(",;\t"), row.size());
    auto cell = row.substr(0, end);
    const auto begin = cell.find_first_not_of(" \"\r");
    cell = begin == std::string_view::npos
               ? std::string_view()
               : cell.substr(begin, cell.find_last_not_of(" \"\r") + 1 - begin);
    cells.push_back(cell);
    if (end == row.size()) return cells;
    row.remove_prefix(end + 1);
  }
}

std::optional<double> number_of(std::string_view text) {
  double value = 0;
  const auto [rest, failed] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (failed != std::errc{} || rest != text.data() + text.size() || !std::isfinite(value))
    return std::nullopt;
  return value;
}

}  // namespace trocar::fit
