#include "server/hall/plan/figures_text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

namespace trocar::hall {
namespace {

constexpr double kMostTicks = 1e15;
constexpr double kMostPeople = 1e6;
constexpr double kOverloaded = 3;  // trocar_rate_level

std::optional<double> value_of(std::string_view line) {
  const auto space = line.rfind(' ');
  if (space == std::string_view::npos) return std::nullopt;
  double value = 0;
  const char* end = line.data() + line.size();
  const auto parsed = std::from_chars(line.data() + space + 1, end, value);
  if (parsed.ec != std::errc{} || parsed.ptr != end || !std::isfinite(value) || value < 0)
    return std::nullopt;
  return value;
}

void take(std::string_view name, double value, ServerFigures& figures) {
  if (name == "trocar_ticks_total")
    figures.ticks = static_cast<std::uint64_t>(std::min(value, kMostTicks));
  else if (name == "trocar_people")
    figures.people += static_cast<int>(std::min(value, kMostPeople));
  else if (name == "trocar_claims")
    figures.claims = static_cast<int>(std::min(value, kMostPeople));
  else if (name == "trocar_time_rate")
    figures.time_rate = value;
  else if (name == "trocar_tick_median_seconds")
    figures.tick_median_s = value;
  else if (name == "trocar_tick_p99_seconds")
    figures.tick_p99_s = value;
  else if (name == "trocar_stage_median_seconds")
    figures.slowest_stage_s = std::max(figures.slowest_stage_s, value);
  else if (name == "trocar_rate_level")
    figures.is_overloaded = value >= kOverloaded;
  else if (name == "trocar_paused")
    figures.is_paused = value > 0;
}

}  // namespace

ServerFigures read_figures(std::string_view text) {
  ServerFigures figures;
  while (!text.empty()) {
    const auto end = std::min(text.find('\n'), text.size());
    const auto line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.starts_with('#')) continue;
    if (const auto value = value_of(line))
      take(line.substr(0, line.find_first_of("{ ")), *value, figures);
  }
  return figures;
}

}  // namespace trocar::hall
