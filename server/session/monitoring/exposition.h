#pragma once

// Figures in the text exposition format of Prometheus, version 0.0.4.
// Source: prometheus.io, "Exposition formats".

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace trocar::monitoring {

inline constexpr const char* kExpositionType = "text/plain; version=0.0.4; charset=utf-8";

// One series of a family: the value of its only label, and its value.
using Labelled = std::pair<std::string, double>;

class Exposition {
 public:
  // `prefix` goes before every name, e.g. "trocar_".
  explicit Exposition(std::string prefix) : prefix_(std::move(prefix)) {}

  // Names are in snake case with their unit at the end; counters end in _total. Units are SI.
  void gauge(std::string_view name, std::string_view help, double value);
  void counter(std::string_view name, std::string_view help, double value);
  void gauges(std::string_view name, std::string_view help, std::string_view label,
              const std::vector<Labelled>& series);
  void counters(std::string_view name, std::string_view help, std::string_view label,
                const std::vector<Labelled>& series);

  const std::string& text() const { return text_; }

 private:
  void head(std::string_view name, std::string_view kind, std::string_view help);
  void lines(std::string_view name, std::string_view label, const std::vector<Labelled>& series);

  std::string prefix_, text_;
};

}  // namespace trocar::monitoring
