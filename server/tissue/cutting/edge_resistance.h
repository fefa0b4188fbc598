#pragma once

// Tissue resists the edge of a blade, part by part: it holds the sides by friction
// (Material::blade_friction_pa), and moving the edge across itself through whole tissue costs
// energy (Material::cut_energy_j_m2). Both count along what is in tissue now, and in proportion
// less what is up to 1.25 mm beside it: a blade has a thickness, and what it feels has no steps. A
// wound that gapes wider, and what the blade has gone through, does nothing.
//
// The edge cuts by its motion in the tissue. So the tissue's own motion along it is measured, too:
// a line fitted to its velocity at these places.
//
// The edge is looked at in kEdgeParts * kEdgeSamples places. Cost: of collecting the nodes by the
// edge (NodeBundles), and a clipped line per tet at these.

#include <array>
#include <vector>

#include "server/tissue/cutting/cut_mesh.h"

namespace trocar::cutting {

// An edge has so many parts of equal length, the first at its first end.
inline constexpr std::size_t kEdgeParts = 8;
inline constexpr std::size_t kEdgeSamples = 8;  // in each

// Integrals over the way along each part.
struct EdgeResistance {
  std::array<double, kEdgeParts> friction_n_m{};  // shear stress of one side, N/m
  std::array<double, kEdgeParts> cut_n{};         // energy per area of wound, N
  double whole_cut_n = 0;             // the part of their sum that is in tets without wound, N
  std::array<Vec3d, 2> tissue_m_s{};  // velocity of the tissue at either end; zero: there is none
};

class EdgeMeter {
 public:
  // Nothing for what is no blade. Between begin() and end() of the mesh. velocities: m/s, of the
  // nodes; none: everything is at rest.
  EdgeResistance measure(CutMesh& mesh, std::span<const Vec3f> velocities, const Vec3d& from,
                         const Vec3d& to);

 private:
  // The tissue that is nearest to a place on the edge.
  struct Sample {
    double nearness = 0;  // 1 in tissue, 0 at 1.25 mm beside it or farther
    TetIndex tet;
    std::array<double, 4> weights{};  // of its corners; their sum is 1
  };

  void find_tets(CutMesh& mesh, const Vec3d& from, const Vec3d& to);
  void drop_aside(const CutMesh& mesh, const Vec3d& from, const Vec3d& to);
  std::array<Vec3d, 2> tissue_motion(const topology::Topology& topology,
                                     std::span<const Vec3f> velocities) const;
  void meet(const std::array<Vec3d, 4>& corners, TetIndex tet, const Vec3d& from, const Vec3d& to);

  std::vector<NodeIndex> nodes_;
  std::vector<TetIndex> tets_;
  std::vector<std::uint8_t> is_found_;  // per tet
  std::array<Sample, kEdgeParts * kEdgeSamples> samples_;
};

}  // namespace trocar::cutting
