#include "server/app/organ/organ_calibrate.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>

#include "common/base/program.h"
#include "common/base/progress_line.h"
#include "common/base/text_file.h"
#include "common/base/timing.h"
#include "common/command_line/limits.h"
#include "common/plot/plot.h"
#include "server/app/organ/organ_reduce.h"
#include "server/app/organ/program_name.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/organs/organ/organ_file.h"

namespace trocar::app {
namespace {

calibration::Progress progress_of(const char* stage) {
  return [stage, line = ProgressLine(kProgram)](std::size_t done, std::size_t all) mutable {
    line.show(stage, done, all);
  };
}

std::string limit_text(const std::optional<std::uint32_t>& limit, const char* unit = "") {
  return limit ? std::to_string(*limit) + unit : "none";
}

std::string table_csv(const organ::DepthTable& table) {
  std::string text =
      "force_up_to_n,frozen_nodes,frozen_error_percent,graded_depth,graded_error_percent\n";
  for (const auto& row : table.rows) {
    char line[160];
    std::snprintf(line, sizeof line, "%.9g,%s,%.6g,%s,%.6g\n", row.force_n,
                  limit_text(row.frozen_nodes).c_str(), 100 * row.frozen_error,
                  limit_text(row.graded_depth).c_str(), 100 * row.graded_error);
    text += line;
  }
  return text;
}

std::string check_csv(const std::vector<calibration::Check>& checks) {
  std::string text =
      "force_up_to_n,places,graded_mean_percent,graded_largest_percent,graded_nodes,"
      "frozen_places,frozen_mean_percent,frozen_largest_percent,frozen_nodes\n";
  for (const auto& c : checks) {
    char line[200];
    std::snprintf(line, sizeof line, "%.9g,%zu,%.6g,%.6g,%.0f,%zu,%.6g,%.6g,%.0f\n", c.force_n,
                  c.places, 100 * c.graded_mean, 100 * c.graded_largest, c.graded_nodes,
                  c.frozen_places, 100 * c.frozen_mean, 100 * c.frozen_largest, c.frozen_nodes);
    text += line;
  }
  return text;
}

// Error over limit, one curve per range of force: the mean over places.
plot::Plot to_plot(const calibration::Calibration& calibration, double error) {
  plot::Plot plot{.title = "Contact force with a limit of nodes, the rest at rest"};
  plot.x = {"limit of nodes", true};
  plot.y = {"error of the contact force (%)", true};
  std::vector<double> limits;
  for (const auto& row : calibration.table.rows) {
    char name[40];
    std::snprintf(name, sizeof name, "up to %g N", row.force_n);
    plot::Series series{name, {}, {}, plot::Style::LineAndPoints, {}};
    std::map<std::uint32_t, std::pair<double, int>> sums;
    for (const auto& finding : calibration.findings)
      if (finding.force_n == row.force_n)
        for (const auto& tried : finding.frozen) {
          sums[tried.limit].first += tried.error;
          ++sums[tried.limit].second;
        }
    for (const auto& [limit, sum] : sums) {
      series.x.push_back(limit);
      series.y.push_back(100 * sum.first / sum.second);
      limits.push_back(limit);
    }
    if (!series.x.empty()) plot.series.push_back(std::move(series));
  }
  if (!limits.empty())
    plot.series.push_back({"asked for",
                           {std::ranges::min(limits), std::ranges::max(limits)},
                           {100 * error, 100 * error},
                           plot::Style::Dashed,
                           {}});
  return plot;
}

void print_table(const calibration::Calibration& calibration) {
  std::printf("  %-14s %24s %24s\n", "force, up to", "frozen needs (error)",
              "graded needs (error)");
  for (const auto& row : calibration.table.rows)
    std::printf("  %8.3g N     %14s (%5.1f %%) %14s (%5.1f %%)\n", row.force_n,
                limit_text(row.frozen_nodes, " nodes").c_str(), 100 * row.frozen_error,
                limit_text(row.graded_depth, " layers").c_str(), 100 * row.graded_error);
}

void print_reference(const calibration::Reference& reference) {
  std::printf("reference: %s\n", reference.convergence.words().c_str());
  std::printf("reference: own error %.3g %%, by a tolerance %g times larger%s\n",
              100 * reference.own_error, calibration::kLooser,
              reference.own_error <= reference.allowed_error
                  ? ""
                  : ", which is more than a tenth of --error");
  if (reference.places_missed > 0)
    std::printf("reference: LEFT OUT: %zu sites, where it did not reach its tolerance\n",
                reference.places_missed);
}

void print_check(const calibration::Checks& checks) {
  std::printf("at other sites, slower and aslant, with what is chosen from the force:\n");
  print_reference(checks.reference);
  for (const auto& c : checks.ranges) {
    if (c.places == 0) continue;
    std::printf("  %8.3g N     graded %4.1f %% (largest %4.1f %%, %.0f nodes)", c.force_n,
                100 * c.graded_mean, 100 * c.graded_largest, c.graded_nodes);
    if (c.frozen_places > 0)
      std::printf(", frozen %4.1f %% (largest %4.1f %%, %.0f nodes)", 100 * c.frozen_mean,
                  100 * c.frozen_largest, c.frozen_nodes);
    std::printf("\n");
  }
}

}  // namespace

void add_calibrate_command(CLI::App& app, CalibrateCommand& command) {
  auto* sub = app.add_subcommand(
      "calibrate",
      "measure how much of an organ must move for a contact of a given force, and keep it in the "
      "organ's file, by which a server then decides");
  sub->add_option("ORGAN", command.organ, ".organ or .msh file, or a built-in organ's name")
      ->required();
  sub->add_option("-o,--out", command.out, "organ file to write [<organ>-calibrated.organ, here]")
      ->type_name("FILE");
  sub->add_option("--results", command.folder,
                  "folder of the tables and the plot [out/calibrate-<organ>]")
      ->type_name("DIR");
  sub->add_option("--error", command.error_percent, "error of the contact force that may remain, %")
      ->type_name("PERCENT")
      ->capture_default_str();
  sub->add_option("--places", command.settings.places, "sites of the surface to press")
      ->type_name("N")
      ->capture_default_str();
  sub->add_option("--seed", command.settings.seed, "draws the first site")
      ->type_name("S")
      ->capture_default_str();
  sub->add_option("--radius", command.radius_mm,
                  "of the round tip, 0.5 to 50 mm [3.2 edges of the surface]")
      ->type_name("MM");
  sub->add_option("--depth", command.depth_mm, "of the deepest press, mm")
      ->type_name("MM")
      ->capture_default_str();
  sub->add_option("--check", command.check_places,
                  "other sites at which the result is tried out, 0: none")
      ->type_name("N")
      ->capture_default_str();
  sub->add_option("--workers", command.settings.workers, "threads that share a tick's work")
      ->check(command_line::whole_from_to(1u, kMaxWorkers))
      ->capture_default_str();
}

Status run_calibrate(CalibrateCommand command) {
  auto& settings = command.settings;
  settings.error = command.error_percent / 100;
  if (command.radius_mm) settings.radius_m = *command.radius_mm * 1e-3;
  settings.depth_m = command.depth_mm * 1e-3;
  if (auto s = calibration::validate(settings); !s) return s;
  auto organ = catalogue::load_organ(command.organ);
  if (!organ) return organ.error();
  if (auto s = calibration::check_held(*organ); !s) return s;
  const auto stem = std::filesystem::path(command.organ).stem().string();
  const std::filesystem::path folder =
      command.folder.empty() ? "out/calibrate-" + stem : command.folder;
  const std::string out = command.out.empty() ? stem + "-calibrated.organ" : command.out;
  if (auto s = organ::check_organ_name(out); !s) return s;
  if (auto s = check_outputs(folder, out); !s) return s;

  const auto begin = monotonic_ns();
  const auto cpu = thread_cpu_ns();
  const auto found = calibration::calibrate(*organ, settings, progress_of("pressing, site"));
  if (found.table.empty())
    return Error{ErrorCode::BadFile,
                 command.organ +
                     ": no site could be pressed until the reference converged, try "
                     "another --radius or --seed"};
  const double wall_s = static_cast<double>(monotonic_ns() - begin) * 1e-9;
  const double cpu_s = static_cast<double>(thread_cpu_ns() - cpu) * 1e-9;
  const auto plain_bytes = organ::pack_organ(*organ).size();
  organ->depth_table = found.table;
  if (auto s = organ::write_organ(out, *organ); !s) return s;
  std::printf("%s: %u sites pressed %.1f mm deep with a tip of %.1f mm, %zu left out\n",
              organ->name.c_str(), found.table.places, command.depth_mm,
              found.table.tool_radius_m * 1e3, found.places_left_out);
  print_reference(found.reference);
  print_table(found);
  if (auto s = write_text_file(folder / "table.csv", table_csv(found.table)); !s) return s;
  if (auto s = write_text_file(folder / "places.csv", calibration::to_csv(found)); !s) return s;
  if (auto s = plot::write_svg(folder / "errors.svg", to_plot(found, settings.error)); !s) return s;
  if (command.check_places > 0) {
    const auto checks = calibration::check(*organ, found.table, settings, command.check_places,
                                           progress_of("checking, site"));
    print_check(checks);
    if (auto s = write_text_file(folder / "check.csv", check_csv(checks.ranges)); !s) return s;
  }
  std::printf("%.0f s (%.0f s of CPU time of one thread) for %llu ticks; %zu bytes more in %s\n",
              wall_s, cpu_s, static_cast<unsigned long long>(found.ticks),
              organ::pack_organ(*organ).size() - plain_bytes, out.c_str());
  std::printf("tables and plot in %s\n", folder.c_str());
  return {};
}

}  // namespace trocar::app
