// trocar-sim: runs a scenario on the engine, without a network, and writes what its probes saw.

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cinttypes>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>

#include "common/base/log.h"
#include "common/base/program.h"
#include "common/base/signals.h"
#include "common/base/stdout_check.h"
#include "common/base/timing.h"
#include "common/base/version.h"
#include "common/command_line/command_line.h"
#include "common/command_line/limits.h"
#include "server/app/sim/program_name.h"
#include "server/app/sim/sim_fem.h"
#include "server/app/sim/sim_hands.h"
#include "server/app/sim/sim_journal.h"
#include "server/lab/scenario/field_files.h"
#include "server/lab/scenario/field_times.h"
#include "server/lab/scenario/probe_file.h"
#include "server/lab/scenario/probe_plots.h"
#include "server/lab/scenario/scenario_run.h"
#include "server/organs/organ/any_material.h"

namespace trocar::app {
namespace {

constexpr double kTick_s = 1e-3;
constexpr std::uint64_t kLookSteps = 10;  // from one look at the tets to the next
constexpr std::uint64_t kProgressAfter_ns = 2'000'000'000, kProgressEvery_ns = 500'000'000;

constexpr const char* kExamples = R"(
Examples:
  trocar-sim deploy/scenes/pull.toml
      pulls at a block of tissue; results in out/pull
  trocar-sim deploy/scenes/pull.toml --plot
      the same, and draws what the probes saw (SVG)
  trocar-sim deploy/scenes/pull.toml --solver full --out /tmp/reference
      the same with every step solved to the tolerance in [run]
  trocar-sim deploy/scenes/stretch.toml --solver fem --material human_liver_nava2008
      a measured material on quadratic finite elements, which do not lock
  trocar-sim deploy/scenes/wedge.toml --journal out/wedge.mcap
      cuts a wedge out of the liver, and records it as a session is recorded: trocar-journal verify
      simulates it again, trocar-client --replay shows it
  trocar-sim --hands session.mcap --organ other.organ --out out/other
      the hands of a recorded session on another organ

Writes probes.csv, and field_<ms>ms.csv and .vtu (ParaView) for the times in [output].
Ctrl-C ends a run early; what was written until then is complete.

Exit codes: 0 ok (also after Ctrl-C), 1 no equilibrium found (--solver fem), 2 command line, 3 bad
scenario or organ, 5 cannot write or processor too old.
)";

struct Options {
  FemCommand fem;
  std::string scenario;
  std::string out;
  std::string solver = "live";
  std::string journal;
  HandsCommand hands;
  bool is_plotted = false;
  unsigned threads = 1;
  std::string log_level = "info";
};

volatile std::sig_atomic_t has_stop_signal = 0;
extern "C" void request_stop(int) {
  has_stop_signal = 1;
  trocar::ignore_ending_signals();
}

// On a terminal, a line on stderr is rewritten once a run has taken two seconds.
class Progress {
 public:
  void show(const scenario::ScenarioRun& run) {
    if (!is_terminal_) return;
    const std::uint64_t now = monotonic_ns();
    if (now < next_) return;
    next_ = now + kProgressEvery_ns;
    is_shown_ = true;
    std::fprintf(stderr, "\r%s: %.3f of %.3f s", kProgram, run.time_s(),
                 run.scenario().run.seconds);
  }
  void end() const {
    if (is_shown_) std::fputc('\n', stderr);
  }
  bool is_shown() const { return is_shown_; }

 private:
  std::uint64_t next_ = monotonic_ns() + kProgressAfter_ns;
  const bool is_terminal_ = ::isatty(STDERR_FILENO) != 0;
  bool is_shown_ = false;
};

struct Totals {
  std::uint64_t sweeps = 0, unconverged = 0, rejected = 0;
  std::size_t most_active = 0;
  float worst_residual_n = 0;
  double first_rejected_s = 0;
  std::size_t most_inverted = 0;
  double first_inverted_s = 0;

