// Dogan 2011 figures 2, 6 and 7 on the full model: a liver of table 1 creeps under a constant force
// for 20 s, at several places and at half of the force; by the off-line solver, and by the live one
// on the same mesh.

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "server/lab/calibration/places.h"
#include "server/lab/finite_elements/scenario_solve.h"
#include "tests/validation/experiments.h"
#include "tests/validation/measure.h"
#include "tests/validation/measured_livers.h"
#include "tests/validation/scenario_text.h"

namespace trocar::validation {
namespace {

using finite_elements::ElementOrder;
using finite_elements::ScenarioSolve;

// Ours, for the paper gives neither: with this radius of influence the built-in liver's first place
// moves by about its 4.5 mm at once.
constexpr double kForce_n = 0.4, kRadius_mm = 15;
constexpr std::size_t kPlaces = 3;
constexpr std::uint64_t kSeed = 2011;
// The neighbours of figure 6 are taken at these distances from the loaded node.
constexpr std::array<double, 3> kNeighbours_mm{15, 30, 45};
// The load of tissue with mass rises within this time, off-line in so many steps.
constexpr double kRamp_s = 0.02;
constexpr int kRampSteps = 4;
// Live and off-line are compared from here on.
constexpr double kSwings_s = 0.2;
// The paper's full model at the whole and at half of the force.
constexpr double kPaper_mm = 4.5, kPaperHalf_mm = 2.1;
// The part of the force at which tissue is linear.
constexpr double kSmallPart = 0.01;

// Sessions aim at the first error; swinging tissue is known to reach the second.
constexpr double kLiveTarget = 0.01, kLiveOnRecord = 0.03;
// A point force on a half-space, which the held body is not.
constexpr double kRelaxedBound = 0.05, kRelaxedOnRecord = 0.08;
constexpr double kStepsBound = 0.005;

struct Steps {
  int count;
  double dt_s;
};
// Returns the steps of the off-line solver after the load, longer by a factor.
std::vector<Steps> slow_steps(bool is_short, int factor) {
  std::vector<Steps> steps{{20 / factor, 0.05 * factor}, {4 / factor, 0.25 * factor}};
  if (!is_short)
    steps.insert(steps.end(), {{6 / factor, 0.5 * factor}, {6 / factor, 2.5 * factor}});
  return steps;
}
std::vector<Steps> steps_with_inertia(bool is_short) {
  std::vector<Steps> steps{{48, 0.01}, {30, 0.05}};
  if (!is_short) steps.insert(steps.end(), {{6, 0.5}, {6, 2.5}});
  return steps;
}

// How the off-line solver takes a load.
enum class CreepWay {
  AtOnce,       // sudden, and no more
  Slowly,       // sudden, then held; no inertia
  Relaxed,      // sudden, then held until nothing changes any more
  WithInertia,  // as the live solver: from rest, with mass and the organ's damping
};

struct Load {
  std::size_t place = 0;
  double force_n = kForce_n;  // pressed; below 0 pulled
};

// Displacements over time of a loaded node and its neighbours, m.
struct Creep {
  std::vector<double> time_s;
  std::vector<std::vector<Vec3d>> moves;  // per time, per node
  bool is_converged = true;

