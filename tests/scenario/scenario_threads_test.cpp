// Threads of a scenario: what is wrong is one line, and what is right runs.

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/scenario/scenario_texts.h"

namespace trocar::scenario {
namespace {

const std::string kOrgan = R"([organ]
source = "lattice"
nodes = [3, 3, 3]
[run]
seconds = 0.3
)";
const std::string kThread = R"([[thread]]
name = "suture"
start_held = true
end_load_n = [0, -2, 0]
end_until_s = 0.1
[[thread.point]]
at_mm = [100, 100, 0]
[[thread.point]]
at_mm = [100, 0, 0]
)";

std::string error_of(const std::string& text) {
  const auto resolved = resolve_text(text);
  return resolved.ok() ? "" : resolved.error().message;
}

TEST(ScenarioThreads, RunAndAreProbed) {
  const auto text =
      kOrgan + kThread + "[[probe]]\nthread = \"suture\"\nquantity = \"start_force\"\n";
  auto resolved = expect_resolved(text);
  ScenarioRun run(std::move(resolved), Solver::Live);
  while (!run.is_finished()) run.step();
  EXPECT_EQ(run.scenario().probes[0].name, "suture_start_force");
  const double weight_n = 0.1 * 46e-6 * 9.81;
  EXPECT_NEAR(run.probe(0).y, -2 - weight_n, 1e-3);
  EXPECT_EQ(run.simulation().state().threads->node_count(), 101u);
}

TEST(ScenarioThreads, AreRefusedInOneLine) {
  const std::pair<std::string, std::string> bad[] = {
      {kOrgan + "[[thread]]\nname = \"short\"\n",
       "test.toml:6: key thread[0].point: is missing, write two or more [[thread.point]] with "
       "at_mm"},
      {kOrgan + "[[thread]]\nsize = \"5-0\"\n",
       "test.toml:7: key thread[0].size: is not one of the known words, write one of \"2-0\", "
       "\"3-0\", \"4-0\""},
      {kOrgan + "[[thread]]\nstart_held = true\nstart_load_n = [1, 0, 0]\n",
       "test.toml:8: key thread[0].start_load_n: is of a free end, remove it or start_held"},
      {kOrgan + kThread + "[[peg]]\nfrom_mm = [0, 0, 0]\nto_mm = [0, 0, 9]\nradius_mm = 0.5\n",
       "test.toml:18: key peg[0].radius_mm: is 0.5, allowed are 1 to 1000"},
      {kOrgan + "[floor]\ny_mm = 0\n", "test.toml:6: key floor: is for threads, add a [[thread]]"},
      {kOrgan + kThread + "[[probe]]\nthread = \"rope\"\nquantity = \"end_force\"\n",
       "test.toml:16: key probe[0].thread: \"rope\" is no [[thread]]'s name"}};
  for (const auto& [text, message] : bad) EXPECT_EQ(error_of(text), message) << text;
}

TEST(ScenarioThreads, MoveInTicksOnly) {
  auto text = kOrgan + kThread;
  text.replace(text.find("seconds = 0.3"), 13, "seconds = 0.3\nstart = \"equilibrium\"");
  EXPECT_NE(error_of(text).find("moves in ticks"), std::string::npos) << error_of(text);
}

// Runs what docs/thread.md begins with.
TEST(ScenarioThreads, TheExampleShowsWhatItSays) {
  auto parsed = parse_scenario(std::string(TROCAR_SOURCE_DIR) + "/deploy/scenes/thread.toml");
  ASSERT_TRUE(parsed.ok()) << parsed.error().message;
  auto resolved = resolve(std::move(*parsed));
  ASSERT_TRUE(resolved.ok()) << resolved.error().message;
  ScenarioRun run(std::move(*resolved), Solver::Live);
  while (!run.is_finished()) run.step();
  EXPECT_NEAR(length(run.probe(0)) / (0.5 * std::exp(0.2 * std::numbers::pi)), 1, 0.03);
  const auto& threads = *run.simulation().state().threads;
  EXPECT_FALSE(threads.holds.nodes.empty());
  EXPECT_LT(run.probe(1).y, 0);
  EXPECT_GT(threads.places_m[threads.holds.nodes.front()].y, 0.01);
}

}  // namespace
}  // namespace trocar::scenario
