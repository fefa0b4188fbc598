// Beyond the paper: pressing into a half-space against closed forms.

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "tests/validation/experiments.h"
#include "tests/validation/measure.h"
#include "tests/validation/organs.h"
#include "tests/validation/scenario_text.h"

namespace trocar::validation {
namespace {

constexpr double kIndentationYoung_pa = 4000;
constexpr double kRadius_mm = 30, kDepth_mm = 2;        // of the round tool
constexpr double kPunch_mm = 15, kPunchDepth_mm = 0.5;  // radius of the flat punch
// The circle of contact, 7.7 mm, is one and a half of the coarser elements. The tool rests on
// faces, which are flat: a coarse surface under it is larger than the circle, and too stiff by 12
// to 22 %, the finer one by 2 to 10 %.
// A few per cent are due to the closed forms.
constexpr double kTarget = 0.05;
constexpr double kMeshTarget = 0.05;
constexpr double kFine_mm = 20, kReach_mm = 400, kGrowth = 1.35;

struct IndentationLaw {
  const char* name;
  const char* title;
  std::string material;
  double poisson;
  // A press is solved to this residual, N. Close to incompressible tissue balances large pressures,
  // whose rounding in float leaves 2e-6 N; half of 1e-5 N changes its force by 0.04 %.
  double tolerance_n;
  // The largest errors on record where the target is missed, 0 where it is kept.
  double round_on_record, punch_on_record, mesh_on_record;
};

Bound bound(Bound target, double on_record) {
  return on_record > 0 ? target.missed(on_record) : target;
}

std::vector<IndentationLaw> indentation_laws() {
  return {{"springs", "springs (nu = 0.25)", "", 0.25, 2e-6, 0, 0, 0.13},
          {"tensor-mass", "tensor-mass, nu = 0.25",
           "elastic_law = \"tensor-mass\"\npoisson_ratio = 0.25\n", 0.25, 2e-6, 0.1, 0.06, 0.13},
          {"neo-hookean-averaged", "neo-Hookean, averaged strain, nu = 0.4756",
           "elastic_law = \"neo-hookean\"\npoisson_ratio = 0.4756\naveraged_strain = true\n",
           0.4756, 1e-5, 0, 0, 0}};
}

// Cells of size h out to kFine_mm from 0, then growing out to kReach_mm; m.
std::vector<double> growing(double h_mm) {
  std::vector<double> places{0};
  double at_mm = 0, step_mm = h_mm;
  while (at_mm < kReach_mm) {
    at_mm += step_mm;
    places.push_back(at_mm * 1e-3);
    if (at_mm >= kFine_mm) step_mm *= kGrowth;
  }
  return places;
}

// A block that is fine where the tool is, at (0, top, 0), and coarse far from it.
organ::Organ half_space(double h_mm) {
  const auto out = growing(h_mm);
  std::vector<double> across, down;
  for (auto it = out.rbegin(); it != out.rend(); ++it) {
    across.push_back(-*it);
    down.push_back(-*it);
  }
  for (std::size_t i = 1; i < out.size(); ++i) across.push_back(out[i]);
  return tet_box(across, down, across);
}

struct Pressed {
  double ours_n, expected_n;
};

std::string common(const IndentationLaw& law, const std::string& organ) {
  return organ_source(organ + ".organ") +
         fmt::format("[material]\nyoung_modulus_pa = {}\n{}\n", kIndentationYoung_pa, law.material);
}

std::string static_in(const IndentationLaw& law, int load_steps) {
  return fmt::format(
      "[run]\nmode = \"static\"\nseconds = 1\nload_steps = {}\nover_relaxation = 1.8\n"
      "tolerance_n = {}\nmax_sweeps = 10000\n\n",
      load_steps, law.tolerance_n);
}

// Hertz: F = 4/3 E / (1 - nu^2) sqrt(R) d^(3/2).
double hertz(const IndentationLaw& law, double depth_m) {
  return 4.0 / 3 * kIndentationYoung_pa / (1 - law.poisson * law.poisson) *
         std::sqrt(kRadius_mm * 1e-3) * depth_m * std::sqrt(depth_m);
}

std::optional<Pressed> press_round(const Lab& lab, Section& section, const IndentationLaw& law,
                                   const std::string& organ, double top_mm, plot::Series& curve) {
  const auto run = lab.try_start(
      section, std::string("round tool, ") + law.title, fmt::format("hertz-{}-{}", law.name, organ),
      common(law, organ) +
          tool(kRadius_mm, 10, {0, 1, 0},
               {{0, {0, top_mm, 0}, "push"}, {1, {0, top_mm - kDepth_mm, 0}, "push"}}) +
          static_in(law, 4) + "[[probe]]\ntool = 0\nquantity = \"force\"\n");
  if (!run) return std::nullopt;
  lab.finish(section, *run, [&](const scenario::StepReport&) {
    curve.x.push_back(kDepth_mm * run->time_s());
    curve.y.push_back(run->probe(0).y);
  });
  return Pressed{run->probe(0).y, hertz(law, kDepth_mm * 1e-3)};
}

// Bonded rigid punch on a half-space: F = 4 mu a d ln(3 - 4 nu) / (1 - 2 nu) (Spence 1968).
std::optional<Pressed> press_flat(const Lab& lab, Section& section, const IndentationLaw& law,
                                  const std::string& organ, double top_mm, double h_mm) {
  const auto run = lab.try_start(
      section, std::string("flat punch, ") + law.title, fmt::format("punch-{}-{}", law.name, organ),
      common(law, organ) +
          fmt::format("[[nodes]]\nname = \"punch\"\nnearest_mm = [0, {:.9g}, 0]\nradius_mm = {}\n"
                      "surface = true\n\n",
                      top_mm, kPunch_mm + 1e-3) +
          displace("punch", {{0, {0, -kPunchDepth_mm, 0}}}) + static_in(law, 1) +
          "[[probe]]\nset = \"punch\"\nquantity = \"reaction\"\n");
  if (!run) return std::nullopt;
  lab.finish(section, *run);
  // A disc of nodes is as large as the cells around its nodes.
  double nodes = 0;
  for (const auto node : run->organ().mesh.surface_nodes) {
    const Vec3d p = run->organ().mesh.rest_positions[node.value] * 1e3 - Vec3d{0, top_mm, 0};
    nodes += length(p) <= kPunch_mm + 1e-3 ? 1 : 0;
  }
  const double radius_m = std::sqrt(nodes * h_mm * h_mm / std::numbers::pi) * 1e-3;
  const double mu = kIndentationYoung_pa / (2 * (1 + law.poisson));
  return Pressed{-run->probe(0).y, 4 * mu * radius_m * kPunchDepth_mm * 1e-3 *
                                       std::log(3 - 4 * law.poisson) / (1 - 2 * law.poisson)};
}

std::vector<std::string> row(const IndentationLaw& law, const char* tool_name, double h_mm,
                             const Pressed& pressed) {
  return {law.title,
          tool_name,
          shown(h_mm),
          shown(pressed.expected_n),
          shown(pressed.ours_n),
          shown_percent(pressed.ours_n / pressed.expected_n - 1)};
}

}  // namespace

void run_indentation(const Lab& lab, Section& section) {
  section.say(fmt::format(
      "A block of 0.9 m and half as deep, fine under the tool and coarse away from it, stands for "
      "a half-space. A round tool of {} mm radius presses {} mm deep (contact radius {:.1f} mm; "
      "Hertz), and "
      "a disc of {} mm radius is moved {} mm down with the nodes bonded to it. The tool's radius "
      "is six "
      "elements and more. The block is not infinite, and a depth of {} mm is not infinitesimal: a "
      "few per "
      "cent of the differences are due to the closed forms.",
      kRadius_mm, kDepth_mm, std::sqrt(kRadius_mm * kDepth_mm), kPunch_mm, kPunchDepth_mm,
      kDepth_mm));
  section.say(
      "Springs on a regular mesh are not isotropic: along the axes these are as stiff as 1.2 E "
      "(see ours/bar), and the force lies between that of E and that of 1.2 E.");
  plot::Plot curves{.title = "Round tool: force while pressing",
                    .x = {"depth, mm"},
                    .y = {"force, N"},
                    .series = {}};
  Table table{"Force at full depth",
              {"law", "tool", "element under the tool, mm", "closed form, N", "ours, N", "error"},
              {}};
  const std::vector<double> sizes =
      lab.is_short() ? std::vector<double>{2.5} : std::vector<double>{5, 2.5};
  std::vector<double> tops_mm;
  const auto name_of = [](double h_mm) { return fmt::format("half-space-{:g}mm", h_mm); };
  for (const double h_mm : sizes) {
    const auto organ = half_space(h_mm);
    double top = 0;
    for (const auto& p : organ.mesh.rest_positions) top = std::max(top, p.y);
    tops_mm.push_back(top * 1e3);
    lab.keep_organ(name_of(h_mm), organ);
  }
  for (const auto& law : indentation_laws()) {
    std::optional<Pressed> round, flat;
    double coarser_n = 0;
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      if (round) coarser_n = round->ours_n;
      plot::Series curve{fmt::format("{}, {:g} mm", law.title, sizes[i]),
                         {0},
                         {0},
                         plot::Style::LineAndPoints,
                         {}};
      round = press_round(lab, section, law, name_of(sizes[i]), tops_mm[i], curve);
      flat = press_flat(lab, section, law, name_of(sizes[i]), tops_mm[i], sizes[i]);
      if (!round || !flat) break;
      table.rows.push_back(row(law, "round", sizes[i], *round));
      table.rows.push_back(row(law, "flat, bonded", sizes[i], *flat));
      curves.series.push_back(std::move(curve));
    }
    if (!round || !flat) continue;
    section.compare(fmt::format("hertz-{}", law.name), round->expected_n, round->ours_n,
                    bound(validation::law(kTarget, "Hertz"), law.round_on_record), "N",
                    fmt::format("{}: round tool, finest mesh.", law.title));
    section.compare(fmt::format("punch-{}", law.name), flat->expected_n, flat->ours_n,
                    bound(validation::law(kTarget, "Spence 1968"), law.punch_on_record), "N",
                    fmt::format("{}: flat punch, finest mesh.", law.title));
    if (coarser_n > 0)
      section.at_most(fmt::format("mesh-{}", law.name), "half the element size",
                      std::abs(coarser_n / round->ours_n - 1),
                      bound(target(kMeshTarget, "elements do not show"), law.mesh_on_record),
                      fmt::format("{}: change of the round tool's force from {:g} to {:g} mm.",
                                  law.title, sizes.front(), sizes.back()));
    if (law.poisson != 0.25 || std::string(law.name) == "springs") {
      plot::Series closed{
          fmt::format("Hertz, nu = {}", law.poisson), {}, {}, plot::Style::Dashed, {}};
      for (double d = 0; d <= kDepth_mm + 1e-9; d += 0.1) {
        closed.x.push_back(d);
        closed.y.push_back(hertz(law, d * 1e-3));
      }
      curves.series.push_back(std::move(closed));
    }
  }
  section.add(std::move(curves));
  section.add(std::move(table));
}

}  // namespace trocar::validation
