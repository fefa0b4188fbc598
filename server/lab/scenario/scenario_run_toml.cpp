// [run] of a scenario's TOML form.

#include "server/lab/scenario/scenario_tables.h"
#include "server/tissue/step/tick_report.h"

namespace trocar::scenario {
namespace {

// Keys that mean something in another kind of run only.
void refuse_keys(tool::TableReader& reader, std::initializer_list<std::string_view> keys,
                 const std::string& why) {
  for (const auto key : keys)
    if (reader.has(key)) reader.fail(key, why + ", remove it");
}

void read_count(tool::TableReader& reader, std::string_view key, std::int64_t least,
                std::int64_t most, std::uint32_t& value) {
  if (const auto number = reader.integer(key, least, most))
    value = static_cast<std::uint32_t>(*number);
}

// "session" sets the keys to what a session does unless its server is told otherwise.
void read_like(tool::TableReader& reader, RunRule& run) {
  if (!reader.choice<bool, 1>("like", {{{"session", true}}})) return;
  const step::TickDecisions session;
  run.boundary = Boundary::Graded;
  run.depth = session.depth_limit;
  run.nodes = session.node_limit;
  run.has_sweeps_for_organ = !reader.has("sweeps");
  run.over_relaxation = static_cast<double>(session.over_relaxation);
  run.has_linear_far_field = !session.is_far_exact;
  refuse_keys(reader, {"dt_s", "integrator", "boundary"}, "follows from like = \"session\"");
}

void read_far_field(tool::TableReader& reader, RunRule& run) {
  const auto is_linear =
      reader.choice<bool, 2>("far_field", {{{"linear", true}, {"exact", false}}});
  run.has_linear_far_field = is_linear.value_or(run.has_linear_far_field);
  std::uint32_t sweeps = 0;
  read_count(reader, "far_sweeps", 1, 16, sweeps);
  if (sweeps > 0) run.far_sweeps = sweeps;
  run.far_over_relaxation = reader.number("far_over_relaxation", 0.5, 1.9);
  if (run.boundary != Boundary::Graded)
    refuse_keys(reader, {"far_sweeps", "far_over_relaxation", "far_field"},
                "is for boundary = \"graded\" or like = \"session\"");
}

// The paper's methods work on whole strokes of an organ that is solved whole.
void read_cutting(tool::TableReader& reader, RunRule& run) {
  run.cutting = reader.choice<nakao::Variant, 2>(
      "cutting", {{{"nakao", nakao::Variant::Adaptive}, {"nakao-plain", nakao::Variant::Plain}}});
  if (run.cutting && (run.boundary != Boundary::Whole || run.self_contact))
    reader.fail("cutting", "needs boundary = \"whole\" and self_contact = false beside it");
}

void read_boundary(tool::TableReader& reader, RunRule& run) {
  const auto boundary = reader.choice<Boundary, 3>(
      "boundary",
      {{{"whole", Boundary::Whole}, {"frozen", Boundary::Frozen}, {"graded", Boundary::Graded}}});
  std::uint32_t limit = 0;
  read_count(reader, "depth", 1, 1000, limit);
  if (limit > 0) run.depth = limit;
  limit = 0;
  read_count(reader, "nodes", 1, 10'000'000, limit);
  if (limit > 0) run.nodes = limit;
  const bool is_limited = run.depth || run.nodes;
  if (boundary || !reader.has("like"))
    run.boundary = boundary.value_or(is_limited ? Boundary::Frozen : Boundary::Whole);
  if (run.boundary == Boundary::Whole)
    refuse_keys(reader, {"depth", "nodes"}, "limits boundary \"frozen\" or \"graded\"");
  else if (!is_limited)
    reader.fail("boundary", "\"frozen\" and \"graded\" need depth or nodes or both beside it");
  read_far_field(reader, run);
}

void read_step(tool::TableReader& reader, RunRule& run) {
  run.integrator = reader
                       .choice<Integrator, 2>("integrator", {{{"implicit", Integrator::Implicit},
                                                              {"explicit", Integrator::Explicit}}})
                       .value_or(Integrator::Implicit);
  if (const auto dt = reader.number("dt_s", 1e-6, 1e-3)) {
    const double steps = std::round(1e-3 / *dt);
    if (std::abs(steps * *dt - 1e-3) > 1e-9)
      reader.fail("dt_s", "is " + tool::shown(*dt) +
                              ", which does not divide a tick of 0.001 s, write " +
                              tool::shown(1e-3 / std::max(std::ceil(1e-3 / *dt), 1.0)));
    run.steps_per_tick = static_cast<std::uint32_t>(steps);
  }
  if (run.integrator != Integrator::Explicit) return;
  if (run.boundary != Boundary::Whole)
    reader.fail("integrator",
                "\"explicit\" moves the whole organ, remove boundary, depth and nodes");
  refuse_keys(reader,
              {"sweeps", "over_relaxation", "tolerance_n", "max_sweeps", "self_contact", "cutting"},
              "is of the implicit integrator");
}

}  // namespace

RunRule read_run(tool::TableReader& reader) {
  RunRule run;
  run.given = places_of_keys(reader);
  run.mode = reader
                 .choice<RunMode, 2>("mode",
                                     {{{"dynamic", RunMode::Dynamic}, {"static", RunMode::Static}}})
                 .value_or(RunMode::Dynamic);
  const auto seconds = reader.number("seconds", 0.001, kScenarioTimeLimit);
  if (!seconds) reader.fail_missing("seconds", "write how long to simulate");
  run.seconds = seconds.value_or(1);
  std::uint32_t load_steps = 1;
  read_count(reader, "load_steps", 1, 100'000, load_steps);
  for (std::uint32_t i = 1; run.mode == RunMode::Static && i <= load_steps; ++i)
    run.load_times_s.push_back(run.seconds * i / load_steps);
  const auto start = reader.choice<bool, 2>("start", {{{"rest", false}, {"equilibrium", true}}});
  run.starts_in_equilibrium = start.value_or(false);
  read_like(reader, run);
  read_boundary(reader, run);
  read_step(reader, run);
  read_count(reader, "sweeps", 1, 64, run.sweeps);
  run.over_relaxation = reader.number("over_relaxation", 1, 1.9).value_or(run.over_relaxation);
  run.self_contact = reader.boolean("self_contact").value_or(true);
  read_cutting(reader, run);
  if (run.mode == RunMode::Static) {
    // Residual forces add up over all nodes, and no later step of a static run corrects them.
    run.tolerance_n = 1e-7;
    run.max_sweeps = 50'000;
  }
  run.tolerance_n = reader.number("tolerance_n", 1e-9, 1).value_or(run.tolerance_n);
  read_count(reader, "max_sweeps", 1, 1'000'000, run.max_sweeps);
  if (run.mode == RunMode::Static)
    refuse_keys(reader,
                {"start", "like", "far_field", "boundary", "depth", "nodes", "integrator", "dt_s",
                 "sweeps", "self_contact", "cutting"},
                "is for mode = \"dynamic\"");
  else
    refuse_keys(reader, {"load_steps"}, "is for mode = \"static\"");
  reader.finish();
  return run;
}

}  // namespace trocar::scenario
