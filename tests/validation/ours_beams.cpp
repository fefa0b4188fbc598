// Beyond the paper: convergence under refinement to closed forms of bars and beams, for each
// elastic law, and what nearly incompressible tets do to a bending beam (locking).

#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <map>
#include <optional>

#include "tests/validation/experiments.h"
#include "tests/validation/measure.h"
#include "tests/validation/organs.h"
#include "tests/validation/scenario_text.h"

namespace trocar::validation {
namespace {

constexpr double kWidth_m = 0.04;  // square section, along y
constexpr double kBar_m = 0.16, kBeam_m = 0.12;
constexpr double kYoung_pa = 4000;
constexpr double kArea_m2 = kWidth_m * kWidth_m;
constexpr double kMoment_m4 = kWidth_m * kWidth_m * kWidth_m * kWidth_m / 12;
constexpr double kLiverPoisson = 0.4756;  // K = 40 C10
constexpr double kBarTarget = 0.03, kBeamTarget = 0.05;

struct BeamLaw {
  const char* name;
  const char* title;
  std::string material;           // keys of [material]
  std::optional<double> poisson;  // springs: as the mesh makes it
  // The cantilever misses the target with these errors on the finest mesh of the long and of the
  // short form; without a value the target is kept.
  std::optional<double> on_record, short_on_record;

