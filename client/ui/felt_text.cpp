#include "client/ui/felt_text.h"

#include <fmt/format.h>

namespace trocar::ui {
namespace {

constexpr double kStep_s = 0.001;

}  // namespace

FeltHandText describe(const FeltHandFigures& figures) {
  FeltHandText said;
  said.loop = fmt::format("{:.0f} per second, {} too long{}", figures.rate_hz, figures.overruns,
                          figures.has_priority ? "" : ", without priority");
  said.lateness = fmt::format("{:.0f} us median, {:.0f} us p95, {:.0f} us p99",
                              figures.late_median_us, figures.late_95_us, figures.late_99_us);
  said.answers = figures.echo_ms > 0 ? fmt::format("{:.0f} ms old, {:.0f} ms after their pose",
                                                   figures.answer_age_ms, figures.echo_ms)
                                     : "none yet";
  said.force =
      fmt::format("{:.2f} N in the hand, {:.2f} N by the server", figures.hand_n, figures.server_n);
  said.scale =
      fmt::format("motion x {:.3g}, force x {:.3g}", figures.motion_scale, figures.force_scale);
  for (std::size_t i = 0; i < figures.limited.size(); ++i)
    if (figures.limited[i] > 0)
      said.safeguards +=
          fmt::format("{}{} {:.3g} s", said.safeguards.empty() ? "" : ", ",
                      wire::kHandLimitNames[i], static_cast<double>(figures.limited[i]) * kStep_s);
  if (said.safeguards.empty()) said.safeguards = "none so far";
  return said;
}

}  // namespace trocar::ui
