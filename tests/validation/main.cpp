// trocar-validate: runs the validation experiments and writes report.html and results.json.

#include <spdlog/fmt/fmt.h>
#include <sys/utsname.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>

#include "common/base/log.h"
#include "common/base/program.h"
#include "common/base/timing.h"
#include "common/base/version.h"
#include "tests/validation/experiments.h"

namespace trocar::validation {
namespace {

constexpr const char* kProgram = "trocar-validate";
constexpr const char* kExamples = R"(
Examples:
  trocar-validate
      all experiments; out/validate/report.html and results.json
  trocar-validate --only choi2002/fig5 --out /tmp/fig5
  trocar-validate --list

Exit codes: 0 every bound kept or missed as declared, 1 not so, 2 command line, 3 a scenario cannot run, 5
cannot write, or gnuplot is missing.
)";

struct Options {
  std::vector<std::string> only;  // prefixes; empty: all
  std::filesystem::path out = "out/validate";
  std::string commit = "unknown";
  bool is_short = false;
  bool lists = false;
};

bool is_asked_for(std::string_view name, const std::vector<std::string>& prefixes) {
  return prefixes.empty() || std::ranges::any_of(prefixes, [&](const std::string& prefix) {
           return name.starts_with(prefix);
         });
}

std::string processor() {
  std::ifstream in("/proc/cpuinfo");
  for (std::string line; std::getline(in, line);)
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  utsname name{};
  uname(&name);
  return name.machine;
}

std::string today() {
  const std::time_t now = std::time(nullptr);
  char text[40];
  std::strftime(text, sizeof text, "%Y-%m-%d %H:%M UTC", std::gmtime(&now));
  return text;
}

double load_average() {
  double load = 0;
  return getloadavg(&load, 1) == 1 ? load : 0;
}

Section run_one(const Lab& lab, const Experiment& experiment) {
  Section section{.name = experiment.name, .title = experiment.title, .source = experiment.source};
  show_progress(experiment.name);
  const auto begin = thread_cpu_ns();
  experiment.run(lab, section);
  section.seconds = static_cast<double>(thread_cpu_ns() - begin) * 1e-9;
  section.check_convergence();
  show_progress("");
  const auto counts = count(section.checks);
  std::printf("%s%-36s %3zu kept, %zu missed, %zu broken, %zu measured only %8.1f s\n",
              counts.failed == 0 ? "  " : "! ", experiment.name, counts.kept, counts.missed,
              counts.failed, counts.measured, section.seconds);
  for (const auto& check : section.checks)
    if (check.fails() || check.verdict() == Verdict::Missed)
      std::printf("    %s: %s: expected %s, ours %s, error %.3g, bound %.3g%s\n",
                  name_of(check.verdict()), check.name.c_str(), check.expected.c_str(),
                  check.ours.c_str(), check.error, check.bound.value,
                  check.bound.largest_missed
                      ? fmt::format(", on record {:.3g}", *check.bound.largest_missed).c_str()
                      : "");
  std::fflush(stdout);
  return section;
}

// Draws the last section, which is new.
Status write_report(const Options& options, Report& report) {
  if (auto s = write_file(options.out / "results.json", to_json(report.sections)); !s) return s;
  if (auto s = write_file(options.out / "results.csv", to_csv(report.sections)); !s) return s;
  if (auto s = write_file(options.out / "run.json", run_to_json(report)); !s) return s;
  auto& section = report.sections.back();
  if (auto s = section.draw(); !s) return s;
  if (!section.svgs.empty())
    if (auto s = write_file(options.out / plot_file(section), section.svgs[0]); !s) return s;
  if (auto s = write_file(options.out / "validation.md", to_markdown(report)); !s) return s;
  return write_file(options.out / "report.html", to_html(report));
}

int run_all(const Options& options, const std::string& command) {
  if (options.lists) {
    for (const auto& experiment : experiments())
      std::printf("%-36s %s\n", experiment.name, experiment.title);
    return 0;
  }
  std::error_code failed;
  for (const char* folder : {"scenarios", "plots"})
    if (!failed) std::filesystem::create_directories(options.out / folder, failed);
  if (failed)
    return trocar::report(kProgram,
                          {ErrorCode::ResourceMissing, options.out.string() + ": cannot be made (" +
                                                           failed.message() + "), see --out"});
  const Lab lab(options.out, options.is_short);
  Report report{.processor = processor(),
                .compiler = fmt::format("g++ {}, sim_version {}", __VERSION__, kSimVersion),
                .commit = options.commit,
                .load_before = load_average(),
                .command = command,
                .date = today(),
                .is_short = options.is_short};
  for (const auto& experiment : experiments()) {
    if (!is_asked_for(experiment.name, options.only)) continue;
    report.sections.push_back(run_one(lab, experiment));
    report.load_after = load_average();
    // Written again after each: who stops the program has what was done until then.
    if (auto s = write_report(options, report); !s) return trocar::report(kProgram, s.error());
  }
  if (report.sections.empty())
    return trocar::report(kProgram, {ErrorCode::Usage, "--only: '" + options.only.front() +
                                                           "' begins no experiment, see --list"});
  std::printf("%s; %s\n", totals(report.sections).c_str(),
              (options.out / "report.html").string().c_str());
  const bool has_failed = std::ranges::any_of(
      report.sections, [](const Section& s) { return count(s.checks).failed > 0; });
  return static_cast<int>(has_failed ? ExitCode::Mismatch : ExitCode::Ok);
}

int run(int argc, char** argv) {
  Options options;
  CLI::App app(
      "Runs the experiments that compare Trocar with the papers, with closed forms and with its "
      "own "
      "full solution, and writes a report.",
      kProgram);
  app.footer(kExamples);
  app.set_version_flag("--version", std::string(kProgram) + " " + kVersion + ", sim_version " +
                                        std::to_string(kSimVersion));
  app.add_option("--only", options.only,
                 "only experiments whose name begins so; may be given several times")
      ->type_name("PREFIX");
  app.add_option("--out", options.out, "folder of report, results and scenarios")
      ->type_name("DIR")
      ->capture_default_str();
  app.add_option("--commit", options.commit, "of the source, for the report")->type_name("ID");
  app.add_flag("--short", options.is_short, "seconds: coarser meshes, fewer points");
  app.add_flag("--list", options.lists, "name the experiments and end");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    return trocar::report(kProgram,
                          {ErrorCode::Usage, std::string(error.what()) + " (see --help)"});
  }
  if (const auto set = log::configure(kProgram, "warn"); !set)
    return trocar::report(kProgram, set.error());
  std::string command = "deploy/validate";
  if (options.is_short) command += " --short";
  for (const auto& prefix : options.only) command += " --only " + prefix;
  return run_all(options, command);
}

}  // namespace
}  // namespace trocar::validation

int main(int argc, char** argv) {
  trocar::begin_program("trocar-validate");
  return trocar::validation::run(argc, argv);
}
