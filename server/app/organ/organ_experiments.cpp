#include "server/app/organ/organ_experiments.h"

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>

#include "common/base/text_file.h"
#include "common/base/writable.h"
#include "common/plot/plot.h"
#include "server/app/organ/program_name.h"
#include "server/lab/fit/fit.h"
#include "server/lab/scenario/settle.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/organs/catalogue/part_file.h"
#include "server/organs/organ/organ_file.h"

namespace trocar::app {
namespace {

std::string to_csv(const fit::MeasuredCurve& measured, const fit::Fit& fit) {
  std::string text = "displacement_mm,measured_force_n,fitted_force_n\n";
  for (std::size_t i = 0; i < measured.points.size(); ++i) {
    char line[120];
    std::snprintf(line, sizeof line, "%.9g,%.9g,%.9g\n", measured.points[i].displacement_m * 1e3,
                  measured.points[i].force_n, fit.forces_n[i]);
    text += line;
  }
  return text;
}

plot::Plot to_plot(const fit::MeasuredCurve& measured, const fit::Fit& fit) {
  plot::Plot plot{.title = measured.source.filename().string() + " and the fitted material"};
  plot.x.label = "displacement (mm)";
  plot.y.label = "force (N)";
  plot.series = {{"fitted", {}, {}, plot::Style::Line, {}},
                 {"measured", {}, {}, plot::Style::Points, {}}};
  for (std::size_t i = 0; i < measured.points.size(); ++i) {
    for (auto& series : plot.series) series.x.push_back(measured.points[i].displacement_m * 1e3);
    plot.series[0].y.push_back(fit.forces_n[i]);
    plot.series[1].y.push_back(measured.points[i].force_n);
  }
  return plot;
}

void print_run(int run, const std::vector<fit::FittedParameter>& tried, double rms_n) {
  if (::isatty(STDERR_FILENO) == 0) return;
  std::fprintf(stderr, "%s: run %d:", kProgram, run);
  for (const auto& p : tried) std::fprintf(stderr, " %s %.6g", p.key.c_str(), p.value);
  std::fprintf(stderr, ", rms %.4g N\n", rms_n);
}

void print_fit(const fit::Fit& fit) {
  for (const auto& p : fit.parameters) {
    std::printf("%-22s %.6g", p.key.c_str(), p.value);
    if (p.standard_error && p.is_determined())
      std::printf(" +- %.2g", *p.standard_error);
    else if (p.standard_error)
      std::printf(" (not determined)");
    else
      std::printf(" (the data do not tell how exactly)");
    std::printf("  (started from %.6g)\n", p.start);
  }
  std::printf("residual               %.4g N rms, %.2f %% of the largest measured force\n",
              fit.rms_n, fit.rms_percent);
  std::printf("runs of the scenario   %d\n", fit.runs);
  std::fflush(stdout);
  for (const auto& remark : fit.remarks())
    std::fprintf(stderr, "%s: warning: %s\n", kProgram, remark.c_str());
  if (!fit.is_converged)
    std::fprintf(stderr, "%s: warning: the fit was still improving when it was ended\n", kProgram);
  if (fit.has_unconverged_steps)
    std::fprintf(stderr,
                 "%s: warning: not every step reached the tolerance: raise max_sweeps or "
                 "tolerance_n in [run]\n",
                 kProgram);
}

Result<organ::Organ> organ_to_settle(const std::string& spec) {
  if (std::filesystem::path(spec).extension() != ".toml" || catalogue::is_part_file(spec))
    return catalogue::load_organ(spec);
  auto parsed = scenario::parse_scenario(spec);
  if (!parsed) return parsed.error();
  auto resolved = scenario::resolve(std::move(*parsed));
  if (!resolved) return resolved.error();
  return std::move(resolved->organ);
}

}  // namespace

void add_fit_command(CLI::App& app, FitCommand& command) {
  auto* fit = app.add_subcommand(
      "fit",
      "fit a material to a measured force-displacement curve: a scenario that makes the same "
      "test is run again and again");
  fit->add_option("SCENARIO", command.scenario,
                  "scenario (.toml) that probes the reaction of a displaced set, or a tool's force")
      ->required();
  fit->add_option("CURVE", command.curve_file,
                  ".csv with the columns displacement_mm and force_n, and time_s to fit damping")
      ->required();
  fit->add_option("--parameters", command.parameters,
                  "what to fit, separated by commas: " + fit::fit_keys() +
                      " [the stiffness that the material has]")
      ->type_name("KEYS")
      ->delimiter(',');
  fit->add_option("--region", command.region, "fit the material of this region [the organ's own]")
      ->type_name("NAME");
  fit->add_option("--curve", command.curve,
                  "set or tool whose curve it is, if the scenario has several")
      ->type_name("NAME");
  fit->add_option("--out", command.out, "folder of the results [out/fit-<scenario's name>]")
      ->type_name("DIR");
  fit->add_option("--organ", command.organ,
                  "also write the scenario's organ with the fitted material")
      ->type_name("FILE");
}

Status run_fit(const FitCommand& command) {
  auto parsed = scenario::parse_scenario(command.scenario);
  if (!parsed) return parsed.error();
  const std::filesystem::path folder =
      command.out.empty() ? "out/fit-" + parsed->source.stem().string() : command.out;
  const auto resolved = scenario::resolve(std::move(*parsed));
  if (!resolved) return resolved.error();
  const auto measured = fit::read_measurements(command.curve_file);
  if (!measured) return measured.error();
  if (auto s = check_writable_folder(folder); !s) return s;
  if (!command.organ.empty()) {
    if (auto s = organ::check_organ_name(command.organ); !s) return s;
    if (auto s = check_writable(command.organ); !s) return s;
  }
  const fit::FitOptions options{command.parameters, command.region, command.curve,
                                scenario::Solver::Full};
  const auto fitted = fit::fit(*resolved, *measured, options, print_run);
  if (!fitted) return fitted.error();
  print_fit(*fitted);
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed)
    return Error{ErrorCode::ResourceMissing,
                 folder.string() + ": cannot be made (" + failed.message() + "), see --out"};
  if (auto s = write_text_file(folder / "material.toml", fit::to_toml(*fitted, options)); !s)
    return s;
  if (auto s = write_text_file(folder / "fit.csv", to_csv(*measured, *fitted)); !s) return s;
  if (!command.organ.empty())
    if (auto s = organ::write_organ(command.organ, fitted->organ); !s) return s;
  if (auto s = plot::write_svg(folder / "fit.svg", to_plot(*measured, *fitted)); !s) return s;
  std::printf("results in %s: material.toml, fit.csv, fit.svg%s%s\n", folder.c_str(),
              command.organ.empty() ? "" : "; the organ in ", command.organ.c_str());
  return {};
}

