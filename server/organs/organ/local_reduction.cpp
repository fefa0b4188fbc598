#include "server/organs/organ/local_reduction.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <type_traits>
#include <utility>

#include "common/base/checksum.h"
#include "common/math/cholesky.h"
#include "server/organs/organ/any_material.h"
#include "server/organs/organ/bad_file.h"

namespace trocar::organ {
namespace {

constexpr std::size_t kMaxSourceBytes = 4096;
constexpr std::uint32_t kTetLimit = std::uint32_t{1} << 31;
// A pivot of the mass matrix must be at least this share of its diagonal. Fields that depend on
// each other exactly still leave 5e-10 after packing, which rounds each on its own; those of a
// block leave 7e-7 and more.
constexpr double kLeastPivot = 1e-12;
// A mode's mass in the file may deviate by this share from that of the organ's nodes: packing makes
// up to 1e-4.
constexpr double kMassMargin = 0.01;

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}
std::string name_of(std::size_t patch) {
  return "patch " + std::to_string(patch + 1);
}
std::string name_of(NodeIndex node) {
  return "node " + std::to_string(node.value);
}
std::string name_of(TetIndex tet) {
  return "tet " + std::to_string(tet.value);
}

// Says whether they are ascending, distinct and below a limit.
template <typename Index>
Status check_indices(const std::string& what, const std::vector<Index>& indices,
                     std::uint32_t limit) {
  for (std::size_t i = 0; i < indices.size(); ++i) {
    if (indices[i].value >= limit)
      return bad(what + " has " + name_of(indices[i]) + ", must be below " + std::to_string(limit));
    if (i > 0 && indices[i - 1] >= indices[i])
      return bad(what + " has " + name_of(indices[i]) + " after " + name_of(indices[i - 1]) +
                 ", must be ascending");
  }
  return {};
}

Status check_field(const std::string& what, const PackedField& field, std::uint32_t node_count) {
  if (field.values.size() != 3 * std::size_t{node_count})
    return bad(what + " has " + std::to_string(field.values.size()) + " numbers, must have 3 x " +
               std::to_string(node_count));
  if (!(field.step >= 0 && field.step <= kMaxFieldStep))
    return bad(what + " has steps of " + number(static_cast<double>(field.step)) +
               ", must be from 0 to " + number(static_cast<double>(kMaxFieldStep)));
  return {};
}

Status check_greens(const LocalReduction& r) {
  if (r.greens.size() > kMaxGreensFunctions)
    return bad("has " + std::to_string(r.greens.size()) + " Green's functions, may have " +
               std::to_string(kMaxGreensFunctions));
  for (std::size_t i = 0; i < r.greens.size(); ++i) {
    const auto& [node, fields] = r.greens[i];
    const auto name = "Green's function of " + name_of(node);
    if (node.value >= r.node_count)
      return bad(name + " is of none of the " + std::to_string(r.node_count) + " nodes");
    if (i > 0 && r.greens[i - 1].node >= node)
      return bad(name + " comes after that of " + name_of(r.greens[i - 1].node) +
                 ", must be ascending");
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (auto s = check_field(name + " along " + "xyz"[axis], fields[axis], r.node_count); !s)
        return s;
  }
  return {};
}

Status check_nodes(const std::string& name, const LocalPatch& patch, const LocalReduction& r) {
  if (patch.centre.value >= r.node_count)
    return bad("centre of " + name + " is " + name_of(patch.centre) + ", must be below " +
               std::to_string(r.node_count));
  if (patch.members.empty()) return bad(name + " has no members");
  if (auto s = check_indices("members of " + name, patch.members, r.node_count); !s) return s;
  if (auto s = check_indices("reach of " + name, patch.reach, r.node_count); !s) return s;
  for (const auto node : patch.members)
    if (!std::ranges::binary_search(patch.reach, node))
      return bad(name + " does not reach " + name_of(node) + " of its members");
  for (const auto node : patch.reach)
    if (!std::ranges::binary_search(r.greens, node, {}, &GreensFunction::node))
      return bad(name + " reaches " + name_of(node) + ", which has no Green's function");
  return {};
}

Status check_tets(const std::string& name, const LocalPatch& patch) {
  if (auto s = check_indices("inner tets of " + name, patch.inner_tets, kTetLimit); !s) return s;
  std::vector<TetIndex> tets;
  tets.reserve(patch.cubature.size());
  for (const auto& [tet, weight] : patch.cubature) tets.push_back(tet);
  if (auto s = check_indices("cubature of " + name, tets, kTetLimit); !s) return s;
  for (const auto& [tet, weight] : patch.cubature) {
    if (std::ranges::binary_search(patch.inner_tets, tet))
      return bad("cubature of " + name + " has " + name_of(tet) + ", which is an inner one");
    if (!(weight > 0 && weight <= kMaxCubatureWeight))
      return bad("cubature of " + name + " has a weight of " + number(static_cast<double>(weight)) +
                 " for " + name_of(tet) + ", must be above 0 and at most " +
                 number(static_cast<double>(kMaxCubatureWeight)));
  }
  return {};
}

// Exact but for the steps.
double product_of(const PackedField& a, const PackedField& b) {
  std::int64_t sum = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i)
    sum += std::int32_t{a.values[i]} * std::int32_t{b.values[i]};
  return static_cast<double>(sum) * static_cast<double>(a.step) * static_cast<double>(b.step);
}

