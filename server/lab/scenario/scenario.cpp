#include "server/lab/scenario/scenario.h"

#include <algorithm>
#include <cmath>

#include "server/lab/scenario/scenario_resolver.h"
#include "server/organs/organ/average_strain.h"

namespace trocar::scenario {
namespace {

// Who holds a node along which axes: bits as in DisplacementRule.
struct Hold {
  std::uint8_t fixed = 0, displaced = 0;

  std::uint8_t held() const { return fixed | displaced; }
};

std::uint8_t axes_of(const TimedVector& over_time) {
  std::uint8_t axes = 0;
  for (const auto& [time, value] : over_time.keys)
    axes = static_cast<std::uint8_t>(axes | (value.x != 0 ? 1 : 0) | (value.y != 0 ? 2 : 0) |
                                     (value.z != 0 ? 4 : 0));
  return axes;
}

std::string node_of_set(NodeIndex node, const SetUse& set) {
  return "node " + std::to_string(node.value) + " of set \"" + set.name + "\" is ";
}

Status resolve_displacements(const Resolver& resolver, std::vector<Hold>& holds,
                             ResolvedScenario& result) {
  for (const auto& rule : resolver.scenario().displacements) {
    auto nodes = resolver.nodes_of(rule.set, result.organ);
    if (!nodes) return nodes.error();
    for (const auto node : *nodes) {
      Hold& hold = holds[node.value];
      if (hold.fixed != 0)
        return resolver.wrong(rule.set.place, node_of_set(node, rule.set) +
                                                  "fixed: take it out of the set, or see [fix]");
      if ((hold.displaced & rule.axes) != 0)
        return resolver.wrong(rule.set.place,
                              node_of_set(node, rule.set) + "displaced by another set too");
      hold.displaced |= rule.axes;
    }
    result.displacements.push_back({std::move(*nodes), rule.axes, rule.over_time});
  }
  return {};
}

Status resolve_forces(const Resolver& resolver, const std::vector<Hold>& holds,
                      ResolvedScenario& result) {
  for (const auto& rule : resolver.scenario().forces) {
    auto nodes = resolver.nodes_of(rule.set, result.organ);
    if (!nodes) return nodes.error();
    for (const auto node : *nodes) {
      const Hold& hold = holds[node.value];
      if (hold.fixed != 0 || (hold.displaced & axes_of(rule.over_time)) != 0)
        return resolver.wrong(rule.set.place,
                              node_of_set(node, rule.set) +
                                  (hold.fixed != 0 ? "fixed" : "displaced") +
                                  ", a force on it would do nothing: take it out of the set");
    }
    const double share = 1.0 / static_cast<double>(nodes->size());
    std::vector<double> shares(nodes->size(), share);
    result.forces.push_back({std::move(*nodes), rule.over_time, std::move(shares), {}});
  }
  return {};
}

// A constant traction on a linear triangle is a third of its force on each corner.
Status resolve_tractions(const Resolver& resolver, const std::vector<Hold>& holds,
                         ResolvedScenario& result) {
  const auto& mesh = result.organ.mesh;
  for (const auto& rule : resolver.scenario().tractions) {
    const auto nodes = resolver.nodes_of(rule.set, result.organ);
    if (!nodes) return nodes.error();
    std::vector<std::uint8_t> is_inside(mesh.node_count());
    for (const auto node : *nodes) is_inside[node.value] = 1;
    std::vector<double> areas(mesh.node_count());
    std::vector<Vec3d> normal_areas(mesh.node_count());
    for (const auto& triangle : mesh.boundary_triangles) {
      if (!std::ranges::all_of(triangle, [&](NodeIndex n) { return is_inside[n.value] != 0; }))
        continue;
      const auto& [a, b, c] = triangle;
      const auto& p = mesh.rest_positions;
      const Vec3d twice = cross(p[b.value] - p[a.value], p[c.value] - p[a.value]);
      for (const auto node : triangle) {
        areas[node.value] += length(twice) / 6;
        normal_areas[node.value] += twice / 6;
      }
    }
    LoadedNodes force{{}, rule.over_time, {}, {}};
    bool moves = false;
    for (const auto node : *nodes) {
      if (areas[node.value] == 0) continue;
      moves |= holds[node.value].held() != kAllAxes;
      force.nodes.push_back(node);
      if (rule.is_pressure)
        force.normal_areas_m2.push_back(normal_areas[node.value]);
      else
        force.shares.push_back(areas[node.value]);
    }
    if (force.nodes.empty())
      return resolver.wrong(rule.set.place, "set \"" + rule.set.name +
                                                "\" holds no whole triangle of the surface, a "
                                                "traction needs one: enlarge it");
    if (!moves)
      return resolver.wrong(rule.set.place,
                            "all nodes of set \"" + rule.set.name +
                                "\" are fixed or displaced, a traction on them would do nothing");
    result.forces.push_back(std::move(force));
  }
  return {};
}

Status resolve_probes(const Resolver& resolver, const std::vector<Hold>& holds,
                      ResolvedScenario& result) {
  for (const auto& probe : resolver.scenario().probes) {
    auto& nodes = result.probe_nodes.emplace_back();
    if (!probe.set) continue;
    auto found = resolver.nodes_of(*probe.set, result.organ);
    if (!found) return found.error();
    nodes = std::move(*found);
    if (probe.quantity != ProbeQuantity::Reaction) continue;
    for (const auto node : nodes)
      if (holds[node.value].held() == 0)
        return resolver.wrong(probe.place,
                              node_of_set(node, *probe.set) +
                                  "neither fixed nor displaced, so nothing holds it: a reaction "
                                  "needs a held set");
  }
  return {};
}

Status resolve_anchors(const Resolver& resolver, ResolvedScenario& result) {
  const Scenario& scenario = resolver.scenario();
  std::vector<Vec3f> rest;
  std::vector<tool::SurfaceTriangle> triangles;
  for (const auto& p : result.organ.mesh.rest_positions) rest.push_back(to_float(p));
  for (const auto& [a, b, c] : result.organ.mesh.boundary_triangles)
    triangles.push_back({a.value, b.value, c.value});
  for (std::size_t i = 0; i < scenario.tools.size(); ++i) {
    result.anchors.emplace_back();
    const auto& tool = scenario.tools[i];
    const std::string key = "tool[" + std::to_string(i) + "]";
    if (tool.anchor) {
      const auto anchor = tool::find_anchor(*tool.anchor, rest, triangles);
      if (!anchor) return resolver.wrong({0, key + ".anchor"}, anchor.error().message);
      result.anchors.back() = *anchor;
    }
    for (std::size_t k = 0; k < tool.keys.size(); ++k)
      if (!(length(sample(tool, tool.keys[k].time_s, result.anchors.back())
                       .world_from_tool.position) <= tool::kScriptReachLimit))
        return resolver.wrong({0, key + ".key[" + std::to_string(k) + "].position_mm"},
                              "is more than 2000 mm from the centre of this organ, move it nearer");
  }
  return {};
}

Status check_blades(const Resolver& resolver, const organ::Organ& organ) {
  const auto& scenario = resolver.scenario();
  if (!has_blade(scenario)) return {};
  if (organ.mesh.tets.empty() || !organ.mesh.links.empty())
    return resolver.wrong(
        scenario.organ.place,
        "is an organ without tets, or with links, which no [[tool]] can cut: take "
        "\"liver\" or \"block\"");
  if (scenario.run.mode == RunMode::Static)
    return resolver.wrong(place_of_key(scenario.run.given, "mode", scenario.run_place),
                          "is \"static\", and a [[tool]] has the verb \"cut\": take \"dynamic\"");
  return {};
}

// Far from the queue nothing moves: whatever acts there has to be in equilibrium already.
Status check_gravity(const Resolver& resolver, const organ::Organ& organ) {
  const auto& scenario = resolver.scenario();
  if (scenario.run.boundary != Boundary::Frozen || length(organ.gravity_m_s2) == 0) return {};
  if (scenario.run.starts_in_equilibrium || !organ.stress_free_positions_m.empty()) return {};
  return resolver.wrong(scenario.gravity_m_s2 ? scenario.gravity_place : scenario.organ.place,
                        "acts on the whole organ, but boundary = \"frozen\" moves a part of it: "
                        "add start = \"equilibrium\" to [run], or take another boundary");
}

}  // namespace

const Place& place_of_key(const std::vector<Place>& places, std::string_view key,
                          const Place& other) {
  for (const auto& place : places) {
    const auto dot = place.key.rfind('.');
    if (std::string_view(place.key).substr(dot == std::string::npos ? 0 : dot + 1) == key)
      return place;
  }
  return other;
}

bool MaterialChange::sets(double material::Material::*member) const {
  for (std::size_t i = 0; i < numbers.size(); ++i)
    if (material::kNumberKeys[i].member == member) return numbers[i].has_value();
  return false;
}

const Place& MaterialChange::place_of(std::string_view key) const {
  return place_of_key(given, key, place);
}

Error scenario_error(const Scenario& scenario, const Place& place, const std::string& what) {
  const std::string line = place.line > 0 ? ":" + std::to_string(place.line) : "";
  const std::string key = place.key.empty() ? "" : "key " + place.key + ": ";
  return {ErrorCode::BadFile, scenario.source.string() + line + ": " + key + what};
}

bool has_blade(const Scenario& scenario) {
  return std::ranges::any_of(scenario.tools, [](const tool::ScriptTool& tool) {
    return std::ranges::any_of(tool.keys,
                               [](const auto& key) { return key.verb == tool::Verb::Cut; });
  });
}

Result<ResolvedScenario> resolve(Scenario scenario) {
  const Resolver resolver(scenario);
  auto organ = resolver.make_organ();
  if (!organ) return organ.error();
  if (auto s = check_gravity(resolver, *organ); !s) return s.error();
  ResolvedScenario result;
  result.organ = std::move(*organ);
  // Sets that nobody uses are checked too: a typing error in them is one all the same.
  for (const auto& rule : scenario.node_rules)
    if (auto nodes = resolver.select(rule, result.organ); !nodes) return nodes.error();
  std::vector<Hold> holds(result.organ.mesh.node_count());
  for (const auto node : result.organ.fixed_nodes) holds[node.value].fixed = kAllAxes;
  if (auto s = resolve_displacements(resolver, holds, result); !s) return s.error();
  if (auto s = resolve_forces(resolver, holds, result); !s) return s.error();
  if (auto s = resolve_tractions(resolver, holds, result); !s) return s.error();
  if (auto s = resolve_probes(resolver, holds, result); !s) return s.error();
  if (auto s = resolve_anchors(resolver, result); !s) return s.error();
  if (auto s = check_blades(resolver, result.organ); !s) return s.error();
  result.scenario = std::move(scenario);
  return result;
}

}  // namespace trocar::scenario