void add_settle_command(CLI::App& app, SettleCommand& command) {
  auto* settle = app.add_subcommand(
      "settle", "let an organ come to rest under gravity and tension, and make that its rest pose");
  settle
      ->add_option(
          "ORGAN", command.organ,
          ".organ or .msh file, a built-in organ's name, or a scenario (.toml) whose organ "
          "and materials it is")
      ->required();
  settle
      ->add_option("--gravity", command.gravity,
                   "x,y,z in m/s^2, y is up [the organ's, else 0,-9.81,0]")
      ->type_name("X,Y,Z")
      ->delimiter(',')
      ->expected(3);
  settle->add_option("-o,--out", command.out, "file to write [<organ>-settled.organ, here]")
      ->type_name("FILE");
}

Status run_settle(const SettleCommand& command) {
  const auto organ = organ_to_settle(command.organ);
  if (!organ) return organ.error();
  Vec3d gravity = organ->gravity_m_s2;
  if (!command.gravity.empty())
    gravity = {command.gravity[0], command.gravity[1], command.gravity[2]};
  else if (length(gravity) == 0)
    gravity = {0, -9.81, 0};
  if (!is_finite(gravity) || length(gravity) > 1000)
    return Error{ErrorCode::Usage, "--gravity must be finite and at most 1000 m/s^2"};
  const std::string path =
      command.out.empty() ? std::filesystem::path(command.organ).stem().string() + "-settled.organ"
                          : command.out;
  if (auto s = organ::check_organ_name(path); !s) return s;
  if (auto s = check_writable(path); !s) return s;
  const auto settled = scenario::settle(*organ, gravity);
  if (!settled) return settled.error();
  if (auto s = organ::write_organ(path, settled->organ); !s) return s;
  std::printf(
      "%s: nodes moved by %.3g mm at most, %.3g mm on average; %u sweeps, %.2g N out of "
      "balance\n",
      organ->name.c_str(), settled->largest_move_m * 1e3, settled->mean_move_m * 1e3,
      settled->sweeps, static_cast<double>(settled->residual_n));
  std::printf("the settled organ is in %s\n", path.c_str());
  return {};
}

}  // namespace trocar::app
