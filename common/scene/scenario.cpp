#include "common/scene/scenario.h"

#include <algorithm>
#include <cmath>

#include "common/scene/builtin_organs.h"
#include "common/scene/load_organ.h"

namespace trocar::scene {
namespace {

constexpr double kBoxMargin_m = 1e-6;

class Resolver {
 public:
  explicit Resolver(const Scenario& scenario) : scenario_(scenario) {}

  Error wrong(const Place& place, const std::string& what) const {
    const std::string line = place.line > 0 ? ":" + std::to_string(place.line) : "";
    return {ErrorCode::BadFile,
            scenario_.source.string() + line + ": key " + place.key + ": " + what};
  }

  Result<Organ> make_organ() const {
    auto organ = source_organ();
    if (!organ) return wrong(scenario_.organ.place, organ.error().message);
    if (auto changed = change_material(*organ); !changed) return changed.error();
    if (!scenario_.keeps_organ_fixed) organ->fixed_nodes.clear();
    for (const auto& use : scenario_.fixes) {
      const auto nodes = nodes_of(use, *organ);
      if (!nodes) return nodes.error();
      organ->fixed_nodes.insert(organ->fixed_nodes.end(), nodes->begin(), nodes->end());
    }
    auto& fixed = organ->fixed_nodes;
    std::sort(fixed.begin(), fixed.end());
    fixed.erase(std::unique(fixed.begin(), fixed.end()), fixed.end());
    return organ;
  }

  Result<NodeList> nodes_of(const SetUse& use, const Organ& organ) const {
    NodeList nodes;
    if (use.name == "fixed") {
      nodes = organ.fixed_nodes;
    } else if (use.name == "all") {
      for (std::size_t i = 0; i < organ.mesh.node_count(); ++i) nodes.push_back(NodeIndex(i));
    } else {
      const auto rule = std::find_if(scenario_.node_rules.begin(), scenario_.node_rules.end(),
                                     [&](const NodeRule& r) { return r.name == use.name; });
      if (rule == scenario_.node_rules.end())
        return wrong(use.place, "there is no set \"" + use.name + "\", add it as [[nodes]]");
      auto selected = select(*rule, organ);
      if (!selected) return selected;
      nodes = std::move(*selected);
    }
    if (nodes.empty()) return wrong(use.place, "set \"" + use.name + "\" has no nodes");
    return nodes;
  }

  Result<NodeList> select(const NodeRule& rule, const Organ& organ) const {
    const auto& rest = organ.mesh.rest_positions;
    NodeList nodes;
    if (rule.ids) {
      for (const auto id : *rule.ids) {
        if (id < 0 || static_cast<std::uint64_t>(id) >= rest.size())
          return wrong(rule.place, "set \"" + rule.name + "\": node " + std::to_string(id) +
                                       " does not exist, the organ has nodes 0 to " +
                                       std::to_string(rest.size() - 1));
        nodes.push_back(NodeIndex(static_cast<std::size_t>(id)));
      }
      std::sort(nodes.begin(), nodes.end());
      nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    } else if (rule.box) {
      const auto is_within = [](double x, double low, double high) {
        return x >= low - kBoxMargin_m && x <= high + kBoxMargin_m;
      };
      const auto& [low, high] = *rule.box;
      for (std::size_t i = 0; i < rest.size(); ++i)
        if (is_within(rest[i].x, low.x, high.x) && is_within(rest[i].y, low.y, high.y) &&
            is_within(rest[i].z, low.z, high.z))
          nodes.push_back(NodeIndex(i));
    } else if (rule.near) {
      std::size_t nearest = 0;
      for (std::size_t i = 0; i < rest.size(); ++i) {
        const double distance = length(rest[i] - rule.near->point_m);
        if (distance < length(rest[nearest] - rule.near->point_m)) nearest = i;
        if (rule.near->radius_m && distance <= *rule.near->radius_m + kBoxMargin_m)
          nodes.push_back(NodeIndex(i));
      }
      if (!rule.near->radius_m) nodes.push_back(NodeIndex(nearest));
    }
    if (nodes.empty())
      return wrong(rule.place, "set \"" + rule.name +
                                   "\" has no nodes; positions are in mm at rest, the origin is "
                                   "the centre of the organ's bounding box");
    return nodes;
  }

