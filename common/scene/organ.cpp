#include "common/scene/organ.h"

#include <algorithm>
#include <cmath>

#include "common/base/bytes.h"
#include "common/base/checksum.h"

namespace trocar::scene {
namespace {

constexpr double kMaxSize_m = 2.0;
constexpr double kCentreTolerance_m = 1e-6;
constexpr std::size_t kMaxTextBytes = 4096;

Error broken(const Organ& organ, std::string what) {
  return {ErrorCode::BadFile, "organ '" + organ.name + "': " + std::move(what)};
}

Status check_number(const Organ& organ, const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return {};
  char text[160];
  std::snprintf(text, sizeof text, "%s is %g, must be from %g to %g", name, value, low, high);
  return broken(organ, text);
}

Status check_material(const Organ& organ) {
  const Material& m = organ.material;
  if (auto s = check_number(organ, "density (kg/m^3)", m.density_kg_m3, 1, 30000); !s) return s;
  if (m.spring_law != SpringLaw::Constant && m.spring_law != SpringLaw::VolumeConsistent)
    return broken(organ, "unknown spring law " + std::to_string(static_cast<int>(m.spring_law)));
  if (auto s = check_number(organ, "spring stiffness (N/m)", m.spring_stiffness_n_m, 0, 1e9); !s)
    return s;
  if (auto s = check_number(organ, "Young's modulus (Pa)", m.young_modulus_pa, 0, 1e12); !s)
    return s;
  if (auto s = check_number(organ, "node damping (1/s)", m.node_damping_per_s, 0, 1e6); !s)
    return s;
  if (auto s = check_number(organ, "spring damping time (s)", m.spring_damping_time_s, 0, 100); !s)
    return s;
  if (m.spring_law == SpringLaw::VolumeConsistent &&
      (organ.mesh.tets.empty() || !organ.mesh.links.empty()))
    return broken(organ,
                  "the volume-consistent spring law needs springs on the edges of tets: use the "
                  "constant law where there are links");
  return {};
}

Status check_extent(const Organ& organ) {
  Vec3d low = organ.mesh.rest_positions.front(), high = low;
  for (const Vec3d& p : organ.mesh.rest_positions) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  const Vec3d size = high - low, centre = (high + low) * 0.5;
  if (std::max({size.x, size.y, size.z}) > kMaxSize_m)
    return broken(organ, "is larger than 2 m: scale it to metres");
  if (std::max({std::abs(centre.x), std::abs(centre.y), std::abs(centre.z)}) > kCentreTolerance_m)
    return broken(organ, "rest bounding box is not centred on the origin");
  return {};
}

Status check_nodes(const Organ& organ) {
  const auto count = organ.mesh.node_count();
  if (organ.node_masses_kg.size() != count)
    return broken(organ, "has " + std::to_string(organ.node_masses_kg.size()) +
                             " node masses for " + std::to_string(count) + " nodes");
  for (std::size_t i = 0; i < count; ++i)
    if (!(organ.node_masses_kg[i] > 0 && organ.node_masses_kg[i] < 1e6))
      return broken(organ, "mass of node " + std::to_string(i) + " is not a positive number of kg");
  for (std::size_t i = 0; i < organ.fixed_nodes.size(); ++i) {
    if (organ.fixed_nodes[i].value >= count)
      return broken(organ, "fixed node " + std::to_string(organ.fixed_nodes[i].value) +
                               " does not exist, there are " + std::to_string(count) + " nodes");
    if (i > 0 && !(organ.fixed_nodes[i - 1] < organ.fixed_nodes[i]))
      return broken(organ, "fixed nodes are not in ascending order at entry " + std::to_string(i));
  }
  return {};
}

template <typename T>
void hash_array(StateHasher& hasher, const std::vector<T>& values) {
  const std::uint64_t count = values.size();
  hasher.update(bytes_of(std::span(&count, 1)));
  hasher.update(bytes_of(values));
}

}  // namespace

// Isotropic spring network: with unit directions n spread evenly over the sphere, springs of total
// k l^2 = S per unit volume store, under the affine strain e,
//   W = 1/2 S <(n.e.n)^2> = 1/2 S/15 ((tr e)^2 + 2 e:e),
// because <n_i n_j n_k n_l> = (d_ij d_kl + d_ik d_jl + d_il d_jk) / 15. Against
// W = lambda/2 (tr e)^2 + mu e:e that is lambda = mu = S/15: Poisson's ratio is 1/4 whatever S is,
// and E = mu (3 lambda + 2 mu) / (lambda + mu) = 5/2 mu = S/6. So S must be 6 E. Giving each edge
//   k_e = c E (sum of the volumes of the tets at e) / l_e^2
// makes S = c E 6, since a tet has six edges: c = 1. A mesh with directions that are not evenly
// spread is stiffer along some axes (body-centred lattice: 7 % softer along the cube's axes), but
// its average over all orientations, and its response to uniform compression, are exact.
std::vector<double> spring_stiffnesses(const Organ& organ) {
  const mesh::TetMesh& mesh = organ.mesh;
  const auto& pairs = mesh.spring_pairs();
  if (organ.material.spring_law == SpringLaw::Constant)
    return std::vector<double>(pairs.size(), organ.material.spring_stiffness_n_m);
  TROCAR_ASSERT(mesh.links.empty());
  std::vector<double> stiffnesses(pairs.size());
  for (std::size_t e = 0; e < pairs.size(); ++e) {
    const auto [a, b] = pairs[e];
    double volume = 0;
    for (const TetIndex t : mesh.node_tets[a]) {
      const auto& tet = mesh.tets[t.value];
      if (std::find(tet.begin(), tet.end(), b) != tet.end()) volume += tet_volume(mesh, t);
    }
    const double l_squared =
        length_squared(mesh.rest_positions[b.value] - mesh.rest_positions[a.value]);
    stiffnesses[e] = organ.material.young_modulus_pa * volume / l_squared;
  }
  return stiffnesses;
}

std::vector<double> lumped_masses(const mesh::TetMesh& mesh, double density_kg_m3) {
  std::vector<double> masses(mesh.node_count(), 0.0);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    const double quarter = density_kg_m3 * tet_volume(mesh, TetIndex(t)) / 4;
    for (const NodeIndex node : mesh.tets[t]) masses[node.value] += quarter;
  }
  return masses;
}

