#include <array>
#include <map>
#include <utility>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/five_tets.h"
#include "server/organs/mesh/pieces.h"

namespace trocar::catalogue {
namespace {

constexpr Vec3d kCell_m{0.006, 0.005, 0.006};
constexpr int kBoardX = 25, kBoardZ = 15;  // cells of the board, one high
constexpr int kPegHeight = 4;              // cells above it
constexpr int kRing = 4, kRingHeight = 2;  // cells; the middle ones of its side are its hole
constexpr double kRingGap_m = 1e-4;        // between ring and board; it settles by that
struct PegCell {
  int i, k;
};
constexpr std::array<PegCell, 6> kPegs{{{3, 3}, {8, 7}, {3, 11}, {21, 3}, {16, 7}, {21, 11}}};
constexpr std::size_t kRings = 3;  // on the first pegs

// A body of cells, which share the nodes of their corners.
class Body {
 public:
  Body(mesh::TetMesh& mesh, const Vec3d& origin_m) : mesh_(mesh), origin_m_(origin_m) {}

  void add_cell(int i, int j, int k) {
    for (int c = 0; c < 8; ++c) add_node(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2 & 1));
    add_five_tets(mesh_, i, j, k, [&](int x, int y, int z) { return nodes_.at({x, y, z}); });
  }

 private:
  void add_node(int i, int j, int k) {
    const auto [entry, is_new] = nodes_.try_emplace({i, j, k}, mesh_.rest_positions.size());
    if (is_new)
      mesh_.rest_positions.push_back(origin_m_ +
                                     Vec3d{kCell_m.x * i, kCell_m.y * j, kCell_m.z * k});
  }

  mesh::TetMesh& mesh_;
  Vec3d origin_m_;
  std::map<std::array<int, 3>, NodeIndex> nodes_;
};

void add_board(mesh::TetMesh& mesh) {
  Body board(mesh, {});
  for (int k = 0; k < kBoardZ; ++k)
    for (int i = 0; i < kBoardX; ++i) board.add_cell(i, 0, k);
  for (const auto& peg : kPegs)
    for (int j = 1; j <= kPegHeight; ++j) board.add_cell(peg.i, j, peg.k);
}

void add_ring(const PegCell& peg, mesh::TetMesh& mesh) {
  constexpr double kBeside = 0.5 - kRing / 2.0;  // cells from the peg's corner to the ring's
  Body ring(mesh,
            {kCell_m.x * (peg.i + kBeside), kCell_m.y + kRingGap_m, kCell_m.z * (peg.k + kBeside)});
  const auto is_inner = [](int cell) { return cell > 0 && cell < kRing - 1; };
  for (int k = 0; k < kRing; ++k)
    for (int j = 0; j < kRingHeight; ++j)
      for (int i = 0; i < kRing; ++i)
        if (!is_inner(i) || !is_inner(k)) ring.add_cell(i, j, k);
}

}  // namespace

organ::Organ make_pegs() {
  organ::Organ organ;
  organ.name = "pegs";
  organ.source = "a board with six pegs and three rings";
  add_board(organ.mesh);
  for (std::size_t r = 0; r < kRings; ++r) add_ring(kPegs[r], organ.mesh);
  mesh::renumber_along_z(organ.mesh);
  organ.mesh.build_adjacency();
  organ.material.elastic_law = material::ElasticLaw::NeoHookean;
  organ.material.young_modulus_pa = 50e3;
  organ.gravity_m_s2 = {0, -9.81, 0};
  for (std::size_t n = 0; n < organ.mesh.node_count(); ++n)
    if (organ.mesh.rest_positions[n].y == 0) organ.fixed_nodes.emplace_back(n);
  organ.source_offset_m = mesh::centre_on_origin(organ.mesh);
  organ.node_masses_kg = organ::lumped_masses(organ);
  TROCAR_ASSERT(validate(organ));
  return organ;
}

}  // namespace trocar::catalogue
