#include "client/ui/away_text.h"

#include <cmath>

namespace trocar::ui {

std::string describe_absence(double away_seconds, double left_seconds) {
  const auto whole = [](double seconds) { return std::to_string(std::lround(seconds)) + " s"; };
  const bool is_fresh = away_seconds < 0.5;
  return (is_fresh ? "The connection broke just now."
                   : "The connection broke " + whole(away_seconds) + " ago.") +
         " Trying again; your seat is kept for " + whole(left_seconds) + ".";
}

}  // namespace trocar::ui
