// Node sets of a scenario on its organ.

#include <algorithm>
#include <charconv>

#include "common/tool/toml_reader.h"
#include "server/lab/scenario/scenario_resolver.h"

namespace trocar::scenario {
namespace {

constexpr double kBoxMargin_m = 1e-6;

void sort_distinct(NodeList& nodes) {
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
}

NodeList nodes_in_box(const NodeRule::Box& box, const std::vector<Vec3d>& rest) {
  const auto is_within = [](double x, double low, double high) {
    return x >= low - kBoxMargin_m && x <= high + kBoxMargin_m;
  };
  NodeList nodes;
  for (std::size_t i = 0; i < rest.size(); ++i)
    if (is_within(rest[i].x, box.low_m.x, box.high_m.x) &&
        is_within(rest[i].y, box.low_m.y, box.high_m.y) &&
        is_within(rest[i].z, box.low_m.z, box.high_m.z))
      nodes.push_back(NodeIndex(i));
  return nodes;
}

NodeList nodes_near(const NodeRule::Near& near, bool is_on_surface, const mesh::TetMesh& mesh) {
  NodeList nodes;
  std::optional<std::size_t> nearest;
  double least = 0;
  for (std::size_t i = 0; i < mesh.node_count(); ++i) {
    if (is_on_surface && mesh.is_surface_node[i] == 0) continue;
    const double distance = length(mesh.rest_positions[i] - near.point_m);
    if (!nearest || distance < least) {
      nearest = i;
      least = distance;
    }
    if (near.radius_m && distance <= *near.radius_m + kBoxMargin_m) nodes.push_back(NodeIndex(i));
  }
  if (!near.radius_m && nearest) nodes.push_back(NodeIndex(*nearest));
  return nodes;
}

std::string_view trimmed(std::string_view text) {
  constexpr const char* kBlank = " \t\r\"";
  const auto begin = text.find_first_not_of(kBlank);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlank) + 1 - begin);
}

// The first column of each line; a header, empty lines and lines that begin with # do not count.
Result<std::vector<std::int64_t>> ids_of_csv(const std::filesystem::path& path) {
  const auto text = tool::read_text_file(path, kScenarioFileLimitBytes, "CSV");
  if (!text) return text.error();
  if (text->size() > kScenarioFileLimitBytes)
    return Error{ErrorCode::BadFile, path.string() + ": is larger than " +
                                         std::to_string(kScenarioFileLimitBytes >> 20) +
                                         " MiB, a list of node ids is not"};
  std::vector<std::int64_t> ids;
  bool may_be_header = true;
  int line = 0;
  for (std::size_t begin = 0; begin < text->size();) {
    const auto end = std::min(text->find('\n', begin), text->size());
    const std::string_view row = std::string_view(*text).substr(begin, end - begin);
    const std::string_view cell = trimmed(row.substr(0, row.find_first_of(",;")));
    begin = end + 1;
    ++line;
    if (cell.empty() || cell.front() == '#') continue;
    std::int64_t id = 0;
    const auto [rest, failed] = std::from_chars(cell.data(), cell.data() + cell.size(), id);
    const bool is_number = failed == std::errc{} && rest == cell.data() + cell.size();
    if (!is_number && !may_be_header)
      return Error{ErrorCode::BadFile, path.string() + ":" + std::to_string(line) +
                                           ": does not begin with a node id, write one per line"};
    may_be_header = false;
    if (is_number) ids.push_back(id);
  }
  return ids;
}

}  // namespace

Result<NodeList> Resolver::nodes_of(const SetUse& use, const organ::Organ& organ) const {
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

Result<NodeList> Resolver::read_ids(const NodeRule& rule, std::size_t node_count) const {
  std::vector<std::int64_t> ids = rule.ids.value_or(std::vector<std::int64_t>{});
  if (rule.csv) {
    const std::filesystem::path path(*rule.csv);
    auto read = ids_of_csv(path.is_absolute() ? path : scenario_.source.parent_path() / path);
    if (!read) return wrong(rule.ids_place, read.error().message);
    ids = std::move(*read);
  }
  NodeList nodes;
  for (const auto id : ids) {
    if (id < 0 || static_cast<std::uint64_t>(id) >= node_count)
      return wrong(rule.ids_place, "set \"" + rule.name + "\": node " + std::to_string(id) +
                                       " does not exist, the organ has nodes 0 to " +
                                       std::to_string(node_count - 1));
    nodes.push_back(NodeIndex(static_cast<std::size_t>(id)));
  }
  sort_distinct(nodes);
  return nodes;
}

Result<NodeList> Resolver::select(const NodeRule& rule, const organ::Organ& organ) const {
  const auto& mesh = organ.mesh;
  NodeList nodes;
  if (rule.ids || rule.csv) {
    auto read = read_ids(rule, mesh.node_count());
    if (!read) return read;
    nodes = std::move(*read);
  } else if (rule.box) {
    nodes = nodes_in_box(*rule.box, mesh.rest_positions);
  } else if (rule.near) {
    nodes = nodes_near(*rule.near, rule.is_on_surface, mesh);
  } else {
    nodes = mesh.surface_nodes;
  }
  if (rule.is_on_surface)
    std::erase_if(nodes, [&](NodeIndex n) { return mesh.is_surface_node[n.value] == 0; });
  if (nodes.empty())
    return wrong(rule.place, "set \"" + rule.name +
                                 "\" has no nodes; positions are in mm at rest, the origin is "
                                 "the centre of the organ's bounding box");
  return nodes;
}

}  // namespace trocar::scenario
