#include "server/tissue/topology/surface_mesh.h"

#include <algorithm>

#include "common/base/assert.h"

namespace trocar::topology {
namespace {

// Corners of the face opposite to each corner of a tet, outward.
constexpr std::size_t kFaces[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};

std::array<NodeIndex, 3> key_of(const mesh::Triangle& nodes) {
  std::array<NodeIndex, 3> key{nodes[0], nodes[1], nodes[2]};
  std::ranges::sort(key);
  return key;
}

}  // namespace

SurfaceMesh::SurfaceMesh(const organ::Organ& organ)
    : triangles_(organ.mesh.boundary_triangles), is_changed_(organ.mesh.node_count()) {
  std::vector<std::vector<TriangleIndex>> lists(organ.mesh.node_count());
  for (std::uint32_t t = 0; t < triangles_.size(); ++t)
    for (const auto node : triangles_[t]) lists[node.value].emplace_back(t);
  triangles_of_.reserve(3 * triangles_.size());
  triangles_of_.extend(lists.size());
  for (std::size_t n = 0; n < lists.size(); ++n)
    std::ranges::copy(lists[n],
                      triangles_of_.resize(n, static_cast<std::uint32_t>(lists[n].size())).begin());
  triangles_of_.end_building();
}

double SurfaceMesh::area_of(const Topology& topology, NodeIndex node) const {
  double area = 0;
  for (const auto triangle : triangles_of(node)) {
    const auto& [a, b, c] = triangles_[triangle.value];
    const auto p = topology.rest();
    area += length(cross(p[b.value] - p[a.value], p[c.value] - p[a.value])) / 6;
  }
  return area;
}

// Faces with a changed node that one tet alone has, by key. A face with a changed node is met from
// both of its tets, for both have that node.
void SurfaceMesh::gather_faces(const Topology& topology) {
  faces_.clear();
  for (const auto changed : topology.changed()) {
    if (!topology.has_node(changed)) continue;
    for (const auto t : topology.tets_of(changed)) {
      const auto& tet = topology.tet(t);
      // Each tet once: from its lowest changed node.
      const bool is_met = std::ranges::any_of(
          tet, [&](NodeIndex n) { return n < changed && is_changed_[n.value] != 0; });
      if (is_met) continue;
      for (std::size_t corner = 0; corner < 4; ++corner) {
        mesh::Triangle nodes;
        bool has_changed = false;
        for (std::size_t i = 0; i < 3; ++i) {
          nodes[i] = tet[kFaces[corner][i]];
          has_changed |= is_changed_[nodes[i].value] != 0;
        }
        if (has_changed)
          faces_.push_back({key_of(nodes), nodes, (topology.wound_faces(t) >> corner & 1) != 0,
                            topology.material_of(t)});
      }
    }
  }
  std::ranges::sort(faces_, {}, &Face::key);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < faces_.size(); ++i) {
    if (i + 1 < faces_.size() && faces_[i + 1].key == faces_[i].key)
      ++i;
    else
      faces_[kept++] = faces_[i];
  }
  faces_.resize(kept);
}

void SurfaceMesh::remove(TriangleIndex triangle) {
  for (const auto node : triangles_[triangle.value]) {
    const auto list = triangles_of_[node.value];
    const auto at = std::ranges::find(list, triangle);
    TROCAR_ASSERT(at != list.end());
    std::copy(at + 1, list.end(), at);
    triangles_of_.resize(node.value, static_cast<std::uint32_t>(list.size() - 1));
    edit_.touched.push_back(node);
  }
  triangles_[triangle.value] = {};
  edit_.removed.push_back(triangle);
}

void SurfaceMesh::add(const Face& face) {
  const TriangleIndex triangle(triangles_.size());
  triangles_.push_back(face.nodes);
  for (const auto node : face.nodes) {
    const auto count = static_cast<std::uint32_t>(triangles_of_[node.value].size());
    triangles_of_.resize(node.value, count + 1).back() = triangle;
    edit_.touched.push_back(node);
  }
  edit_.added.push_back({face.nodes, face.is_wound, face.material});
}

const SurfaceEdit& SurfaceMesh::update(const Topology& topology) {
  edit_.clear();
  is_changed_.resize(topology.node_count());
  triangles_of_.extend(topology.node_count());
  for (const auto node : topology.changed()) is_changed_[node.value] = 1;
  gather_faces(topology);

  old_.clear();
  for (const auto node : topology.changed())
    for (const auto triangle : triangles_of(node)) {
      const auto& nodes = triangles_[triangle.value];
      const bool is_met = std::ranges::any_of(
          nodes, [&](NodeIndex n) { return n < node && is_changed_[n.value] != 0; });
      if (!is_met) old_.emplace_back(key_of(nodes), triangle);
    }
  std::ranges::sort(old_);

  // Old triangles that are no faces any more, and faces that were none.
  gone_.clear();
  std::size_t kept = 0;
  auto old = old_.begin();
  for (const auto& face : faces_) {
    for (; old != old_.end() && old->first < face.key; ++old) gone_.push_back(old->second);
    if (old != old_.end() && old->first == face.key)
      ++old;
    else
      faces_[kept++] = face;
  }
  for (; old != old_.end(); ++old) gone_.push_back(old->second);
  faces_.resize(kept);
  for (const auto& face : faces_)
    for (const auto node : face.nodes)
      if (triangles_of(node).empty()) edit_.surfaced.push_back(node);
  std::ranges::sort(gone_);
  for (const auto triangle : gone_) remove(triangle);
  for (const auto& face : faces_) add(face);

  for (auto* nodes : {&edit_.surfaced, &edit_.touched}) {
    std::ranges::sort(*nodes);
    nodes->erase(std::unique(nodes->begin(), nodes->end()), nodes->end());
  }
  for (const auto node : edit_.touched)
    edit_.areas_m2.push_back(static_cast<float>(area_of(topology, node)));
  for (const auto node : topology.changed()) is_changed_[node.value] = 0;
  triangles_of_.tidy();
  return edit_;
}

}  // namespace trocar::topology
