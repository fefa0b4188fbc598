// trocar-validate: runs the validation experiments and writes report.html and results.json.

#include <spdlog/fmt/fmt.h>
#include <sys/utsname.h>
#include <CLI/CLI.hpp>

#include <cstdio>
#include <ctime>
#include <fstream>

#include "common/base/cpu.h"
#include "common/base/log.h"
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

Exit codes: 0 every bound kept, 1 a bound is not kept, 2 command line, 3 a scenario cannot run, 5
cannot write, or gnuplot is missing.
)";

struct Options {
  std::string only;
  std::filesystem::path out = "out/validate";
  bool is_short = false;
  bool lists = false;
};

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

Section run_one(const Lab& lab, const Experiment& experiment) {
  Section section{.name = experiment.name, .title = experiment.title, .source = experiment.source};
  show_progress(experiment.name);
  const auto begin = thread_cpu_ns();
  experiment.run(lab, section);
  section.seconds = static_cast<double>(thread_cpu_ns() - begin) * 1e-9;
  show_progress("");
  std::size_t kept = 0;
  for (const auto& check : section.checks) kept += check.is_kept() ? 1u : 0u;
  std::printf("%s%-36s %3zu of %zu kept %8.1f s\n", kept == section.checks.size() ? "  " : "! ",
              experiment.name, kept, section.checks.size(), section.seconds);
  for (const auto& check : section.checks)
    if (!check.is_kept())
      std::printf("    not kept: %s: expected %s, ours %s, error %.3g, bound %.3g\n",
                  check.name.c_str(), check.expected.c_str(), check.ours.c_str(), check.error,
                  check.bound);
  std::fflush(stdout);
  return section;
}

Status write_report(const Options& options, const Report& report) {
  if (auto s = write_file(options.out / "results.json", to_json(report.sections)); !s) return s;
  const auto html = to_html(report);
  if (!html) return html.error();
  return write_file(options.out / "report.html", *html);
}

int run_all(const Options& options, const std::string& command) {
  if (options.lists) {
    for (const auto& experiment : experiments())
      std::printf("%-36s %s\n", experiment.name, experiment.title);
    return 0;
  }
  std::error_code failed;
  std::filesystem::create_directories(options.out / "scenarios", failed);
  if (failed)
    return trocar::report(kProgram,
                          {ErrorCode::ResourceMissing, options.out.string() + ": cannot be made (" +
                                                           failed.message() + "), see --out"});
  const Lab lab(options.out, options.is_short);
  Report report{
      .machine = fmt::format("{}, g++ {}, sim_version {}", processor(), __VERSION__, kSimVersion),
      .command = command,
      .date = today(),
      .is_short = options.is_short};
  for (const auto& experiment : experiments()) {
    if (!std::string(experiment.name).starts_with(options.only)) continue;
    report.sections.push_back(run_one(lab, experiment));
    // Written again after each: who stops the program has what was done until then.
    if (auto s = write_report(options, report); !s) return trocar::report(kProgram, s.error());
  }
  if (report.sections.empty())
    return trocar::report(kProgram, {ErrorCode::Usage, "--only: '" + options.only +
                                                           "' begins no experiment, see --list"});
  std::size_t checks = 0, kept = 0;
  for (const auto& section : report.sections)
    for (const auto& check : section.checks) {
      ++checks;
      kept += check.is_kept() ? 1u : 0u;
    }
  std::printf("%zu of %zu bounds kept; %s\n", kept, checks,
              (options.out / "report.html").string().c_str());
  return static_cast<int>(kept == checks ? ExitCode::Ok : ExitCode::Mismatch);
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
  app.add_option("--only", options.only, "only experiments whose name begins so")
      ->type_name("PREFIX");
  app.add_option("--out", options.out, "folder of report, results and scenarios")
      ->type_name("DIR")
      ->capture_default_str();
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
  if (!options.only.empty()) command += " --only " + options.only;
  return run_all(options, command);
}

}  // namespace
}  // namespace trocar::validation

int main(int argc, char** argv) {
  trocar::require_cpu_features("trocar-validate");
  return trocar::validation::run(argc, argv);
}
