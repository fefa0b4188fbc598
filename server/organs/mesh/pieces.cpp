#include "server/organs/mesh/pieces.h"

#include <algorithm>
#include <numeric>

namespace trocar::mesh {
namespace {

// Disjoint sets; the smallest member represents its set, so numbering follows the members' order.
class Sets {
 public:
  explicit Sets(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), std::uint32_t{0});
  }
  std::uint32_t find(std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::uint32_t a, std::uint32_t b) {
    a = find(a), b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

struct EdgeUse {
  NodePair edge;
  std::uint32_t tet;
};

// Among the tets around one edge, [begin, end), marks all but the largest fan.
void mark_lesser_fans(const TetMesh& mesh, const EdgeUse* begin, const EdgeUse* end,
                      std::vector<std::uint8_t>& dropped) {
  const auto count = static_cast<std::uint32_t>(end - begin);
  Sets fans(count);
  // Two tets at an edge share a face there when they have a third node in common.
  for (std::uint32_t i = 0; i < count; ++i)
    for (std::uint32_t j = 0; j < i; ++j) {
      int common = 0;
      for (const NodeIndex node : mesh.tets[begin[i].tet])
        common += static_cast<int>(std::ranges::count(mesh.tets[begin[j].tet], node));
      if (common >= 3) fans.join(i, j);
    }
  std::vector<double> volumes(count, 0.0);
  for (std::uint32_t i = 0; i < count; ++i)
    volumes[fans.find(i)] += tet_volume(mesh, TetIndex(begin[i].tet));
  const auto kept = static_cast<std::uint32_t>(std::max_element(volumes.begin(), volumes.end()) -
                                               volumes.begin());
  for (std::uint32_t i = 0; i < count; ++i)
    if (fans.find(i) != kept) dropped[begin[i].tet] = 1;
}

std::size_t erase_marked(TetMesh& mesh, const std::vector<std::uint8_t>& dropped) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < mesh.tets.size(); ++i)
    if (!dropped[i]) mesh.tets[kept++] = mesh.tets[i];
  const std::size_t removed = mesh.tets.size() - kept;
  mesh.tets.resize(kept);
  return removed;
}

}  // namespace

Pieces find_pieces(const TetMesh& mesh) {
  struct Face {
    Triangle key;
    std::uint32_t tet;
  };
  std::vector<Face> faces;
  faces.reserve(mesh.tets.size() * 4);
  for (std::uint32_t t = 0; t < mesh.tets.size(); ++t)
    for (const auto& [i, j, k] : kTetFaces) {
      Face face{{mesh.tets[t][i], mesh.tets[t][j], mesh.tets[t][k]}, t};
      std::sort(face.key.begin(), face.key.end());
      faces.push_back(face);
    }
  std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) {
    return a.key != b.key ? a.key < b.key : a.tet < b.tet;
  });
  Sets sets(mesh.tets.size());
  for (std::size_t i = 1; i < faces.size(); ++i)
    if (faces[i].key == faces[i - 1].key) sets.join(faces[i].tet, faces[i - 1].tet);
  Pieces pieces;
  pieces.piece_of_tet.resize(mesh.tets.size());
  for (std::uint32_t t = 0; t < mesh.tets.size(); ++t) {
    const auto root = sets.find(t);
    pieces.piece_of_tet[t] = root == t ? pieces.count++ : pieces.piece_of_tet[root];
  }
  return pieces;
}

std::uint32_t keep_largest_piece(TetMesh& mesh) {
  const Pieces pieces = find_pieces(mesh);
  if (pieces.count <= 1) return 0;
  std::vector<double> volumes(pieces.count, 0.0);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    volumes[pieces.piece_of_tet[t]] += tet_volume(mesh, TetIndex(t));
  const auto kept = static_cast<std::uint32_t>(std::max_element(volumes.begin(), volumes.end()) -
                                               volumes.begin());
  std::vector<std::uint8_t> dropped(mesh.tets.size());
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) dropped[t] = pieces.piece_of_tet[t] != kept;
  erase_marked(mesh, dropped);
  return pieces.count - 1;
}

std::size_t drop_touching_parts(TetMesh& mesh) {
  std::size_t total = 0;
  while (true) {
    std::vector<EdgeUse> uses;
    uses.reserve(mesh.tets.size() * 6);
    for (std::uint32_t t = 0; t < mesh.tets.size(); ++t)
      for (int i = 0; i < 4; ++i)
        for (int j = 0; j < i; ++j) {
          const auto [a, b] = std::minmax(mesh.tets[t][i], mesh.tets[t][j]);
          uses.push_back({{a, b}, t});
        }
    std::sort(uses.begin(), uses.end(), [](const EdgeUse& a, const EdgeUse& b) {
      return a.edge != b.edge ? a.edge < b.edge : a.tet < b.tet;
    });
    std::vector<std::uint8_t> dropped(mesh.tets.size(), 0);
    for (std::size_t i = 0; i < uses.size();) {
      std::size_t end = i + 1;
      while (end < uses.size() && uses[end].edge == uses[i].edge) ++end;
      mark_lesser_fans(mesh, uses.data() + i, uses.data() + end, dropped);
      i = end;
    }
    const std::size_t removed = erase_marked(mesh, dropped);
    if (removed == 0) return total;
    total += removed;
  }
}

std::size_t drop_unused_nodes(TetMesh& mesh) {
  std::vector<std::uint32_t> new_number(mesh.node_count(), 0);
  for (const Tet& tet : mesh.tets)
    for (const NodeIndex node : tet) new_number[node.value] = 1;
  std::uint32_t kept = 0;
  for (std::size_t i = 0; i < new_number.size(); ++i)
    if (new_number[i]) {
      mesh.rest_positions[kept] = mesh.rest_positions[i];
      new_number[i] = kept++;
    }
  const std::size_t removed = mesh.node_count() - kept;
  mesh.rest_positions.resize(kept);
  for (Tet& tet : mesh.tets)
    for (NodeIndex& node : tet) node = NodeIndex(new_number[node.value]);
  return removed;
}

std::vector<std::uint32_t> renumber_along_z(TetMesh& mesh) {
  drop_unused_nodes(mesh);
  std::vector<std::uint32_t> order(mesh.node_count());
  std::iota(order.begin(), order.end(), std::uint32_t{0});
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const Vec3d &p = mesh.rest_positions[a], &q = mesh.rest_positions[b];
    if (p.z != q.z) return p.z < q.z;
    if (p.y != q.y) return p.y < q.y;
    if (p.x != q.x) return p.x < q.x;
    return a < b;
  });
  std::vector<Vec3d> positions(order.size());
  std::vector<std::uint32_t> new_number(order.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) {
    positions[i] = mesh.rest_positions[order[i]];
    new_number[order[i]] = i;
  }
  mesh.rest_positions = std::move(positions);
  // An even permutation keeps the orientation: smallest node first, the next smallest second.
  for (Tet& tet : mesh.tets) {
    for (NodeIndex& node : tet) node = NodeIndex(new_number[node.value]);
    const auto first = std::min_element(tet.begin(), tet.end()) - tet.begin();
    if (first != 0) {
      std::swap(tet[0], tet[first]);
      std::swap(tet[first == 1 ? 2 : 1], tet[first == 3 ? 2 : 3]);
    }
    std::rotate(tet.begin() + 1, std::min_element(tet.begin() + 1, tet.end()), tet.end());
  }
  std::sort(mesh.tets.begin(), mesh.tets.end());
  return order;
}

}  // namespace trocar::mesh
