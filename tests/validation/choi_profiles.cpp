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
constexpr int kProfilePaperDepth = 10;
constexpr double kPull_mm = 15, kProfileSpacing_mm = 10;
constexpr double kInvisible = 0.03;  // of the pull: what the paper calls imperceptible
constexpr const char* kAsWhole = "the depth that is offered acts as the whole";

struct Material {
  const char* name;
  const char* title;
  organ::Organ organ;
  std::string text;  // that makes it
};

struct Pulled {
  Field field;
  double displacement_mm = 0, force_n = 0;
};

// The patch is three nodes across: at one node alone the answer would depend on the spacing only.
constexpr Vec3d kPatch_mm{5, 70, 5};
constexpr double kPatchRadius_mm = 14.2;

std::string label(int depth) {
  return depth == kWhole ? "whole" : fmt::format("{:02}", depth);
}

// The nodes that the queue does not reach, as a file of node numbers.
std::string beyond(const Lab& lab, const organ::Organ& organ, const std::string& name, int depth) {
  std::vector<NodeIndex> patch;
  for (const auto node : organ.mesh.surface_nodes)
    if (length(organ.mesh.rest_positions[node.value] * 1e3 - kPatch_mm) <= kPatchRadius_mm)
      patch.push_back(node);
  propagation::PropagationQueue queue(organ.mesh.node_count());
  const std::vector<std::span<const NodeIndex>> seeds{patch};
  queue.fill(organ.mesh.node_neighbours, seeds, {static_cast<std::uint32_t>(depth), 1'000'000});
  std::string ids;
  for (std::uint32_t i = 0; i < organ.mesh.node_count(); ++i)
    if (!queue.contains(NodeIndex(i))) ids += fmt::format("{}\n", i);
  if (ids.empty()) return "";
  lab.keep_file(name + ".csv", ids);
  return fmt::format(
      "[[nodes]]\nname = \"beyond\"\ncsv = \"{}.csv\"\n\n[fix]\nsets = [\"beyond\"]\n\n", name);
}

// In equilibrium, with what lies beyond the depth held in place.
std::string setting(const Lab& lab, const Material& material, int depth) {
  const auto name = fmt::format("fig5-{}-beyond-{}", material.name, label(depth));
  return material.text + near_set("patch", kPatch_mm, kPatchRadius_mm) +
         (depth == kWhole ? "" : beyond(lab, material.organ, name, depth));
}

constexpr const char* kProfileStatic =
    "[run]\nmode = \"static\"\nseconds = 1\nload_steps = 3\nover_relaxation = 1.8\n"
    "tolerance_n = 1e-5\nmax_sweeps = 6000\n\n"
    "[[probe]]\nset = \"patch\"\nquantity = \"displacement\"\n";

Pulled pull_by(const Lab& lab, Section& section, const Material& material, int depth) {
  const auto run = lab.start(
      section, fmt::format("{}, moved", material.name),
      fmt::format("fig5-{}-moved-{}", material.name, label(depth)),
      setting(lab, material, depth) + displace("patch", {{0, {}}, {1, {0, kPull_mm, 0}}}) +
          kProfileStatic + "\n[[probe]]\nset = \"patch\"\nquantity = \"reaction\"\n");
  lab.finish(section, *run);
  return {field_of(*run), run->probe(0).y * 1e3, run->probe(1).y};
}

Pulled pull_with(const Lab& lab, Section& section, const Material& material, int depth,
                 double force_n) {
  const auto run = lab.start(section, fmt::format("{}, pulled", material.name),
                             fmt::format("fig5-{}-pulled-{}", material.name, label(depth)),
                             setting(lab, material, depth) +
                                 force("patch", {{0, {}}, {1, {0, force_n, 0}}}) + kProfileStatic);
  lab.finish(section, *run);
  return {field_of(*run), run->probe(0).y * 1e3, force_n};
}