std::uint64_t organ_hash(const Organ& organ) {
  StateHasher hasher;
  hash_array(hasher, organ.mesh.rest_positions);
  hash_array(hasher, organ.mesh.tets);
  hash_array(hasher, organ.mesh.links);
  hash_array(hasher, organ.mesh.boundary_triangles);
  hash_array(hasher, organ.fixed_nodes);
  hash_array(hasher, organ.node_masses_kg);
  const Material& m = organ.material;
  hash_array(hasher, std::vector<double>{m.density_kg_m3, static_cast<double>(m.spring_law),
                                         m.spring_stiffness_n_m, m.young_modulus_pa,
                                         m.node_damping_per_s, m.spring_damping_time_s});
  return hasher.digest();
}

Status validate(const Organ& organ) {
  if (organ.name.empty() || organ.name.size() > kMaxTextBytes ||
      organ.source.size() > kMaxTextBytes)
    return Error{ErrorCode::BadFile, "organ: name and source must have 1 to 4096 bytes"};
  const auto is_control = [](char c) { return static_cast<unsigned char>(c) < 32 || c == 127; };
  if (std::ranges::any_of(organ.name, is_control) || std::ranges::any_of(organ.source, is_control))
    return Error{ErrorCode::BadFile, "organ: name and source must not hold control characters"};
  if (auto s = mesh::validate(organ.mesh); !s) return broken(organ, s.error().message);
  if (organ.mesh.tets.empty() && organ.mesh.links.empty())
    return broken(organ, "has neither tets nor links, nothing would hold it together");
  if (auto s = check_extent(organ); !s) return s;
  if (auto s = check_nodes(organ); !s) return s;
  if (!is_finite(organ.source_offset_m)) return broken(organ, "source offset is not finite");
  return check_material(organ);
}

}  // namespace trocar::scene
