#pragma once

// A hall reads this from the figures of a server, which are in the text format of Prometheus.

#include <cstdint>
#include <string_view>

namespace trocar::hall {

struct ServerFigures {
  std::uint64_t ticks = 0;
  int people = 0;
  int claims = 0;        // tools that act on tissue
  double time_rate = 0;  // simulated over real time
  double tick_median_s = 0, tick_p99_s = 0;
  double slowest_stage_s = 0;  // median
  bool is_overloaded = false;  // the server does the least and still falls behind
  bool is_paused = false;
};

// Lines that are no figures, or unknown ones, are left out; what is missing stays 0.
ServerFigures read_figures(std::string_view text);

}  // namespace trocar::hall
