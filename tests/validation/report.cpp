#include "tests/validation/report.h"

#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>

#include "common/base/quote.h"

namespace trocar::validation {
namespace {

// JSON has no infinity and no NaN.
std::string number(double value) {
  return std::isfinite(value) ? fmt::format("{:.9g}", value) : "null";
}

// A text that is a number goes out as one.
std::string value_of(const std::string& text) {
  if (text.empty()) return "null";
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  return *end == '\0' && std::isfinite(value) ? number(value) : quote(text);
}

}  // namespace

std::string shown(double value) {
  return fmt::format("{:.4g}", value);
}

std::string shown_percent(double share) {
  return fmt::format("{:.3g} %", 100 * share);
}

void Section::compare(const std::string& what, double expected, double ours, double bound,
                      const std::string& unit, const std::string& note) {
  const std::string end = unit.empty() ? "" : " " + unit;
  checks.push_back({name + "/" + what, shown(expected) + end, shown(ours) + end,
                    std::abs(ours - expected) / std::abs(expected), bound, true, note});
}

void Section::at_most(const std::string& what, const std::string& expected, double error,
                      double bound, const std::string& note) {
  checks.push_back(
      {name + "/" + what, expected, shown_percent(error) + " off", error, bound, true, note});
}

void Section::at_least(const std::string& what, const std::string& expected, double ours,
                       double least, const std::string& note) {
  const double shortfall =
      std::isfinite(ours) ? std::max(0.0, least - ours) : std::numeric_limits<double>::quiet_NaN();
  checks.push_back({name + "/" + what, expected, shown(ours), shortfall, 0, false,
                    note + " At least " + shown(least) + "."});
}

void Section::exactly(const std::string& what, const std::string& expected, const std::string& ours,
                      const std::string& note) {
  checks.push_back(
      {name + "/" + what, expected, ours, expected == ours ? 0.0 : 1.0, 0, false, note});
}

std::string to_json(const std::vector<Section>& sections) {
  std::string out = "[";
  for (const auto& section : sections)
    for (const auto& check : section.checks) {
      out += out.size() > 1 ? ",\n " : "\n ";
      out += fmt::format(
          "{{\"name\": {}, \"paper\": {}, \"ours\": {}, \"error\": {}, \"bound\": {}, \"kept\": "
          "{}, \"note\": {}}}",
          quote(check.name), value_of(check.expected), value_of(check.ours), number(check.error),
          number(check.bound), check.is_kept(), quote(check.note));
    }
  return out + "\n]\n";
}

Status write_file(const std::filesystem::path& path, const std::string& text) {
  std::ofstream out(path, std::ios::binary);
  out << text;
  out.close();
  if (!out)
    return Error{ErrorCode::ResourceMissing, path.string() + ": cannot be written, see --out"};
  return {};
}

}  // namespace trocar::validation