 private:
  Result<Organ> source_organ() const {
    const auto& rule = scenario_.organ;
    if (rule.source == "lattice") {
      LatticeSize size;
      if (rule.lattice_nodes)
        size = {(*rule.lattice_nodes)[0], (*rule.lattice_nodes)[1], (*rule.lattice_nodes)[2],
                size.spacing_m};
      size.spacing_m = rule.lattice_spacing_m.value_or(size.spacing_m);
      return make_lattice(size);
    }
    const std::filesystem::path path(rule.source);
    if (!path.has_extension() || path.is_absolute()) return load_organ(rule.source);
    return load_organ((scenario_.source.parent_path() / path).string());
  }

  Status change_material(Organ& organ) const {
    const auto& change = scenario_.material;
    Material& material = organ.material;
    if (change.density_kg_m3) {
      // Masses are in proportion to density whatever they were made from.
      for (double& mass : organ.node_masses_kg)
        mass *= *change.density_kg_m3 / material.density_kg_m3;
      material.density_kg_m3 = *change.density_kg_m3;
    }
    if (change.young_modulus_pa) {
      if (organ.mesh.tets.empty() || !organ.mesh.links.empty())
        return wrong(change.place,
                     "this organ's springs are no edges of tets, write spring_stiffness_n_m");
      material.spring_law = SpringLaw::VolumeConsistent;
      material.young_modulus_pa = *change.young_modulus_pa;
    }
    if (change.spring_stiffness_n_m) {
      material.spring_law = SpringLaw::Constant;
      material.spring_stiffness_n_m = *change.spring_stiffness_n_m;
    }
    material.node_damping_per_s = change.node_damping_per_s.value_or(material.node_damping_per_s);
    material.spring_damping_time_s =
        change.spring_damping_time_s.value_or(material.spring_damping_time_s);
    if (auto status = validate(organ); !status) return wrong(change.place, status.error().message);
    return {};
  }