// Along x over the patch's middle, outwards: what figure 5 draws on both sides.
plot::Series profile(const std::string& name, const Pulled& pulled) {
  plot::Series series{name, {}, {}, plot::Style::LineAndPoints, {}};
  for (int layer = -14; layer <= 14; ++layer) {
    const auto node = catalogue::lattice_node({}, 15 + layer, 14, 15);
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

struct Depth {
  int depth = 0;
  plot::Series profile;
  double shape = 0, displacement = 0, reaction = 0;  // errors against the whole lattice
  double change = 1;                                 // of the profile since the depth before
  std::vector<std::string> row;
};

std::vector<Depth> try_depths(const Lab& lab, Section& section, const Material& material,
                              const Pulled& whole, double whole_pulled_mm) {
  const auto reference = profile("whole", whole);
  std::vector<Depth> results;
  for (const int depth : {1, 2, 4, 6, 8, 10, 12, 14}) {
    const Pulled moved = pull_by(lab, section, material, depth);
    const Pulled pulled = pull_with(lab, section, material, depth, whole.force_n);
    Depth result{.depth = depth, .profile = profile(fmt::format("n = {}", depth), moved)};
    result.shape = profile_difference(result.profile, reference);
    result.displacement = std::abs(pulled.displacement_mm / whole_pulled_mm - 1);
    result.reaction = std::abs(moved.force_n / whole.force_n - 1);
    if (!results.empty())
      result.change = profile_difference(result.profile, results.back().profile);
    result.row = {std::to_string(depth),
                  results.empty() ? "" : shown_percent(result.change),
                  shown_percent(result.shape),
                  shown(pulled.displacement_mm),
                  shown_percent(result.displacement),
                  shown(moved.force_n),
                  shown_percent(result.reaction),
                  shown_percent(field_error(moved.field, whole.field))};
    results.push_back(std::move(result));
  }
  return results;
}

void show_depths(Section& section, const Material& material, const std::vector<Depth>& results,
                 const Pulled& whole, double whole_pulled_mm) {
  plot::Plot profiles{.title = fmt::format("{}: profile of the surface", material.title),
                      .x = {"layers from the middle of the pull"},
                      .y = {"displacement / pull"},
                      .series = {}};
  plot::Series forces{"reaction for the same pull", {}, {}, plot::Style::LineAndPoints, {}},
      displacements{"displacement under the same force", {}, {}, plot::Style::LineAndPoints, {}},
      shapes{"profile, largest difference", {}, {}, plot::Style::LineAndPoints, {}};
  Table table{
      fmt::format("{}: against the whole lattice moving", material.title),
      {"depth", "profile changed by", "differs from whole by", "displacement, equal force, mm",
       "error", "reaction, equal pull, N", "error", "field error"},
      {}};
  for (const auto& result : results) {
    if (result.depth != 1 && result.depth != 12) profiles.series.push_back(result.profile);
    const std::pair<plot::Series*, double> points[] = {
        {&shapes, result.shape}, {&displacements, result.displacement}, {&forces, result.reaction}};
    for (const auto& [out, value] : points) {
      out->x.push_back(result.depth);
      out->y.push_back(100 * value);
    }
    table.rows.push_back(result.row);
  }
  table.rows.push_back({"whole", "", "", shown(whole_pulled_mm), "", shown(whole.force_n), "", ""});
  profiles.series.push_back(profile("whole", whole));
  profiles.series.back().style = plot::Style::Dashed;
  section.add(std::move(profiles));
  section.add({.title = fmt::format("{}: convergence with the depth", material.title),
               .x = {"penetration depth n"},
               .y = {"error, %", true},
               .series = {shapes, displacements, forces}});
  section.add(std::move(table));
}

// Without shear the whole lattice is no reference: `has_shear` says whether its errors have bounds.
void study(const Lab& lab, Section& section, const Material& material, bool has_shear) {
  const Pulled whole = pull_by(lab, section, material, kWhole);
  const double whole_pulled_mm =
      pull_with(lab, section, material, kWhole, whole.force_n).displacement_mm;
  const auto results = try_depths(lab, section, material, whole, whole_pulled_mm);
  const std::string prefix = material.name;
  for (std::size_t i = 1; i < results.size(); ++i)
    if (results[i].depth == kProfilePaperDepth)
      section.at_most(prefix + "-change", "no visible change beyond an optimum", results[i].change,
                      paper(kInvisible, "figure 5: no visible change"),
                      fmt::format("Change of the profile from depth {} to {}, the paper's example, "
                                  "as a share of the pull.",
                                  results[i - 1].depth, kProfilePaperDepth));
  const Depth& last = results.back();
  const std::string at_end = fmt::format(" at depth {}.", last.depth);
  if (has_shear) {
    section.at_most(prefix + "-profile", "whole lattice solved", last.shape, target(0.02, kAsWhole),
                    "Profile against the whole lattice, as a share of the pull," + at_end);
    section.at_most(prefix + "-displacement", "whole lattice solved", last.displacement,
                    target(0.02, kAsWhole), "Displacement under equal force" + at_end);
    section.at_most(prefix + "-reaction", "whole lattice solved", last.reaction,
                    target(0.02, kAsWhole), "Reaction to an equal pull" + at_end);
  }
  show_depths(section, material, results, whole, whole_pulled_mm);
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
      "Springs along the three axes alone have no shear stiffness: a pull is carried by the "
      "columns "
      "below it and spreads sideways only because springs across it are stretched. A column that "
      "ends at depth n has n springs, so the reaction falls about as 1/n down to the base, however "
      "narrow the profile is: for this lattice the depth is a matter of looks, not of force, and "
      "its errors against the whole lattice have no bound here. The second lattice has springs "
      "along the diagonals of the faces too, and with them shear, as tissue has.");
  study(lab, section,
        {"lattice", "Lattice of the paper", catalogue::make_lattice(),
         lattice_organ(30, 15, 30, kProfileSpacing_mm)},
        false);
  const auto organ = lattice_with_diagonals({});
  lab.keep_organ("lattice-with-diagonals", organ);
  study(
      lab, section,
      {"diagonals", "Lattice with diagonals", organ, organ_source("lattice-with-diagonals.organ")},
      true);
}

}  // namespace trocar::validation
