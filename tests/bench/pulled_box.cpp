#include "tests/bench/pulled_box.h"

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"
#include "server/organs/catalogue/builtin_organs.h"

namespace trocar::bench {
namespace {

// Corners of a cell: bit 2 is x, bit 1 is y, bit 0 is z. Orientation follows from the volume's
// sign.
constexpr int kFive[5][4] = {{0, 4, 2, 1}, {6, 2, 4, 7}, {5, 4, 1, 7}, {3, 1, 2, 7}, {1, 4, 2, 7}};
// The same, mirrored in x: diagonals of cells that share a face meet.
constexpr int kFiveMirrored[5][4] = {
    {4, 0, 5, 6}, {2, 0, 6, 3}, {1, 0, 3, 5}, {7, 5, 3, 6}, {5, 0, 3, 6}};
constexpr int kSix[6][4] = {{0, 4, 6, 7}, {0, 6, 2, 7}, {0, 2, 3, 7},
                            {0, 3, 1, 7}, {0, 1, 5, 7}, {0, 5, 4, 7}};

class Grid {
 public:
  explicit Grid(const BoxShape& shape) : shape_(shape) {}

  NodeIndex node(int i, int j, int k) const {
    return NodeIndex((i * (shape_.cells[1] + 1) + j) * (shape_.cells[2] + 1) + k);
  }

  void add_nodes(mesh::TetMesh& mesh) const {
    const auto along = [&](int index, std::size_t axis) {
      return shape_.size_m[axis] * (static_cast<double>(index) / shape_.cells[axis] - 0.5);
    };
    for (int i = 0; i <= shape_.cells[0]; ++i)
      for (int j = 0; j <= shape_.cells[1]; ++j)
        for (int k = 0; k <= shape_.cells[2]; ++k)
          mesh.rest_positions.push_back({along(i, 0), along(j, 1), along(k, 2)});
  }

  void add_tets(mesh::TetMesh& mesh) const {
    for (int i = 0; i < shape_.cells[0]; ++i)
      for (int j = 0; j < shape_.cells[1]; ++j)
        for (int k = 0; k < shape_.cells[2]; ++k) {
          const bool is_mirrored = (i + j + k) % 2 != 0;
          const auto add = [&](const int(&corners)[4]) {
            mesh::Tet tet;
            for (std::size_t c = 0; c < 4; ++c)
              tet[c] = node(i + (corners[c] >> 2), j + (corners[c] >> 1 & 1), k + (corners[c] & 1));
            mesh.tets.push_back(tet);
            if (mesh::tet_volume(mesh, TetIndex(mesh.tets.size() - 1)) < 0)
              std::swap(mesh.tets.back()[2], mesh.tets.back()[3]);
          };
          if (shape_.split == CellSplit::Six)
            for (const auto& corners : kSix) add(corners);
          else
            for (const auto& corners : is_mirrored ? kFiveMirrored : kFive) add(corners);
        }
  }

 private:
  const BoxShape& shape_;
};

// Spreads the force over the triangles of the high x face.
void load_face(const BoxShape& shape, PulledBox& box) {
  const auto& mesh = box.organ.mesh;
  const double high = shape.size_m[0] / 2;
  const auto is_loaded = [&](NodeIndex node) {
    return mesh.rest_positions[node.value].x > high - 1e-9;
  };
  std::vector<double> weights(mesh.node_count());
  double area = 0;
  const int ny = shape.cells[1], nz = shape.cells[2];
  const double cell = shape.size_m[1] / ny * shape.size_m[2] / nz;
  const Grid grid(shape);
  for (int j = 0; j < ny; ++j)
    for (int k = 0; k < nz; ++k)
      for (const int corner : {0, 1, 2, 3})
        weights[grid.node(shape.cells[0], j + (corner >> 1), k + (corner & 1)).value] += cell / 4;
  area = cell * ny * nz;
  box.total_force_n = box.material.nominal_strain * box.material.young_modulus_pa * area;
  box.forces_n.resize(mesh.node_count());
  for (std::uint32_t n = 0; n < mesh.node_count(); ++n) {
    if (is_loaded(NodeIndex(n))) box.loaded_nodes.push_back(NodeIndex(n));
    box.forces_n[n].x = static_cast<float>(box.total_force_n * weights[n] / area);
  }
}

}  // namespace

PulledBox make_pulled_box(const BoxShape& shape, const PulledMaterial& material) {
  PulledBox box;
  box.material = material;
  auto& organ = box.organ;
  organ.name = shape.name;
  organ.source = "pulled box " + shape.name;
  const Grid grid(shape);
  grid.add_nodes(organ.mesh);
  grid.add_tets(organ.mesh);
  organ.mesh.build_adjacency();
  organ.material.density_kg_m3 = material.density_kg_m3;
  organ.material.spring_law = material::SpringLaw::VolumeConsistent;
  organ.material.young_modulus_pa = material.young_modulus_pa;
  organ.material.node_damping_per_s = material.node_damping_per_s;
  organ.material.poisson_ratio = material.poisson_ratio;
  organ.material.edge_damping_time_s = 0;
  organ.node_masses_kg = organ::lumped_masses(organ);
  for (int j = 0; j <= shape.cells[1]; ++j)
    for (int k = 0; k <= shape.cells[2]; ++k) organ.fixed_nodes.push_back(grid.node(0, j, k));
  load_face(shape, box);
  const auto status = organ::validate(organ);
  TROCAR_ASSERT(status.ok());
  return box;
}

PulledBox make_pulled_liver(int target_tets) {
  constexpr double kRadius = 0.020, kForce = 0.4;
  auto liver = catalogue::make_liver(target_tets);
  TROCAR_ASSERT(liver.ok());
  PulledBox box;
  box.organ = std::move(*liver);
  const auto& p = box.organ.mesh.rest_positions;
  const auto farthest =
      *std::max_element(p.begin(), p.end(), [](const auto& a, const auto& b) { return a.x < b.x; });
  for (std::uint32_t n = 0; n < p.size(); ++n)
    if (length(p[n] - farthest) <= kRadius &&
        !std::binary_search(box.organ.fixed_nodes.begin(), box.organ.fixed_nodes.end(),
                            NodeIndex(n)))
      box.loaded_nodes.push_back(NodeIndex(n));
  box.total_force_n = kForce;
  box.forces_n.resize(p.size());
  for (const auto node : box.loaded_nodes)
    box.forces_n[node.value].x =
        static_cast<float>(kForce / static_cast<double>(box.loaded_nodes.size()));
  return box;
}

BoxShape plate_box() {
  return {"W1 plate", {24, 25, 1}, {0.16, 0.16, 0.004}, CellSplit::Six};
}
BoxShape liver_box() {
  return {"W2 liver size", {20, 14, 12}, {0.20, 0.14, 0.12}, CellSplit::Five};
}
BoxShape chest_box() {
  return {"W3 chest size", {52, 40, 7}, {0.40, 0.308, 0.054}, CellSplit::Five};
}
BoxShape growing_box(int tets) {
  const int n = std::max(1, static_cast<int>(std::lround(std::cbrt(tets / 10.0))));
  return {"box of " + std::to_string(10 * n * n * n) + " tets",
          {2 * n, n, n},
          {0.02 * n, 0.01 * n, 0.01 * n},
          CellSplit::Five};
}

}  // namespace trocar::bench
