#pragma once

// An organ: mesh, material, what holds it, and where it came from. This is what `.organ` files hold
// and what the server is started with.

#include <cstdint>
#include <string>
#include <vector>

#include "common/math/vec3.h"
#include "common/mesh/tet_mesh.h"

namespace trocar::scene {

// How the stiffness of a spring follows from the material.
enum class SpringLaw : std::uint8_t {
  Constant = 0,          // the same k for every spring (Choi 2002, Nakao 2003)
  VolumeConsistent = 1,  // k from Young's modulus, edge length and the volume of the tets around it
};

struct Material {
  double density_kg_m3 = 1060;
  SpringLaw spring_law = SpringLaw::VolumeConsistent;
  double spring_stiffness_n_m = 100;  // SpringLaw::Constant
  double young_modulus_pa = 4000;     // SpringLaw::VolumeConsistent
  // Damping of each node in proportion to its velocity: d_i = rate x m_i (Choi 2002 eq. 1).
  double node_damping_per_s = 10;
  // Damping along each spring: b = time x k (Kelvin-Voigt).
  double spring_damping_time_s = 0.001;

  bool operator==(const Material&) const = default;
};

struct Organ {
  std::string name;    // "liver" or another built-in one's, or the file's stem
  std::string source;  // one line: generator and parameters, or the imported file's name
  mesh::TetMesh mesh;  // adjacency built; rest bounding box centred on the origin
  Material material;
  std::vector<NodeIndex> fixed_nodes;  // ascending, distinct
  std::vector<double> node_masses_kg;  // node_count; Nakao 2003 eq. 4 where there are tets
  Vec3d source_offset_m;               // add to a rest position to get the source's coordinates

  bool operator==(const Organ&) const = default;
};

// Spring constants for mesh.spring_pairs(), N/m. SpringLaw::VolumeConsistent: k = E x (volume of
// the tets at the edge) / length^2, derived in the source; it gives Young's modulus E on average
// over orientations, and Poisson's ratio 1/4, as every network of springs does. Needs springs on
// tet edges.
std::vector<double> spring_stiffnesses(const Organ& organ);

// m_i = sum over tets k at node i of rho V_k / 4 (Nakao 2003 eq. 4). Needs tets.
std::vector<double> lumped_masses(const mesh::TetMesh& mesh, double density_kg_m3);

// XXH3-64 over the organ's arrays (not over a file's bytes): names a mesh and material for files
// and sessions that depend on it. Each array is preceded by its length (u64); in order: rest
// positions, tets, links, boundary triangles, fixed nodes, node masses, the six numbers of the
// material. Name, source and source offset are left out: they change no result.
std::uint64_t organ_hash(const Organ& organ);

// Validates mesh, sizes and ranges; the rest bounding box is centred on the origin and at most 2 m.
Status validate(const Organ& organ);

}  // namespace trocar::scene
