#include "server/lab/calibration/calibrate.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "server/session/control/depth_chooser.h"

namespace trocar::calibration {
namespace {

constexpr double kElements = 3.2, kLeastRadius_m = 0.0005, kGreatestRadius_m = 0.05;
constexpr std::size_t kMaxRanges = 12;
// The first range begins here: below, the tip has just met the surface.
constexpr double kFirstShare = 0.25;
// A place has something to say about a range in which it was for so many ticks.
constexpr std::size_t kLeastTicks = 4;
// A limit near the whole organ is none.
constexpr double kWholeShare = 0.9;
constexpr std::array<std::uint32_t, 6> kDepths{0, 1, 2, 3, 4, 6};

struct Ranges {
  double first_n = 0;

  double end_n(std::size_t range) const { return first_n * std::pow(2.0, range); }
  // kMaxRanges: in none.
  std::size_t of(double force_n) const {
    if (force_n <= kFirstShare * first_n) return kMaxRanges;
    for (std::size_t range = 0; range < kMaxRanges; ++range)
      if (force_n <= end_n(range)) return range;
    return kMaxRanges;
  }
};

struct RangeErrors {
  std::array<double, kMaxRanges> difference{}, force{}, nodes{};
  std::array<std::size_t, kMaxRanges> ticks{};

  RangeErrors(const PressCourse& course, const PressCourse& full, const Ranges& ranges) {
    for (std::size_t i = 0; i < full.forces_n.size(); ++i) {
      const double expected = length(full.forces_n[i]);
      const auto range = ranges.of(expected);
      if (range == kMaxRanges) continue;
      difference[range] += length(course.forces_n[i] - full.forces_n[i]);
      force[range] += expected;
      nodes[range] += course.queue_nodes[i];
      ++ticks[range];
    }
  }
  bool has(std::size_t range) const { return ticks[range] >= kLeastTicks; }
  double error(std::size_t range) const { return difference[range] / force[range]; }
  double mean_nodes(std::size_t range) const {
    return nodes[range] / static_cast<double>(ticks[range]);
  }
};

step::TickDecisions frozen_with(std::uint32_t nodes) {
  return {.depth_limit = step::kMaxDepthLimit,
          .node_limit = nodes,
          .boundary = world::Boundary::Frozen};
}

step::TickDecisions graded_with(std::uint32_t depth) {
  return {
      .depth_limit = depth, .node_limit = step::kMaxNodeLimit, .boundary = world::Boundary::Graded};
}

bool suffices(const std::vector<Finding::Tried>& tried, double error) {
  return !tried.empty() && tried.back().error <= error;
}

// The reference of one place, and what it is worth, added to what is known of all places. The
// tolerance suits the smallest range. Nothing where a tick missed it: the place is left out.
std::optional<PressCourse> reference_press(PressBench& bench, const Place& place,
                                           const PressPlan& plan, const Ranges& ranges,
                                           Reference& reference) {
  const auto pilot = bench.pilot(place, plan);
  const auto converged = [&](double looser) {
    return bench.press(
        place, plan,
        converged_decisions(pilot.tolerance_for(ranges.first_n, bench.node_count(), looser)));
  };
  auto full = converged(1);
  reference.convergence.add(full.convergence);
  if (!full.convergence.is_reached()) {
    ++reference.places_missed;
    return std::nullopt;
  }
  const RangeErrors loose(converged(kLooser), full, ranges);
  for (std::size_t range = 0; range < kMaxRanges; ++range)
    if (loose.has(range)) reference.own_error = std::max(reference.own_error, loose.error(range));
  return full;
}

class PlaceStudy {
 public:
  PlaceStudy(PressBench& bench, const Place& place, std::size_t number, const PressPlan& plan,
             const Settings& settings, PressCourse full)
      : bench_(bench),
        place_(place),
        plan_(plan),
        settings_(settings),
        ranges_{settings.first_n},
        full_(std::move(full)) {
    const RangeErrors reached(full_, full_, ranges_);
    for (std::size_t range = 0; range < kMaxRanges; ++range)
      if (reached.has(range))
        findings_.push_back({number, place.node, ranges_.end_n(range), {}, {}});
  }

