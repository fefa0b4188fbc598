#include "server/lab/scenario/load_curve.h"

#include <optional>

namespace trocar::scenario {
namespace {

Vec3d largest(const scenario::TimedVector& over_time) {
  Vec3d result;
  for (const auto& key : over_time.keys)
    if (length(key.value) > length(result)) result = key.value;
  return result;
}

Vec3d tip_at(const scenario::ResolvedScenario& resolved, std::size_t tool, double time_s) {
  return to_double(tool::sample(resolved.scenario.tools[tool], time_s, resolved.anchors[tool])
                       .world_from_tool.position);
}

// Returns the tip's displacement at the key that is farthest from the start, m.
Vec3d way_of(const scenario::ResolvedScenario& resolved, std::size_t tool) {
  Vec3d result;
  for (const auto& key : resolved.scenario.tools[tool].keys) {
    const Vec3d way = tip_at(resolved, tool, key.time_s) - tip_at(resolved, tool, 0);
    if (length(way) > length(result)) result = way;
  }
  return result;
}

// Returns the rule for a set; of several (one per axis, say) the one with the largest value.
template <typename Rules>
std::optional<std::size_t> about(const Rules& rules, const std::string& set) {
  std::optional<std::size_t> found;
  for (std::size_t i = 0; i < rules.size(); ++i)
    if (rules[i].set.name == set &&
        (!found || length(largest(rules[i].over_time)) > length(largest(rules[*found].over_time))))
      found = i;
  return found;
}

std::optional<LoadCurve> curve_of(const scenario::ResolvedScenario& resolved, std::size_t index) {
  using scenario::ProbeQuantity;
  const auto& scenario = resolved.scenario;
  const auto& probe = scenario.probes[index];
  LoadCurve curve;
  curve.probe = index;
  Vec3d along;
  if (probe.quantity == ProbeQuantity::ToolForce) {
    curve.kind = LoadCurve::Kind::Tool;
    curve.load = *probe.tool;
    curve.name = "tool" + std::to_string(*probe.tool);
    along = way_of(resolved, curve.load);
  } else {
    const bool is_held = probe.quantity == ProbeQuantity::Reaction;
    if (!is_held && probe.quantity != ProbeQuantity::Displacement) return std::nullopt;
    const auto load = is_held ? about(scenario.displacements, probe.set->name)
                              : about(scenario.forces, probe.set->name);
    if (!load) return std::nullopt;
    curve.kind = is_held ? LoadCurve::Kind::DisplacedSet : LoadCurve::Kind::LoadedSet;
    curve.load = *load;
    curve.name = probe.set->name;
    along = largest(is_held ? scenario.displacements[*load].over_time
                            : scenario.forces[*load].over_time);
  }
  if (length(along) == 0) return std::nullopt;
  curve.direction = along / length(along);
  return curve;
}

}  // namespace

std::vector<LoadCurve> load_curves(const scenario::ResolvedScenario& resolved) {
  std::vector<LoadCurve> curves;
  for (std::size_t i = 0; i < resolved.scenario.probes.size(); ++i)
    if (auto curve = curve_of(resolved, i)) curves.push_back(std::move(*curve));
  return curves;
}

LoadPoint load_point(const ScenarioRun& run, const LoadCurve& curve) {
  const Vec3d probed = run.probe(curve.probe);
  const Vec3d& d = curve.direction;
  switch (curve.kind) {
    case LoadCurve::Kind::DisplacedSet:
      return {dot(run.scenario().displacements[curve.load].over_time.at(run.time_s()), d),
              dot(probed, d)};
    case LoadCurve::Kind::Tool:
      return {dot(run.tool_tip(curve.load) - tip_at(run.resolved(), curve.load, 0), d),
              -dot(probed, d)};
    case LoadCurve::Kind::LoadedSet:
      return {dot(probed, d), dot(run.scenario().forces[curve.load].over_time.at(run.time_s()), d)};
  }
  return {};
}

}  // namespace trocar::scenario
