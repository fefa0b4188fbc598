// Choi 2002 figure 4, creep and relaxation: what the material does over time.
//
// A column (springs along y only carry load, because top and bottom move as a whole) is a chain of
// springs and dampers in closed form: K = k columns / intervals, B = K tau.

#include <spdlog/fmt/fmt.h>

#include <cmath>

#include "tests/validation/experiments.h"
#include "tests/validation/measure.h"
#include "tests/validation/scenario_text.h"

namespace trocar::validation {
namespace {

constexpr int kAcross = 3, kAlong = 5;
constexpr double kSpacing_mm = 10, kStiffness_n_m = 40;
constexpr double kColumnStiffness = kStiffness_n_m * kAcross * kAcross / (kAlong - 1);  // N/m
constexpr double kHeight_m = (kAlong - 1) * kSpacing_mm * 1e-3;
// The cross-section that belongs to the springs, one cell each.
constexpr double kSection_m2 = kAcross * kAcross * kSpacing_mm * kSpacing_mm * 1e-6;

// Returns a column so light that inertia is below the bounds: the closed forms have no inertia.
std::string column(double spring_damping_s, double node_damping_per_s, double density = 10) {
  return lattice_organ(kAcross, kAlong, kAcross, kSpacing_mm) +
         fmt::format(
             "[material]\ndensity_kg_m3 = {}\nspring_stiffness_n_m = {}\n"
             "node_damping_per_s = {}\nedge_damping_time_s = {}\n\n",
             density, kStiffness_n_m, node_damping_per_s, spring_damping_s) +
         box_set("top", {-10, 20, -10}, {10, 20, 10});
}

constexpr const char* kRunToTolerance =
    "over_relaxation = 1.7\ntolerance_n = 1e-5\nmax_sweeps = 2000\n\n";

struct Curve {
  std::vector<double> time_s, displacement_m, force_n;
};

// Displacement of the top and the force that holds it (or the load on it).
Curve update(const Lab& lab, Section& section, ScenarioRun& run) {
  Curve curve;
  lab.finish(section, run, [&](const scenario::StepReport&) {
    curve.time_s.push_back(run.time_s());
    curve.displacement_m.push_back(run.probe(0).y);
    curve.force_n.push_back(run.probe(1).y);
  });
  return curve;
}

constexpr const char* kTopAndBase =
    "[[probe]]\nset = \"top\"\nquantity = \"displacement\"\n\n"
    "[[probe]]\nset = \"top\"\nquantity = \"reaction\"\n";

// Strain and stress up and down twice, by 10 % in half a second.
constexpr double kStroke_m = 0.1 * kHeight_m, kHalfCycle_s = 0.5;
// Stretched all the time: a lattice of springs along the axes buckles under the least pressure.
constexpr double kPreload_m = 0.5 * kStroke_m, kPreload_s = 0.25;

Curve cycle(const Lab& lab, Section& section, const std::string& name, double spring_damping_s,
            double node_damping_per_s, double density) {
  std::vector<TimedValue> keys{{0, {}}};
  for (int i = 0; i <= 4; ++i)
    keys.push_back(
        {kPreload_s + i * kHalfCycle_s, {0, (kPreload_m + (i % 2 == 1 ? kStroke_m : 0)) * 1e3, 0}});
  const auto run =
      lab.start(section, name, "fig4-" + name,
                column(spring_damping_s, node_damping_per_s, density) + displace("top", keys) +
                    fmt::format("[run]\nseconds = {}\n", kPreload_s + 4 * kHalfCycle_s) +
                    kRunToTolerance + kTopAndBase,
                Solver::Full);
  return update(lab, section, *run);
}

// Area of the second cycle, J: the first starts from rest.
double second_loop(const Curve& curve) {
  const auto first =
      static_cast<std::size_t>(std::llround((kPreload_s + 2 * kHalfCycle_s) * 1e3)) - 1;
  return loop_area(std::span(curve.displacement_m).subspan(first),
                   std::span(curve.force_n).subspan(first));
}

plot::Series stress_strain(const std::string& name, const Curve& curve, std::size_t from) {
  plot::Series series{name, {}, {}, plot::Style::Line, {}};
  for (std::size_t i = from; i < curve.time_s.size(); i += 5) {
    series.x.push_back(100 * curve.displacement_m[i] / kHeight_m);
    series.y.push_back(curve.force_n[i] / kSection_m2 * 1e-3);
  }
  return series;
}

}  // namespace

void run_fig4_hysteresis(const Lab& lab, Section& section) {
  constexpr double kDamping_s = 0.05;
  section.say(
      "The top of a column of 3 x 5 x 3 nodes, stretched by 5 %, goes up by 10 % of the column's "
      "height and back, "
      "twice, at 0.2 per second. With dampers along the springs (Kelvin-Voigt) the "
      "force is K u + B u' with K = 90 N/m and B = 4.5 N s/m, so loading and unloading follow "
      "two curves B u' above and below the elastic one and the loop's area is "
      "2 B U u'. With damping in proportion to each node's velocity (the paper's equation 1) they "
      "differ too; without damping they are the same curve.");
  const Curve viscous = cycle(lab, section, "kelvin-voigt", kDamping_s, 0, 10);
  const Curve nodal = cycle(lab, section, "nodal-damping", 0, 200, 1060);
  const Curve elastic = cycle(lab, section, "elastic", 0, 0, 10);
  const double speed = kStroke_m / kHalfCycle_s;
  const double expected = 2 * kColumnStiffness * kDamping_s * speed * kStroke_m;
  const double stored = 0.5 * kColumnStiffness * kStroke_m * kStroke_m;
  section.compare("loop-area", expected * 1e3, second_loop(viscous) * 1e3,
                  law(0.02, "Kelvin-Voigt: 2 B U u'"), "mJ",
                  "Area of the second loop against 2 B U u'.");
  section.at_least(
      "nodal-damping", "loading and unloading differ", second_loop(nodal) / stored,
      paper(0.05, "figure 4: the two curves are apart"),
      "Area of the loop with nodal damping, as a share of the energy stored at the top.");
  section.at_most("elastic-area", "no area", std::abs(second_loop(elastic)) / stored,
                  law(0.002, "elasticity keeps all work"),
                  "Area without damping, as a share of the energy stored at the top.");
  const auto second = static_cast<std::size_t>((kPreload_s + 2 * kHalfCycle_s) * 1e3);
  section.add({.title = "Second cycle (loading above, unloading below)",
               .x = {"strain, %"},
               .y = {"stress, kPa"},
               .series = {stress_strain("dampers along springs, tau = 50 ms", viscous, second),
                          stress_strain("nodal damping, 200 per s", nodal, second),
                          stress_strain("no damping", elastic, second)}});
  section.add(Table{
      "Energy lost in a cycle",
      {"damping", "area, mJ", "share of the stored energy"},
      {{"Kelvin-Voigt", shown(second_loop(viscous) * 1e3),
        shown_percent(second_loop(viscous) / stored)},
       {"nodal", shown(second_loop(nodal) * 1e3), shown_percent(second_loop(nodal) / stored)},
       {"none", shown(second_loop(elastic) * 1e3), shown_percent(second_loop(elastic) / stored)}}});
}

void run_creep(const Lab& lab, Section& section) {
  constexpr double kTau_s = 0.2, kForce_n = 0.5;
  section.say(
      "A force of 0.5 N pulls suddenly at the top of the column and stays. Springs with dampers "
      "beside them creep towards F/K: u(t) = F/K (1 - exp(-t/tau)), tau = 0.2 s.");
  const auto run = lab.start(section, "step force", "creep",
                             column(kTau_s, 0) + force("top", {{0, {0, kForce_n, 0}}}) +
                                 "[run]\nseconds = 1.2\n" + kRunToTolerance +
                                 "[[probe]]\nset = \"top\"\nquantity = \"displacement\"\n\n"
                                 "[[probe]]\nset = \"fixed\"\nquantity = \"reaction\"\n",
                             Solver::Full);
  const Curve curve = update(lab, section, *run);
  const double final_m = kForce_n / kColumnStiffness;
  plot::Series ours{"ours", {}, {}, plot::Style::Points, {}},
      closed{"F/K (1 - exp(-t/tau))", {}, {}, plot::Style::Line, {}};
  double worst = 0;
  for (std::size_t i = 0; i < curve.time_s.size(); ++i) {
    const double expected = final_m * (1 - std::exp(-curve.time_s[i] / kTau_s));
    worst = std::max(worst, std::abs(curve.displacement_m[i] - expected) / final_m);
    if (i % 40 == 0) {
      ours.x.push_back(curve.time_s[i]);
      ours.y.push_back(curve.displacement_m[i] * 1e3);
    }
    if (i % 5 == 0) {
      closed.x.push_back(curve.time_s[i]);
      closed.y.push_back(expected * 1e3);
    }
  }
  section.at_most("curve", "F/K (1 - exp(-t/tau))", worst,
                  law(0.005, "Kelvin-Voigt: F/K (1 - exp(-t/tau))"),
                  "Largest difference at any time, over F/K.");
  const double at_tau = curve.displacement_m[static_cast<std::size_t>(kTau_s * 1e3) - 1];
  section.compare("at-tau", (1 - std::exp(-1)) * final_m * 1e3, at_tau * 1e3,
                  law(0.005, "Kelvin-Voigt at one tau"), "mm", "Displacement after one tau.");
  section.add({.title = "Creep under a constant force",
               .x = {"time, s"},
               .y = {"displacement of the top, mm"},
               .series = {closed, ours}});
}

void run_relaxation(const Lab& lab, Section& section) {
  constexpr double kTau_s = 0.05, kRamp_s = 0.1, kStretch_m = 0.004;
  section.say(
      "The top of the column is moved by 4 mm within 0.1 s and then held. While it moves the force "
      "is K u + B u'; when it stops the viscous part B u' is gone at once (a spring beside a "
      "damper "
      "has no slower relaxation than that) and K U remains. Slower relaxation, with time constants "
      "of the tissue, is the matter of the quasi-linear law (Dogan 2011) and not of this model.");
  const auto run = lab.start(
      section, "ramp and hold", "relaxation",
      column(kTau_s, 0) + displace("top", {{0, {0, 0, 0}}, {kRamp_s, {0, kStretch_m * 1e3, 0}}}) +
          "[run]\nseconds = 0.3\n" + kRunToTolerance + kTopAndBase,
      Solver::Full);
  const Curve curve = update(lab, section, *run);
  const double damping = kColumnStiffness * kTau_s, speed = kStretch_m / kRamp_s;
  const auto expected = [&](double t) {
    return t <= kRamp_s ? kColumnStiffness * speed * t + damping * speed
                        : kColumnStiffness * kStretch_m;
  };
  plot::Series ours{"ours", {}, {}, plot::Style::Points, {}},
      closed{"K u + B u'", {}, {}, plot::Style::Line, {}};
  for (std::size_t i = 0; i < curve.time_s.size(); ++i) {
    closed.x.push_back(curve.time_s[i]);
    closed.y.push_back(expected(curve.time_s[i]));
    if (i % 10 != 0) continue;
    ours.x.push_back(curve.time_s[i]);
    ours.y.push_back(curve.force_n[i]);
  }
  const auto at = [&](double t) {
    return curve.force_n[static_cast<std::size_t>(std::llround(t * 1e3)) - 1];
  };
  section.compare("peak", expected(kRamp_s), at(kRamp_s), law(0.01, "Kelvin-Voigt: K U + B u'"),
                  "N", "Force at the end of the ramp against K U + B u'.");
  section.compare("held", expected(0.2), at(0.2), law(0.002, "Kelvin-Voigt: K U"), "N",
                  "Force 0.1 s after the stop against K U.");
  section.compare("viscous-part", damping * speed, at(kRamp_s) - at(0.2),
                  law(0.02, "Kelvin-Voigt: B u'"), "N",
                  "What is gone after the stop against B u'.");
  section.add({.title = "Force that moves and then holds the top",
               .x = {"time, s"},
               .y = {"force, N"},
               .series = {closed, ours}});
}

}  // namespace trocar::validation
