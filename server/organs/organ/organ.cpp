#include "server/organs/organ/organ.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "common/base/bytes.h"
#include "common/base/hash_array.h"
#include "server/organs/material/material_keys.h"

namespace trocar::organ {
namespace {

constexpr double kMaxSize_m = 2.0;
constexpr double kCentreTolerance_m = 1e-6;
constexpr double kUnitTolerance = 1e-6;
constexpr std::size_t kMaxTextBytes = 4096;

double stress_free_volume(const Organ& organ, std::size_t tet) {
  const auto& p = organ.stress_free();
  const auto& [a, b, c, d] = organ.mesh.tets[tet];
  return dot(cross(p[b.value] - p[a.value], p[c.value] - p[a.value]), p[d.value] - p[a.value]) / 6;
}

Error broken(const Organ& organ, std::string what) {
  return {ErrorCode::BadFile, "organ '" + organ.name + "': " + std::move(what)};
}

Status check_number(const Organ& organ, const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return {};
  char text[160];
  std::snprintf(text, sizeof text, "%s is %g, must be from %g to %g", name, value, low, high);
  return broken(organ, text);
}

Status check_measured(const material::HyperelasticMaterial& m) {
  if (auto s = validate(m); !s) return s;
  if (m.split != material::VolumeSplit::Unsplit)
    return Error{ErrorCode::BadFile, "material " + m.name +
                                         " is split into volume and shape, which only the off-line "
                                         "solver knows"};
  return {};
}

Status check_material(const Organ& organ, const material::Material& m) {
  const auto number = [&](const char* name, double value, double low, double high) {
    return check_number(organ, name, value, low, high);
  };
  for (const auto& key : material::kNumberKeys)
    if (auto s = number(key.title, m.*key.member, key.low, key.high); !s) return s;
  if (auto s = number("tension and fibre tension together", m.tension + m.fibre_tension, 0,
                      material::kMaxTension);
      !s)
    return s;
  if (m.tear_stretch != 0)
    if (auto s = number("tear stretch", m.tear_stretch, material::kLeastTearStretch, 100); !s)
      return s;
  if (m.elastic_law > material::ElasticLaw::Measured)
    return broken(organ, "unknown elastic law " + std::to_string(static_cast<int>(m.elastic_law)));
  if (m.spring_law > material::SpringLaw::VolumeConsistent)
    return broken(organ, "unknown spring law " + std::to_string(static_cast<int>(m.spring_law)));
  if (m.elastic_law == material::ElasticLaw::Measured)
    if (auto s = check_measured(m.measured); !s) return broken(organ, s.error().message);
  if (!is_finite(m.fibre_direction)) return broken(organ, "fibre direction is not finite");
  const bool has_tet_springs = !organ.mesh.tets.empty() && organ.mesh.links.empty();
  if (m.elastic_law != material::ElasticLaw::Springs)
    return organ.mesh.tets.empty() ? Status(broken(organ, "has no tets, only springs fit it"))
                                   : Status();
  if (m.spring_law == material::SpringLaw::VolumeConsistent && !has_tet_springs)
    return broken(organ,
                  "the volume-consistent spring law needs springs on the edges of tets: use the "
                  "constant law where there are links");
  return {};
}

Status check_regions(const Organ& organ) {
  if (organ.regions.size() > kMaxRegions)
    return broken(organ, "has more than " + std::to_string(kMaxRegions) + " material regions");
  for (const auto& region : organ.regions) {
    if (region.nodes.empty() || region.name.empty() || region.name.size() > kMaxTextBytes ||
        region.look.size() > kMostNameBytes)
      return broken(organ, "a material region needs a name and nodes");
    for (std::size_t i = 0; i < region.nodes.size(); ++i)
      if (region.nodes[i].value >= organ.mesh.node_count() ||
          (i > 0 && !(region.nodes[i - 1] < region.nodes[i])))
        return broken(organ, "nodes of region '" + region.name +
                                 "' are not ascending nodes of the mesh at entry " +
                                 std::to_string(i));
    for (std::size_t i = 0; i < region.tets.size(); ++i) {
      const auto tet = region.tets[i].value;
      if (tet >= organ.mesh.tets.size() || (i > 0 && !(region.tets[i - 1] < region.tets[i])) ||
          !std::ranges::all_of(organ.mesh.tets[tet], [&](NodeIndex node) {
            return std::ranges::binary_search(region.nodes, node);
          }))
        return broken(organ, "tets of region '" + region.name +
                                 "' are not ascending tets of its nodes at entry " +
                                 std::to_string(i));
    }
    if (auto s = check_material(organ, region.material); !s) return s;
  }
  return {};
}

Status check_stress_free(const Organ& organ) {
  if (!is_finite(organ.gravity_m_s2) || length(organ.gravity_m_s2) > 1000)
    return broken(organ, "gravity must be finite and at most 1000 m/s^2");
  const auto& free = organ.stress_free_positions_m;
  if (free.empty()) return {};
  if (free.size() != organ.mesh.node_count())
    return broken(organ, "has " + std::to_string(free.size()) + " stress-free positions for " +
                             std::to_string(organ.mesh.node_count()) + " nodes");
  for (std::size_t i = 0; i < free.size(); ++i)
    if (!(length(free[i] - organ.mesh.rest_positions[i]) <= kMaxSize_m))
      return broken(organ, "stress-free position of node " + std::to_string(i) +
                               " is not within 2 m of its rest position");
  for (std::size_t t = 0; t < organ.mesh.tets.size(); ++t)
    if (!(stress_free_volume(organ, t) > 0))
      return broken(organ, "tet " + std::to_string(t) + " has no volume free of stress");
  return {};
}

Status check_fibres(const Organ& organ) {
  const auto& fibres = organ.fibre_directions;
  if (fibres.empty()) return {};
  if (fibres.size() != organ.mesh.node_count())
    return broken(organ, "has " + std::to_string(fibres.size()) + " directions of fibres for " +
                             std::to_string(organ.mesh.node_count()) + " nodes");
  for (std::size_t i = 0; i < fibres.size(); ++i)
    if (!(length_squared(fibres[i]) == 0 ||
          std::abs(length_squared(fibres[i]) - 1) <= 2 * kUnitTolerance))
      return broken(organ, "direction of fibres of node " + std::to_string(i) +
                               " is neither of length 1 nor zero");
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

std::vector<double> numbers_of(const material::Material& m) {
  std::vector<double> numbers{m.density_kg_m3,
                              static_cast<double>(m.spring_law),
                              m.spring_stiffness_n_m,
                              m.young_modulus_pa,
                              m.node_damping_per_s,
                              m.edge_damping_time_s,
                              static_cast<double>(m.elastic_law),
                              m.poisson_ratio,
                              m.has_averaged_strain ? 1.0 : 0.0,
                              m.fibre_direction.x,
                              m.fibre_direction.y,
                              m.fibre_direction.z,
                              m.fibre_stiffness_ratio,
                              m.tension,
                              m.fibre_tension};
  // Organs from before there were these keep their hash.
  const material::Material usual;
  if (m.cut_energy_j_m2 != usual.cut_energy_j_m2 || m.tear_stretch != usual.tear_stretch ||
      m.blade_friction_pa != usual.blade_friction_pa)
    numbers.insert(numbers.end(), {m.cut_energy_j_m2, m.tear_stretch});
  if (m.blade_friction_pa != usual.blade_friction_pa) numbers.push_back(m.blade_friction_pa);
  if (m.elastic_law != material::ElasticLaw::Measured) return numbers;
  numbers.insert(numbers.end(), m.measured.coefficients_pa.begin(),
                 m.measured.coefficients_pa.end());
  numbers.push_back(m.measured.bulk_modulus_pa);
  if (m.measured.energy == material::StrainEnergy::Exponential)
    numbers.push_back(m.measured.exponent);
  for (const auto& [weight, time_s] : m.measured.relaxation)
    numbers.insert(numbers.end(), {weight, time_s});
  return numbers;
}

}  // namespace

Vec3d sum_of_axes(std::span<const Vec3d> axes) {
  const auto first =
      std::ranges::find_if(axes, [](const Vec3d& a) { return length_squared(a) > 0; });
  if (first == axes.end()) return {};
  // Two sums: of four equal ones, three would be rounded.
  std::array<Vec3d, 2> sums{};
  for (std::size_t i = 0; i < axes.size(); ++i)
    sums[i % 2] += dot(axes[i], *first) < 0 ? -axes[i] : axes[i];
  return sums[0] + sums[1];
}

const Vec3d& fibres_in(const material::Material& material, const Vec3d& axis) {
  return length_squared(axis) > 0 ? axis : material.fibre_direction;
}

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
Spring spring_along(const Vec3d& along, const material::Material& own, const Vec3d& axis,
                    std::span<const SpringTet> tets) {
  const double l_squared = length_squared(along);
  const Vec3d& fibres = fibres_in(own, axis);
  const double fibre_squared = length_squared(fibres);
  const double d = dot(along, fibres);
  const double cos_squared = fibre_squared > 0 ? d * d / (l_squared * fibre_squared) : 0;
  const double factor = 1 + (own.fibre_stiffness_ratio - 1) * cos_squared;
  Spring spring;
  spring.rest_length_m =
      std::sqrt(l_squared) *
      (1 - own.tension - (fibre_squared > 0 ? own.fibre_tension : 0) * cos_squared);
  const auto add = [&](const material::Material& material, double stiffness) {
    if (material.elastic_law == material::ElasticLaw::Springs) spring.stiffness_n_m += stiffness;
    spring.damping_n_s_m += stiffness * material.edge_damping_time_s;
  };
  if (own.elastic_law == material::ElasticLaw::Springs &&
      own.spring_law == material::SpringLaw::Constant) {
    add(own, own.spring_stiffness_n_m * factor);
    return spring;
  }
  for (const auto& [material, volume] : tets)
    add(*material, material->young_modulus_pa * volume / l_squared *
                       (material->elastic_law == material::ElasticLaw::Springs ? factor : 1.0));
  return spring;
}

std::vector<Spring> springs_of(const Organ& organ) {
  const mesh::TetMesh& mesh = organ.mesh;
  const auto& pairs = mesh.spring_pairs();
  const auto& free = organ.stress_free();
  const MaterialMap map = material_map(organ);
  std::vector<Spring> springs;
  springs.reserve(pairs.size());
  std::vector<SpringTet> tets;
  for (std::size_t e = 0; e < pairs.size(); ++e) {
    const auto [a, b] = pairs[e];
    tets.clear();
    // Elastic tets with links beside are damped by the tets' edges, not by the links.
    if (mesh.links.empty())
      for (const TetIndex t : mesh.node_tets[a])
        if (std::ranges::find(mesh.tets[t.value], b) != mesh.tets[t.value].end())
          tets.push_back(
              {&material_at(organ, map.tets[t.value]), stress_free_volume(organ, t.value)});
    const auto& fibres = organ.fibre_directions;
    const Vec3d axis =
        fibres.empty() ? Vec3d{} : sum_of_axes(std::array{fibres[a.value], fibres[b.value]});
    springs.push_back(spring_along(free[b.value] - free[a.value],
                                   material_at(organ, map.spring_pairs[e]), axis, tets));
  }
  return springs;
}

MaterialMap material_map(const Organ& organ) {
  MaterialMap map{std::vector<std::uint16_t>(organ.mesh.tets.size()),
                  std::vector<std::uint16_t>(organ.mesh.spring_pairs().size()),
                  std::vector<std::uint16_t>(organ.mesh.node_count())};
  std::vector<std::uint8_t> is_inside(organ.mesh.node_count());
  for (std::size_t r = 0; r < organ.regions.size(); ++r) {
    std::fill(is_inside.begin(), is_inside.end(), std::uint8_t{0});
    const auto index = static_cast<std::uint16_t>(r + 1);
    for (const auto node : organ.regions[r].nodes) {
      is_inside[node.value] = 1;
      map.nodes[node.value] = index;
    }
    const auto mark = [&](const auto& elements, std::vector<std::uint16_t>& out) {
      for (std::size_t i = 0; i < elements.size(); ++i)
        if (std::ranges::all_of(elements[i], [&](NodeIndex n) { return is_inside[n.value] != 0; }))
          out[i] = index;
    };
    if (organ.regions[r].tets.empty()) mark(organ.mesh.tets, map.tets);
    for (const auto tet : organ.regions[r].tets) map.tets[tet.value] = index;
    mark(organ.mesh.spring_pairs(), map.spring_pairs);
  }
  return map;
}

const material::Material& material_at(const Organ& organ, std::uint16_t index) {
  return index == 0 ? organ.material : organ.regions[index - 1u].material;
}

std::vector<double> lumped_masses(const Organ& organ) {
  std::vector<double> masses(organ.mesh.node_count(), 0.0);
  const MaterialMap map = material_map(organ);
  for (std::size_t t = 0; t < organ.mesh.tets.size(); ++t) {
    const double density = material_at(organ, map.tets[t]).density_kg_m3;
    const double quarter = density * stress_free_volume(organ, t) / 4;
    for (const NodeIndex node : organ.mesh.tets[t]) masses[node.value] += quarter;
  }
  return masses;
}

std::vector<double> mass_weights(const Organ& organ) {
  if (!organ.mesh.tets.empty()) return lumped_masses(organ);
  std::vector<double> densities;
  for (const auto index : material_map(organ).nodes)
    densities.push_back(material_at(organ, index).density_kg_m3);
  return densities;
}

void follow_weights(Organ& organ, const std::vector<double>& weights_before) {
  const auto after = mass_weights(organ);
  for (std::size_t i = 0; i < after.size(); ++i)
    if (after[i] != weights_before[i]) organ.node_masses_kg[i] *= after[i] / weights_before[i];
}

namespace {

void hash_ties(StateHasher& hasher, const TieBand& band) {
  std::vector<double> numbers{band.law.strength_pa, band.law.toughness_j_m2, band.law.rise_m};
  for (const auto& tie : band.ties) {
    for (const auto& end : tie.ends) {
      numbers.push_back(end.triangle.value);
      numbers.insert(numbers.end(), end.weights.begin(), end.weights.end());
    }
    numbers.push_back(tie.area_m2);
  }
  hash_array(hasher, numbers);
}

}  // namespace

std::uint64_t organ_hash(const Organ& organ) {
  StateHasher hasher;
  hash_array(hasher, organ.mesh.rest_positions);
  hash_array(hasher, organ.mesh.tets);
  hash_array(hasher, organ.mesh.links);
  hash_array(hasher, organ.mesh.boundary_triangles);
  hash_array(hasher, organ.fixed_nodes);
  hash_array(hasher, organ.node_masses_kg);
  hash_array(hasher, numbers_of(organ.material));
  for (const auto& region : organ.regions) {
    hash_array(hasher, numbers_of(region.material));
    hash_array(hasher, region.nodes);
    if (!region.tets.empty()) hash_array(hasher, region.tets);
  }
  hash_array(hasher, std::vector<Vec3d>{organ.gravity_m_s2});
  hash_array(hasher, organ.stress_free_positions_m);
  if (!organ.fibre_directions.empty()) hash_array(hasher, organ.fibre_directions);
  for (const auto& band : organ.ties) hash_ties(hasher, band);
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
  if (auto s = check_stress_free(organ); !s) return s;
  if (auto s = check_fibres(organ); !s) return s;
  if (auto s = check_regions(organ); !s) return s;
  if (auto s = validate(organ.ties, organ.mesh); !s) return broken(organ, s.error().message);
  if (auto s = validate(organ.depth_table); !s) return broken(organ, s.error().message);
  if (auto s = wire::validate(organ.fine_surface); !s) return broken(organ, s.error().message);
  return check_material(organ, organ.material);
}

}  // namespace trocar::organ
