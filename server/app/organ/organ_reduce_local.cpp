#include "server/app/organ/organ_reduce_local.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "common/base/progress_line.h"
#include "common/base/text_file.h"
#include "server/app/organ/program_name.h"
#include "server/lab/reduce/local_quality.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/organs/organ/average_strain.h"
#include "server/organs/organ/local_reduction_file.h"

namespace trocar::app {
namespace {

using reduce::LocalErrors;
using reduce::LocalStage;

const char* name_of(LocalStage stage) {
  switch (stage) {
    case LocalStage::Greens:
      return "unit forces, node";
    case LocalStage::Presses:
      return "presses, place";
    case LocalStage::Patches:
      return "patches, patch";
  }
  return "";
}

// Refuses options of the other method, and takes those that both have with their own defaults.
Status take_settings(ReduceCommand& command) {
  for (const char* option : {"--places", "--magnitudes", "--radius", "--tangents", "--creep-nodes",
                             "--creep-seconds", "--influence", "--check-creep"})
    if (command.app->count(option) > 0)
      return Error{ErrorCode::Usage, std::string(option) + ": is of --method dogan"};
  auto& local = command.local;
  if (command.app->count("--modes") > 0) local.modes = command.settings.modes;
  if (command.app->count("--directions") > 0) local.directions = command.settings.directions;
  local.force_n = command.settings.force_n;
  local.seed = command.settings.seed;
  local.threads = command.settings.threads;
  local.patch_radius_m = command.patch_radius_mm * 1e-3;
  if (command.check_places > kMaxCheckPlaces)
    return Error{ErrorCode::Usage, "--check: at most " + std::to_string(kMaxCheckPlaces)};
  if (!(command.accepted_percent >= 0 && command.accepted_percent <= 1000))
    return Error{ErrorCode::Usage, "--accept-error: must be from 0 to 1000"};
  return reduce::validate(local);
}

void print_row(const char* what, const std::vector<double>& values) {
  const auto e = reduce::errors_of(values);
  std::printf("  %-20s%6.2f / %6.2f / %6.2f %%\n", what, 100 * e.mean, 100 * e.high, 100 * e.worst);
}

void print(const char* where, const LocalErrors& errors) {
  std::printf("%zu loads at %s: mean / 95 of 100 / worst\n", errors.field.size(), where);
  if (errors.unsolved > 0) std::printf("  no equilibrium      %zu\n", errors.unsolved);
  if (errors.field.empty()) return;
  print_row("L2", errors.field);
  print_row("contact, moves", errors.contact);
  print_row("contact, force", errors.force);
}

std::string csv_of(std::span<const reduce::LocalLoad> loads, const LocalErrors& trained,
                   const LocalErrors& unseen) {
  std::string text =
      "place,node,force_x_n,force_y_n,force_z_n,l2_percent,contact_percent,force_percent\n";
  std::size_t next[2] = {0, 0};
  for (const auto& load : loads) {
    const auto& errors = load.is_trained ? trained : unseen;
    const auto i = next[load.is_trained ? 0 : 1]++;
    if (errors.unsolved > 0 || i >= errors.force.size()) continue;
    char line[200];
    const auto& f = load.press.force_n;
    std::snprintf(line, sizeof line, "%s,%u,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g\n",
                  load.is_trained ? "trained" : "unseen", load.press.node.value, f.x, f.y, f.z,
                  100 * errors.field[i], 100 * errors.contact[i], 100 * errors.force[i]);
    text += line;
  }
  return text;
}

void print_patches(const organ::Organ& organ, const reduce::LocalBuilt& built) {
  const auto& r = built.reduction;
  std::size_t members = 0, inner = 0, cubature = 0;
  for (const auto& patch : r.patches) {
    members += patch.members.size();
    inner = std::max(inner, patch.inner_tets.size());
    cubature = std::max(cubature, patch.cubature.size());
  }
  std::printf("%s: %zu patches of %zu nodes, fields of %zu\n", organ.name.c_str(), r.patches.size(),
              members, r.greens.size());
  std::printf("  tets of a patch     at most %zu as they are, %zu weighted\n", inner, cubature);
  if (!built.residuals.empty())
    std::printf("  not linear beyond   at most %.1f %% of the forces, of which %.2g %% are left\n",
                100 * *std::ranges::max_element(built.nonlinear),
                100 * *std::ranges::max_element(built.residuals));
  if (built.failed > 0)
    std::printf("  left out            %zu presses without an equilibrium\n", built.failed);
}

// The larger of both groups' errors of force in all but 5 of 100 loads. A load that is not solved
// is as wrong as can be.
double force_error_of(const LocalErrors& trained, const LocalErrors& unseen) {
  if (trained.unsolved + unseen.unsolved > 0) return 1;
  return std::max(reduce::errors_of(trained.force).high, reduce::errors_of(unseen.force).high);
}

// Finds the reduction's force_error.
Status check(const organ::Organ& organ, reduce::LocalBuilt& built, const ReduceCommand& command,
             const std::filesystem::path& folder) {
  auto model = reduce::FullModel::create(organ);
  if (!model) return model.error();
  ProgressLine line(kProgram);
  const auto loads = reduce::solve_local_loads(
      **model, built, command.check_places, command.check_places,
      [&](std::size_t done, std::size_t all) { line.show("check, place", done, all); });
  if (loads.empty()) return {};
  const auto trained = errors_of_local(built.reduction, organ, loads, true);
  const auto unseen = errors_of_local(built.reduction, organ, loads, false);
  print("places of the training, under other forces", trained);
  print("places at least 8 mm from all of these", unseen);
  built.reduction.force_error = force_error_of(trained, unseen);
  const auto rate = reduce::rate_of_local(built.reduction, organ, loads.back().press);
  std::printf("  unknowns            %zu; a step of a press %.0f us, at worst %.0f us\n",
              unseen.largest.unknowns(), rate.median_us, rate.worst_us);
  return write_text_file(folder / "local.csv", csv_of(loads, trained, unseen));
}

// A reduction that is not true is refused; its parts stay, so that it can be had all the same.
Status accept(const reduce::LocalBuilt& built, const ReduceCommand& command,
              const std::string& out) {
  const double percent = 100 * built.reduction.force_error.value_or(0);
  if (percent <= command.accepted_percent) return {};
  char text[300];
  std::snprintf(text, sizeof text,
                ": is not written, for contact forces err by %.0f %% in 5 of 100 presses of its "
                "check, more than %.3g %%: make it with a smaller --force, or as it is with "
                "--resume --accept-error %.0f",
                percent, command.accepted_percent, std::ceil(percent));
  return Error{ErrorCode::Mismatch, out + text};
}

}  // namespace

Status run_reduce_local(ReduceCommand command) {
  if (auto s = take_settings(command); !s) return s;
  auto organ = catalogue::load_organ(command.organ);
  if (!organ) return organ.error();
  organ::use_plain_strain(*organ);  // as sessions with a reduction do
  const auto stem = std::filesystem::path(command.organ).stem().string();
  const std::filesystem::path folder =
      command.folder.empty() ? "out/reduce-" + stem : command.folder;
  const std::string out = command.out.empty() ? stem + ".reduction" : command.out;
  if (auto s = check_outputs(folder, out); !s) return s;
  command.local.parts = out + ".parts";
  if (!command.is_resumed && std::filesystem::exists(command.local.parts))
    return Error{ErrorCode::Usage, command.local.parts.string() +
                                       ": is left of an interrupted run: go on from it with "
                                       "--resume, or remove it"};
  ProgressLine line(kProgram);
  auto built = reduce::build_local(*organ, command.local,
                                   [&](LocalStage stage, std::size_t done, std::size_t all) {
                                     line.show(name_of(stage), done, all);
                                   });
  if (!built) return built.error();
  print_patches(*organ, *built);
  if (command.check_places > 0)
    if (auto s = check(*organ, *built, command, folder); !s) return s;
  if (auto s = accept(*built, command, out); !s) return s;
  if (auto s = organ::write_local_reduction(out, built->reduction); !s) return s;
  std::error_code ignored;
  std::filesystem::remove_all(command.local.parts, ignored);
  std::printf("%s, %ju bytes; tables in %s\n", out.c_str(),
              static_cast<std::uintmax_t>(std::filesystem::file_size(out, ignored)),
              folder.c_str());
  return {};
}

}  // namespace trocar::app
