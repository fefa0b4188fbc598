// Choi 2002: how many nodes a force reaches (equation 2), and what they cost (figure 6).

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "common/base/timing.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "tests/validation/experiments.h"
#include "tests/validation/scenario_text.h"

namespace trocar::validation {
namespace {

// The paper's lattice at 10 mm: node (15, 14, 15) is at the surface, (15, 7, 15) in the middle.
constexpr Vec3d kSurface_mm{5, 70, 5}, kInside_mm{5, 0, 5};
constexpr int kPaperDepth = 10, kPaperNodes = 891;

std::string point_load(const Vec3d& place_mm, int depth, double seconds, bool is_held) {
  return lattice_organ(30, 15, 30, 10) + near_set("touched", place_mm, 0) +
         (is_held ? "" : "[fix]\norgan = false\n\n") + force("touched", {{0, {0, 0.05, 0}}}) +
         fmt::format("[run]\nseconds = {}\ndepth = {}\n", seconds, depth);
}

std::size_t reached(const Lab& lab, Section& section, bool is_surface, int depth) {
  const auto name = fmt::format("eq2-{}-{:02}", is_surface ? "surface" : "inside", depth);
  const auto run =
      lab.start(section, is_surface ? "surface" : "inside", name,
                point_load(is_surface ? kSurface_mm : kInside_mm, depth, 0.001, is_surface));
  return run->step().active_nodes;
}

}  // namespace

void run_eq2(const Lab& lab, Section& section) {
  section.say(
      "A force at one node of the 30 x 15 x 30 lattice reaches its neighbours, their neighbours, "
      "and so on to the penetration depth n. For a node of the surface the paper counts "
      "(n + 1)(2n² + 4n + 3)/3 nodes; for one inside an unbounded lattice the same reasoning gives "
      "(2n + 1)(2n² + 2n + 3)/3.");
  Table table{
      "Nodes that move", {"depth n", "surface: eq. 2", "ours", "inside: formula", "ours"}, {}};
  int wrong_surface = 0, wrong_inside = 0;
  std::size_t at_paper_depth = 0;
  for (int n = 1; n <= 12; ++n) {
    const auto expected = static_cast<std::size_t>((n + 1) * (2 * n * n + 4 * n + 3) / 3);
    const auto ours = reached(lab, section, true, n);
    wrong_surface += ours == expected ? 0 : 1;
    if (n == kPaperDepth) at_paper_depth = ours;
    std::vector<std::string> row{std::to_string(n), std::to_string(expected), std::to_string(ours)};
    if (n <= 7) {
      const auto inside = static_cast<std::size_t>((2 * n + 1) * (2 * n * n + 2 * n + 3) / 3);
      const auto ours_inside = reached(lab, section, false, n);
      wrong_inside += ours_inside == inside ? 0 : 1;
      row.insert(row.end(), {std::to_string(inside), std::to_string(ours_inside)});
    } else {
      row.insert(row.end(), {"", "reaches the faces"});
    }
    table.rows.push_back(row);
  }
  section.exactly("depth-10", std::to_string(kPaperNodes), std::to_string(at_paper_depth),
                  paper(0, "equation 2 at n = 10"), "Nodes at depth 10, which the paper prints.");
  section.exactly("surface", "0 of 12 depths differ",
                  fmt::format("{} of 12 depths differ", wrong_surface),
                  law(0, "equation 2, a count of layers"),
                  "Equation 2 for a node of the surface, n = 1 to 12.");
  section.exactly(
      "inside", "0 of 7 depths differ", fmt::format("{} of 7 depths differ", wrong_inside),
      law(0, "the same count without a surface"), "The formula for an inner node, n = 1 to 7.");
  section.add(std::move(table));
}

namespace {

struct Cost {
  double nodes = 0, start_ms = 0, queue_ms = 0, step_ms = 0;
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double milliseconds_since(std::uint64_t begin_ns) {
  return static_cast<double>(thread_cpu_ns() - begin_ns) * 1e-6;
}

Cost cost_of(const Lab& lab, Section& section, int depth, int steps) {
  const auto name = fmt::format("fig6-depth-{:02}", depth);
  const auto text = point_load(kSurface_mm, depth, 0.001 * steps, true);
  // Parsing and making the lattice are not part of what the paper calls initialisation.
  lab.start(section, "point load", name, text);
  auto resolved = scenario::resolve(std::move(*scenario::parse_scenario_text(text, name)));
  Cost cost;
  auto begin = thread_cpu_ns();
  ScenarioRun run(std::move(*resolved), Solver::Live);
  cost.start_ms = milliseconds_since(begin);

  std::vector<double> times;
  for (int i = 0; i < steps; ++i) {
    begin = thread_cpu_ns();
    cost.nodes = static_cast<double>(run.step().active_nodes);
    times.push_back(milliseconds_since(begin));
  }
  cost.step_ms = median(times);

  // Then the same queue is timed by itself.
  propagation::PropagationQueue queue(run.organ().mesh.node_count());
  const std::vector<NodeIndex> touched{catalogue::lattice_node({}, 15, 14, 15)};
  const std::vector<std::span<const NodeIndex>> seeds{touched};
  times.clear();
  for (int i = 0; i < steps; ++i) {
    begin = thread_cpu_ns();
    queue.fill(run.organ().mesh.node_neighbours, seeds,
               {static_cast<std::uint32_t>(depth), 1'000'000});
    times.push_back(milliseconds_since(begin));
  }
  cost.queue_ms = median(times);
  return cost;
}

}  // namespace

void run_fig6_times(const Lab& lab, Section& section) {
  section.say(
      "One node of the 30 x 15 x 30 lattice is pulled; 100 steps of 1 ms with four sweeps each. "
      "CPU "
      "time of one thread, medians over the steps. The paper's machine was a Pentium III at 800 "
      "MHz "
      "running Java; ours is named at the top of this page, so the comparison says what today's "
      "machine and solver do with the paper's problem, not which method is better.");
  Table table{"Thread CPU time, this machine",
              {"depth", "nodes", "initialisation, ms", "queue per step, ms", "whole step, ms",
               "queue's share"},
              {}};
  plot::Series start{"initialisation, once", {}, {}, plot::Style::LineAndPoints, {}},
      queue{"queue, 100 steps", {}, {}, plot::Style::LineAndPoints, {}},
      solve{"positions, 100 steps", {}, {}, plot::Style::LineAndPoints, {}},
      total{"total", {}, {}, plot::Style::LineAndPoints, {}};
  const int steps = lab.is_short() ? 20 : 100;
  double at_paper_depth = 0, longest = 0, starts_low = 1e9, starts_high = 0;
  for (int depth = 1; depth <= 14; depth += lab.is_short() ? 3 : 1) {
    const Cost cost = cost_of(lab, section, depth, steps);
    if (depth == kPaperDepth) at_paper_depth = cost.step_ms;
    longest = std::max(longest, cost.step_ms);
    starts_low = std::min(starts_low, cost.start_ms);
    starts_high = std::max(starts_high, cost.start_ms);
    table.rows.push_back({std::to_string(depth), shown(cost.nodes), shown(cost.start_ms),
                          shown(cost.queue_ms), shown(cost.step_ms),
                          shown_percent(cost.queue_ms / cost.step_ms)});
    const double solve_ms = std::max(0.0, cost.step_ms - cost.queue_ms);
    const std::pair<plot::Series*, double> points[] = {
        {&start, cost.start_ms},
        {&queue, 100 * cost.queue_ms},
        {&solve, 100 * solve_ms},
        {&total, cost.start_ms + 100 * cost.step_ms}};
    for (const auto& [series, y] : points) {
      series->x.push_back(cost.nodes);
      series->y.push_back(y);
    }
  }
  const auto below = [&](const char* what, double paper_ms, double ours_ms, const char* note) {
    section.checks.push_back({section.name + "/" + what, fmt::format("{:g} ms", paper_ms),
                              shown(ours_ms) + " ms", ours_ms,
                              paper(paper_ms, "figure 6, its own time"), false, note});
  };
  below("step-at-891-nodes", 5, at_paper_depth,
        "CPU time of a step at depth 10, in ms; the bound is the paper's own time.");
  below("longest-step", 28, longest,
        "CPU time of the longest step up to depth 14, in ms; the paper's range ends at 28 ms.");
  section.add({.title = "100 steps, CPU time by part",
               .x = {"nodes in the local region"},
               .y = {"ms, this machine"},
               .series = {start, queue, solve, total}});
  section.add(std::move(table));
  section.say(fmt::format(
      "As in the paper, initialisation does not depend on the depth (here {} to {} ms: it makes "
      "the "
      "solver's arrays for all 13,500 nodes) and positions take most of a step. Unlike there, the "
      "queue's time also grows with the nodes in it, since everything else has become fast enough "
      "for that to be seen.",
      shown(starts_low), shown(starts_high)));
}

}  // namespace trocar::validation