  // The deepest press of all tells about each smaller force on its way.
  std::vector<Finding> study() {
    const auto whole = kWholeShare * static_cast<double>(bench_.node_count());
    for (auto nodes = settings_.first_nodes; nodes < whole; nodes *= 2)
      if (!try_one(frozen_with(nodes), nodes, &Finding::frozen)) break;
    for (const auto depth : kDepths)
      if (!try_one(graded_with(depth), depth, &Finding::graded)) break;
    return std::move(findings_);
  }

 private:
  // False if all ranges have what suffices.
  bool try_one(const step::TickDecisions& decisions, std::uint32_t limit,
               std::vector<Finding::Tried> Finding::*tried) {
    const auto is_open = [&](const Finding& f) { return !suffices(f.*tried, settings_.error); };
    if (std::ranges::none_of(findings_, is_open)) return false;
    const RangeErrors errors(bench_.press(place_, plan_, decisions), full_, ranges_);
    for (auto& finding : findings_)
      if (is_open(finding)) {
        const auto range = ranges_.of(finding.force_n);
        (finding.*tried)
            .push_back(
                {limit, static_cast<std::uint32_t>(errors.mean_nodes(range)), errors.error(range)});
      }
    return true;
  }

  PressBench& bench_;
  const Place& place_;
  const PressPlan& plan_;
  const Settings& settings_;
  const Ranges ranges_;
  const PressCourse full_;
  std::vector<Finding> findings_;
};

// Makes the row of what all places need in one range; a limit below one that a smaller force needs
// is raised to it.
organ::DepthRow row_of(const std::vector<Finding>& findings, double force_n, double error,
                       const organ::DepthRow* before) {
  organ::DepthRow row{force_n, 0u, 0u, 0, 0};
  const auto gather = [&](const std::vector<Finding::Tried>& tried,
                          std::optional<std::uint32_t>& limit, double& worst) {
    if (tried.empty()) {
      limit.reset();
      return;
    }
    worst = std::max(worst, tried.back().error);
    if (!suffices(tried, error))
      limit.reset();
    else if (limit)
      limit = std::max(*limit, tried.back().limit);
  };
  for (const auto& finding : findings) {
    if (finding.force_n != force_n) continue;
    gather(finding.frozen, row.frozen_nodes, row.frozen_error);
    gather(finding.graded, row.graded_depth, row.graded_error);
  }
  if (!before) return row;
  if (row.frozen_nodes && before->frozen_nodes)
    row.frozen_nodes = std::max(*row.frozen_nodes, *before->frozen_nodes);
  if (row.graded_depth && before->graded_depth)
    row.graded_depth = std::max(*row.graded_depth, *before->graded_depth);
  return row;
}

PressPlan plan_of(const organ::Organ& organ, const Settings& settings) {
  return {.radius_m = radius_of(organ, settings), .depth_m = settings.depth_m};
}

}  // namespace

Status validate(const Settings& s) {
  const auto bad = [](const char* what) { return Error{ErrorCode::Usage, what}; };
  if (!(s.error >= 0.001 && s.error <= 0.5)) return bad("--error must be 0.1 to 50 %");
  if (s.places < 1 || s.places > 1000) return bad("--places must be 1 to 1000");
  if (s.radius_m && !(*s.radius_m >= kLeastRadius_m && *s.radius_m <= kGreatestRadius_m))
    return bad("--radius must be 0.5 to 50 mm");
  if (!(s.depth_m >= 0.001 && s.depth_m <= 0.05)) return bad("--depth must be 1 to 50 mm");
  if (s.first_nodes < 1 || !(s.first_n > 0)) return bad("the first range must not be empty");
  return {};
}

Status check_held(const organ::Organ& organ) {
  if (!organ.fixed_nodes.empty()) return {};
  return Error{ErrorCode::BadFile,
               "organ '" + organ.name +
                   "': nothing holds it, so a press moves all of it: import the mesh with a --fix "
                   "rule"};
}

double radius_of(const organ::Organ& organ, const Settings& settings) {
  if (settings.radius_m) return *settings.radius_m;
  return std::clamp(kElements * surface_edge_m(organ), kLeastRadius_m, kGreatestRadius_m);
}

Calibration calibrate(const organ::Organ& organ, const Settings& settings,
                      const Progress& progress) {
  Calibration result;
  const auto places = spread_places(organ, settings.places, settings.seed);
  const auto plan = plan_of(organ, settings);
  PressBench bench(organ, settings.workers);
  const Ranges ranges{settings.first_n};
  result.reference.allowed_error = settings.reference_error * settings.error;
  for (std::size_t i = 0; i < places.size(); ++i) {
    auto full = reference_press(bench, places[i], plan, ranges, result.reference);
    std::vector<Finding> findings;
    if (full) findings = PlaceStudy(bench, places[i], i, plan, settings, std::move(*full)).study();
    result.places_left_out += findings.empty();
    std::ranges::move(findings, std::back_inserter(result.findings));
    if (progress) progress(i + 1, places.size());
  }
  auto& table = result.table;
  table.error = settings.error;
  table.tool_radius_m = static_cast<double>(static_cast<float>(plan.radius_m));
  table.places = static_cast<std::uint32_t>(places.size() - result.places_left_out);
  // A force that hardly any place reached says nothing about the others.
  for (std::size_t range = 0; range < kMaxRanges; ++range) {
    const double force = ranges.end_n(range);
    const auto count =
        static_cast<std::size_t>(std::ranges::count(result.findings, force, &Finding::force_n));
    if (count == 0 || 4 * count < table.places) continue;
    const auto* before = table.rows.empty() ? nullptr : &table.rows.back();
    const auto row = row_of(result.findings, force, settings.error, before);
    table.rows.push_back(row);
  }
  result.ticks = bench.ticks_done();
  return result;
}

Checks check(const organ::Organ& organ, const organ::DepthTable& table, const Settings& settings,
             std::size_t places, const Progress& progress) {
  const auto used = spread_places(organ, settings.places, settings.seed);
  const auto unseen = spread_places(organ, places, settings.seed, used);
  PressPlan plan = plan_of(organ, settings);
  plan.speed_m_s /= 2;
  plan.depth_m *= 0.9;
  plan.slant = 0.2;
  const Ranges ranges{settings.first_n};
  PressBench bench(organ, settings.workers);
  Checks result;
  auto& checks = result.ranges;
  checks.resize(table.rows.size());
  for (std::size_t k = 0; k < checks.size(); ++k) checks[k].force_n = table.rows[k].force_n;

  result.reference.allowed_error = settings.reference_error * settings.error;
  for (std::size_t i = 0; i < unseen.size(); ++i) {
    const auto full = reference_press(bench, unseen[i], plan, ranges, result.reference);
    if (!full) continue;
    const auto chosen = [&](const step::TickDecisions& most) {
      control::DepthChooser chooser(table, 1);
      const auto course = bench.press(unseen[i], plan, [&](std::span<const double> forces) {
        return chooser.choose(most, forces);
      });
      return RangeErrors(course, *full, ranges);
    };
    const auto frozen = chosen(frozen_with(step::kMaxNodeLimit)), graded = chosen(graded_with(3));
    for (auto& c : checks) {
      const auto range = ranges.of(c.force_n);
      if (!graded.has(range)) continue;
      ++c.places;
      c.graded_mean += graded.error(range);
      c.graded_largest = std::max(c.graded_largest, graded.error(range));
      c.graded_nodes += graded.mean_nodes(range);
      const double force = c.force_n;
      if (!organ::frozen_nodes_for(table, std::span(&force, 1))) continue;
      ++c.frozen_places;
      c.frozen_mean += frozen.error(range);
      c.frozen_largest = std::max(c.frozen_largest, frozen.error(range));
      c.frozen_nodes += frozen.mean_nodes(range);
    }
    if (progress) progress(i + 1, unseen.size());
  }
  for (auto& c : checks) {
    const auto n = static_cast<double>(std::max<std::size_t>(1, c.places));
    const auto f = static_cast<double>(std::max<std::size_t>(1, c.frozen_places));
    c.graded_mean /= n;
    c.graded_nodes /= n;
    c.frozen_mean /= f;
    c.frozen_nodes /= f;
  }
  return result;
}

std::string to_csv(const Calibration& calibration) {
  std::string text = "place,node,force_up_to_n,boundary,limit,queue_nodes,error_percent\n";
  for (const auto& f : calibration.findings)
    for (const auto& [name, all] : {std::pair{"frozen", &f.frozen}, std::pair{"graded", &f.graded}})
      for (const auto& tried : *all) {
        char line[160];
        std::snprintf(line, sizeof line, "%zu,%u,%.9g,%s,%u,%u,%.6g\n", f.place, f.node.value,
                      f.force_n, name, tried.limit, tried.nodes, 100 * tried.error);
        text += line;
      }
  return text;
}

}  // namespace trocar::calibration
