#pragma once

// A scenario that several tests load, and how they make a run of a text.

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

inline std::unique_ptr<ScenarioRun> make(const std::string& text, Solver solver = Solver::Full) {
  auto parsed = scenario::parse_scenario_text(text, "test.toml");
  EXPECT_TRUE(parsed.ok()) << (parsed.ok() ? "" : parsed.error().message);
  if (!parsed) return nullptr;
  auto resolved = scenario::resolve(std::move(*parsed));
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
