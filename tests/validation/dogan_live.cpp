// The measured liver live: one hand presses it by a tool, in the ticks of a session. How far
// contact displacement and contact force are from the same session with every tick solved to a
// tolerance, and what a tick takes, from the same run.

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

#include "common/base/timing.h"
#include "server/lab/calibration/places.h"
#include "server/session/control/rate_controller.h"
#include "server/tissue/hands/sampling.h"
#include "server/tissue/step/simulation.h"
#include "tests/validation/experiments.h"
#include "tests/validation/measure.h"
#include "tests/validation/measured_livers.h"
#include "tests/validation/references.h"

namespace trocar::validation {
namespace {

// The targets are an error of 1 % and a tick of 1 ms.
constexpr double kErrorTarget = 0.01, kTickTarget_ms = 1, kBudget_ms = 0.8;
constexpr double kReferenceTarget = kErrorTarget / 5;
// Plain tets are known to miss it by little.
constexpr double kPlainOnRecord = 0.015;
// Averaged strain misses it by little in the small liver, by the force.
constexpr double kAveragedForceOnRecord = 0.0125;
constexpr float kToolRadius_m = 0.008f, kDeep_m = 0.010f, kAbove_m = 0.003f;
constexpr std::uint64_t kLiveSeed = 2011;
// Below this share of the largest force the tool has hardly met the tissue.
constexpr double kLeastShare = 0.05;

// Returns the height of the tip above the surface, m: it presses, holds while the tissue relaxes,
// presses deeper and lifts off. `part` is the share of the run, 0 to 1.
float height_m(float part) {
  struct Key {
    float part, height_m;
  };
  constexpr std::array<Key, 6> kKeys{{{0, kAbove_m},
                                      {0.25f, -0.6f * kDeep_m},
                                      {0.65f, -0.6f * kDeep_m},
                                      {0.75f, -kDeep_m},
                                      {0.85f, -kDeep_m},
                                      {1, kAbove_m}}};
  for (std::size_t i = 1; i < kKeys.size(); ++i)
    if (part <= kKeys[i].part) {
      const auto& [begin, from] = kKeys[i - 1];
      const auto& [end, to] = kKeys[i];
      return from + (to - from) * (part - begin) / (end - begin);
    }
  return kAbove_m;
}

struct LiveCourse {
  std::vector<Vec3d> forces_n, moves_m;  // per tick: of the tissue on the tool, of the place
  std::vector<double> tick_ms;           // CPU time
  calibration::Convergence convergence;  // of a reference
  calibration::Pilot pilot;
};

double largest_of(const std::vector<Vec3d>& values) {
  double most = 0;
  for (const auto& value : values) most = std::max(most, length(value));
  return most;
}

class LiveHand {
 public:
  LiveHand(const organ::Organ& organ, Tick ticks)
      : organ_(organ),
        place_(calibration::spread_places(organ, 1, kLiveSeed).at(0)),
        ticks_(ticks) {}

  using Decide = std::function<step::TickDecisions(Tick)>;
  // is_controlled: a rate controller decides, and the first tick is its highest. scheme: of
  // averaged strain; empty: as in a session.
  LiveCourse press(const Decide& decide, bool is_controlled = false,
                   std::optional<dynamics::StrainScheme> scheme = {}) const {
    step::Simulation simulation(organ_, 1, {.strain_scheme = scheme});
    std::optional<control::RateController> controller;
    if (is_controlled)
      controller.emplace(
          control::RateLimits{.highest = decide(1),
                              .layer_sweeps = simulation.context().solve.far_plan.sweeps,
                              .far_interval = control::kLongestFarInterval,
                              .budget_us = kBudget_ms * 1e3});
    hands::TickInputs inputs;
    hands::HandJoin join{.slot = {0}};
    join.shapes[0] = {.radius_m = kToolRadius_m, .length_m = 0.3f};
    inputs.joins.push_back(join);
    LiveCourse course;
    for (Tick tick = 1; tick <= ticks_; ++tick) {
      if (hands::takes_samples(tick)) inputs.samples.push_back(sample_at(tick));
      const auto decisions = controller ? controller->decisions() : decide(tick);
      const auto begin = thread_cpu_ns();
      const auto& report = simulation.tick(inputs, decisions);
      const auto cpu_ns = thread_cpu_ns() - begin;
      inputs.clear();
      simulation.pop_frame();
      if (controller) controller->observe(report, {cpu_ns, 0});
      course.convergence.note(report, decisions);
      course.tick_ms.push_back(static_cast<double>(cpu_ns) * 1e-6);
      course.forces_n.push_back(force_in(simulation));
      course.pilot.note(report, length(course.forces_n.back()));
      course.moves_m.push_back(
          to_double(simulation.state().world.displacements[place_.node.value]));
    }
    return course;
  }