  Bound beam_bound(bool is_short) const {
    const auto aim = validation::law(kBeamTarget, "Timoshenko");
    const auto& missed = is_short ? short_on_record : on_record;
    return missed ? aim.missed(*missed) : aim;
  }
};

std::vector<BeamLaw> laws() {
  const auto tets = [](const char* law, double poisson, bool is_averaged) {
    return fmt::format("elastic_law = \"{}\"\npoisson_ratio = {}\n{}", law, poisson,
                       is_averaged ? "averaged_strain = true\n" : "");
  };
  return {
      {"springs", "springs", "", std::nullopt, {}, 0.08},
      {"tensor-mass", "tensor-mass, nu = 0.25", tets("tensor-mass", 0.25, false), 0.25, 0.10, 0.15},
      {"neo-hookean", "neo-Hookean, nu = 0.4756", tets("neo-hookean", kLiverPoisson, false),
       kLiverPoisson, 0.25, 0.25},
      {"neo-hookean-averaged", "neo-Hookean, averaged strain, nu = 0.4756",
       tets("neo-hookean", kLiverPoisson, true), kLiverPoisson, 0.15, 0.15},
  };
}

struct BeamElastic {
  double young_pa, shear_pa, poisson;
};

// Returns the constants of the law as a continuum. Springs in five tets per cell are stiffer along
// the cell's axes.
BeamElastic elastic_of(const BeamLaw& law, const organ::Organ& organ) {
  if (law.poisson) return {kYoung_pa, kYoung_pa / (2 * (1 + *law.poisson)), *law.poisson};
  const auto c = constants_of(organ);
  return {c.young_modulus(), c.c44, c.poisson_ratio()};
}

std::string organ_of(const Lab& lab, const char* what, double length_m, int across,
                     organ::Organ& organ) {
  const auto name = fmt::format("{}-{}", what, across);
  const auto side = even(kWidth_m, across);
  organ = tet_box(side, even(length_m, static_cast<int>(std::lround(length_m / kWidth_m)) * across),
                  side);
  lab.keep_organ(name, organ);
  return organ_source(name + ".organ");
}

std::string plane(const char* name, double y_mm) {
  const double half_mm = kWidth_m * 500;
  return box_set(name, {-half_mm, y_mm, -half_mm}, {half_mm, y_mm, half_mm});
}

std::string beam_traction(const Vec3d& pa) {
  return fmt::format(
      "[[traction]]\nset = \"end\"\n[[traction.key]]\ntime_s = 0\n"
      "traction_pa = [{:.9g}, {:.9g}, {:.9g}]\n\n",
      pa.x, pa.y, pa.z);
}

std::string static_to(double tolerance_n) {
  return fmt::format(
      "[run]\nmode = \"static\"\nseconds = 1\nover_relaxation = 1.9\ntolerance_n = {}\n"
      "max_sweeps = 100000\n\n",
      tolerance_n);
}

std::string material_of(const BeamLaw& law) {
  return fmt::format("[material]\nyoung_modulus_pa = {}\n{}\n", kYoung_pa, law.material);
}

std::string displacement_probe(const char* set) {
  return fmt::format("[[probe]]\nset = \"{}\"\nquantity = \"displacement\"\n\n", set);
}

using Refine = std::optional<double> (*)(const Lab&, Section&, const BeamLaw&, int, double&);

// A law over mesh sizes: ours and the closed form, mm. Returns ours over the closed form on the
// finest mesh, by law.
std::map<std::string, double> refine(const Lab& lab, Section& section, const char* unit_title,
                                     bool is_beam, const std::vector<int>& sizes, Refine measure) {
  plot::Series closed{"closed form", {}, {}, plot::Style::Dashed, {}};
  plot::Plot plot{.title = unit_title,
                  .x = {"elements across the section"},
                  .y = {"ours / closed form"},
                  .series = {}};
  Table table{unit_title, {"law", "elements across", "closed form, mm", "ours, mm", "error"}, {}};
  std::map<std::string, double> finest;
  for (const auto& law : laws()) {
    plot::Series series{law.title, {}, {}, plot::Style::LineAndPoints, {}};
    double error = 0, expected = 0;
    for (const int across : sizes) {
      const auto ours = measure(lab, section, law, across, expected);
      if (!ours) break;
      error = std::abs(*ours / expected - 1);
      series.x.push_back(across);
      series.y.push_back(*ours / expected);
      table.rows.push_back({law.title, std::to_string(across), shown(expected), shown(*ours),
                            shown_percent(*ours / expected - 1)});
    }
    if (series.x.size() < sizes.size()) continue;
    section.at_most(
        law.name, fmt::format("{} mm", shown(expected)), error,
        is_beam ? law.beam_bound(lab.is_short()) : validation::law(kBarTarget, "F L / (E A)"),
        fmt::format("{}, {} elements across: {} of the closed form.", law.title, sizes.back(),
                    shown(series.y.back())));
    finest[law.name] = series.y.back();
    plot.series.push_back(std::move(series));
  }
  closed.x = {static_cast<double>(sizes.front()), static_cast<double>(sizes.back())};
  closed.y = {1, 1};
  plot.series.push_back(std::move(closed));
  section.add(std::move(plot));
  section.add(std::move(table));
  return finest;
}

std::optional<double> stretch_bar(const Lab& lab, Section& section, const BeamLaw& law, int across,
                                  double& expected_mm) {
  constexpr double kStrain = 0.01;
  organ::Organ organ;
  const auto source = organ_of(lab, "bar", kBar_m, across, organ);
  const double stress_pa = kStrain * kYoung_pa;
  // The middle half: the clamped end does not let the section shrink.
  const auto run = lab.try_start(section, law.title, fmt::format("bar-{}-{}", law.name, across),
                                 source + material_of(law) + plane("end", kBar_m * 500) +
                                     plane("lower", -kBar_m * 250) + plane("upper", kBar_m * 250) +
                                     beam_traction({0, stress_pa, 0}) + static_to(1e-6) +
                                     displacement_probe("upper") + displacement_probe("lower"));
  if (!run) return std::nullopt;
  lab.finish(section, *run);
  expected_mm = stress_pa / elastic_of(law, organ).young_pa * kBar_m / 2 * 1e3;
  return (run->probe(0).y - run->probe(1).y) * 1e3;
}

std::optional<double> bend_beam(const Lab& lab, Section& section, const BeamLaw& law, int across,
                                double& expected_mm) {
  constexpr double kForce_n = 0.004;
  organ::Organ organ;
  const auto source = organ_of(lab, "beam", kBeam_m, across, organ);
  const auto run = lab.try_start(
      section, law.title, fmt::format("cantilever-{}-{}", law.name, across),
      source + material_of(law) + plane("end", kBeam_m * 500) +
          beam_traction({kForce_n / kArea_m2, 0, 0}) + static_to(1e-6) + displacement_probe("end"));
  if (!run) return std::nullopt;
  lab.finish(section, *run);
  const BeamElastic e = elastic_of(law, organ);
  const double shear_factor = 10 * (1 + e.poisson) / (12 + 11 * e.poisson);
  expected_mm = (kForce_n * kBeam_m * kBeam_m * kBeam_m / (3 * e.young_pa * kMoment_m4) +
                 kForce_n * kBeam_m / (shear_factor * e.shear_pa * kArea_m2)) *
                1e3;
  return run->probe(0).x * 1e3;
}

}  // namespace

void run_bar(const Lab& lab, Section& section) {
  section.say(
      "A bar of 40 x 160 x 40 mm, clamped at one end, is pulled at the other by 1 % of E = 4 kPa. "
      "Its middle half lengthens by F L / (2 E A). Springs get their stiffness from E by the "
      "volume "
      "of the tets around them; the continuum that they make has E on average over all directions, "
      "but a regular mesh is stiffer along its axes (five tets per cell: 1.2 E), which is the "
      "reference for springs here.");
  refine(lab, section, "Elongation of the middle half", false,
         lab.is_short() ? std::vector<int>{2, 4} : std::vector<int>{2, 4, 8}, stretch_bar);
}

void run_cantilever(const Lab& lab, Section& section) {
  section.say(
      "A beam of 40 x 120 x 40 mm bends under 4 mN across its free end. Timoshenko: u = F L^3 / (3 "
      "E I) + F L / "
      "(kappa G A). Linear tets are too stiff in bending and converge as they get smaller; nearly "
      "incompressible ones (K = 40 C10) lock, and averaging strain over each node's tets is "
      "there to undo that.");
  const auto finest =
      refine(lab, section, "Deflection of the end", true,
             lab.is_short() ? std::vector<int>{2, 4} : std::vector<int>{2, 4, 6}, bend_beam);
  if (finest.contains("neo-hookean") && finest.contains("neo-hookean-averaged"))
    section.at_least("averaging-against-locking", "softer than without",
                     finest.at("neo-hookean-averaged") / finest.at("neo-hookean"),
                     target(1.02, "averaging is worth its price"),
                     "Deflection with averaged strain over that without, finest mesh.");
  section.say(
      "Averaged strain takes away more than half of what plain tets are too stiff by: of what "
      "comes of "
      "incompressibility, and of what linear tets are too stiff in bending whatever their volume "
      "does.");
}

}  // namespace trocar::validation
