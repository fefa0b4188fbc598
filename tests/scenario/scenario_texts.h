#pragma once

// A scenario that several tests load, and how they resolve a text and make a run of it.

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "server/lab/scenario/scenario_run.h"

namespace trocar::scenario {

// A column of 2 x 6 x 2 nodes: four chains of five springs of k = 40 N/m, joined by springs across.
inline const std::string kColumn = R"([organ]
source = "lattice"
nodes = [2, 6, 2]
spacing_mm = 10
[material]
spring_stiffness_n_m = 40
node_damping_per_s = 20
[[nodes]]
name = "top"
box_min_mm = [-5, 25, -5]
box_max_mm = [5, 25, 5]
)";
inline constexpr double kStiffness = 40, kWeight = 9.81;

inline Result<ResolvedScenario> resolve_text(const std::string& text,
                                             const std::string& source = "test.toml") {
  auto parsed = parse_scenario_text(text, source);
  if (!parsed) return parsed.error();
  return resolve(std::move(*parsed));
}

// Fails the test and returns an empty scenario if the text is refused.
inline ResolvedScenario expect_resolved(const std::string& text) {
  auto result = resolve_text(text);
  EXPECT_TRUE(result.ok()) << (result.ok() ? "" : result.error().message);
  return result.ok() ? std::move(*result) : ResolvedScenario{};
}

inline std::unique_ptr<ScenarioRun> make(const std::string& text, Solver solver = Solver::Full) {
  auto resolved = resolve_text(text);
  EXPECT_TRUE(resolved.ok()) << (resolved.ok() ? "" : resolved.error().message);
  if (!resolved) return nullptr;
  const auto supported = check_supported(*resolved);
  EXPECT_TRUE(supported.ok()) << (supported.ok() ? "" : supported.error().message);
  if (!supported) return nullptr;
  return std::make_unique<ScenarioRun>(std::move(*resolved), solver);
}

inline void finish(ScenarioRun& run) {
  while (!run.is_finished()) run.step();
}

}  // namespace trocar::scenario
