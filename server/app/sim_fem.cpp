#include "server/app/sim_fem.h"

#include <unistd.h>

#include <cinttypes>
#include <cstdio>

#include "server/finite_elements/scenario_solve.h"
#include "server/scenario/field_files.h"
#include "server/scenario/probe_file.h"

namespace trocar::app {
namespace {

using finite_elements::ElementOrder;
using finite_elements::ScenarioSolve;

constexpr const char* kProgram = "trocar-sim";
constexpr const char* kStateFile = "fem.state";

Result<finite_elements::ScenarioSettings> settings_of(const FemCommand& command, unsigned threads) {
  finite_elements::ScenarioSettings settings;
  settings.order = command.elements == "linear" ? ElementOrder::Linear : ElementOrder::Quadratic;
  settings.is_equilibrium = command.response == "equilibrium";
  settings.dt_s = command.step_ms * 1e-3;
  settings.solver.threads = threads;
  if (command.material.empty()) return settings;
  const auto* material = scene::find_measured_material(command.material);
  if (material == nullptr)
    return Error{ErrorCode::Usage, "--material: '" + command.material + "' is not known, write " +
                                       scene::measured_material_names()};
  settings.material = *material;
  if (command.bulk_ratio > 0)
    settings.material->bulk_modulus_pa = command.bulk_ratio * material->coefficients_pa[0];
  return settings;
}

scenario::Field field_of(const ScenarioSolve& solve) {
  return {solve.resolved().organ, solve.time_s(), solve.displacements(), solve.velocities(),
          solve.held_nodes()};
}

// Lines on stderr: one per step, and where that takes long, its Newton iterations on a terminal.
void show_iterations(ScenarioSolve& solve) {
  if (isatty(STDERR_FILENO) == 0) return;
  solve.solver().on_progress = [](const finite_elements::NewtonProgress& p) {
    std::fprintf(stderr, "\r%s: %3.0f %% of the step, iteration %d, residual %.2g of %.2g N  ",
                 kProgram, 100 * p.part_done, p.iteration, p.residual_n, p.tolerance_n);
  };
}

class Outputs {
 public:
  Outputs(const std::filesystem::path& folder, scenario::ProbeFile probes)
      : folder_(folder), probes_(std::move(probes)) {}

  Status add(const ScenarioSolve& solve) {
    std::vector<std::optional<Vec3d>> values(solve.resolved().scenario.probes.size());
    for (std::size_t i = 0; i < values.size(); ++i)
      if (solve.is_due(i)) values[i] = solve.probe(i);
    probes_.add(solve.time_s(), values);
    probes_.flush();
    const auto& times = solve.resolved().scenario.field_times_s;
    bool is_due = false;
    for (; next_field_ < times.size() && times[next_field_] <= solve.time_s() + 0.5e-3;
         ++next_field_)
      is_due = true;
    return is_due ? scenario::write_field(folder_, field_of(solve)) : Status{};
  }
  // Fields before this time are there already.
  void skip_to(const ScenarioSolve& solve) {
    const auto& times = solve.resolved().scenario.field_times_s;
    while (next_field_ < times.size() && times[next_field_] <= solve.time_s() + 0.5e-3)
      ++next_field_;
  }
  Status close() { return probes_.close(); }

 private:
  const std::filesystem::path& folder_;
  scenario::ProbeFile probes_;
  std::size_t next_field_ = 0;
};

Status solve_all(ScenarioSolve& solve, Outputs& outputs, const std::filesystem::path& folder,
                 const volatile std::sig_atomic_t& stop_requested) {
  show_iterations(solve);
  while (!solve.is_finished() && stop_requested == 0) {
    const auto report = solve.step();
    std::fprintf(stderr,
                 "%s%s: step %" PRIu64 " of %" PRIu64 ": %d iterations in %d parts, %.2g N\n",
                 isatty(STDERR_FILENO) != 0 ? "\r" : "", kProgram, solve.steps_done(),
                 solve.step_count(), report.iterations, report.parts, report.residual_n);
    if (!report.is_converged || !solve.settling().is_converged)
      return Error{ErrorCode::Mismatch,
                   solve.resolved().scenario.source.string() +
                       ": no equilibrium was found in this step: the load is too large for this "
                       "material, or the tissue buckles; take more load_steps"};
    if (auto s = outputs.add(solve); !s) return s;
    if (auto s = solve.save(folder / kStateFile); !s) return s;
  }
  return outputs.close();
}

}  // namespace

void add_fem_options(CLI::App& app, FemCommand& command) {
  const char* group = "With --solver fem";
  app.add_option("--elements", command.elements, "linear or quadratic tetrahedra")
      ->check(CLI::IsMember({"linear", "quadratic"}))
      ->capture_default_str()
      ->group(group);
  app.add_option(
         "--material", command.material,
         "measured material instead of the organ's own: " + scene::measured_material_names())
      ->type_name("NAME")
      ->group(group);
  app.add_option("--bulk-ratio", command.bulk_ratio, "its bulk modulus over C10 [its own]")
      ->type_name("RATIO")
      ->check(CLI::Range(2.0, 1e6))
      ->group(group);
  app.add_option("--response", command.response,
                 "static runs: instantaneous, or equilibrium after all relaxation")
      ->check(CLI::IsMember({"instantaneous", "equilibrium"}))
      ->capture_default_str()
      ->group(group);
  app.add_option("--step-ms", command.step_ms, "dynamic runs: step of time")
      ->type_name("MS")
      ->check(CLI::Range(0.001, 1e6))
      ->capture_default_str()
      ->group(group);
  app.add_option("--resume", command.resume,
                 "go on from this state; every run leaves one, fem.state in its folder")
      ->type_name("FILE")
      ->group(group);
}

Status run_fem(const FemCommand& command, scene::ResolvedScenario resolved,
               const std::filesystem::path& folder, unsigned threads,
               const volatile std::sig_atomic_t& stop_requested) {
  const auto settings = settings_of(command, threads);
  if (!settings) return settings.error();
  auto solve = ScenarioSolve::create(std::move(resolved), *settings);
  if (!solve) return solve.error();
  auto probes = scenario::ProbeFile::create(
      folder / (command.resume.empty() ? "probes.csv" : "probes-resumed.csv"),
      (*solve)->resolved().scenario);
  if (!probes) return probes.error();
  Outputs outputs(folder, std::move(*probes));
  if (!command.resume.empty()) {
    if (auto s = (*solve)->resume(command.resume); !s) return s;
    outputs.skip_to(**solve);
  }
  if (auto s = solve_all(**solve, outputs, folder, stop_requested); !s) return s;
  const auto& mesh = (*solve)->solver().problem().mesh;
  std::printf("%s: %.3f s of %s, %zu %s elements, %zu nodes\nresults in %s\n",
              (*solve)->resolved().scenario.source.c_str(), (*solve)->time_s(),
              (*solve)->resolved().organ.name.c_str(), mesh.element_count(),
              command.elements.c_str(), mesh.node_count(), folder.c_str());
  return {};
}

}  // namespace trocar::app