  void look_at_tets(const scenario::ScenarioRun& run) {
    const auto count = run.inverted_tets();
    if (most_inverted == 0) first_inverted_s = run.time_s();
    most_inverted = std::max(most_inverted, count);
  }
  void add(double time_s, const scenario::StepReport& report) {
    sweeps += report.solve.sweeps;
    unconverged += report.is_converged ? 0 : 1;
    if (rejected == 0) first_rejected_s = time_s;
    rejected += report.solve.nodes_rejected;
    most_active = std::max(most_active, report.active_nodes);
    worst_residual_n = std::max(worst_residual_n, report.solve.residual_n);
  }
};

Status simulate(scenario::ScenarioRun& run, const std::filesystem::path& folder, bool is_plotted,
                SimJournal* journal, Totals& totals) {
  auto probes = scenario::ProbeFile::create(folder / "probes.csv", run.scenario());
  if (!probes) return probes.error();
  scenario::FieldTimes field_times(run.scenario().field_times_s, kTick_s);
  const auto write_due_field = [&]() -> Status {
    return field_times.pop_due(run.time_s()) ? scenario::write_field(folder, run) : Status{};
  };
  std::optional<scenario::ProbePlots> plots;
  if (is_plotted) plots.emplace(run);
  Progress progress;
  if (auto s = write_due_field(); !s) return s;
  totals.look_at_tets(run);
  const bool is_static = run.scenario().run.mode == scenario::RunMode::Static;
  while (!run.is_finished() && has_stop_signal == 0) {
    const auto report = run.step();
    totals.add(run.time_s(), report);
    if (is_static || run.steps_done() % kLookSteps == 0 || run.is_finished())
      totals.look_at_tets(run);
    if (journal != nullptr) {
      auto& simulation = run.simulation();
      journal->add(simulation.pop_frame(), run.inputs(), run.decisions(),
                   simulation.context().report);
      journal->record_due_snapshot(simulation);
    }
    probes->add(run);
    if (plots) plots->add(run);
    if (auto s = write_due_field(); !s) return s;
    progress.show(run);
    if (progress.is_shown()) probes->flush();
  }
  progress.end();
  if (auto s = probes->close(); !s) return s;
  return plots ? plots->write(folder, run) : Status{};
}

void print_summary(const scenario::ScenarioRun& run, const Totals& totals,
                   const std::filesystem::path& folder) {
  const auto steps = run.steps_done();
  if (!run.is_finished())
    std::fprintf(stderr, "%s: stopped at %.3f of %.3f s\n", kProgram, run.time_s(),
                 run.scenario().run.seconds);
  if (!run.settling().is_converged)
    std::fprintf(stderr,
                 "%s: warning: the equilibrium at the start was not reached to %g N in %u sweeps: "
                 "raise max_sweeps or tolerance_n in [run]\n",
                 kProgram, run.scenario().run.tolerance_n, run.scenario().run.max_sweeps);
  if (totals.unconverged > 0)
    std::fprintf(
        stderr,
        "%s: warning: %" PRIu64 " of %" PRIu64
        " steps did not reach %g N in %u sweeps: raise max_sweeps or tolerance_n in [run]\n",
        kProgram, totals.unconverged, steps, run.scenario().run.tolerance_n,
        run.scenario().run.max_sweeps);
  if (totals.rejected > 0)
    std::fprintf(stderr,
                 "%s: warning: some nodes had no finite step, first at %.3f s: loads are too large "
                 "for this material\n",
                 kProgram, totals.first_rejected_s);
  if (totals.most_inverted > 0)
    std::fprintf(stderr,
                 "%s: warning: up to %zu of %zu tets are inside out, first seen at %.3f s: the "
                 "material is too soft for these loads%s\n",
                 kProgram, totals.most_inverted, run.organ().mesh.tets.size(),
                 totals.first_inverted_s,
                 run.organ().material.elastic_law == material::ElasticLaw::Springs
                     ? ", and springs fold first: elastic_law = \"neo-hookean\" bears more"
                     : "");
  std::printf(
      "%s: %.3f s of %s, %zu nodes, at most %zu active, %.1f sweeps per step, residual at "
      "most %.2g N\n",
      run.scenario().source.c_str(), run.time_s(), run.organ().name.c_str(),
      run.world().node_count(), totals.most_active,
      steps == 0 ? 0.0 : static_cast<double>(totals.sweeps) / static_cast<double>(steps),
      static_cast<double>(totals.worst_residual_n));
  if (run.stable_dt_s())
    std::printf("explicit steps of %.4g s, stable up to %.4g s\n", run.scenario().run.dt_s(),
                *run.stable_dt_s());
  if (const auto& ties = run.simulation().state().cuts.topology().ties(); ties.count() > 0)
    std::printf("%zu of %zu ties hold\n", ties.whole_count(), ties.count());
  std::printf("results in %s\n", folder.c_str());
}

// Two tools each, as ScenarioRun gives them to hands.
std::vector<participants::Participant> hands_of(const scenario::Scenario& scenario) {
  std::vector<participants::Participant> hands;
  for (std::size_t i = 0; i < scenario.tools.size(); i += kToolsPerHand) {
    auto& hand = hands.emplace_back();
    hand.slot = ToolSlot{static_cast<std::uint8_t>(i)}.owner();
    hand.name = "hand " + std::to_string(hands.size());
    hand.role = participants::Role::Surgeon;
    for (std::size_t t = i; t < std::min(i + kToolsPerHand, scenario.tools.size()); ++t)
      hand.tools.push_back(scenario.tools[t].shape);
  }
  return hands;
}

// Null without --journal.
Result<std::unique_ptr<SimJournal>> open_sim_journal(const Options& options,
                                                     const scenario::ScenarioRun& run) {
  if (options.journal.empty()) return std::unique_ptr<SimJournal>();
  if (!run.has_ticks())
    return Error{ErrorCode::Usage,
                 "--journal: records ticks, which a static run and the explicit integrator have "
                 "not: leave it out"};
  if (run.scenario().run.cutting)
    return Error{
        ErrorCode::Usage,
        "--journal: recordings know no cutting = \"nakao\", which moves nodes of the mesh: "
        "remove one of the two"};
  recording::Beginning beginning;
  beginning.starts_from_snapshot = run.scenario().run.starts_in_equilibrium;
  beginning.has_implicit_strain = run.has_implicit_strain();
  auto journal = SimJournal::create(options.journal, run.simulation(), std::move(beginning));
  if (journal) (*journal)->record_hands(hands_of(run.scenario()), 0);
  return journal;
}

Result<std::filesystem::path> make_folder(const std::filesystem::path& folder) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed)
    return Error{ErrorCode::ResourceMissing,
                 folder.string() + ": cannot be made (" + failed.message() + "), see --out"};
  for (const int signal : ending_signals()) std::signal(signal, request_stop);
  return folder;
}