  // NaN if that was not noted or not found.
  double at_mm(double time, std::size_t node = 0) const {
    for (std::size_t i = 0; i < time_s.size() && is_converged; ++i)
      if (std::abs(time_s[i] - time) < 1e-6) return length(moves[i][node]) * 1e3;
    return std::nan("");
  }
  double last_over_first() const {
    return is_converged ? length(moves.back()[0]) / length(moves.front()[0]) : std::nan("");
  }
  bool rises() const {
    for (std::size_t i = 1; i < moves.size(); ++i)
      if (length(moves[i][0]) <= length(moves[i - 1][0])) return false;
    return is_converged;
  }
};

plot::Series curve(const std::string& name, const Creep& creep, plot::Style style,
                   std::optional<int> colour, std::size_t node = 0) {
  plot::Series series{name, creep.time_s, {}, style, colour};
  for (const auto& moves : creep.moves) series.y.push_back(length(moves[node]) * 1e3);
  return series;
}

// How much farther tissue is after `time_s` than at once if it is linear, incompressible and of
// this series: 1 = strain - sum q_k with tau_k q_k' = g_k strain - q_k, by small steps.
double linear_growth(const material::HyperelasticMaterial& material, double time_s) {
  constexpr int kSteps = 200'000;
  const double dt = time_s / kSteps;
  std::vector<double> q(material.relaxation.size(), 0.0);
  const auto strain_of = [&] {
    double strain = 1;
    for (const double value : q) strain += value;
    return strain;
  };
  for (int i = 0; i < kSteps; ++i) {
    const double strain = strain_of();
    for (std::size_t k = 0; k < q.size(); ++k) {
      const auto& [weight, tau] = material.relaxation[k];
      q[k] += dt / tau * (weight * strain - q[k]);
    }
  }
  return strain_of();
}

class CreepStudy {
 public:
  CreepStudy(const Lab& lab, Section& section, const MeasuredLiver& liver)
      : lab_(lab),
        section_(section),
        liver_(liver),
        places_(calibration::spread_places(liver.organ, kPlaces, kSeed)) {
    lab.keep_organ("creep-" + liver.name, liver.organ);
  }

  const MeasuredLiver& liver() const { return liver_; }
  std::size_t place_count() const { return places_.size(); }
  double seconds() const { return lab_.is_short() ? 2 : 20; }

  Creep off_line(const Load& load, CreepWay way, ElementOrder order = ElementOrder::Linear,
                 int longer = 1) const {
    show_progress(
        fmt::format("{}: place {}, {} N, off-line", liver_.name, load.place + 1, load.force_n));
    const bool has_inertia = way == CreepWay::WithInertia;
    const auto solve = problem(load, order, has_inertia);
    const auto nodes = nodes_at(load.place);
    Creep creep;
    const auto note = [&](const finite_elements::StepReport& report) {
      creep.is_converged = creep.is_converged && report.is_converged;
      creep.time_s.push_back(solve->solver().time_s());
      const auto field = solve->displacements();
      auto& moves = creep.moves.emplace_back();
      for (const auto node : nodes) moves.push_back(field[node.value]);
    };
    for (int i = 0; i < (has_inertia ? kRampSteps : 1); ++i) note(solve->step());
    if (way == CreepWay::AtOnce) return creep;
    const auto loads = solve->solver().state().loads;
    if (way == CreepWay::Relaxed) {
      note(solve->solver().step(loads, {std::numeric_limits<double>::infinity(), false}));
      return creep;
    }
    const auto steps =
        has_inertia ? steps_with_inertia(lab_.is_short()) : slow_steps(lab_.is_short(), longer);
    for (const auto& [count, dt_s] : steps)
      for (int i = 0; i < count; ++i) note(solve->solver().step(loads, {dt_s, has_inertia}));
    return creep;
  }

  // At the times of an off-line run.
  Creep live(const Load& load, const std::vector<double>& times_s) const {
    const auto run =
        lab_.start(section_, "creep", fmt::format("creep-{}-{}mN", liver_.name, 1e3 * load.force_n),
                   text(load, fmt::format("seconds = {}\nself_contact = false\n", seconds())));
    const auto nodes = nodes_at(load.place);
    Creep creep;
    std::size_t next = 0;
    lab_.finish(section_, *run, [&](const scenario::StepReport&) {
      if (next >= times_s.size() || run->time_s() < times_s[next] - 1e-6) return;
      ++next;
      creep.time_s.push_back(run->time_s());
      auto& moves = creep.moves.emplace_back();
      for (const auto node : nodes)
        moves.push_back(to_double(run->world().displacements[node.value]));
    });
    return creep;
  }

 private:
  // The loaded node of a place, then its neighbours of figure 6.
  std::vector<NodeIndex> nodes_at(std::size_t place) const {
    const auto& mesh = liver_.organ.mesh;
    const Vec3d centre = mesh.rest_positions[places_[place].node.value];
    std::vector<NodeIndex> nodes{places_[place].node};
    for (const double distance_mm : kNeighbours_mm) {
      const auto off = [&](NodeIndex n) {
        return std::abs(length(mesh.rest_positions[n.value] - centre) - distance_mm * 1e-3);
      };
      nodes.push_back(*std::min_element(mesh.surface_nodes.begin(), mesh.surface_nodes.end(),
                                        [&](NodeIndex a, NodeIndex b) { return off(a) < off(b); }));
    }
    return nodes;
  }

