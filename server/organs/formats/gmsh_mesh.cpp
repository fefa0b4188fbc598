#include "server/organs/formats/gmsh_mesh.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace trocar::formats {
namespace {

struct GmshKind {
  std::int64_t type;
  int nodes, dimension;
};
constexpr std::size_t kMostGroupGrowth = 4;  // of groups beyond the file
constexpr GmshKind kGmshKinds[] = {{15, 1, 0}, {1, 2, 1}, {2, 3, 2}, {4, 4, 3}};

const GmshKind* find_gmsh_kind(std::int64_t type) {
  for (const GmshKind& kind : kGmshKinds)
    if (kind.type == type) return &kind;
  return nullptr;
}

const char* unsupported_gmsh_name(std::int64_t type) {
  switch (type) {
    case 3:
      return " (quadrangle)";
    case 5:
      return " (hexahedron)";
    case 6:
      return " (prism)";
    case 7:
      return " (pyramid)";
    case 11:
      return " (tetrahedron of second order)";
    default:
      return "";
  }
}

}  // namespace

Status GmshMesh::begin_nodes() {
  if (has_nodes_) return in_.error("a second $Nodes section: a file must have one");
  has_nodes_ = true;
  return {};
}

Status GmshMesh::add_node(std::int64_t id, const Vec3d& position) {
  if (id < 1)
    return in_.error("node number " + std::to_string(id) + " must be a whole number from 1 on");
  if (!is_finite(position))
    return in_.error("node " + std::to_string(id) + ": a coordinate is not a finite number");
  raw_.positions.push_back(position);
  raw_.node_ids.push_back(id);
  return {};
}

Status GmshMesh::end_nodes() {
  return numbers_.index(raw_.node_ids, in_);
}

Status GmshMesh::begin_elements() {
  if (!has_nodes_) return in_.error("$Elements comes before $Nodes");
  if (has_elements_) return in_.error("a second $Elements section: a file must have one");
  has_elements_ = true;
  return {};
}

Result<int> GmshMesh::node_count_of(const std::string& element, std::int64_t type) const {
  if (const GmshKind* kind = find_gmsh_kind(type)) return kind->nodes;
  return in_.error(element + " has type " + std::to_string(type) + unsupported_gmsh_name(type) +
                   ", which is not supported: mesh with tetrahedra of four nodes (type 4)");
}

std::string GmshMesh::element_name(std::int64_t id, std::int64_t type) const {
  const std::string name = "element " + std::to_string(id);
  return type == 4 ? "tet " + std::to_string(raw_.tets.size() + 1) + " (" + name + ")" : name;
}

Status GmshMesh::add_element(std::int64_t id, std::int64_t type, std::int64_t entity,
                             std::span<const std::int64_t> physical,
                             std::span<const std::int64_t> nodes) {
  const GmshKind* kind = find_gmsh_kind(type);
  TROCAR_ASSERT(kind != nullptr && nodes.size() == static_cast<std::size_t>(kind->nodes));
  mesh::Tet tet;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const auto found = numbers_.find(nodes[i]);
    if (found < 0)
      return in_.error(element_name(id, type) + " refers to node '" + std::to_string(nodes[i]) +
                       "', which is not in $Nodes");
    tet[i] = NodeIndex(static_cast<std::uint32_t>(found));
    for (std::size_t j = 0; j < i; ++j)
      if (tet[j] == tet[i])
        return in_.error(element_name(id, type) + " uses node " + std::to_string(nodes[i]) +
                         " twice");
  }
  grown_ += nodes.size() * (std::max<std::size_t>(physical.size(), 1) - 1);
  if (grown_ / kMostGroupGrowth > in_.text().size())
    return in_.error("elements in many groups make the groups far larger than the file");
  const auto groups = std::ranges::count_if(physical, [](auto number) { return number != 0; });
  for (const auto number : physical) {
    if (number == 0) continue;
    if (type == 4) {
      volumes_[number].push_back(raw_.tets.size());
    } else {
      auto& group = groups_[{kind->dimension, number}];
      group.insert(group.end(), tet.begin(), tet.begin() + kind->nodes);
    }
  }
  if (type == 4) {
    raw_.tets.push_back(tet);
    raw_.element_ids.push_back(id);
    if (groups == 0) ungrouped_.insert(entity);
  } else if (groups == 0) {
    ++skipped_;
  }
  return {};
}

