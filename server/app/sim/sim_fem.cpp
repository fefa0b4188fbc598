#include "server/app/sim/sim_fem.h"

#include <unistd.h>

#include <array>
#include <cinttypes>
#include <cstdio>

#include "common/command_line/limits.h"
#include "server/app/sim/program_name.h"
#include "server/lab/finite_elements/scenario_solve.h"
#include "server/lab/scenario/field_files.h"
#include "server/lab/scenario/field_times.h"
#include "server/lab/scenario/probe_file.h"
#include "server/organs/material/material_file.h"

namespace trocar::app {
namespace {

using finite_elements::ElementOrder;
using finite_elements::ScenarioSolve;

constexpr const char* kStateFile = "fem.state";
constexpr double kUsualStep_ms = 1;

Result<finite_elements::ScenarioSettings> settings_of(const FemCommand& command, unsigned threads) {
  finite_elements::ScenarioSettings settings;
  settings.order = command.elements == "linear" ? ElementOrder::Linear : ElementOrder::Quadratic;
  settings.is_equilibrium = command.response == "equilibrium";
  settings.dt_s = command.step_ms.value_or(kUsualStep_ms) * 1e-3;
  settings.solver.threads = threads;
  if (command.material.empty()) return settings;
  auto material = material::measured_material(command.material);
  if (!material) return material.error();
  settings.material = std::move(*material);
  if (command.bulk_ratio)
    settings.material->bulk_modulus_pa =
        *command.bulk_ratio * settings.material->coefficients_pa[0];
  return settings;
}

// Options that mean something in one kind of run only.
Status check_mode(const FemCommand& command, const scenario::RunRule& run) {
  const bool is_static = run.mode == scenario::RunMode::Static;
  if (is_static && command.step_ms)
    return Error{ErrorCode::Usage,
                 "--step-ms: this run is static, its steps are load_steps in [run]: remove it"};
  if (!is_static && command.response)
    return Error{ErrorCode::Usage, "--response: is of static runs, this one is dynamic: remove it"};
  return {};
}

scenario::Field field_of(const ScenarioSolve& solve) {
  return {solve.resolved().organ, solve.time_s(), solve.displacements(), solve.velocities(),
          solve.held_nodes()};
}

// On a terminal, stderr shows the Newton iterations of a step that takes long.
void show_iterations(ScenarioSolve& solve) {
  if (isatty(STDERR_FILENO) == 0) return;
  solve.solver().on_progress = [](const finite_elements::NewtonProgress& p) {
    std::fprintf(stderr, "\r%s: %3.0f %% of the step, iteration %d, residual %.2g of %.2g N  ",
                 kProgram, 100 * p.part_done, p.iteration, p.residual_n, p.tolerance_n);
  };
}

double step_of(const ScenarioSolve& solve) {
  const auto& run = solve.resolved().scenario.run;
  return run.seconds / static_cast<double>(solve.step_count());
}

class Outputs {
 public:
  Outputs(const std::filesystem::path& folder, const ScenarioSolve& solve,
          scenario::ProbeFile probes)
      : folder_(folder),
        probes_(std::move(probes)),
        field_times_(solve.resolved().scenario.field_times_s, step_of(solve)) {}

  // Adds the state at time 0, which has no row of probes.
  Status add_start(const ScenarioSolve& solve) { return add_due_field(solve); }
  Status add(const ScenarioSolve& solve) {
    std::vector<std::optional<Vec3d>> values(solve.resolved().scenario.probes.size());
    for (std::size_t i = 0; i < values.size(); ++i)
      if (solve.is_due(i)) values[i] = solve.probe(i);
    probes_.add(solve.time_s(), values);
    probes_.flush();
    return add_due_field(solve);
  }
  // Fields until this time are there already.
  void skip_to(const ScenarioSolve& solve) { field_times_.pop_due(solve.time_s()); }
  Status close() { return probes_.close(); }

 private:
  Status add_due_field(const ScenarioSolve& solve) {
    return field_times_.pop_due(solve.time_s()) ? scenario::write_field(folder_, field_of(solve))
                                                : Status{};
  }

