#include "server/session/monitoring/exposition.h"

#include <fmt/format.h>

#include <cmath>

namespace trocar::monitoring {
namespace {

std::string escaped(std::string_view text, bool is_label) {
  std::string result;
  for (const char c : text) {
    if (c == '\n')
      result += "\\n";
    else if (c == '\\' || (c == '"' && is_label))
      result += {'\\', c};
    else
      result += c;
  }
  return result;
}

std::string number(double value) {
  if (std::isnan(value)) return "NaN";
  if (std::isinf(value)) return value > 0 ? "+Inf" : "-Inf";
  return fmt::format("{}", value);
}

}  // namespace

void Exposition::head(std::string_view name, std::string_view kind, std::string_view help) {
  text_ += fmt::format("# HELP {0}{1} {2}\n# TYPE {0}{1} {3}\n", prefix_, name,
                       escaped(help, false), kind);
}

void Exposition::lines(std::string_view name, std::string_view label,
                       const std::vector<Labelled>& series) {
  for (const auto& [value, figure] : series)
    text_ += fmt::format("{}{}{{{}=\"{}\"}} {}\n", prefix_, name, label, escaped(value, true),
                         number(figure));
}

void Exposition::gauge(std::string_view name, std::string_view help, double value) {
  head(name, "gauge", help);
  text_ += fmt::format("{}{} {}\n", prefix_, name, number(value));
}

void Exposition::counter(std::string_view name, std::string_view help, double value) {
  head(name, "counter", help);
  text_ += fmt::format("{}{} {}\n", prefix_, name, number(value));
}

void Exposition::gauges(std::string_view name, std::string_view help, std::string_view label,
                        const std::vector<Labelled>& series) {
  head(name, "gauge", help);
  lines(name, label, series);
}

void Exposition::counters(std::string_view name, std::string_view help, std::string_view label,
                          const std::vector<Labelled>& series) {
  head(name, "counter", help);
  lines(name, label, series);
}

}  // namespace trocar::monitoring