Status run_recording(const Options& options) {
  if (!options.scenario.empty())
    return Error{ErrorCode::Usage, "--hands: stands instead of a scenario, leave one out"};
  if (options.solver != "live" || options.is_plotted)
    return Error{ErrorCode::Usage, "--hands: has neither --solver nor --plot, leave them out"};
  const std::filesystem::path named =
      "out/" + std::filesystem::path(options.hands.recording).stem().string();
  const auto folder = make_folder(options.out.empty() ? named : std::filesystem::path(options.out));
  if (!folder) return folder.error();
  return run_hands(options.hands, *folder, options.journal, options.threads, has_stop_signal);
}

Status run_scenario(const Options& options) {
  if (!options.hands.recording.empty()) return run_recording(options);
  if (options.scenario.empty())
    return Error{ErrorCode::Usage, "SCENARIO: is missing, name a file (see --help)"};
  if (!options.hands.organ.empty())
    return Error{ErrorCode::Usage, "--organ: is of --hands; a scenario names its own organ"};
  const bool is_fem = options.solver == "fem";
  if (auto s = check_fem_options(options.fem, is_fem); !s) return s;
  if (is_fem && options.is_plotted)
    return Error{ErrorCode::Usage, "--plot: --solver fem draws nothing, remove it"};
  if (is_fem && !options.journal.empty())
    return Error{ErrorCode::Usage, "--journal: --solver fem has no ticks to record, remove it"};
  auto parsed = scenario::parse_scenario(options.scenario);
  if (!parsed) return parsed.error();
  if (is_fem && parsed->threads)
    return Error{ErrorCode::Usage, "--solver fem: knows no threads, remove it or each [[thread]]"};
  const std::filesystem::path folder =
      !options.out.empty()
          ? options.out
          : parsed->output_folder.value_or("out/" + parsed->source.stem().string());
  auto resolved = scenario::resolve(std::move(*parsed));
  if (!resolved) return resolved.error();
  if (!is_fem)
    if (auto s = scenario::check_supported(*resolved); !s) return s;
  const bool has_ticks = !is_fem && resolved->scenario.run.mode == scenario::RunMode::Dynamic &&
                         resolved->scenario.run.integrator == scenario::Integrator::Implicit;
  if (!has_ticks && organ::any_material(resolved->organ, [](const material::Material& m) {
        return m.tear_stretch > 0;
      }))
    std::fprintf(stderr,
                 "%s: warning: %s: tear_stretch is left out: tissue tears in dynamic runs of the "
                 "live solver only\n",
                 kProgram, resolved->scenario.source.c_str());
  if (is_fem && organ::any_material(resolved->organ, [](const material::Material& m) {
        return m.has_averaged_strain;
      }))
    std::fprintf(stderr,
                 "%s: warning: %s: averaged_strain is of the live solver, here quadratic elements "
                 "do not lock\n",
                 kProgram, resolved->scenario.source.c_str());
  if (const auto made = make_folder(folder); !made) return made.error();
  if (is_fem)
    return run_fem(options.fem, std::move(*resolved), folder, options.threads, has_stop_signal);
  scenario::ScenarioRun run(
      std::move(*resolved),
      options.solver == "full" ? scenario::Solver::Full : scenario::Solver::Live, options.threads);
  auto journal = open_sim_journal(options, run);
  if (!journal) return journal.error();
  Totals totals;
  if (auto s = simulate(run, folder, options.is_plotted, journal->get(), totals); !s) return s;
  if (*journal)
    if (auto s = (*journal)->close(); !s) return s;
  print_summary(run, totals, folder);
  return {};
}