Status GmshMesh::add_physical_name(std::int64_t dimension, std::int64_t number,
                                   std::string_view quoted) {
  if (dimension < 0 || dimension > 3)
    return in_.error("a physical group has dimension " + std::to_string(dimension) +
                     ", must be 0 to 3");
  if (quoted.size() < 2 || quoted.front() != '"' || quoted.back() != '"')
    return in_.error("the name of a physical group must stand in quotation marks");
  names_[{dimension, number}] = quoted.substr(1, quoted.size() - 2);
  return {};
}

void GmshMesh::join_repeated() {
  if (volumes_.size() < 2) return;
  std::vector<std::int64_t> group_of(raw_.tets.size(), 0);
  for (const auto& [number, tets] : volumes_)
    for (const auto t : tets) group_of[t] = number;
  std::vector<std::pair<mesh::Tet, std::size_t>> sorted;
  for (const auto& tet : raw_.tets) {
    auto corners = tet;
    std::ranges::sort(corners);
    sorted.emplace_back(corners, sorted.size());
  }
  std::ranges::sort(sorted);
  std::vector<std::size_t> place(raw_.tets.size());
  std::iota(place.begin(), place.end(), std::size_t{0});
  for (std::size_t i = 1, first = 0; i < sorted.size(); ++i) {
    if (sorted[i].first != sorted[first].first) first = i;
    const auto one = sorted[first].second, other = sorted[i].second;
    if (group_of[one] != 0 && group_of[other] != 0 && group_of[one] != group_of[other])
      place[other] = one;
  }
  std::size_t kept = 0;
  for (std::size_t t = 0; t < place.size(); ++t) {
    if (place[t] != t) {  // it comes after the one that it is
      place[t] = place[place[t]];
      continue;
    }
    raw_.tets[kept] = raw_.tets[t];
    raw_.element_ids[kept] = raw_.element_ids[t];
    place[t] = kept++;
  }
  if (kept == place.size()) return;
  raw_.tets.resize(kept);
  raw_.element_ids.resize(kept);
  for (auto& [number, tets] : volumes_) {
    for (auto& t : tets) t = place[t];
    std::ranges::sort(tets);
    tets.erase(std::unique(tets.begin(), tets.end()), tets.end());
  }
}

Result<mesh::RawTets> GmshMesh::finish() {
  if (!has_nodes_) return in_.error("the file ends without a $Nodes section");
  if (!has_elements_) return in_.error("the file ends without an $Elements section");
  const auto name_of = [&](std::int64_t dimension, std::int64_t number, const char* begin) {
    const auto named = names_.find({dimension, number});
    return named != names_.end() ? named->second : begin + std::to_string(number);
  };
  join_repeated();
  mesh::RegionSets regions(raw_.tets.size());
  for (const auto& [number, tets] : volumes_) regions.add(name_of(3, number, "region "), tets);
  std::move(regions).finish(raw_);
  for (auto& [key, nodes] : groups_)
    raw_.node_sets.push_back({name_of(key.first, key.second, ""), std::move(nodes)});
  if (volumes_.empty() && ungrouped_.size() > 1)
    raw_.left_out.push_back("no regions: its " + std::to_string(ungrouped_.size()) +
                            " volumes are in no physical group");
  if (skipped_ > 0)
    raw_.left_out.push_back("left out " + std::to_string(skipped_) +
                            " points, lines and triangles of no physical group");
  if (!left_out_.empty()) raw_.left_out.push_back("left out: " + mesh::list_of(left_out_));
  return std::move(raw_);
}

}  // namespace trocar::formats