  // Its steps are those of the load alone.
  std::unique_ptr<ScenarioSolve> problem(const Load& load, ElementOrder order,
                                         bool has_inertia) const {
    const std::string run = has_inertia ? "seconds = 1\n" : "mode = \"static\"\nseconds = 1\n";
    auto parsed =
        scenario::parse_scenario_text(text(load, run), (lab_.scenarios() / "creep.toml").string());
    TROCAR_ASSERT(parsed.ok());
    auto resolved = scenario::resolve(std::move(*parsed));
    TROCAR_ASSERT(resolved.ok());
    auto made = ScenarioSolve::create(
        std::move(*resolved),
        {.order = order, .dt_s = kRamp_s / kRampSteps, .solver = {.threads = 1}});
    TROCAR_ASSERT(made.ok());
    return std::move(*made);
  }

  std::string text(const Load& load, const std::string& run) const {
    const auto& place = places_[load.place];
    const Vec3d at_mm = liver_.organ.mesh.rest_positions[place.node.value] * 1e3;
    const Vec3d push_n = to_double(place.outward) * -load.force_n;
    return organ_source("creep-" + liver_.name + ".organ") +
           "[material]\nelastic_law = \"measured\"\nmeasured = \"human_liver_nava2008\"\n\n" +
           near_set("patch", at_mm, kRadius_mm, true) +
           force("patch", {{0, {}}, {kRamp_s, push_n}}) + "[run]\n" + run;
  }

