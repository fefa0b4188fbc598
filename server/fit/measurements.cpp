#include "server/fit/measurements.h"

#include <fstream>
#include <optional>
#include <string>
#include <string_view>

#include "server/fit/csv_row.h"

namespace trocar::fit {
namespace {

constexpr std::uintmax_t kLimitBytes = 64u << 20;

struct Columns {
  std::optional<std::size_t> displacement, force, time;
};

Columns columns_of(const std::vector<std::string_view>& names) {
  Columns columns;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] == "displacement_mm") columns.displacement = i;
    if (names[i] == "force_n") columns.force = i;
    if (names[i] == "time_s") columns.time = i;
  }
  return columns;
}

}  // namespace

Result<MeasuredCurve> read_measurements(const std::filesystem::path& path) {
  const auto wrong = [&](int line, const std::string& what) {
    return Error{ErrorCode::BadFile,
                 path.string() + (line > 0 ? ":" + std::to_string(line) : "") + ": " + what};
  };
  std::error_code missing;
  const auto bytes = std::filesystem::file_size(path, missing);
  std::ifstream file(path);
  if (missing || !file) return wrong(0, "cannot be opened, check name and rights");
  if (bytes > kLimitBytes) return wrong(0, "is larger than 64 MiB, a measured curve is not");
  MeasuredCurve curve;
  curve.source = path;
  std::optional<Columns> columns;
  std::string row;
  for (int line = 1; std::getline(file, row); ++line) {
    const auto cells = cells_of(row);
    if ((cells.size() == 1 && cells[0].empty()) || row.starts_with("#")) continue;
    if (!columns) {
      columns = columns_of(cells);
      curve.has_times = columns->time.has_value();
      if (columns->displacement && columns->force) continue;
      return wrong(line,
                   "is no header with the columns displacement_mm and force_n, write "
                   "\"displacement_mm,force_n\" above the numbers");
    }
    const auto value = [&](std::optional<std::size_t> column) {
      return column && *column < cells.size() ? number_of(cells[*column]) : std::nullopt;
    };
    const auto displacement_mm = value(columns->displacement), force = value(columns->force);
    if (!displacement_mm || !force)
      return wrong(line, "displacement_mm and force_n are not both numbers");
    Measurement point{*displacement_mm * 1e-3, *force, 0, line};
    if (curve.has_times) {
      const auto time = value(columns->time);
      if (!time || (!curve.points.empty() && *time <= curve.points.back().time_s))
        return wrong(line, "time_s is no number above the one before, put rows in order of time");
      point.time_s = *time;
    }
    curve.points.push_back(point);
  }
  if (curve.points.empty()) return wrong(0, "has no measurements");
  return curve;
}

}  // namespace trocar::fit
