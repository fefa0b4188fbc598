#include "tests/validation/references.h"

#include <spdlog/fmt/fmt.h>

namespace trocar::validation {

void check_reference(Section& section, const std::string& name,
                     const calibration::Convergence& convergence, double own_error, Bound bound) {
  const auto all = fmt::format("{} ticks", convergence.ticks);
  section.exactly(
      name + "-converged", convergence.ticks > 0 ? all : "some ticks",
      fmt::format("{} ticks", convergence.reached), law(0, "the tolerance of the reference"),
      fmt::format("Ticks of the reference that reached its tolerance: {}.", convergence.words()));
  section.at_most(name, fmt::format("{:.0f} times the tolerance", calibration::kLooser), own_error,
                  std::move(bound),
                  "Largest change of the reference's force with the looser tolerance, over the "
                  "largest force.");
}

}  // namespace trocar::validation