  LiveCourse press(const step::TickDecisions& decisions) const {
    return press([&](Tick) { return decisions; });
  }
  // With all forces implicit.
  LiveCourse press_converged(const calibration::Pilot& pilot, double looser = 1) const {
    const auto decisions =
        calibration::converged_decisions(pilot.tolerance_n(organ_.mesh.node_count(), looser));
    return press([&](Tick) { return decisions; }, false, dynamics::StrainScheme::Implicit);
  }

 private:
  hands::ToolInput sample_at(Tick tick) const {
    const float height = height_m(static_cast<float>(tick) / static_cast<float>(ticks_));
    return {tool_slot({0}, 0),
            {{place_.position + place_.outward * height, rotation_from_z(place_.outward)},
             tool::Verb::Push}};
  }

  static Vec3d force_in(const step::Simulation& simulation) {
    Vec3d force;
    const auto& contacts = simulation.context().contact.found;
    for (const auto& tool : contacts.tools)
      force += to_double(contact::reaction_on(contacts, tool, simulation.state().world).force_n);
    return force;
  }

  const organ::Organ& organ_;
  const calibration::Place place_;
  const Tick ticks_;
};

double percentile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// Mean: sum of the differences over the sum of the reference; others over the reference's largest.
struct Error {
  double mean = 0, p95 = 0, worst = 0;

