// Beyond the paper: what it costs that only a part of an organ moves (frozen), or that the part far
// from the tools is swept less (graded), against every node solved to a tolerance.

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

#include "common/base/timing.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "tests/validation/experiments.h"
#include "tests/validation/measure.h"
#include "tests/validation/organs.h"
#include "tests/validation/scenario_text.h"

namespace trocar::validation {
namespace {

constexpr double kPressEnd_s = 0.25, kHoldEnd_s = 0.35, kLiftEnd_s = 0.40, kEnd_s = 0.60;
constexpr int kDefaultNodes = 1200;
// 1,200 nodes cost much in a liver that is nearly incompressible: what a press displaces must go
// somewhere, and there is nowhere to go but into the nodes that stand still. With springs, which
// are compressible, it was 12 to 16 %. These errors are on record.
constexpr double kFrozenLiver4k = 0.4, kFrozenLiver17k = 0.9, kFrozenStomach = 0.9;

struct Press {
  const char* organ;   // in names
  std::string source;  // text of [organ]
  const char* anchor;
  double radius_mm;  // more than three elements
  double depth_mm;   // below 0: grasps and pulls
  // Bounds of the contact force's error, the latter three at the default limit of nodes.
  double whole_mean = 0.01, frozen_mean = 0.2, graded_mean = 0.03, graded_peak = 0.05;
  std::optional<double> frozen_on_record;  // where frozen_mean is known to be missed