// Each is a field, and orthonormal with those before it and with `others`.
Status check_orthonormal(const std::string& what, const std::string& of,
                         const std::vector<PackedField>& fields,
                         const std::vector<PackedField>& others, std::uint32_t node_count) {
  for (std::size_t a = 0; a < fields.size(); ++a) {
    const auto own = what + " " + std::to_string(a + 1) + of;
    if (auto s = check_field(own, fields[a], node_count); !s) return s;
    if (fields[a].step == 0) return bad(own + " has steps of 0, must be above");
    for (std::size_t b = 0; b <= a; ++b)
      if (const double product = product_of(fields[a], fields[b]);
          std::abs(product - (a == b ? 1 : 0)) > kLocalOrthonormality)
        return bad(what + "s " + std::to_string(b + 1) + " and " + std::to_string(a + 1) + of +
                   " are not orthonormal, their product is " + number(product));
    for (std::size_t b = 0; b < others.size(); ++b)
      if (const double product = product_of(fields[a], others[b]);
          std::abs(product) > kLocalOrthonormality)
        return bad(own + " and vibration " + std::to_string(b + 1) +
                   " are not orthogonal, their product is " + number(product));
  }
  return {};
}

Status check_matrices(const std::string& name, const LocalPatch& patch, std::size_t n) {
  struct Named {
    const char* name;
    const std::vector<double>& values;
  };
  for (const auto& [matrix, values] :
       {Named{"outer stiffness", patch.outer_stiffness}, Named{"mass", patch.mass}}) {
    const auto what = std::string(matrix) + " of " + name;
    if (values.size() != n * (n + 1) / 2)
      return bad(what + " has " + std::to_string(values.size()) + " numbers, must have " +
                 std::to_string(n * (n + 1) / 2) + " of " + std::to_string(n) + " fields");
    if (!std::ranges::all_of(values, [](double v) { return std::isfinite(v); }))
      return bad(what + " has numbers that are not finite");
  }
  for (std::size_t i = 0; i < n; ++i)
    if (const double own = patch.outer_stiffness[i * (i + 1) / 2 + i]; own < 0)
      return bad("outer stiffness of " + name + " is " + number(own) + " for field " +
                 std::to_string(i + 1) + ", must be from 0 up");
  if (!is_positive_definite(patch.mass, n, kLeastPivot))
    return bad("mass of " + name + " is not positive definite");
  return {};
}

Status check_patch(const std::string& name, const LocalPatch& patch, const LocalReduction& r) {
  if (patch.modes.empty() || patch.modes.size() > kMaxReducedModes)
    return bad(name + " has " + std::to_string(patch.modes.size()) + " modes, must have 1 to " +
               std::to_string(kMaxReducedModes));
  const auto fields = r.field_count(patch);
  if (fields > kMaxLocalFields)
    return bad(name + " has " + std::to_string(fields) +
               " fields, vibrations, modes and three per node of its reach, may have " +
               std::to_string(kMaxLocalFields));
  if (auto s = check_nodes(name, patch, r); !s) return s;
  if (auto s = check_tets(name, patch); !s) return s;
  if (auto s = check_orthonormal("mode", " of " + name, patch.modes, r.vibrations, r.node_count);
      !s)
    return s;
  return check_matrices(name, patch, fields);
}

