#include "tests/validation/off_line.h"

#include <cmath>

namespace trocar::validation {

using finite_elements::ElementOrder;
using finite_elements::ScenarioSolve;

std::unique_ptr<ScenarioSolve> solve_off_line(const Lab& lab, const std::string& text,
                                              ElementOrder order) {
  const auto file = (lab.scenarios() / "off-line.toml").string();
  auto parsed = must(scenario::parse_scenario_text(text, file), file);
  auto resolved = must(scenario::resolve(std::move(parsed)), file);
  auto solve = must(ScenarioSolve::create(std::move(resolved), {.order = order}), file);
  while (!solve->is_finished())
    if (!solve->step().is_converged) return nullptr;
  return solve;
}

Vec3d probe_off_line(const Lab& lab, const std::string& text, ElementOrder order) {
  const auto solve = solve_off_line(lab, text, order);
  return solve ? solve->probe(0) : Vec3d{std::nan(""), std::nan(""), std::nan("")};
}

}  // namespace trocar::validation
