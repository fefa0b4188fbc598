#pragma once

// An organ: mesh, material, what holds it, and where it came from. This is what `.organ` files hold
// and what the server is started with.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "common/math/vec3.h"
#include "common/wire/fine_surface.h"
#include "server/organs/material/material.h"
#include "server/organs/mesh/tet_mesh.h"
#include "server/organs/organ/depth_table.h"
#include "server/organs/organ/tie.h"

namespace trocar::organ {

inline constexpr std::size_t kMaxRegions = 1000;
// A name that an organ or a region is given has 1 to so many bytes of printable UTF-8.
inline constexpr std::size_t kMostNameBytes = 200;

struct Organ {
  std::string name;    // "liver" or another built-in one's, or the file's stem
  std::string source;  // one line: generator and parameters, or the imported file's name
  mesh::TetMesh mesh;  // adjacency built; rest bounding box centred on the origin
  material::Material material;
  std::vector<material::MaterialRegion> regions;  // where it is another
  std::vector<NodeIndex> fixed_nodes;             // ascending, distinct
  std::vector<double> node_masses_kg;  // node_count; Nakao 2003 eq. 4 where there are tets
  Vec3d source_offset_m;               // add to a rest position to get the source's coordinates
  Vec3d gravity_m_s2;
  // Every node would be here without gravity and tension, if the rest pose is in equilibrium with
  // them: then the organ does not sag when a session starts. Empty: the rest pose itself.
  std::vector<Vec3d> stress_free_positions_m;
  // Per node the direction of its fibres, such as Langer's lines of skin: of length 1, either sign,
  // or zero where Material::fibre_direction holds. Empty: it holds everywhere.
  std::vector<Vec3d> fibre_directions;
  std::vector<TieBand> ties;  // between places of the surface
  DepthTable depth_table;     // empty: not calibrated
  // Clients draw this instead of the mesh's surface; empty: that. It changes no result.
  wire::FineSurface fine_surface;

  // Geometry from which energies measure strain.
  const std::vector<Vec3d>& stress_free() const {
    return stress_free_positions_m.empty() ? mesh.rest_positions : stress_free_positions_m;
  }

  bool operator==(const Organ&) const = default;
};

// Index of the material of each tet and of each pair of mesh.spring_pairs(): 0 for the organ's own,
// r + 1 for regions[r].
struct MaterialMap {
  std::vector<std::uint16_t> tets, spring_pairs, nodes;
};
MaterialMap material_map(const Organ& organ);
const material::Material& material_at(const Organ& organ, std::uint16_t index);

// Returns an element's fibres from those of its nodes: the sum of the axes, each with the sign that
// is nearer to the first of them; zeros are left out. Nothing can cancel, for no part is turned by
// more than a right angle from the first. Of equal ones exactly a multiple by a power of two.
Vec3d sum_of_axes(std::span<const Vec3d> axes);
// `axis`, or the material's own direction where it is zero; of any length.
const Vec3d& fibres_in(const material::Material& material, const Vec3d& axis);

// A spring stands for one pair of mesh.spring_pairs(). With SpringLaw::VolumeConsistent, k = sum
// over the tets at the edge of E V / length^2, derived in the source; it gives Young's modulus E on
// average over orientations, and Poisson's ratio 1/4, as every network of springs does. Edges of
// tets whose law is not ElasticLaw::Springs get the damping but no stiffness of them.
struct Spring {
  double stiffness_n_m = 0;
  double damping_n_s_m = 0;
  double rest_length_m = 0;
};
std::vector<Spring> springs_of(const Organ& organ);
// One of them. along: from the end with the lower index to the other, free of stress, m; own: the
// material of the pair; axis: the sum of its ends' fibres, or zero; tets: those at the edge in
// ascending order, none where links carry springs.
struct SpringTet {
  const material::Material* material = nullptr;
  double volume_m3 = 0;  // free of stress
};
Spring spring_along(const Vec3d& along, const material::Material& own, const Vec3d& axis,
                    std::span<const SpringTet> tets);

// m_i = sum over tets k at node i of rho_k V_k / 4 (Nakao 2003 eq. 4). Needs tets.
std::vector<double> lumped_masses(const Organ& organ);

// A weight per node to which its mass is proportional: the lumped mass, kg, or, without tets, the
// density of the node's material, kg/m^3.
std::vector<double> mass_weights(const Organ& organ);
// Brings the node masses from weights that the organ had before to those that it has now, whatever
// the masses were made from. Equal weights leave a mass as it is, to the bit.
void follow_weights(Organ& organ, const std::vector<double>& weights_before);

// XXH3-64 over the organ's arrays (not over a file's bytes): names a mesh and material for files
// and sessions that depend on it. Each array is preceded by its length (u64); in order: rest
// positions, tets, links, boundary triangles, fixed nodes, node masses, the numbers of the
// material, of each region with its nodes, gravity, stress-free positions, directions of fibres and
// ties if there are any. Name, source, source offset, depth table and fine surface are left out:
// they change no result.
std::uint64_t organ_hash(const Organ& organ);

// Validates mesh, sizes and ranges; the rest bounding box is centred on the origin and at most 2 m.
Status validate(const Organ& organ);

}  // namespace trocar::organ