  Bound frozen_bound() const {
    const auto aim = target(frozen_mean, "20 % of the converged force");
    return frozen_on_record ? aim.missed(*frozen_on_record) : aim;
  }
};

std::string press_scene(const Press& press, const std::string& run) {
  const bool pulls = press.depth_mm < 0;
  return press.source +
         fmt::format(
             "[[tool]]\nradius_mm = {0}\nreach_mm = {0}\nease = \"linear\"\nanchor = {1}\n"
             "anchor_frame = \"normal\"\n"
             "[[tool.key]]\ntime_s = 0\nposition_mm = [0, 0, 1]\nverb = \"{2}\"\n"
             "[[tool.key]]\ntime_s = {3}\nposition_mm = [0, 0, {4}]\n"
             "[[tool.key]]\ntime_s = {5}\nposition_mm = [0, 0, {4}]\n{6}"
             "[[tool.key]]\ntime_s = {7}\nposition_mm = [0, 0, 20]\n\n",
             press.radius_mm, press.anchor, pulls ? "grasp" : "push", kPressEnd_s, -press.depth_mm,
             kHoldEnd_s, pulls ? "verb = \"none\"\n" : "", kLiftEnd_s) +
         fmt::format("[run]\nseconds = {}\n", kEnd_s) + run +
         "\n[[probe]]\ntool = 0\nquantity = \"force\"\n";
}

struct PropagationCourse {
  std::vector<Vec3d> forces_n;          // per tick
  Field held, released;                 // at the end of the hold, and at the end
  double active = 0, milliseconds = 0;  // means per tick
};

PropagationCourse update_propagation(const Lab& lab, Section& section, ScenarioRun& run) {
  PropagationCourse course;
  const auto begin = thread_cpu_ns();
  lab.finish(section, run, [&](const scenario::StepReport& report) {
    course.forces_n.push_back(run.probe(0));
    course.active += static_cast<double>(report.active_nodes);
    if (std::abs(run.time_s() - kHoldEnd_s) < 1e-6) course.held = field_of(run);
  });
  const auto ticks = static_cast<double>(course.forces_n.size());
  course.milliseconds = static_cast<double>(thread_cpu_ns() - begin) * 1e-6 / ticks;
  course.active /= ticks;
  course.released = field_of(run);
  return course;
}

struct PropagationErrors {
  double mean = 0, peak = 0;  // of the contact force: over its mean, over its largest
  double field = 0;           // at the end of the hold
  double after_mm = 0;        // largest difference of any node a fifth of a second after release
};

PropagationErrors compare_propagation(const PropagationCourse& course,
                                      const PropagationCourse& reference) {
  PropagationErrors errors;
  double sum = 0, reference_sum = 0, most = 0, largest_force = 0;
  for (std::size_t i = 0; i < reference.forces_n.size(); ++i) {
    const double difference = length(course.forces_n[i] - reference.forces_n[i]);
    sum += difference;
    most = std::max(most, difference);
    reference_sum += length(reference.forces_n[i]);
    largest_force = std::max(largest_force, length(reference.forces_n[i]));
  }
  errors.mean = sum / reference_sum;
  errors.peak = most / largest_force;
  errors.field = field_error(course.held, reference.held);
  errors.after_mm = largest_difference(course.released, reference.released) * 1e3;
  return errors;
}

struct PropagationStudy {
  plot::Plot forces, errors;
  Table table;
};

void propagation_add_row(PropagationStudy& study, const std::string& mode, const std::string& limit,
                         const PropagationCourse& course, const PropagationErrors& errors) {
  study.table.rows.push_back({mode, limit, fmt::format("{:.0f}", course.active),
                              shown_percent(errors.mean), shown_percent(errors.peak),
                              shown_percent(errors.field), fmt::format("{:.3g}", errors.after_mm),
                              fmt::format("{:.3g}", course.milliseconds)});
}

// One mode over several limits; false if the solver has not got it.
bool sweep_limits(const Lab& lab, Section& section, const Press& press,
                  const PropagationCourse& reference, const std::string& mode,
                  PropagationStudy& study, PropagationErrors& at_default) {
  plot::Series mean{mode + ": contact force, mean", {}, {}, plot::Style::LineAndPoints, {}},
      field{mode + ": field at the hold", {}, {}, plot::Style::LineAndPoints, {}};
  const std::vector<int> limits = lab.is_short()
                                      ? std::vector<int>{kDefaultNodes}
                                      : std::vector<int>{300, 600, kDefaultNodes, 2400, 4800};
  for (const int nodes : limits) {
    const auto run = lab.try_start(
        section, mode, fmt::format("{}-{}-{}", mode, press.organ, nodes),
        press_scene(press, fmt::format("boundary = \"{}\"\nnodes = {}\n", mode, nodes)));
    if (!run) return false;
    const PropagationCourse course = update_propagation(lab, section, *run);
    const PropagationErrors errors = compare_propagation(course, reference);
    if (nodes == kDefaultNodes) {
      at_default = errors;
      study.forces.series.push_back(force_curve(fmt::format("{}, {} nodes", mode, nodes),
                                                course.forces_n, plot::Style::Line));
    }
    for (auto* series : {&mean, &field}) series->x.push_back(nodes);
    mean.y.push_back(100 * errors.mean);
    field.y.push_back(100 * errors.field);
    propagation_add_row(study, mode, std::to_string(nodes), course, errors);
  }
  study.errors.series.push_back(mean);
  study.errors.series.push_back(field);
  return true;
}

void study_press(const Lab& lab, Section& section, const Press& press) {
  const auto full =
      lab.start(section, "full", fmt::format("full-{}", press.organ),
                press_scene(press, "tolerance_n = 1e-6\nmax_sweeps = 2000\n"), Solver::Full);
  const PropagationCourse reference = update_propagation(lab, section, *full);
  const std::string title = fmt::format("{} ({} nodes)", press.organ, full->world().node_count());
  PropagationStudy study{
      {.title = title + ": contact force", .x = {"time, s"}, .y = {"force, N"}, .series = {}},
      {.title = title + ": error against the full solve",
       .x = {"limit of nodes", true},
       .y = {"error, %", true},
       .series = {}},
      {title,
       {"mode", "limit", "near nodes, mean", "contact force, mean", "peak", "field at the hold",
        "largest after release, mm", "CPU per tick, ms"},
       {}}};

  const auto whole = lab.start(section, "whole", fmt::format("whole-{}", press.organ),
                               press_scene(press, "boundary = \"whole\"\n"));
  const PropagationCourse live = update_propagation(lab, section, *whole);
  const PropagationErrors live_errors = compare_propagation(live, reference);
  propagation_add_row(study, "whole", "all", live, live_errors);
  section.at_most(fmt::format("{}-whole", press.organ), "full solve", live_errors.mean,
                  target(press.whole_mean, "1 % of the converged force"),
                  "Every node, four sweeps per tick: mean error of the contact force.");

  PropagationErrors frozen, graded;
  sweep_limits(lab, section, press, reference, "frozen", study, frozen);
  section.at_most(fmt::format("{}-frozen", press.organ), "full solve", frozen.mean,
                  press.frozen_bound(),
                  fmt::format("Only {} nodes move: mean error of the contact force (peak {}).",
                              kDefaultNodes, shown_percent(frozen.peak)));
  if (sweep_limits(lab, section, press, reference, "graded", study, graded)) {
    section.at_most(fmt::format("{}-graded", press.organ), "full solve", graded.mean,
                    target(press.graded_mean, "3 % of the converged force"),
                    fmt::format("{} nodes swept more, the rest less: mean error of the contact "
                                "force.",
                                kDefaultNodes));
    section.at_most(fmt::format("{}-graded-peak", press.organ), "full solve", graded.peak,
                    target(press.graded_peak, "5 % of the largest force"),
                    "The same: largest error over the largest force.");
  }
  // Last, so that it is seen on top of what agrees with it.
  study.forces.series.push_back(force_curve("full", reference.forces_n, plot::Style::Dashed));
  section.add(std::move(study.forces));
  if (!lab.is_short()) section.add(std::move(study.errors));
  section.add(std::move(study.table));
}

void introduce(Section& section, double radius_mm, double depth_mm) {
  section.say(fmt::format(
      "A tool with a round tip of {} mm radius presses {} mm into the organ within {} s, holds "
      "until {} s, and leaves. In the reference every node is solved to 1e-6 N in every tick. "
      "\"frozen\" moves only the nodes of the queue, as the papers do; \"graded\" moves every node "
      "and sweeps those of the queue more. Errors of the contact force are differences as vectors: "
      "mean over mean, largest over largest.",
      radius_mm, depth_mm, kPressEnd_s, kHoldEnd_s));
}

}  // namespace

void run_propagation_lattice(const Lab& lab, Section& section) {
  introduce(section, 32, 10);
  section.say(
      "The lattice with springs along its diagonals is pressed. The paper's own lattice has no "
      "shear stiffness: its columns buckle under a push, and where they go depends on the last "
      "digit, so it "
      "is grasped and pulled out by 10 mm instead.");
  lab.keep_organ("lattice-with-diagonals", lattice_with_diagonals({}));
  study_press(lab, section,
              {.organ = "lattice-with-diagonals",
               .source = organ_source("lattice-with-diagonals.organ"),
               .anchor = "[0.03, 1, 0.03]",
               .radius_mm = 32,
               .depth_mm = 10});
  if (lab.is_short()) return;
  study_press(lab, section,
              {.organ = "lattice",
               .source = lattice_organ(30, 15, 30, 10),
               .anchor = "[0.03, 1, 0.03]",
               .radius_mm = 16,
               .depth_mm = -10,
               .frozen_on_record = 0.7});
}

void run_propagation_liver(const Lab& lab, Section& section) {
  introduce(section, 28, 10);
  Press press{.organ = "liver-4k",
              .source = organ_source("elastic-liver"),
              .anchor = "[0.2, 0.1, 1]",
              .radius_mm = 28,
              .depth_mm = 10,
              .frozen_on_record = kFrozenLiver4k};
  study_press(lab, section, press);
  if (lab.is_short()) return;
  press.organ = "liver-4k-left";
  press.anchor = "[-0.5, -0.6, 1]";
  study_press(lab, section, press);
}

void run_propagation_large_liver(const Lab& lab, Section& section) {
  introduce(section, 18, 10);
  auto liver = catalogue::make_liver(90'000);
  TROCAR_ASSERT(liver.ok());
  lab.keep_organ("liver-17k", *liver);
  study_press(lab, section,
              {.organ = "liver-17k",
               .source = organ_source("liver-17k.organ"),
               .anchor = "[0.2, 0.1, 1]",
               .radius_mm = 18,
               .depth_mm = 10,
               .frozen_on_record = kFrozenLiver17k});
}

void run_propagation_stomach(const Lab& lab, Section& section) {
  introduce(section, 14, 10);
  study_press(lab, section,
              {.organ = "stomach",
               .source = organ_source("stomach"),
               .anchor = "[0.3, 0.2, 1]",
               .radius_mm = 14,
               .depth_mm = 10,
               .frozen_on_record = kFrozenStomach});
}

}  // namespace trocar::validation