  const Lab& lab_;
  Section& section_;
  const MeasuredLiver& liver_;
  const std::vector<calibration::Place> places_;
};

// Largest difference at any time over the displacement then, from `begin_s` on.
double curve_error(const Creep& ours, const Creep& reference, double begin_s) {
  if (!reference.is_converged || ours.time_s.size() != reference.time_s.size()) return std::nan("");
  double worst = 0;
  for (std::size_t i = 0; i < ours.time_s.size(); ++i)
    if (ours.time_s[i] > begin_s - 1e-6)
      worst = std::max(
          worst, length(ours.moves[i][0] - reference.moves[i][0]) / length(reference.moves[i][0]));
  return worst;
}

std::string name_of(const CreepStudy& study, const char* what) {
  return study.liver().name + "-" + what;
}

// Figures 2 and 6: all places; the table of times.
std::vector<Creep> show_places(Section& section, const CreepStudy& study) {
  const double end = study.seconds();
  Table table{fmt::format("Creep under {} N, off-line, mm: {}", kForce_n, study.liver().title),
              {"place", "at once"},
              {}};
  std::vector<double> times{0};
  for (const double time : {1.0, 2.0, 5.0, 20.0})
    if (time <= end) times.push_back(time), table.head.push_back(fmt::format("{} s", time));
  table.head.push_back("last over first");
  table.rows.push_back({"linear tissue of this series, over its first"});
  for (const double time : times)
    table.rows[0].push_back(shown(linear_growth(study.liver().organ.material.measured, time)));
  table.rows[0].push_back(table.rows[0].back());
  plot::Plot places{.title = "Displacement of the loaded node",
                    .x = {"time, s"},
                    .y = {"displacement, mm", false, 0.0, {}},
                    .series = {}};
  std::vector<Creep> all;
  for (std::size_t place = 0; place < study.place_count(); ++place) {
    const auto& creep = all.emplace_back(study.off_line({place}, CreepWay::Slowly));
    auto& row = table.rows.emplace_back(1, std::to_string(place + 1));
    for (const double time : times) row.push_back(shown(creep.at_mm(time)));
    row.push_back(shown(creep.last_over_first()));
    places.series.push_back(
        curve(fmt::format("place {}", place + 1), creep, plot::Style::Line, {}));
    section.exactly(name_of(study, "rises-") + std::to_string(place + 1), "yes",
                    creep.rises() ? "yes" : "no", law(0, "relaxation under a constant force"),
                    "The displacement grows in every step.");
  }
  plot::Plot neighbours{.title = "Place 1 and nodes of the surface around it",
                        .x = {"time, s"},
                        .y = {"displacement, mm", false, 0.0, {}},
                        .series = {}};
  for (std::size_t node = 0; node <= kNeighbours_mm.size(); ++node)
    neighbours.series.push_back(curve(
        node == 0 ? "N, loaded" : fmt::format("N{}, {} mm off", node, kNeighbours_mm[node - 1]),
        all[0], plot::Style::Line, {}, node));
  section.add(std::move(table));
  section.add(std::move(places));
  section.add(std::move(neighbours));
  return all;
}

// Compares the displacement under half of the force with that under the whole, both at once:
// pressed and pulled, on linear and quadratic elements.
void show_half_force(const Lab& lab, Section& section, const CreepStudy& study) {
  Table table{fmt::format("Half of the force, at once: {}", study.liver().title),
              {"place, elements", "way", fmt::format("{} N, mm", kForce_n),
               fmt::format("{} N, mm", kForce_n / 2), "ratio"},
              {}};
  const auto ratio = [&](std::size_t place, double force_n, ElementOrder order) {
    const double whole = study.off_line({place, force_n}, CreepWay::AtOnce, order).at_mm(0),
                 half = study.off_line({place, force_n / 2}, CreepWay::AtOnce, order).at_mm(0);
    table.rows.push_back(
        {fmt::format("{}, {}", place + 1, order == ElementOrder::Linear ? "linear" : "quadratic"),
         force_n > 0 ? "pressed" : "pulled", shown(whole), shown(half), shown(half / whole)});
    return half / whole;
  };
  for (std::size_t place = 0; place < study.place_count(); ++place) {
    const double pressed = ratio(place, kForce_n, ElementOrder::Linear);
    ratio(place, -kForce_n, ElementOrder::Linear);
    if (place == 0)
      section.measured(name_of(study, "half-force"), shown(pressed),
                       fmt::format("Displacement at half of the force over that at the whole, "
                                   "place 1, pressed. The paper's is {}; its force, place and "
                                   "mesh are unknown, ours are chosen.",
                                   shown(kPaperHalf_mm / kPaper_mm)));
  }
  if (!lab.is_short()) ratio(0, kForce_n, ElementOrder::Quadratic);
  table.rows.push_back({"paper's", "not stated", shown(kPaper_mm), shown(kPaperHalf_mm),
                        shown(kPaperHalf_mm / kPaper_mm)});
  section.add(std::move(table));
}

// Draws figure 7, and the live solver beside the off-line one.
void show_two_loads(Section& section, const CreepStudy& study, const Creep& whole) {
  const double end = study.seconds();
  const auto half = study.off_line({0, kForce_n / 2}, CreepWay::Slowly);
  const auto moving = study.off_line({0}, CreepWay::WithInertia);
  const auto live = study.live({0}, moving.time_s);
  section.add(
      {.title = fmt::format("Place 1, two loads: {}", study.liver().title),
       .x = {"time, s"},
       .y = {"displacement, mm", false, 0.0, {}},
       .series = {curve(fmt::format("{} N, off-line", kForce_n), whole, plot::Style::Line, 0),
                  curve("off-line with inertia", moving, plot::Style::Dashed, 1),
                  curve("live", live, plot::Style::Points, 2),
                  curve(fmt::format("{} N, off-line", kForce_n / 2), half, plot::Style::Line, 3)}});
  Table table{fmt::format("Place 1, mm: {}", study.liver().title),
              {"time, s", "off-line, half of the force", "whole", "ratio", "whole, with inertia",
               "live", "live off"},
              {}};
  for (const double time : {0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 20.0}) {
    if (time > end) break;
    if (time == 0) {
      table.rows.push_back({"0", shown(half.at_mm(0)), shown(whole.at_mm(0)),
                            shown(half.at_mm(0) / whole.at_mm(0)), "", "", ""});
      continue;
    }
    table.rows.push_back({shown(time), shown(half.at_mm(time)), shown(whole.at_mm(time)),
                          shown(half.at_mm(time) / whole.at_mm(time)), shown(moving.at_mm(time)),
                          shown(live.at_mm(time)),
                          shown_percent(live.at_mm(time) / moving.at_mm(time) - 1)});
  }
  section.add(std::move(table));
  section.at_most(name_of(study, "live"), "off-line with inertia",
                  curve_error(live, moving, kSwings_s),
                  target(kLiveTarget, "1 % of the converged solution").missed(kLiveOnRecord),
                  "Live solver, same mesh and elements, largest difference from 0.2 s on.");
  section.compare(name_of(study, "live-end"), moving.at_mm(end), live.at_mm(end),
                  target(kLiveTarget, "1 % of the converged solution"), "mm",
                  "The same at the end.");
}

// How much farther a half-space under a point force is after all relaxation than at once: (1 - nu)
// / mu of then over now (Boussinesq), since only shear relaxes.
double relaxed_half_space(const material::HyperelasticMaterial& material) {
  const auto compliance = [&](double share) {
    const double mu = 2 * material.coefficients_pa[0] * share, k = material.bulk_modulus_pa;
    return (1 - (3 * k - 2 * mu) / (2 * (3 * k + mu))) / mu;
  };
  return compliance(material.equilibrium_share()) / compliance(1);
}

// Small displacements grow as those of a half-space, in elements that do not lock.
void show_relaxed(const Lab& lab, Section& section, const CreepStudy& study) {
  const double expected = relaxed_half_space(study.liver().organ.material.measured);
  Table table{
      fmt::format("A hundredth of the force, all relaxed over at once: {}", study.liver().title),
      {"elements", "at once, um", "relaxed, um", "ratio", "half-space"},
      {}};
  for (const auto order : {ElementOrder::Linear, ElementOrder::Quadratic}) {
    const bool is_linear = order == ElementOrder::Linear;
    const auto creep = study.off_line({0, kSmallPart * kForce_n}, CreepWay::Relaxed, order);
    table.rows.push_back({is_linear ? "linear" : "quadratic",
                          shown(length(creep.moves.front()[0]) * 1e6),
                          shown(length(creep.moves.back()[0]) * 1e6),
                          shown(creep.last_over_first()), shown(expected)});
    if (!is_linear)
      section.compare(name_of(study, "relaxed"), expected, creep.last_over_first(),
                      law(kRelaxedBound, "Boussinesq, only shear relaxes").missed(kRelaxedOnRecord),
                      "",
                      "A hundredth of the force, quadratic elements: displacement after all "
                      "relaxation over that at once, against a half-space under a point force.");
  }
  section.add(std::move(table));
  if (!lab.is_short()) return;
  const double end = study.seconds();
  const auto creep = study.off_line({0}, CreepWay::Slowly),
             longer = study.off_line({0}, CreepWay::Slowly, ElementOrder::Linear, 2);
  section.compare(name_of(study, "time-steps"), creep.at_mm(end), longer.at_mm(end),
                  target(kStepsBound, "steps of time do not show"), "mm",
                  "Off-line with steps of time twice as long.");
}

}  // namespace

void run_dogan_creep(const Lab& lab, Section& section) {
  section.say(fmt::format(
      "The paper holds a liver of 4,055 nodes and 9,126 tets at its \"end nodes\", loads surface "
      "nodes within a radius of influence by a constant \"unit force\" for 20 s, and shows the "
      "displacement of the loaded node (figure 2), of some neighbours (figure 6) and for two loads "
      "(figure 7); in the text, 4.5 mm for the whole and 2.1 mm for half of the force, where "
      "linear "
      "tissue would have 2.25. It states neither the force's unit and direction, nor place, "
      "radius, "
      "mesh or the moment of these figures, so only the method and the kind of behaviour can be "
      "compared. Ours: {} N along the inward normal, spread over the surface nodes within {} mm; "
      "table 1 with K = 40 C10, plain linear tets, which lock (see dogan2011/locking).",
      kForce_n, kRadius_mm));
  for (const auto& liver : measured_livers(lab)) {
    const CreepStudy study(lab, section, liver);
    const auto places = show_places(section, study);
    show_half_force(lab, section, study);
    show_two_loads(section, study, places[0]);
    show_relaxed(lab, section, study);
  }
}

}  // namespace trocar::validation