  std::string shown_all() const {
    return fmt::format("{:.2f}, {:.2f}, {:.2f} %", 100 * mean, 100 * p95, 100 * worst);
  }
};

// Over the ticks in which the tool presses.
Error error_of(const std::vector<Vec3d>& ours, const std::vector<Vec3d>& reference,
               const std::vector<Vec3d>& reference_forces) {
  const double largest = largest_of(reference), largest_force = largest_of(reference_forces);
  double sum = 0, reference_sum = 0;
  std::vector<double> differences;
  for (std::size_t i = 0; i < ours.size(); ++i) {
    if (length(reference_forces[i]) < kLeastShare * largest_force) continue;
    const double difference = length(ours[i] - reference[i]);
    sum += difference;
    reference_sum += length(reference[i]);
    differences.push_back(difference / largest);
  }
  return {sum / reference_sum, percentile(differences, 0.95), percentile(differences, 1)};
}

struct LiveStudy {
  Table table{
      "One hand on the measured liver: displacement and force at the contact against the "
      "converged solution, and CPU time of a tick",
      {"liver", "strain", "decisions", "displacement: mean, 95th, worst",
       "force: mean, 95th, worst", "within 1 %", "tick, ms: median, 95th", "ticks within 1 ms"},
      {}};
};

void add_row(LiveStudy& study, const MeasuredLiver& liver, const char* strain,
             const char* decisions, const LiveCourse& course, const Error& move,
             const Error& force) {
  const auto fast = std::count_if(course.tick_ms.begin(), course.tick_ms.end(),
                                  [](double ms) { return ms <= kTickTarget_ms; });
  study.table.rows.push_back(
      {liver.title, strain, decisions, move.shown_all(), force.shown_all(),
       move.p95 <= kErrorTarget && force.p95 <= kErrorTarget ? "yes" : "no",
       fmt::format("{:.2f}, {:.2f}", percentile(course.tick_ms, 0.5),
                   percentile(course.tick_ms, 0.95)),
       fmt::format("{:.0f} %", 100.0 * static_cast<double>(fast) /
                                   static_cast<double>(course.tick_ms.size()))});
}

void measure(const Lab& lab, Section& section, const MeasuredLiver& liver, bool is_averaged,
             LiveStudy& study) {
  const char* strain = is_averaged ? "averaged" : "plain";
  show_progress(fmt::format("{}, {} strain", liver.name, strain));
  auto organ = liver.organ;
  organ.material.has_averaged_strain = is_averaged;
  const Tick ticks = lab.is_short() ? 400 : 1500;
  LiveHand hand(organ, ticks);
  const auto pilot = hand.press(calibration::Pilot::decisions).pilot;
  const auto reference = hand.press_converged(pilot),
             loose = hand.press_converged(pilot, calibration::kLooser);
  const auto errors = [&](const LiveCourse& course) {
    return std::pair{error_of(course.moves_m, reference.moves_m, reference.forces_n),
                     error_of(course.forces_n, reference.forces_n, reference.forces_n)};
  };
  const auto fixed = hand.press(step::TickDecisions{});
  const auto [move, force] = errors(fixed);
  add_row(study, liver, strain, "fixed, 4 sweeps", fixed, move, force);
  // Whether the linear far field is what is off.
  const auto exact = hand.press(step::TickDecisions{.is_far_exact = true});
  const auto [exact_move, exact_force] = errors(exact);
  add_row(study, liver, strain, "4 sweeps, exact far field", exact, exact_move, exact_force);
  const auto controlled = hand.press([](Tick) { return step::TickDecisions{}; }, true);
  const auto [controlled_move, controlled_force] = errors(controlled);
  add_row(study, liver, strain, "rate controller, 0.8 ms", controlled, controlled_move,
          controlled_force);
  const auto name = [&](const char* what) {
    return fmt::format("{}-{}-{}", liver.name, strain, what);
  };
  check_reference(section, name("reference"), reference.convergence,
                  error_of(loose.forces_n, reference.forces_n, reference.forces_n).worst,
                  target(kReferenceTarget, "a fifth of what the reference judges"));
  const auto aim = target(kErrorTarget, "1 % of the converged solution");
  // Plain tets miss the target in the large liver, by the displacement.
  const auto of_move = lab.is_short() || is_averaged ? aim : aim.missed(kPlainOnRecord);
  section.at_most(name("displacement"), "its converged solution", move.p95, of_move,
                  "Displacement at the contact, 95th percentile over ticks.");
  // The small liver's contact is as wide as the liver, where far forces are linear.
  const auto of_force = lab.is_short() && is_averaged ? aim.missed(kAveragedForceOnRecord) : aim;
  section.at_most(name("force"), "its converged solution", force.p95, of_force,
                  "Contact force, 95th percentile over ticks.");
  section.add({.title = fmt::format("Contact force, {}, {} strain", liver.title, strain),
               .x = {"time, s"},
               .y = {"force, N"},
               .series = {force_curve("converged", reference.forces_n, plot::Style::Line),
                          force_curve("a session's tick", fixed.forces_n, plot::Style::Dashed),
                          force_curve("with the rate controller", controlled.forces_n,
                                      plot::Style::Dashed)}});
}

}  // namespace

void run_dogan_live(const Lab& lab, Section& section) {
  section.say(fmt::format(
      "A tip of {:.0f} mm presses the measured liver 6 mm in, holds while the tissue relaxes, "
      "presses 10 mm in and leaves, in the ticks of a session. The same hand on the same organ "
      "with every tick solved to a tolerance is the reference: all residuals together are at most "
      "{:g} of the largest force, or a little more than rounding leaves. Errors are over the ticks "
      "with "
      "force: the mean is a sum over a sum, the others are over the reference's largest value. "
      "Aimed at: 1 % "
      "(displacement and force, 95th percentile) and 1 ms; times depend on the machine and are no "
      "bound.",
      1e3 * static_cast<double>(kToolRadius_m), calibration::kResidualShare));
  LiveStudy study;
  for (const auto& liver : measured_livers(lab))
    for (const bool is_averaged : {false, true}) measure(lab, section, liver, is_averaged, study);
  section.add(std::move(study.table));
}

}  // namespace trocar::validation
