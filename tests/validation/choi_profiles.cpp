// Choi 2002 figure 5: the surface's profile for several penetration depths.

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "tests/validation/experiments.h"
#include "tests/validation/measure.h"
#include "tests/validation/organs.h"
#include "tests/validation/scenario_text.h"

namespace trocar::validation {
namespace {

constexpr int kWhole = 0;  // stands for no limit
constexpr double kPull_mm = 15, kSpacing_mm = 10;
constexpr double kInvisible = 0.02;  // of the pull: what the paper calls imperceptible

struct Material {
  const char* name;
  const char* title;
  std::string organ;
};

struct Pulled {
  Field field;
  double displacement_mm = 0, force_n = 0;
};

// The patch is three nodes across: at one node alone the answer would depend on the spacing only.
std::string setting(const Material& material) {
  return material.organ + near_set("patch", {5, 70, 5}, 14.2);
}

std::string settle(int depth) {
  return "[run]\nseconds = 0.6\ntolerance_n = 2e-5\nmax_sweeps = 4000\n" +
         (depth == kWhole ? std::string() : fmt::format("depth = {}\n", depth)) +
         "\n[[probe]]\nset = \"patch\"\nquantity = \"displacement\"\n";
}

constexpr const char* kDamped = "[material]\nnode_damping_per_s = 60\n\n";

std::string label(int depth) {
  return depth == kWhole ? "whole" : fmt::format("{:02}", depth);
}

Pulled pull_by(const Lab& lab, Section& section, const Material& material, int depth) {
  const auto run = lab.start(
      section, fmt::format("{}, moved", material.name),
      fmt::format("fig5-{}-moved-{}", material.name, label(depth)),
      setting(material) + kDamped + displace("patch", {{0, {}}, {0.2, {0, kPull_mm, 0}}}) +
          settle(depth) + "\n[[probe]]\nset = \"patch\"\nquantity = \"reaction\"\n",
      Solver::Full);
  lab.finish(*run);
  return {field_of(*run), run->probe(0).y * 1e3, run->probe(1).y};
}

Pulled pull_with(const Lab& lab, Section& section, const Material& material, int depth,
                 double force_n) {
  const auto run = lab.start(section, fmt::format("{}, pulled", material.name),
                             fmt::format("fig5-{}-pulled-{}", material.name, label(depth)),
                             setting(material) + kDamped +
                                 force("patch", {{0, {}}, {0.2, {0, force_n, 0}}}) + settle(depth),
                             Solver::Full);
  lab.finish(*run);
  return {field_of(*run), run->probe(0).y * 1e3, force_n};
}

// Along x over the patch's middle, outwards: what figure 5 draws on both sides.
plot::Series profile(const std::string& name, const Pulled& pulled) {
  plot::Series series{name, {}, {}, plot::Style::LineAndPoints, {}};
  for (int layer = -14; layer <= 14; ++layer) {
    const auto node = scene::lattice_node({}, 15 + layer, 14, 15);
    series.x.push_back(layer);
    series.y.push_back(pulled.field[node.value].y * 1e3 / kPull_mm);
  }
  return series;
}

double profile_difference(const plot::Series& a, const plot::Series& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.y.size(); ++i) most = std::max(most, std::abs(a.y[i] - b.y[i]));
  return most;
}

struct Bounds {
  double profile, displacement, force;  // at the greatest depth
};

void study(const Lab& lab, Section& section, const Material& material, const Bounds& bounds) {
  const std::vector<int> depths =
      lab.is_short() ? std::vector<int>{2, 6} : std::vector<int>{1, 2, 4, 6, 8, 10, 12, 14};
  const Pulled whole = pull_by(lab, section, material, kWhole);
  const auto reference = profile("whole", whole);
  plot::Plot profiles{.title = fmt::format("{}: profile of the surface", material.title),
                      .x = {"layers from the middle of the pull"},
                      .y = {"displacement / pull"},
                      .series = {}};
  plot::Series forces{"reaction for the same pull", {}, {}, plot::Style::LineAndPoints, {}},
      displacements{"displacement under the same force", {}, {}, plot::Style::LineAndPoints, {}},
      shapes{"profile, largest difference", {}, {}, plot::Style::LineAndPoints, {}};
  Table table{fmt::format("{}: against the whole lattice moving", material.title),
              {"depth", "profile differs by", "displacement under equal force, mm", "error",
               "reaction to equal pull, N", "error", "field error"},
              {}};
  int optimum = 0;
  double last[3]{};
  for (const int depth : depths) {
    const Pulled moved = pull_by(lab, section, material, depth);
    const Pulled pulled = pull_with(lab, section, material, depth, whole.force_n);
    const auto series = profile(fmt::format("n = {}", depth), moved);
    const double shape = profile_difference(series, reference);
    const double displacement = std::abs(pulled.displacement_mm - kPull_mm) / kPull_mm;
    const double reaction = std::abs(moved.force_n - whole.force_n) / whole.force_n;
    last[0] = shape, last[1] = displacement, last[2] = reaction;
    if (optimum == 0 && shape <= kInvisible) optimum = depth;
    if (depth != 1 && depth != 12) profiles.series.push_back(series);
    const std::pair<plot::Series*, double> points[] = {
        {&shapes, shape}, {&displacements, displacement}, {&forces, reaction}};
    for (const auto& [out, value] : points) {
      out->x.push_back(depth);
      out->y.push_back(100 * value);
    }
    table.rows.push_back({std::to_string(depth), shown_percent(shape),
                          shown(pulled.displacement_mm), shown_percent(displacement),
                          shown(moved.force_n), shown_percent(reaction),
                          shown_percent(field_error(moved.field, whole.field))});
  }
  table.rows.push_back({"whole", "", shown(kPull_mm), "", shown(whole.force_n), "", ""});
  profiles.series.push_back(reference);
  profiles.series.back().style = plot::Style::Dashed;
  const std::string prefix = material.name;
  section.at_most(
      prefix + "-profile", "no visible change beyond an optimum", last[0], bounds.profile,
      fmt::format("Profile at depth {} against the whole lattice, as a share of the pull.",
                  depths.back()));
  section.at_most(prefix + "-displacement", "whole lattice solved", last[1], bounds.displacement,
                  fmt::format("Displacement under equal force at depth {}.", depths.back()));
  section.at_most(prefix + "-reaction", "whole lattice solved", last[2], bounds.force,
                  fmt::format("Reaction to an equal pull at depth {}.", depths.back()));
  section.add(std::move(profiles));
  section.add({.title = fmt::format("{}: convergence with the depth", material.title),
               .x = {"penetration depth n"},
               .y = {"error, %", true},
               .series = {shapes, displacements, forces}});
  section.add(std::move(table));
  section.say(optimum > 0
                  ? fmt::format("From depth {} on the profile differs by less than {} of the pull.",
                                optimum, shown_percent(kInvisible))
                  : fmt::format("No depth up to {} brings the profile to within {} of the pull.",
                                depths.back(), shown_percent(kInvisible)));
}

}  // namespace