int run(int argc, char** argv) {
  Options options;
  CLI::App app(
      "Runs a scenario: an organ, loads and scripted tools over time, without a network. "
      "docs/scripts-and-scenarios.md describes the file.",
      kProgram);
  app.footer(kExamples);
  app.set_version_flag("--version", std::string(kProgram) + " " + kVersion + ", sim_version " +
                                        std::to_string(kSimVersion));
  app.add_option("SCENARIO", options.scenario, "scenario file (.toml)");
  app.add_option("--out", options.out, "folder of the results [dir in [output], else out/<name>]")
      ->type_name("DIR");
  app.add_option("--solver", options.solver,
                 "live: the sweeps of a session; full: every step to the tolerance in [run]; fem: "
                 "the off-line finite elements, for reference")
      ->type_name("SOLVER")
      ->check(command_line::one_of({"live", "full", "fem"}))
      ->capture_default_str();
  app.add_flag("--plot", options.is_plotted,
               "also draw what each probe saw: probe_<name>.svg over time, and force_<name>.svg, "
               "force against displacement, of what loads the tissue and is probed");
  app.add_option("--threads", options.threads, "of the solver; results are the same")
      ->type_name("N")
      ->check(command_line::whole_from_to(1, 64))
      ->capture_default_str();
  app.add_option("--journal", options.journal,
                 "also record the run as a session is recorded, in this file (.mcap)")
      ->type_name("FILE");
  add_hands_options(app, options.hands);
  add_fem_options(app, options.fem);
  app.add_option("--log-level", options.log_level, "error, warn, info, debug or off")
      ->capture_default_str();
  const auto parsed = command_line::parse_command_line(app, argc, argv);
  if (!parsed) return report(kProgram, parsed.error());
  if (!*parsed) return static_cast<int>(ExitCode::Ok);
  if (const auto set = log::configure(kProgram, options.log_level); !set)
    return report(kProgram, set.error());
  const auto status = run_scenario(options);
  return status ? static_cast<int>(ExitCode::Ok) : report(kProgram, status.error());
}

}  // namespace
}  // namespace trocar::app

int main(int argc, char** argv) {
  trocar::begin_program("trocar-sim");
  return trocar::finish_output("trocar-sim", trocar::app::run(argc, argv));
}