// A node belongs to one patch.
Status check_owners(const LocalReduction& r) {
  std::vector<std::pair<NodeIndex, std::size_t>> owners;
  for (std::size_t i = 0; i < r.patches.size(); ++i)
    for (const auto node : r.patches[i].members) owners.emplace_back(node, i);
  std::ranges::sort(owners);
  for (std::size_t i = 1; i < owners.size(); ++i)
    if (owners[i - 1].first == owners[i].first)
      return bad(name_of(owners[i].first) + " belongs to " + name_of(owners[i - 1].second) +
                 " and to " + name_of(owners[i].second));
  return {};
}

double mass_of(const PackedField& field, const std::vector<double>& node_masses_kg) {
  double sum = 0;
  for (std::size_t i = 0; i < field.values.size(); ++i) {
    const double u = static_cast<double>(field.values[i]) * static_cast<double>(field.step);
    sum += node_masses_kg[i / 3] * u * u;
  }
  return sum;
}

// Arrays with their lengths, fields one by one: padding is in no hash.
class Hash {
 public:
  template <typename T>
  void add(const T& value) {
    static_assert(std::has_unique_object_representations_v<T> || std::is_floating_point_v<T>);
    hasher_.update(bytes_of(std::span(&value, 1)));
  }
  template <typename T>
  void add(const std::vector<T>& values) {
    add(std::uint64_t{values.size()});
    hasher_.update(bytes_of(values));
  }
  void add(const PackedField& field) {
    add(field.step);
    add(field.values);
  }
  void add(const LocalPatch& patch) {
    add(patch.centre.value);
    add(patch.members);
    add(patch.reach);
    add(std::uint64_t{patch.modes.size()});
    for (const auto& mode : patch.modes) add(mode);
    add(patch.inner_tets);
    add(std::uint64_t{patch.cubature.size()});
    for (const auto& [tet, weight] : patch.cubature) add(tet.value), add(weight);
    add(patch.outer_stiffness);
    add(patch.mass);
  }
  std::uint64_t digest() const { return hasher_.digest(); }

 private:
  StateHasher hasher_;
};

Status check_patch_of(const Organ& organ, const std::string& name, const LocalPatch& patch) {
  std::vector<NodeIndex> nodes;
  const auto check_tet = [&](TetIndex tet) -> Status {
    if (tet.value >= organ.mesh.tets.size())
      return bad(name + " has " + name_of(tet) + ", " + organ.name + " has " +
                 std::to_string(organ.mesh.tets.size()));
    nodes.insert(nodes.end(), organ.mesh.tets[tet.value].begin(), organ.mesh.tets[tet.value].end());
    return {};
  };
  for (const auto tet : patch.inner_tets)
    if (auto s = check_tet(tet); !s) return s;
  for (const auto& [tet, weight] : patch.cubature)
    if (auto s = check_tet(tet); !s) return s;
  std::ranges::sort(nodes);
  for (const auto node : patch.reach)
    if (!std::ranges::binary_search(nodes, node))
      return bad(name + " reaches " + name_of(node) + ", which is at none of its tets");
  return {};
}

}  // namespace

PackedField pack_field(std::span<const double> field) {
  constexpr double kMost = 32767;
  double largest = 0;
  for (const double value : field) largest = std::max(largest, std::abs(value));
  PackedField packed{static_cast<float>(largest / kMost), {}};
  packed.values.reserve(field.size());
  for (const double value : field) {
    const double steps =
        packed.step > 0 ? std::round(value / static_cast<double>(packed.step)) : 0.0;
    packed.values.push_back(static_cast<std::int16_t>(std::clamp(steps, -kMost, kMost)));
  }
  return packed;
}

