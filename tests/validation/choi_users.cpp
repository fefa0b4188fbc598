// Choi 2002 figure 2: several users pull at one object at once.

#include <spdlog/fmt/fmt.h>

#include <algorithm>

#include "server/organs/catalogue/builtin_organs.h"
#include "tests/validation/experiments.h"
#include "tests/validation/measure.h"
#include "tests/validation/scenario_text.h"

namespace trocar::validation {
namespace {

constexpr int kDepth = 6;
constexpr double kSeconds = 0.4;
constexpr const char* kNames[] = {"left", "middle", "right"};

// Three grasping tools above a row of the surface; each pulls its own way.
std::string three_tools() {
  const Vec3d tips_mm[] = {{-65, 70, 5}, {5, 70, 5}, {65, 70, 15}};
  const Vec3d pulls_mm[] = {{-6, 12, 0}, {0, 18, 4}, {5, 10, -5}};
  std::string text = lattice_organ(30, 15, 30, 10);
  for (int i = 0; i < 3; ++i)
    text += tool(5, 16, {0, 1, 0},
                 {{0, tips_mm[i], "grasp"},
                  {0.1, tips_mm[i], "grasp"},
                  {0.3, tips_mm[i] + pulls_mm[i], "grasp"}});
  return text;
}

std::string ids_of(const std::vector<NodeIndex>& nodes) {
  std::string text;
  for (const auto node : nodes) text += (text.empty() ? "" : ", ") + std::to_string(node.value);
  return text;
}

// How many separate local regions three forces have at a depth.
std::uint16_t regions(const organ::Organ& organ, std::uint32_t depth,
                      const std::vector<std::vector<NodeIndex>>& seeds) {
  propagation::PropagationQueue queue(organ.mesh.node_count());
  const std::vector<std::span<const NodeIndex>> spans(seeds.begin(), seeds.end());
  queue.fill(organ.mesh.node_neighbours, spans, {depth, 1'000'000});
  return queue.region_count();
}

}  // namespace

void run_fig2_users(const Lab& lab, Section& section) {
  section.say(fmt::format(
      "Three tools grasp the surface of the 30 x 15 x 30 lattice, each by the nodes within 16 mm, "
      "and pull "
      "it in different directions; forces propagate {} layers deep and the three regions meet. The "
      "reference is one region that covers all of them: the same pulls, every node of the union "
      "free, all others held, no queue at all. Every step of both is solved to 1e-6 N, so what "
      "remains is what merging the regions does.",
      kDepth));
  const std::string run_text =
      fmt::format("[run]\nseconds = {}\ntolerance_n = 1e-6\nmax_sweeps = 20000\n", kSeconds);
  std::string probes;
  for (int i = 0; i < 3; ++i)
    probes += fmt::format("[[probe]]\ntool = {}\nquantity = \"force\"\n\n", i);

  const auto joint = lab.start(
      section, "three regions", "fig2-three-tools",
      three_tools() + run_text + fmt::format("depth = {}\n\n", kDepth) + probes, Solver::Full);
  std::vector<plot::Series> forces(3);
  for (int i = 0; i < 3; ++i) forces[static_cast<std::size_t>(i)].name = kNames[i];
  lab.finish(section, *joint, [&](const scenario::StepReport&) {
    if (joint->steps_done() % 5 != 0) return;
    for (std::size_t i = 0; i < 3; ++i) {
      forces[i].x.push_back(joint->time_s());
      forces[i].y.push_back(length(joint->probe(i)));
    }
  });

  std::vector<NodeIndex> outside;
  for (std::uint32_t i = 0; i < joint->world().node_count(); ++i)
    if (joint->world().node_classes[i] == world::NodeClass::Far) outside.push_back(NodeIndex(i));
  const auto one =
      lab.start(section, "one region", "fig2-one-region",
                three_tools() + "[[nodes]]\nname = \"outside\"\nids = [" + ids_of(outside) +
                    "]\n\n[fix]\nsets = [\"outside\"]\n\n" + run_text + "\n" + probes,
                Solver::Full);
  // Tens of thousands of node numbers help nobody who reads the report; the file has them.
  auto& shown_text = section.scenes.back().text;
  if (const auto begin = shown_text.find("ids = ["); begin != std::string::npos)
    shown_text.replace(begin, shown_text.find(']', begin) - begin, "ids = [...");
  lab.finish(section, *one);

  const Field ours = field_of(*joint), reference = field_of(*one);
  section.at_most("displacement", "one region that covers all",
                  largest_difference(ours, reference) / largest(reference),
                  law(1e-3, "one problem has one equilibrium"),
                  "Largest difference of any node's displacement, over the largest displacement.");
  double worst = 0;
  for (std::size_t i = 0; i < 3; ++i)
    worst = std::max(worst, length(joint->probe(i) - one->probe(i)) / length(one->probe(i)));
  section.at_most("tool-forces", "one region that covers all", worst,
                  law(1e-3, "one problem has one equilibrium"),
                  "Largest difference of any tool's force, over that force.");

  const auto node = [](int i, int k) {
    return std::vector<NodeIndex>{catalogue::lattice_node({}, i, 14, k)};
  };
  const std::vector<std::vector<NodeIndex>> seeds{node(8, 15), node(15, 15), node(22, 15)};
  Table table{"Three touched nodes of the surface, seven nodes apart",
              {"depth", "separate regions", "expected"},
              {}};
  int wrong = 0;
  for (std::uint32_t depth = 1; depth <= 6; ++depth) {
    // Two regions have a node in common once twice the depth is the distance.
    const int expected = 2 * depth >= 7 ? 1 : 3;
    const int ours_count = regions(joint->organ(), depth, seeds);
    wrong += ours_count == expected ? 0 : 1;
    table.rows.push_back(
        {std::to_string(depth), std::to_string(ours_count), std::to_string(expected)});
  }
  section.exactly("merging", "0 of 6 depths differ", fmt::format("{} of 6 depths differ", wrong),
                  law(0, "sets of nodes that meet are one"),
                  "Regions become one exactly when they have a node in common.");
  section.add({.title = "Force on each tool",
               .x = {"time, s"},
               .y = {"force, N"},
               .series = std::move(forces)});
  section.add(std::move(table));
}

}  // namespace trocar::validation
