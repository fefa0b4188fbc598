#include "server/lab/fit/measurements.h"

#include "server/lab/fit/csv_table.h"

namespace trocar::fit {

Result<MeasuredCurve> read_measurements(const std::filesystem::path& path) {
  auto table = CsvTable::read(path, {{"displacement_mm", "force_n"}, {"time_s"}});
  if (!table) return table.error();
  MeasuredCurve curve;
  curve.source = path;
  curve.has_times = table->has("time_s");
  for (;;) {
    const auto is_row = table->next();
    if (!is_row) return is_row.error();
    if (!*is_row) break;
    const auto displacement_mm = table->number("displacement_mm"), force = table->number("force_n");
    if (!displacement_mm || !force)
      return table->wrong(
          "displacement_mm and force_n are not both numbers, write them with a decimal point");
    Measurement point{*displacement_mm * 1e-3, *force, 0, table->line()};
    if (curve.has_times) {
      const auto time = table->number("time_s");
      if (!time || (!curve.points.empty() && *time <= curve.points.back().time_s))
        return table->wrong("time_s is no number above the one before, put rows in order of time");
      point.time_s = *time;
    }
    curve.points.push_back(point);
  }
  if (curve.points.empty()) return table->wrong("has no measurements");
  return curve;
}

}  // namespace trocar::fit
