#include "client/ui/rate_text.h"

#include <algorithm>
#include <cmath>

namespace trocar::ui {
namespace {

std::string whole(float value) {
  return with_thousands(static_cast<std::uint64_t>(std::lround(std::min(value, 1e9f))));
}

std::string sweeps_text(const wire::LayerCounts& sweeps) {
  if (sweeps.front() == 0) return {};
  std::string text = std::to_string(sweeps.front()) + " at the tools";
  for (std::size_t i = 1; i < sweeps.size(); ++i)
    text += (i == 1 ? ", then " : ", ") + std::to_string(sweeps[i]);
  return text;
}

}  // namespace

std::string with_thousands(std::uint64_t value) {
  std::string text = std::to_string(value);
  for (int at = static_cast<int>(text.size()) - 3; at > 0; at -= 3)
    text.insert(static_cast<std::size_t>(at), ",");
  return text;
}

RateText describe(const wire::FrameFigures& figures) {
  const auto& rate = figures.pace.rate;
  RateText text;
  switch (rate.level) {
    case wire::RateLevel::Fixed:
      text.level = "fixed detail";
      break;
    case wire::RateLevel::Full:
      text.level = "full detail";
      break;
    case wire::RateLevel::Reduced:
      text.level = "less detail, to keep pace";
      text.tone = RateTone::Notice;
      break;
    case wire::RateLevel::Overloaded:
      text.level = "least detail, and still too slow";
      text.tone = RateTone::Warning;
      break;
  }
  text.sweeps = sweeps_text(figures.solve.layer_sweeps);
  if (rate.budget_us > 0)
    text.load = whole(rate.predicted_us) + " of " + whole(rate.budget_us) + " us";
  if (rate.level != wire::RateLevel::Fixed)
    text.changes = with_thousands(rate.lowered) + " down, " + with_thousands(rate.raised) + " up";
  if (rate.time_rate < kSlowTimeRate) text.banner = slow_text(rate.time_rate);
  return text;
}

std::string slow_text(float time_rate) {
  return "Time is slow, " + whole(100 * time_rate) + " % of real speed. Go on.";
}

}  // namespace trocar::ui
