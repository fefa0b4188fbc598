#include "server/app/organ/organ_identify.h"

#include <cstdio>
#include <filesystem>

#include "common/base/text_file.h"
#include "common/command_line/limits.h"
#include "server/app/organ/program_name.h"
#include "server/lab/fit/csv_table.h"
#include "server/lab/fit/identify_report.h"

namespace trocar::app {
namespace {

// "g:tau".
Result<material::PronyTerm> parse_term(const std::string& text) {
  const auto colon = text.find(':');
  const auto weight = fit::number_of(std::string_view(text).substr(0, colon));
  const auto time_s = colon == std::string::npos
                          ? std::nullopt
                          : fit::number_of(std::string_view(text).substr(colon + 1));
  if (!weight || !time_s)
    return Error{ErrorCode::Usage, "--start: '" + text + "' is no weight:seconds, write 0.5:0.6"};
  return material::PronyTerm{*weight, *time_s};
}

void print_iteration(int iteration, double rms_percent) {
  std::fprintf(stderr, "%s: iteration %d: rms %.4g %%\n", kProgram, iteration, rms_percent);
}

Status write_results(const std::filesystem::path& folder, const std::vector<fit::TestCurve>& curves,
                     const fit::Identification& found) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed)
    return Error{ErrorCode::ResourceMissing,
                 folder.string() + ": cannot be made (" + failed.message() + "), see --out"};
  if (auto s = write_text_file(folder / "material.toml", to_toml(found)); !s) return s;
  if (auto s = write_text_file(folder / "identify.csv", to_csv(curves, found)); !s) return s;
  if (auto s = plot::write_svg(folder / "time.svg", plot_over_time(curves, found)); !s) return s;
  return plot::write_svg(folder / "stretch.svg", plot_over_stretch(curves, found));
}

}  // namespace

void add_identify_command(CLI::App& app, IdentifyCommand& command) {
  auto* identify = app.add_subcommand(
      "identify",
      "constants of a measured material (C_i0, g_k, tau_k) from force curves of specimens, loading "
      "and relaxation");
  identify
      ->add_option("CURVES", command.curves,
                   ".csv with the columns time_s, displacement_mm, force_n, and test and curve if "
                   "there are several")
      ->required();
  identify->add_option("--length-mm", command.length_mm, "of the specimen at rest")
      ->type_name("MM")
      ->required();
  identify->add_option("--area-mm2", command.area_mm2, "of its section at rest")
      ->type_name("MM2")
      ->required();
  identify
      ->add_option("--test", command.size.test,
                   "of rows that do not say: tension, compression, equibiaxial (also the apex of "
                   "aspirated tissue) or shear")
      ->type_name("TEST")
      ->capture_default_str();
  identify->add_option("--order", command.options.order, "number of C_i0, 1 to 5")
      ->type_name("N")
      ->capture_default_str();
  identify->add_option("--terms", command.options.term_count, "of relaxation, 0 to 4")
      ->type_name("K")
      ->capture_default_str();
  identify
      ->add_option("--start", command.start,
                   "weights and times of relaxation to start from, instead of --terms")
      ->type_name("G:TAU_S,...")
      ->delimiter(',');
  identify->add_option("--bulk-ratio", command.options.bulk_ratio, "bulk modulus over C10")
      ->type_name("RATIO")
      ->capture_default_str();
  identify
      ->add_option("--form", command.form,
                   "unsplit: Psi(I1) as in the live solver; isochoric: Psi(I1 J^(-2/3))")
      ->check(command_line::one_of({"unsplit", "isochoric"}))
      ->capture_default_str();
  identify->add_option("--name", command.options.name, "of the material")
      ->type_name("NAME")
      ->capture_default_str();
  identify->add_option("--out", command.out, "folder of the results [out/identify-<curves' name>]")
      ->type_name("DIR");
}

Status run_identify(IdentifyCommand command) {
  command.size.length_m = command.length_mm * 1e-3;
  command.size.area_m2 = command.area_mm2 * 1e-6;
  if (command.form == "isochoric") command.options.split = material::VolumeSplit::Isochoric;
  for (const auto& text : command.start) {
    const auto term = parse_term(text);
    if (!term) return term.error();
    command.options.start.push_back(*term);
  }
  const auto curves = fit::read_test_curves(command.curves, command.size);
  if (!curves) return curves.error();
  const auto found = fit::identify(*curves, command.options, print_iteration);
  if (!found && found.error().code == ErrorCode::Usage) return found.error();
  if (!found) return Error{found.error().code, command.curves + ": " + found.error().message};
  std::fputs(to_text(*found).c_str(), stdout);
  std::fflush(stdout);
  if (!found->is_converged)
    std::fprintf(stderr, "%s: warning: the fit was still improving when it was ended\n", kProgram);
  for (const auto& remark : found->remarks())
    std::fprintf(stderr, "%s: warning: %s\n", kProgram, remark.c_str());
  if (!found->stability)
    return Error{found->stability.error().code,
                 command.curves + ": " + found->stability.error().message + ", see --order"};
  const std::filesystem::path folder =
      command.out.empty() ? "out/identify-" + std::filesystem::path(command.curves).stem().string()
                          : command.out;
  if (auto s = write_results(folder, *curves, *found); !s) return s;
  std::printf("results in %s: material.toml, identify.csv, time.svg, stretch.svg\n",
              folder.c_str());
  return {};
}

}  // namespace trocar::app