void run_fig5_profiles(const Lab& lab, Section& section) {
  section.say(fmt::format(
      "Nine nodes in the middle of the top of the 30 x 15 x 30 lattice (spacing 10 mm) are pulled "
      "up by {} mm; "
      "nodes beyond the penetration depth stay where they are. The paper draws the normalised "
      "displacement over the layers and says that beyond some optimal depth nothing visible "
      "changes; it prints no values. Ours is compared with the solution in which the whole lattice "
      "moves.",
      kPull_mm));
  section.say(
      "Springs along the three axes alone have no shear stiffness: what spreads a pull sideways is "
      "only that springs across it are stretched, so the profile is narrow and the pull is carried "
      "by the columns below it. The second lattice has springs along the diagonals of the faces, "
      "and with them shear, as tissue has.");
  study(lab, section, {"lattice", "Lattice of the paper", lattice_organ(30, 15, 30, kSpacing_mm)},
        {0.02, 0.02, 0.02});
  if (lab.is_short()) return;
  lab.keep_organ("lattice-with-diagonals", lattice_with_diagonals({}));
  study(lab, section,
        {"diagonals", "Lattice with diagonals", organ_source("lattice-with-diagonals.organ")},
        {0.05, 0.10, 0.10});
}

}  // namespace trocar::validation