  const std::filesystem::path& folder_;
  scenario::ProbeFile probes_;
  scenario::FieldTimes field_times_;
};

Error no_equilibrium(const ScenarioSolve& solve) {
  const auto& scenario = solve.resolved().scenario;
  const bool is_static = scenario.run.mode == scenario::RunMode::Static;
  const char* advice = is_static                ? "more load_steps"
                       : solve.steps_done() > 0 ? "a shorter --step-ms"
                                                : "smaller loads at time 0";
  return {ErrorCode::Mismatch,
          scenario.source.string() +
              ": no equilibrium was found in this step: the load is too large for this material, "
              "or the tissue buckles; take " +
              advice};
}

Status solve_all(ScenarioSolve& solve, Outputs& outputs, const std::filesystem::path& folder,
                 const volatile std::sig_atomic_t& stop_requested) {
  show_iterations(solve);
  if (solve.steps_done() == 0) {
    if (!solve.start().is_converged) return no_equilibrium(solve);
    if (auto s = outputs.add_start(solve); !s) return s;
  }
  while (!solve.is_finished() && stop_requested == 0) {
    const auto report = solve.step();
    if (isatty(STDERR_FILENO) != 0)
      std::fprintf(stderr,
                   "\r%s: step %" PRIu64 " of %" PRIu64 ": %d iterations in %d parts, %.2g N\n",
                   kProgram, solve.steps_done(), solve.step_count(), report.iterations,
                   report.parts, report.residual_n);
    if (!report.is_converged) return no_equilibrium(solve);
    if (auto s = outputs.add(solve); !s) return s;
    if (auto s = solve.save(folder / kStateFile); !s) return s;
  }
  return outputs.close();
}

}  // namespace

void add_fem_options(CLI::App& app, FemCommand& command) {
  const char* group = "With --solver fem";
  app.add_option("--elements", command.elements, "linear or quadratic tetrahedra [quadratic]")
      ->type_name("ORDER")
      ->check(command_line::one_of({"linear", "quadratic"}))
      ->group(group);
  app.add_option(
         "--material", command.material,
         "measured material instead of the organ's own: " + material::measured_material_names() +
             ", or a .toml file as trocar-organ identify leaves it")
      ->type_name("NAME")
      ->group(group);
  app.add_option("--bulk-ratio", command.bulk_ratio, "its bulk modulus over C10 [its own]")
      ->type_name("RATIO")
      ->check(command_line::from_to(2, 1e6))
      ->group(group);
  app.add_option("--response", command.response,
                 "static runs: instantaneous, or equilibrium after all relaxation [instantaneous]")
      ->type_name("RESPONSE")
      ->check(command_line::one_of({"instantaneous", "equilibrium"}))
      ->group(group);
  app.add_option("--step-ms", command.step_ms, "dynamic runs: step of time [1]")
      ->type_name("MS")
      ->check(command_line::from_to(0.001, 1e6))
      ->group(group);
  app.add_option("--resume", command.resume,
                 "go on from this state of the same run; every run leaves one, fem.state in its "
                 "folder. Rows go to probes-from-step-<N>.csv")
      ->type_name("FILE")
      ->group(group);
}

Status check_fem_options(const FemCommand& command, bool is_fem) {
  const std::array<std::pair<const char*, bool>, 6> given{
      {{"--elements", command.elements.has_value()},
       {"--material", !command.material.empty()},
       {"--bulk-ratio", command.bulk_ratio.has_value()},
       {"--response", command.response.has_value()},
       {"--step-ms", command.step_ms.has_value()},
       {"--resume", !command.resume.empty()}}};
  for (const auto& [name, is_given] : given)
    if (is_given && !is_fem)
      return Error{ErrorCode::Usage,
                   std::string(name) + ": is of --solver fem, add that or remove it"};
  if (command.bulk_ratio && command.material.empty())
    return Error{ErrorCode::Usage, "--bulk-ratio: is that of --material, name one"};
  return {};
}

Status run_fem(const FemCommand& command, scenario::ResolvedScenario resolved,
               const std::filesystem::path& folder, unsigned threads,
               const volatile std::sig_atomic_t& stop_requested) {
  if (auto s = check_mode(command, resolved.scenario.run); !s) return s;
  const auto settings = settings_of(command, threads);
  if (!settings) return settings.error();
  auto solve = ScenarioSolve::create(std::move(resolved), *settings);
  if (!solve) return solve.error();
  std::string probe_file = "probes.csv";
  if (!command.resume.empty()) {
    if (auto s = (*solve)->resume(command.resume); !s) return s;
    probe_file = "probes-from-step-" + std::to_string((*solve)->steps_done() + 1) + ".csv";
  }
  auto probes = scenario::ProbeFile::create(folder / probe_file, (*solve)->resolved().scenario);
  if (!probes) return probes.error();
  Outputs outputs(folder, **solve, std::move(*probes));
  if (!command.resume.empty()) outputs.skip_to(**solve);
  if (auto s = solve_all(**solve, outputs, folder, stop_requested); !s) return s;
  const auto& mesh = (*solve)->solver().problem().mesh;
  std::printf("%s: %.9g s of %s, %zu %s elements, %zu nodes\nresults in %s\n",
              (*solve)->resolved().scenario.source.c_str(), (*solve)->time_s(),
              (*solve)->resolved().organ.name.c_str(), mesh.element_count(),
              command.elements.value_or("quadratic").c_str(), mesh.node_count(), folder.c_str());
  return {};
}

}  // namespace trocar::app
