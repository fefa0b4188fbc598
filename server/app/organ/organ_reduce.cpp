#include "server/app/organ/organ_reduce.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "common/base/progress_line.h"
#include "common/base/text_file.h"
#include "common/base/timing.h"
#include "common/base/writable.h"
#include "common/plot/plot.h"
#include "server/app/organ/program_name.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/organs/organ/average_strain.h"
#include "server/papers/dogan/quality.h"
#include "server/papers/reduction/reduction_file.h"

namespace trocar::app {
namespace {

constexpr std::size_t kMaxCheckPlaces = 500;

using dogan::Quality;
using dogan::Stage;

constexpr const char* kHelp = R"(
Dogan 2011: a few Karhunen-Loeve modes of the whole organ and a constant tangent. What it does
(sections on model reduction and results):
  1. The full model (off-line solver, linear tets) is pressed at --places of the surface, in
     --directions, with forces up to --force. Each solution is a snapshot.
  2. The snapshots' first --modes Karhunen-Loeve modes B are the reduced model's unknowns.
  3. B^T K B xi = B^T f is the reduced model: K is the tissue's tangent at rest or, of the tangents
     at --tangents of the snapshots, the one whose solution errs least over the training.
  4. For creep, --creep-nodes of the surface are held under --force for --creep-seconds; the
     displacement at once is scaled by the growth around the nearest of them.
  Expect errors of tens of per cent, and more at the loaded node: the reduced model is linear,
  tissue is not, and a press is local. More modes do not cure it.

It is compared with the full model on loads outside the training.

Examples:
  trocar-organ reduce liver
      8 modes from 360 snapshots, into liver.reduction; some minutes
  trocar-organ reduce liver --modes 64 --places 100 --threads 2 -o liver-64.reduction
      more modes, a denser training
  trocar-organ reduce liver --places 6 --directions 1 --creep-nodes 0
      a quick try without creep
)";

const char* name_of(Stage stage) {
  switch (stage) {
    case Stage::Snapshots:
      return "snapshots, press";
    case Stage::Tangents:
      return "tangents, state";
    case Stage::Creep:
      return "creep, node";
    case Stage::Check:
      return "check, site";
  }
  return "";
}

dogan::Progress make_progress() {
  return [line = ProgressLine(kProgram)](Stage stage, std::size_t done, std::size_t all) mutable {
    line.show(name_of(stage), done, all);
  };
}

struct Outcome {
  dogan::Training training;
  dogan::Built built;
  dogan::UnseenLoads unseen;
  std::vector<Quality> qualities;  // by number of modes; the last is of all
  std::vector<dogan::CreepCheck> creep;
  double snapshot_s = 0, solve_us = 0;  // of one full and of one reduced solution
};

std::vector<std::size_t> mode_counts(std::size_t all) {
  std::vector<std::size_t> counts;
  for (std::size_t n = 1; n < all; n *= 2) counts.push_back(n);
  counts.push_back(all);
  return counts;
}

double time_solve_us(const reduction::Reduction& reduced, const organ::Organ& organ,
                     const dogan::Press& press) {
  const dogan::ReducedModel model(reduced, dogan::TangentChoice::Best);
  const auto forces = dogan::node_forces(organ, press);
  constexpr int kTimes = 1000;
  double sum = 0;
  const auto begin = thread_cpu_ns();
  for (int i = 0; i < kTimes; ++i) sum += model.solve(forces)[0];
  const double ns = static_cast<double>(thread_cpu_ns() - begin);
  return std::isfinite(sum) ? ns * 1e-3 / kTimes : 0;
}

// How much there is to do, before it is begun.
void announce(const ReduceCommand& command) {
  const auto& s = command.settings;
  const std::size_t times = dogan::creep_times(s.creep_s).size();
  std::fprintf(stderr,
               "%s: up to %zu full solutions for snapshots, %zu for creep, %zu to check the "
               "result\n",
               kProgram, s.places * s.directions * s.magnitudes, s.creep_nodes * times,
               2 * command.check_places + command.check_creep * times);
}

Result<Outcome> reduce(const organ::Organ& organ, const ReduceCommand& command) {
  auto model = dogan::FullModel::create(organ, command.settings.threads);
  if (!model) return model.error();
  announce(command);
  const auto progress = make_progress();
  Outcome outcome;
  const auto begin = thread_cpu_ns();
  outcome.training = dogan::train(**model, command.settings, progress);
  outcome.snapshot_s = static_cast<double>(thread_cpu_ns() - begin) * 1e-9 /
                       static_cast<double>(std::max<std::size_t>(
                           1, outcome.training.snapshots.size() + outcome.training.failed));
  auto built = dogan::reduce(**model, outcome.training, command.settings, progress);
  if (!built) return built.error();
  outcome.built = std::move(*built);
  auto& reduced = outcome.built.reduction;
  dogan::add_creep(**model, command.settings, reduced, progress);
  outcome.solve_us = time_solve_us(reduced, organ, outcome.training.snapshots.front().press);
  if (command.check_places == 0) return outcome;
  outcome.unseen = dogan::solve_unseen(**model, outcome.training, command.settings,
                                       command.check_places, progress);
  if (outcome.unseen.loads.empty()) return outcome;
  for (const auto modes : mode_counts(reduced.mode_count()))
    outcome.qualities.push_back(dogan::quality_of(reduced, organ, outcome.unseen.loads, modes));
  for (std::size_t i = 0; i < command.check_creep && !reduced.creep.empty(); ++i) {
    const std::size_t at = 2 * i + 1;  // the larger force of a place
    if (at >= outcome.unseen.loads.size()) break;
    if (auto check = dogan::check_creep(**model, reduced, outcome.unseen.loads[at].press))
      outcome.creep.push_back(std::move(*check));
    progress(Stage::Creep, i + 1, command.check_creep);
  }
  return outcome;
}

std::string percent(const dogan::Errors& e) {
  char text[80];
  std::snprintf(text, sizeof text, "%5.1f / %5.1f / %5.1f %%", 100 * e.mean, 100 * e.high,
                100 * e.worst);
  return text;
}

void print_press(const char* what, const dogan::Press& press) {
  const Vec3d& f = press.force_n;
  std::printf("%s node %u under %.3g %.3g %.3g N", what, press.node.value, f.x, f.y, f.z);
}

void print(const organ::Organ& organ, const Outcome& outcome) {
  const auto& r = outcome.built.reduction;
  double kept = 0;
  for (const double value : r.eigenvalues_m2) kept += value;
  std::printf("%s: %zu modes of %u snapshots hold %.2f %% of what they move\n", organ.name.c_str(),
              r.mode_count(), r.snapshot_count, 100 * kept / r.eigenvalue_sum_m2);
  if (outcome.training.failed > 0)
    std::printf("  left out            %zu presses without an equilibrium\n",
                outcome.training.failed);
  std::printf("  training            initial tangent errs by %.1f %%, the best of %zu by %.1f %%\n",
              100 * outcome.built.initial_error, outcome.built.tried.size() + 1,
              100 * outcome.built.best_error);
  if (outcome.built.best_at) {
    print_press("  best tangent        at the snapshot of", *outcome.built.best_at);
    std::printf("\n");
  }
  if (outcome.built.indefinite > 0)
    std::printf("  refused             %zu tangents that are not positive definite\n",
                outcome.built.indefinite);
  std::printf("  creep               %zu nodes, %zu times to %.4g s; between nodes: the nearest\n",
              r.creep.size(), r.creep_times_s.size(),
              r.creep_times_s.empty() ? 0 : r.creep_times_s.back());
  std::printf("  time of a solution  %.2f us reduced, %.2f s full\n", outcome.solve_us,
              outcome.snapshot_s);
  if (outcome.qualities.empty()) return;
  const auto& q = outcome.qualities.back();
  std::printf(
      "%zu loads outside the training: mean / 95 of 100 / worst (Dogan 2011: 22 and 17 %%)\n",
      outcome.unseen.loads.size());
  std::printf("  L2, modes at best   %s\n", percent(q.projection).c_str());
  std::printf("  L2, initial         %s\n", percent(q.initial.field).c_str());
  std::printf("  L2, best            %s\n", percent(q.best.field).c_str());
  std::printf("  contact, initial    %s, moves %.2f times as far\n",
              percent(q.initial.contact).c_str(), q.initial.contact_ratio);
  std::printf("  contact, best       %s, moves %.2f times as far\n",
              percent(q.best.contact).c_str(), q.best.contact_ratio);
  for (const auto& c : outcome.creep)
    std::printf(
        "  creep, node %-6u  L2 %.1f %% at once, %.1f %% after %.4g s; of the scaling alone %.1f "
        "%%\n",
        c.press.node.value, 100 * c.field_errors.front(), 100 * c.field_errors.back(),
        c.times_s.back(), 100 * c.scaling_errors.back());
}

std::string modes_csv(const Outcome& outcome) {
  std::string text =
      "modes,eigenvalue_m2,projection_mean_percent,initial_mean_percent,initial_95_percent,"
      "initial_worst_percent,best_mean_percent,best_95_percent,best_worst_percent,"
      "initial_contact_mean_percent,best_contact_mean_percent\n";
  const auto& r = outcome.built.reduction;
  for (const auto& q : outcome.qualities) {
    char line[240];
    std::snprintf(line, sizeof line, "%zu,%.9g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g\n",
                  q.modes, r.eigenvalues_m2[q.modes - 1], 100 * q.projection.mean,
                  100 * q.initial.field.mean, 100 * q.initial.field.high,
                  100 * q.initial.field.worst, 100 * q.best.field.mean, 100 * q.best.field.high,
                  100 * q.best.field.worst, 100 * q.initial.contact.mean,
                  100 * q.best.contact.mean);
    text += line;
  }
  return text;
}

std::string loads_csv(const Outcome& outcome) {
  std::string text =
      "node,force_x_n,force_y_n,force_z_n,initial_percent,best_percent,initial_contact_percent,"
      "best_contact_percent\n";
  for (std::size_t i = 0; i < outcome.unseen.loads.size(); ++i) {
    const auto& [node, f, radius] = outcome.unseen.loads[i].press;
    const auto& q = outcome.qualities.back();
    char line[200];
    std::snprintf(line, sizeof line, "%u,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g\n", node.value, f.x,
                  f.y, f.z, 100 * q.initial.field_errors[i], 100 * q.best.field_errors[i],
                  100 * q.initial.contact_errors[i], 100 * q.best.contact_errors[i]);
    text += line;
  }
  return text;
}

std::string creep_csv(const Outcome& outcome) {
  std::string text = "node,time_s,full_mm,reduced_mm,l2_percent,scaling_l2_percent\n";
  for (const auto& c : outcome.creep)
    for (std::size_t i = 0; i < c.times_s.size(); ++i) {
      char line[160];
      std::snprintf(line, sizeof line, "%u,%.6g,%.6g,%.6g,%.6g,%.6g\n", c.press.node.value,
                    c.times_s[i], 1e3 * c.full_m[i], 1e3 * c.reduced_m[i], 100 * c.field_errors[i],
                    100 * c.scaling_errors[i]);
      text += line;
    }
  return text;
}

plot::Plot errors_plot(const Outcome& outcome) {
  plot::Plot plot{.title = "Loads outside the training"};
  plot.x = {"modes", true, {}, {}};
  plot.y = {"L2 error, mean (%)", false, 0.0, {}};
  plot.series = {{"best that the modes can show", {}, {}, plot::Style::LineAndPoints, {}},
                 {"initial tangent", {}, {}, plot::Style::LineAndPoints, {}},
                 {"best tangent", {}, {}, plot::Style::LineAndPoints, {}}};
  for (const auto& q : outcome.qualities) {
    const double values[]{q.projection.mean, q.initial.field.mean, q.best.field.mean};
    for (std::size_t i = 0; i < 3; ++i) {
      plot.series[i].x.push_back(static_cast<double>(q.modes));
      plot.series[i].y.push_back(100 * values[i]);
    }
  }
  return plot;
}

plot::Plot creep_plot(const Outcome& outcome) {
  plot::Plot plot{.title = "Creep of the loaded node"};
  plot.x = {"time (s)", false, {}, {}};
  plot.y = {"displacement (mm)", false, 0.0, {}};
  for (std::size_t i = 0; i < outcome.creep.size(); ++i) {
    const auto& c = outcome.creep[i];
    const auto name = "node " + std::to_string(c.press.node.value);
    const auto add = [&](const char* what, const std::vector<double>& metres, plot::Style style) {
      plot::Series series{name + what, c.times_s, {}, style, static_cast<int>(i)};
      for (const double m : metres) series.y.push_back(1e3 * m);
      plot.series.push_back(std::move(series));
    };
    add(", full", c.full_m, plot::Style::Line);
    add(", reduced", c.reduced_m, plot::Style::Dashed);
  }
  return plot;
}

Status write_results(const std::filesystem::path& folder, const Outcome& outcome) {
  if (outcome.qualities.empty()) return {};
  if (auto s = write_text_file(folder / "modes.csv", modes_csv(outcome)); !s) return s;
  if (auto s = write_text_file(folder / "loads.csv", loads_csv(outcome)); !s) return s;
  if (auto s = plot::write_svg(folder / "errors.svg", errors_plot(outcome)); !s) return s;
  if (outcome.creep.empty()) return {};
  if (auto s = write_text_file(folder / "creep.csv", creep_csv(outcome)); !s) return s;
  return plot::write_svg(folder / "creep.svg", creep_plot(outcome));
}

Status validate(const ReduceCommand& command) {
  if (command.check_places > kMaxCheckPlaces)
    return Error{ErrorCode::Usage, "--check: at most " + std::to_string(kMaxCheckPlaces)};
  if (command.check_creep > command.check_places)
    return Error{ErrorCode::Usage, "--check-creep: at most as many as --check"};
  return dogan::validate(command.settings);
}

}  // namespace

