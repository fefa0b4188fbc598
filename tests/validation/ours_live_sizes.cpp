// When a local reduction pays: the same press of livers from a thousand nodes on, with the full
// solver as it runs and with one patch of a reduction; what a tick takes, what is off, and what the
// reduction takes to make and to keep.

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/builtin_search.h"
#include "server/organs/catalogue/liver_shape.h"
#include "server/organs/mesh/stuffing.h"
#include "tests/validation/live_experiments.h"
#include "tests/validation/live_livers.h"

namespace trocar::validation {
namespace {

constexpr Tick kSizesFieldTicks = 10;
// Above this the converged session takes longer than it is worth.
constexpr std::size_t kMostReferenceNodes = 60'000;

struct Size {
  int tets;
  double radius_m;         // of the patch: fewer nodes of a fine mesh, for kMaxLocalFields
  std::size_t directions;  // of the presses of the training
};
// About 1,000, 4,000, 17,000, 50,000 and 100,000 nodes.
constexpr std::array<Size, 5> kSizes{{{4'200, 0.02, 5},
                                      {catalogue::kDefaultLiverTets, 0.012, 5},
                                      {87'000, 0.012, 2},
                                      {265'000, 0.008, 1},
                                      {540'000, 0.0065, 1}}};
constexpr std::size_t kShortSizes = 2;

// catalogue::make_measured_liver() has a limit.
organ::Organ liver_of(int tets) {
  auto mesh = catalogue::mesh_with_about(
      tets, 1.63e-3,
      [](double spacing_m) {
        return mesh::stuff_isosurface(catalogue::liver_field, catalogue::liver_box(), spacing_m);
      },
      "liver");
  TROCAR_ASSERT(mesh.ok());
  organ::Organ organ;
  organ.name = "liver";
  organ.source = fmt::format("liver, {} tets asked for", tets);
  organ.mesh = std::move(*mesh);
  for (const NodeIndex node : organ.mesh.surface_nodes)
    if (catalogue::is_liver_held(organ.mesh.rest_positions[node.value]))
      organ.fixed_nodes.push_back(node);
  organ.source_offset_m = mesh::centre_on_origin(organ.mesh);
  organ.node_masses_kg = organ::lumped_masses(organ);
  material::use_measured(*material::find_measured_material("human_liver_nava2008"), organ.material);
  TROCAR_ASSERT(organ::validate(organ).ok());
  return organ;
}

struct Found {
  double nodes = 0, full_us = 0, reduced_us = 0;
};

class SizesStudy {
 public:
  SizesStudy(const Lab& lab, Section& section) : section_(section), is_short_(lab.is_short()) {}

  void run() {
    for (std::size_t i = 0; i < (is_short_ ? kShortSizes : kSizes.size()); ++i) measure(kSizes[i]);
    show();
  }

 private:
  void measure(const Size& size) {
    const auto organ = liver_of(size.tets);
    const auto nodes = organ.mesh.node_count();
    const auto name = fmt::format("{} nodes", nodes);
    show_progress(name);
    reduce::LocalSettings settings{
        .patch_radius_m = size.radius_m, .directions = size.directions, .patches = 1, .threads = 2};
    if (is_short_) settings.directions = 1, settings.field_nodes = 5;
    const auto made = make_live_reduction(name, organ, settings);
    const auto place = live_places(organ, made, 1, 0).at(0);
    Stroke stroke{.place = place, .aside = place.inward, .depth_m = 0.006f};
    stroke.hold_ticks = is_short_ ? 100 : 200;
    const auto script = script_of(stroke);
    show_progress(name + ": sessions");
    const auto reduced = run_session(organ, made.local, script, kSizesFieldTicks),
               full = run_session(organ, nullptr, script, kSizesFieldTicks);
    Course reference;
    References references;
    const bool has_reference = nodes <= kMostReferenceNodes;
    if (has_reference) {
      show_progress(name + ": converged session");
      reference = references.run(organ, script, kSizesFieldTicks);
    }
    std::vector<double> reduced_us, full_us;
    std::array<std::vector<double>, 2> force, field;
    std::size_t contact = 0;
    const double least = kLeastShare * full.largest_force_n();
    for (std::size_t i = 0; i < full.ticks.size(); ++i) {
      if (length(full.ticks[i].force_n) < least) continue;
      ++contact;
      if (!reduced.ticks[i].is_reduced) continue;
      reduced_us.push_back(reduced.ticks[i].us);
      full_us.push_back(full.ticks[i].us);
      if (!has_reference) continue;
      force[0].push_back(force_error(reduced, reference, i));
      force[1].push_back(force_error(full, reference, i));
      if ((i + 1) % kSizesFieldTicks != 0) continue;
      const auto f = (i + 1) / kSizesFieldTicks - 1;
      field[0].push_back(field_error(reduced, reference, f));
      field[1].push_back(field_error(full, reference, f));
    }
    const Found found{static_cast<double>(nodes), quantile(full_us, 0.5),
                      quantile(reduced_us, 0.5)};
    const auto errors = [&](const std::vector<double>& values) {
      return has_reference ? shown_errors(values) : std::string("no reference");
    };
    const auto& patch = made.local->patches.front();
    times_.rows.push_back(
        {std::to_string(nodes), std::to_string(organ.mesh.tets.size()),
         fmt::format("{} us, {} us", shown(found.full_us), shown(quantile(full_us, 0.99))),
         fmt::format("{} us, {} us", shown(found.reduced_us), shown(quantile(reduced_us, 0.99))),
         shown(found.full_us / found.reduced_us),
         shown_percent(static_cast<double>(reduced_us.size()) / static_cast<double>(contact)),
         fmt::format("{:.0f} mm, {}", 1e3 * size.radius_m, made.local->field_count(patch)),
         fmt::format("{} s", shown(made.seconds)),
         fmt::format("{} MB", shown(1e-6 * static_cast<double>(made.bytes)))});
    errors_.rows.push_back({std::to_string(nodes), errors(force[1]), errors(force[0]),
                            errors(field[1]), errors(field[0]),
                            reduced.lost == 0 ? "" : fmt::format("tick {}", reduced.lost)});
    found_.push_back(found);
    const auto check = fmt::format("{}k", (nodes + 500) / 1000);
    if (has_reference) {
      references.check(section_, check + "-reference",
                       target(0.03 / 5, "a fifth of what the reference judges"));
      section_.at_most(check + "-force", "3 %", mean(force[0]),
                       target(0.03, "3 % of the converged force"),
                       "Contact force of the reduced solver, mean over ticks in contact.");
    }
  }

  // The number of nodes where both take as long, between sizes; empty: there is none.
  std::string crossing() const {
    std::string text;
    for (std::size_t i = 0; i + 1 < found_.size(); ++i) {
      const auto &a = found_[i], &b = found_[i + 1];
      const double from = std::log(a.full_us / a.reduced_us),
                   to = std::log(b.full_us / b.reduced_us);
      if (!((from < 0) != (to < 0))) continue;
      const double nodes =
          std::exp(std::log(a.nodes) + std::log(b.nodes / a.nodes) * from / (from - to));
      text +=
          fmt::format("{}{} nodes, from where the {} solver is faster", text.empty() ? "" : "; ",
                      shown(std::round(nodes / 100) * 100), to > 0 ? "reduced" : "full");
    }
    return text;
  }

  void show() {
    times_.title = "CPU time of a tick in contact while the patch acts, one press at its centre";
    times_.head = {"nodes",
                   "tets",
                   "full: median, 99th percentile",
                   "reduced: median, 99th percentile",
                   "full over reduced",
                   "ticks in contact reduced",
                   "patch: radius, fields",
                   "made in",
                   "file"};
    errors_.title = "Mean (95th percentile, worst) error in these ticks";
    errors_.head = {"nodes", "force, full", "force, reduced", "L2, full", "L2, reduced", "lost"};
    section_.add(std::move(times_));
    section_.add(std::move(errors_));
    plot::Plot plot;
    plot.title = "Tick of the full solver and of a patch";
    plot.x = {"nodes of the liver", true, {}, {}};
    plot.y = {"median CPU time, us", true, {}, {}};
    plot::Series full{"full, as it runs", {}, {}, plot::Style::LineAndPoints, 0},
        reduced{"reduced", {}, {}, plot::Style::LineAndPoints, 1};
    for (const auto& found : found_) {
      full.x.push_back(found.nodes), full.y.push_back(found.full_us);
      reduced.x.push_back(found.nodes), reduced.y.push_back(found.reduced_us);
    }
    plot.series = {full, reduced};
    section_.add(std::move(plot));
    const auto at = crossing();
    section_.say(at.empty() ? "They cross nowhere between these sizes."
                            : "They cross, between sizes by power laws, at " + at + ".");
  }

  Section& section_;
  const bool is_short_;
  std::vector<Found> found_;
  Table times_, errors_;
};

}  // namespace

void run_live_reduction_sizes(const Lab& lab, Section& section) {
  section.say(fmt::format(
      "A tip of 8 mm presses the centre of the one patch of a reduction 6 mm deep at 40 mm/s and "
      "stays, on the built-in liver at several sizes: with the reduction, and with the full solver "
      "as it runs, each alone, one worker, thread CPU time. The converged reference is left out "
      "above {} nodes. Patches of finer meshes are smaller, so that their fields are few enough, "
      "and are trained by fewer presses; the file is of that one patch with its Green's functions.",
      kMostReferenceNodes));
  SizesStudy(lab, section).run();
}

}  // namespace trocar::validation