Status validate(const LocalReduction& r) {
  if (r.source.size() > kMaxSourceBytes || r.source.find('\n') != std::string::npos)
    return bad("its source is not one line of at most " + std::to_string(kMaxSourceBytes) +
               " bytes");
  if (r.patches.empty() || r.patches.size() > kMaxLocalPatches)
    return bad("has " + std::to_string(r.patches.size()) + " patches, must have 1 to " +
               std::to_string(kMaxLocalPatches));
  if (!(r.force_n > 0 && r.force_n <= kMaxLocalForce_n))
    return bad("its force is " + number(r.force_n) + " N, must be above 0 and at most " +
               number(kMaxLocalForce_n));
  if (r.force_error && !(*r.force_error >= 0 && *r.force_error < kMostForceError))
    return bad("its check found an error of " + number(*r.force_error) +
               ", must be from 0 to below " + number(kMostForceError));
  if (r.free_layers > kMaxFreeLayers)
    return bad("has " + std::to_string(r.free_layers) + " free layers, may have " +
               std::to_string(kMaxFreeLayers));
  if (r.vibrations.size() > kMaxReducedModes)
    return bad("has " + std::to_string(r.vibrations.size()) + " vibrations, may have " +
               std::to_string(kMaxReducedModes));
  if (auto s = check_orthonormal("vibration", "", r.vibrations, {}, r.node_count); !s) return s;
  if (auto s = check_greens(r); !s) return s;
  for (std::size_t i = 0; i < r.patches.size(); ++i)
    if (auto s = check_patch(name_of(i), r.patches[i], r); !s) return s;
  return check_owners(r);
}

Status check_organ(const LocalReduction& r, const Organ& organ) {
  if (auto s = check_organ(ReducedOrgan{r.node_count, r.mesh_hash, r.elasticity_hash}, organ); !s)
    return s;
  const auto& is_on_surface = organ.mesh.is_surface_node;
  const auto inside = [&](const std::string& what, NodeIndex node) {
    return bad(what + " is of " + name_of(node) + ", which is not on the surface of " + organ.name);
  };
  for (const auto& greens : r.greens)
    if (is_on_surface[greens.node.value] == 0) return inside("a Green's function", greens.node);
  for (std::size_t i = 0; i < r.patches.size(); ++i) {
    const auto& patch = r.patches[i];
    if (is_on_surface[patch.centre.value] == 0)
      return inside("centre of " + name_of(i), patch.centre);
    // Its reach, and so its members, are nodes of Green's functions.
    if (auto s = check_patch_of(organ, name_of(i), patch); !s) return s;
  }
  return {};
}

Status check_reducible(const Organ& organ) {
  const auto cannot = [&](const std::string& why) {
    return bad("sessions of " + organ.name + " can have no reduction: " + why);
  };
  if (organ.mesh.tets.empty() ||
      any_material(organ, [](const auto& m) { return !material::is_hyperelastic(m); }))
    return cannot("not all of it is of tets of a neo-Hookean or measured law");
  if (any_material(organ, [](const auto& m) { return m.has_averaged_strain; }))
    return cannot("its strain is averaged over nodes, leave out --averaged-strain");
  if (length(organ.gravity_m_s2) > 0) return cannot("it is under gravity");
  if (!organ.stress_free_positions_m.empty())
    return cannot("it is settled, its tissue is not free of stress at rest");
  if (any_material(organ, [](const auto& m) { return m.tension != 0 || m.fibre_tension != 0; }))
    return cannot("it is under tension");
  return {};
}

Status check_masses(const LocalReduction& r, const Organ& organ) {
  for (std::size_t i = 0; i < r.patches.size(); ++i) {
    const auto& patch = r.patches[i];
    // The first of its fields, and of its mass matrix.
    const auto& field = r.vibrations.empty() ? patch.modes.front() : r.vibrations.front();
    const double own = mass_of(field, organ.node_masses_kg);
    if (!(std::abs(patch.mass.front() - own) <= kMassMargin * own))
      return bad("is of tissue of another density than that of " + organ.name +
                 ": the first field of " + name_of(i) + " moves " + number(patch.mass.front()) +
                 " kg, not " + number(own) +
                 ": make it again with trocar-organ reduce --method local");
  }
  return {};
}

std::uint64_t reduction_hash(const LocalReduction& r) {
  Hash hash;
  hash.add(r.mesh_hash);
  hash.add(r.elasticity_hash);
  hash.add(r.node_count);
  hash.add(r.force_n);
  hash.add(r.free_layers);
  hash.add(std::uint64_t{r.vibrations.size()});
  for (const auto& vibration : r.vibrations) hash.add(vibration);
  hash.add(std::uint64_t{r.greens.size()});
  for (const auto& [node, fields] : r.greens) {
    hash.add(node.value);
    for (const auto& field : fields) hash.add(field);
  }
  hash.add(std::uint64_t{r.patches.size()});
  for (const auto& patch : r.patches) hash.add(patch);
  return hash.digest();
}

}  // namespace trocar::organ