  const Scenario& scenario_;
};

// Who holds a node.
enum class Hold : std::uint8_t { Free, Fixed, Displaced };

Status resolve_loads(const Resolver& resolver, const Scenario& scenario, std::vector<Hold>& holds,
                     ResolvedScenario& result) {
  for (const auto& rule : scenario.displacements) {
    auto nodes = resolver.nodes_of(rule.set, result.organ);
    if (!nodes) return nodes.error();
    for (const auto node : *nodes) {
      if (holds[node.value] != Hold::Free)
        return resolver.wrong(rule.set.place,
                              "node " + std::to_string(node.value) + " of set \"" + rule.set.name +
                                  (holds[node.value] == Hold::Fixed
                                       ? "\" is fixed: take it out of the set, or see [fix]"
                                       : "\" is displaced by another set too"));
      holds[node.value] = Hold::Displaced;
    }
    result.displacements.push_back({std::move(*nodes), rule.over_time});
  }
  for (const auto& rule : scenario.forces) {
    auto nodes = resolver.nodes_of(rule.set, result.organ);
    if (!nodes) return nodes.error();
    for (const auto node : *nodes)
      if (holds[node.value] != Hold::Free)
        return resolver.wrong(
            rule.set.place,
            "node " + std::to_string(node.value) + " of set \"" + rule.set.name +
                (holds[node.value] == Hold::Fixed ? "\" is fixed" : "\" is displaced") +
                ", a force on it would do nothing: take it out of the set");
    result.forces.push_back({std::move(*nodes), rule.over_time});
  }
  return {};
}

Status resolve_probes(const Resolver& resolver, const Scenario& scenario,
                      const std::vector<Hold>& holds, ResolvedScenario& result) {
  for (const auto& probe : scenario.probes) {
    auto& nodes = result.probe_nodes.emplace_back();
    if (!probe.set) continue;
    auto found = resolver.nodes_of(*probe.set, result.organ);
    if (!found) return found.error();
    nodes = std::move(*found);
    if (probe.quantity != ProbeQuantity::Reaction) continue;
    for (const auto node : nodes)
      if (holds[node.value] == Hold::Free)
        return resolver.wrong(probe.place, "node " + std::to_string(node.value) + " of set \"" +
                                               probe.set->name +
                                               "\" is neither fixed nor displaced, so nothing "
                                               "holds it: a reaction needs a held set");
  }
  return {};
}

Status resolve_anchors(const Resolver& resolver, const Scenario& scenario,
                       ResolvedScenario& result) {
  std::vector<Vec3f> rest;
  std::vector<SurfaceTriangle> triangles;
  for (const auto& p : result.organ.mesh.rest_positions) rest.push_back(to_float(p));
  for (const auto& [a, b, c] : result.organ.mesh.boundary_triangles)
    triangles.push_back({a.value, b.value, c.value});
  for (std::size_t i = 0; i < scenario.tools.size(); ++i) {
    result.anchors.emplace_back();
    const auto& tool = scenario.tools[i];
    const std::string key = "tool[" + std::to_string(i) + "]";
    if (tool.anchor) {
      const auto anchor = find_anchor(*tool.anchor, rest, triangles);
      if (!anchor) return resolver.wrong({0, key + ".anchor"}, anchor.error().message);
      result.anchors.back() = *anchor;
    }
    for (std::size_t k = 0; k < tool.keys.size(); ++k)
      if (!(length(sample(tool, tool.keys[k].time_s, result.anchors.back())
                       .world_from_tool.position) <= kScriptReachLimit))
        return resolver.wrong({0, key + ".key[" + std::to_string(k) + "].position_mm"},
                              "is more than 2000 mm from the centre of this organ, move it nearer");
  }
  return {};
}

}  // namespace

Vec3d TimedVector::at(double time_s) const {
  if (time_s <= keys.front().time_s) return keys.front().value;
  for (std::size_t i = 1; i < keys.size(); ++i) {
    if (time_s > keys[i].time_s) continue;
    const auto& [t0, a] = keys[i - 1];
    const auto& [t1, b] = keys[i];
    return a + (b - a) * ((time_s - t0) / (t1 - t0));
  }
  return keys.back().value;
}

Result<ResolvedScenario> resolve(Scenario scenario) {
  const Resolver resolver(scenario);
  auto organ = resolver.make_organ();
  if (!organ) return organ.error();
  if ((scenario.run.depth || scenario.run.nodes) && length(scenario.gravity_m_s2) > 0)
    return resolver.wrong(scenario.gravity_place,
                          "acts on the whole organ, remove depth and nodes from [run]");
  ResolvedScenario result;
  result.organ = std::move(*organ);
  // Sets that nobody uses are checked too: a typing error in them is one all the same.
  for (const auto& rule : scenario.node_rules)
    if (auto nodes = resolver.select(rule, result.organ); !nodes) return nodes.error();
  std::vector<Hold> holds(result.organ.mesh.node_count(), Hold::Free);
  for (const auto node : result.organ.fixed_nodes) holds[node.value] = Hold::Fixed;
  if (auto s = resolve_loads(resolver, scenario, holds, result); !s) return s.error();
  if (auto s = resolve_probes(resolver, scenario, holds, result); !s) return s.error();
  if (auto s = resolve_anchors(resolver, scenario, result); !s) return s.error();
  result.scenario = std::move(scenario);
  return result;
}

}  // namespace trocar::scene
