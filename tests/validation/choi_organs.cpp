// Choi 2002 figures 3, 7 and 8, and what its discussion proposes: feeling abnormal tissue.

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

#include "tests/validation/experiments.h"
#include "tests/validation/measure.h"
#include "tests/validation/organs.h"
#include "tests/validation/scenario_text.h"

namespace trocar::validation {
namespace {

constexpr const char* kStatic =
    "[run]\nmode = \"static\"\nseconds = 1\nload_steps = {}\nover_relaxation = 1.8\n"
    "tolerance_n = {}\nmax_sweeps = 8000\n\n";

std::string static_run(int load_steps, double tolerance_n) {
  return fmt::format(fmt::runtime(kStatic), load_steps, tolerance_n);
}

// Displacement of the middle of the top, mm, under a pull at nine nodes.
double protrusion(const Lab& lab, Section& section, const std::string& organ,
                  const std::string& name, bool is_transverse, double force_n,
                  plot::Series& profile) {
  const auto run = lab.start(
      section, name, "fig3-" + name,
      organ + "[material]\nspring_stiffness_n_m = 10\n" +
          (is_transverse ? "fibre_direction = [0, 1, 0]\nfibre_stiffness_ratio = 0.1\n" : "") +
          "\n" + near_set("patch", {5, 70, 5}, 14.2) +
          force("patch", {{0, {}}, {1, {0, force_n, 0}}}) + static_run(3, 4e-6) +
          "[[probe]]\nset = \"patch\"\nquantity = \"displacement\"\n");
  lab.finish(section, *run);
  for (int layer = -14; layer <= 14; ++layer) {
    profile.x.push_back(layer);
    profile.y.push_back(
        static_cast<double>(
            run->world().displacements[catalogue::lattice_node({}, 15 + layer, 14, 15).value].y) *
        1e3);
  }
  return run->probe(0).y * 1e3;
}

constexpr double kUniform_n = 0.2;

double uniform_pull(const Lab& lab, Section& section, bool is_transverse) {
  const auto run = lab.start(
      section, "uniform", is_transverse ? "fig3-uniform-transverse" : "fig3-uniform-isotropic",
      lattice_organ(9, 15, 9, 10) + "[material]\nspring_stiffness_n_m = 10\n" +
          (is_transverse ? "fibre_direction = [0, 1, 0]\nfibre_stiffness_ratio = 0.1\n" : "") +
          "\n" + box_set("top", {-40, 70, -40}, {40, 70, 40}) +
          force("top", {{0, {0, kUniform_n, 0}}}) + static_run(1, 1e-7) +
          "[[probe]]\nset = \"top\"\nquantity = \"displacement\"\n");
  lab.finish(section, *run);
  return run->probe(0).y * 1e3;
}

}  // namespace

void run_fig3_transverse(const Lab& lab, Section& section) {
  constexpr double kPull_n = 0.05;
  section.say(
      "The same force pulls at nine nodes of the top of the 30 x 15 x 30 lattice: once every "
      "spring has k = 10 N/m; once those along y, the direction of the pull, have k = 1 "
      "(fibre_stiffness_ratio = 0.1). The paper reports that the transversely isotropic material "
      "protrudes further and prints no value. A pull at the whole top of a 9 x 15 x 9 lattice has "
      "a closed form, u = 14 F / (81 k_y).");
  const double isotropic = uniform_pull(lab, section, false),
               transverse = uniform_pull(lab, section, true);
  section.compare("isotropic", 14 * kUniform_n / (81 * 10) * 1e3, isotropic,
                  law(0.005, "springs in series"), "mm", "Whole top pulled, k = 10.");
  section.compare("transverse", 14 * kUniform_n / (81 * 1) * 1e3, transverse,
                  law(0.005, "springs in series"), "mm", "Whole top pulled, k_y = 1.");
  const auto lattice = lattice_organ(30, 15, 30, 10);
  plot::Series profile{"k = 10", {}, {}, plot::Style::LineAndPoints, {}},
      profile_transverse{"k_y = 1, k_x = k_z = 10", {}, {}, plot::Style::LineAndPoints, {}};
  const double far = protrusion(lab, section, lattice, "isotropic", false, kPull_n, profile);
  const double farther =
      protrusion(lab, section, lattice, "transverse", true, kPull_n, profile_transverse);
  section.at_least(
      "larger-amplitude", "protrudes further", farther / far,
      paper(1.2, "figure 3: visibly further"),
      fmt::format("Protrusion under {} N, transversely isotropic over isotropic.", kPull_n));
  section.add({.title = fmt::format("Profile under {} N", kPull_n),
               .x = {"layers from the middle of the pull"},
               .y = {"displacement along the pull, mm"},
               .series = {profile, profile_transverse}});
  section.add(Table{
      "Displacement, mm",
      {"pull", "k = 10", "k_y = 1, k_x = k_z = 10", "ratio"},
      {{"nine nodes, 0.05 N", shown(far), shown(farther), shown(farther / far)},
       {"whole top, 0.2 N", shown(isotropic), shown(transverse), shown(transverse / isotropic)}}});
}

namespace {

struct Hand {
  const char* name;
  const char* verb;
  const char* anchor;           // from the organ's centre
  double radius_mm, travel_mm;  // along the outward normal
};

std::string organ_scene(const char* organ, const Hand& hand) {
  return organ_source(organ) +
         fmt::format(
             "[[tool]]\nradius_mm = {0}\nreach_mm = {0}\nease = \"linear\"\nanchor = {1}\n"
             "anchor_frame = \"normal\"\n"
             "[[tool.key]]\ntime_s = 0\nposition_mm = [0, 0, 1]\nverb = \"{2}\"\n"
             "[[tool.key]]\ntime_s = 0.1\nposition_mm = [0, 0, 1]\n"
             "[[tool.key]]\ntime_s = 0.4\nposition_mm = [0, 0, {3}]\n\n"
             "[run]\nseconds = 0.6\n\n[[probe]]\ntool = 0\nquantity = \"force\"\n",
             hand.radius_mm, hand.anchor, hand.verb, hand.travel_mm);
}

// Surface nodes near the plane through the contact, seen along the axis across it.
plot::Plot cut_through(const std::string& title, const ScenarioRun& run, const Vec3d& at,
                       double thickness_m) {
  plot::Series rest{"at rest", {}, {}, plot::Style::Points, {}},
      moved{"deformed", {}, {}, plot::Style::Points, {}};
  for (const auto node : run.organ().mesh.surface_nodes) {
    const Vec3d& p = run.organ().mesh.rest_positions[node.value];
    if (std::abs(p.y - at.y) > thickness_m) continue;
    const Vec3d q = p + to_double(run.world().displacements[node.value]);
    rest.x.push_back(p.x * 1e3), rest.y.push_back(p.z * 1e3);
    moved.x.push_back(q.x * 1e3), moved.y.push_back(q.z * 1e3);
  }
  return {.title = title, .x = {"x, mm"}, .y = {"z, mm"}, .series = {rest, moved}};
}

void show_organ(const Lab& lab, Section& section, const char* organ, const Hand& hand) {
  const std::string name = fmt::format("fig7-fig8-{}-{}", organ, hand.name);
  const auto run = lab.start(section, name, name, organ_scene(organ, hand));
  lab.finish(section, *run);
  const Field field = field_of(*run);
  std::size_t moved = 0;
  for (const auto& u : field) moved += length(u) > 1e-3 ? 1u : 0u;
  const auto at =
      static_cast<std::size_t>(std::max_element(field.begin(), field.end(),
                                                [](const Vec3d& a, const Vec3d& b) {
                                                  return length_squared(a) < length_squared(b);
                                                }) -
                               field.begin());
  const std::string prefix = fmt::format("{}-{}", organ, hand.name);
  section.at_least(
      prefix + "-moves", "locally deformed", largest(field) * 1e3,
      paper(0.7 * std::abs(hand.travel_mm),
            "figures 7 and 8: the dent is as deep as the tool went"),
      fmt::format("Largest displacement in mm; the tool went {} mm; {} of the nodes "
                  "moved by more than 1 mm.",
                  std::abs(hand.travel_mm),
                  shown_percent(static_cast<double>(moved) / static_cast<double>(field.size()))));
  section.add(cut_through(
      fmt::format("{}, {}: surface nodes near the plane through the contact", organ, hand.name),
      *run, run->organ().mesh.rest_positions[at], 0.004));
}

// Share of the tool's travel by which the inner face of the wall opposite the contact follows.
double inner_wall_motion(const ScenarioRun& run) {
  const auto& mesh = run.organ().mesh;
  const auto normals = mesh::surface_normals(mesh);
  const Field field = field_of(run);
  NodeIndex pushed;
  for (const auto node : mesh.surface_nodes)
    if (!pushed.is_valid() ||
        length_squared(field[node.value]) > length_squared(field[pushed.value]))
      pushed = node;
  const Vec3d outward = normals[pushed.value];
  double most = 0;
  for (const auto node : mesh.surface_nodes) {
    const bool is_opposite = dot(normals[node.value], outward) < -0.7;
    const double apart =
        length(mesh.rest_positions[node.value] - mesh.rest_positions[pushed.value]);
    if (is_opposite && apart < 0.012) most = std::max(most, length(field[node.value]));
  }
  return most / length(field[pushed.value]);
}

}  // namespace

void run_fig7_fig8_organs(const Lab& lab, Section& section) {
  section.say(
      "The hollow stomach and the liver, as in the paper's pictures: a tool pushes a dent into "
      "each, and a grasping tool pulls the liver out. Live solver, four sweeps per tick, every "
      "node "
      "free. The paper shows pictures without values, so the bounds ask what a picture shows.");
  show_organ(lab, section, "elastic-liver", {"dented", "push", "[0.2, 0.1, 1]", 12, -14});
  if (lab.is_short()) return;
  show_organ(lab, section, "elastic-liver", {"protruded", "grasp", "[0.2, 0.1, 1]", 14, 16});
  const Hand hand{"dented", "push", "[0.3, 0.2, 1]", 12, -14};
  show_organ(lab, section, "stomach", hand);
  const auto run = lab.start(section, "fig7-fig8-stomach-dented", "fig7-fig8-stomach-dented",
                             organ_scene("stomach", hand));
  section.scenes.pop_back();
  lab.finish(section, *run);
  section.at_least("stomach-wall-moves", "the wall moves as a whole", inner_wall_motion(*run),
                   paper(0.7, "figure 7: the hollow wall gives way as a whole"),
                   "Displacement of the inner face of the wall under the tool, as a share of the "
                   "outer one's.");
}

namespace {

constexpr double kInclusionDepth_mm = 20, kInclusionRadius_mm = 14, kPress_mm = 5, kTool_mm = 16;
constexpr int kPressSteps = 5;

// Press depth against force at a place of the top of a block of 5 mm cells.
plot::Series press(const Lab& lab, Section& section, const std::string& name, double x_mm,
                   bool has_inclusion) {
  const double top_mm = 35;
  std::string text =
      organ_source("palpation-block.organ") + "[material]\nspring_stiffness_n_m = 8\n\n";
  if (has_inclusion)
    text += near_set("tumour", {0, top_mm - kInclusionDepth_mm, 0}, kInclusionRadius_mm) +
            "[[region]]\nset = \"tumour\"\nspring_stiffness_n_m = 80\n\n";
  text += tool(kTool_mm, 10, {0, 1, 0},
               {{0, {x_mm, top_mm, 0}, "push"}, {1, {x_mm, top_mm - kPress_mm, 0}, "push"}}) +
          static_run(kPressSteps, 1e-5) + "[[probe]]\ntool = 0\nquantity = \"force\"\n";
  const auto run = lab.start(section, has_inclusion ? "with inclusion" : "homogeneous",
                             "palpation-" + name, text);
  plot::Series series{name, {0}, {0}, plot::Style::LineAndPoints, {}};
  lab.finish(section, *run, [&](const scenario::StepReport&) {
    series.x.push_back(kPress_mm * run->time_s());
    series.y.push_back(run->probe(0).y);
  });
  return series;
}

}  // namespace

void run_palpation(const Lab& lab, Section& section) {
  const catalogue::LatticeSize size{
      .nx = lab.is_short() ? 21 : 31, .ny = 15, .nz = lab.is_short() ? 21 : 31, .spacing_m = 0.005};
  lab.keep_organ("palpation-block", lattice_with_diagonals(size));
  section.say(fmt::format(
      "The discussion of the paper proposes to tell abnormal tissue by how it deforms. A tool with "
      "a "
      "round tip of {} mm radius (more than three elements of 5 mm) presses {} mm into a block "
      "with shear stiffness, in equilibrium at each step. Under the middle a sphere of {} mm "
      "radius, its centre {} mm deep, is ten times as stiff. "
      "Positions off the middle in the homogeneous block tell how much the force depends on where "
      "the nodes are.",
      kTool_mm, kPress_mm, kInclusionRadius_mm, kInclusionDepth_mm));
  const std::vector<double> places =
      lab.is_short() ? std::vector<double>{0, 7.3} : std::vector<double>{-21.2, -7.3, 0, 2.5, 13.7};
  std::vector<plot::Series> curves;
  double low = INFINITY, high = 0, sum = 0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    auto curve = press(lab, section, fmt::format("homogeneous-{}", i + 1), places[i], false);
    curve.name = fmt::format("homogeneous, x = {:g} mm", places[i]);
    low = std::min(low, curve.y.back());
    high = std::max(high, curve.y.back());
    sum += curve.y.back();
    curves.push_back(std::move(curve));
  }
  const double mean = sum / static_cast<double>(places.size());
  auto above = press(lab, section, "inclusion-above", 0, true);
  above.name = "above the inclusion";
  const double ratio = above.y.back() / mean, noise = (high - low) / mean;
  section.at_least(
      "force-ratio", "harder above abnormal tissue", ratio,
      target(1.05, "a difference that a hand can feel"),
      fmt::format("Force above the inclusion over the mean of the homogeneous block, at "
                  "{} mm.",
                  kPress_mm));
  section.at_least("signal-over-noise", "told from the place's own variation",
                   (ratio - 1) / std::max(noise, 1e-6),
                   target(2, "told from what the place alone does"),
                   fmt::format("Increase of the force over the spread between places without "
                               "inclusion ({}).",
                               shown_percent(noise)));
  plot::Series along{"with inclusion", {}, {}, plot::Style::LineAndPoints, {}};
  Table table{"Force at full depth", {"x, mm", "with inclusion, N", "over homogeneous"}, {}};
  std::vector<double> scan{0};
  if (!lab.is_short()) scan = {-40, -30, -20, -10, 0, 10, 20, 30, 40};
  for (const double x : scan) {
    const double force_n =
        x == 0 ? above.y.back()
               : press(lab, section, fmt::format("scan-{:+g}", x), x, true).y.back();
    along.x.push_back(x);
    along.y.push_back(force_n);
    table.rows.push_back({shown(x), shown(force_n), shown(force_n / mean)});
  }
  curves.push_back(std::move(above));
  section.add({.title = "Force while pressing",
               .x = {"press depth, mm"},
               .y = {"force, N"},
               .series = std::move(curves)});
  if (!lab.is_short())
    section.add(
        {.title = "Force at full depth along a line over the inclusion",
         .x = {"x, mm"},
         .y = {"force, N"},
         .series = {along,
                    {"homogeneous, mean", {-40, 40}, {mean, mean}, plot::Style::Dashed, {}}}});
  section.add(std::move(table));
}

}  // namespace trocar::validation