Status check_outputs(const std::filesystem::path& folder, const std::string& out) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed)
    return Error{ErrorCode::ResourceMissing,
                 folder.string() + ": cannot be made (" + failed.message() + "), see --results"};
  return check_writable(out);
}

void add_reduce_command(CLI::App& app, ReduceCommand& command) {
  auto* sub = app.add_subcommand(
      "reduce",
      "make a reduced model of an organ: a few modes that are solved in microseconds, with creep");
  sub->footer(kHelp);
  sub->add_option("ORGAN", command.organ, ".organ or .msh file, or a built-in organ's name")
      ->required();
  auto& s = command.settings;
  const auto number = [&](const char* name, auto& value, const char* what, const char* unit) {
    sub->add_option(name, value, what)->type_name(unit)->capture_default_str();
  };
  number("--modes", s.modes, "unknowns of the reduced model, 1 to 64", "N");
  sub->add_option("-o,--out", command.out, "file to write [<organ>.reduction, here]")
      ->type_name("FILE");
  sub->add_option("--results", command.folder,
                  "folder of the comparison with the full model [out/reduce-<organ>]")
      ->type_name("DIR");
  number("--places", s.places, "sites of the surface that are pressed", "N");
  number("--directions", s.directions,
         "of the force at each site: straight, aslant, every fifth pulls", "N");
  number("--magnitudes", s.magnitudes, "of the force in each direction, equal parts", "N");
  number("--force", s.force_n, "the largest", "NEWTON");
  number("--radius", command.radius_mm, "of the patch that is pressed; 0: single nodes", "MM");
  number("--tangents", s.tangents, "at snapshots that are tried beside the one at rest", "N");
  number("--creep-nodes", s.creep_nodes, "whose creep is kept; 0: none", "N");
  number("--creep-seconds", s.creep_s, "how long", "S");
  number("--influence", command.influence_mm,
         "radius around them in which nodes have a growth of their own", "MM");
  number("--check", command.check_places,
         "sites outside the training at which the result is compared; 0: none", "N");
  number("--check-creep", command.check_creep, "of these at which creep is compared, too", "N");
  number("--seed", s.seed, "chooses the first site", "S");
  number("--threads", s.threads, "of the full model", "N");
}

Status run_reduce(ReduceCommand command) {
  command.settings.radius_m = command.radius_mm * 1e-3;
  command.settings.influence_m = command.influence_mm * 1e-3;
  if (auto s = validate(command); !s) return s;
  auto organ = catalogue::load_organ(command.organ);
  if (!organ) return organ.error();
  organ::use_plain_strain(*organ);
  const auto stem = std::filesystem::path(command.organ).stem().string();
  const std::filesystem::path folder =
      command.folder.empty() ? "out/reduce-" + stem : command.folder;
  const std::string out = command.out.empty() ? stem + ".reduction" : command.out;
  if (auto c = check_outputs(folder, out); !c) return c;
  const auto outcome = reduce(*organ, command);
  if (!outcome) return outcome.error();
  if (auto s = reduction::write_reduction(out, outcome->built.reduction); !s) return s;
  print(*organ, *outcome);
  std::error_code ignored;
  std::printf("%s, %ju bytes; tables and plots in %s\n", out.c_str(),
              static_cast<std::uintmax_t>(std::filesystem::file_size(out, ignored)),
              folder.c_str());
  return write_results(folder, *outcome);
}

}  // namespace trocar::app
