#include "tests/reduce/small_organ.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/lab/scenario/scenario_block.h"

namespace trocar::reduce::testing {
namespace {

using Field = std::vector<double>;

double product(const Field& a, const Field& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

// Waves over the nodes' numbers: any of them are independent.
Field wave(std::size_t length, std::size_t k) {
  Field field;
  for (std::size_t i = 0; i < length; ++i)
    field.push_back(std::cos((static_cast<double>(i) + 0.5) * static_cast<double>(k) * 3.14 /
                             static_cast<double>(length)));
  return field;
}

std::vector<Field> orthonormal(std::size_t length, std::size_t first, std::size_t count) {
  std::vector<Field> fields;
  for (std::size_t k = 0; k < count; ++k) {
    auto field = wave(length, first + k);
    for (const auto& other : fields) {
      const double along = product(field, other);
      for (std::size_t i = 0; i < length; ++i) field[i] -= along * other[i];
    }
    const double norm = std::sqrt(product(field, field));
    for (double& value : field) value /= norm;
    fields.push_back(std::move(field));
  }
  return fields;
}

Field unpacked(const organ::PackedField& field) {
  Field values;
  for (const auto value : field.values)
    values.push_back(static_cast<double>(value) * static_cast<double>(field.step));
  return values;
}

// B^T B of the patch's fields.
std::vector<double> gram(const organ::LocalReduction& r, const organ::LocalPatch& patch) {
  std::vector<Field> basis;
  for (const auto* modes : {&r.vibrations, &patch.modes})
    for (const auto& mode : *modes) basis.push_back(unpacked(mode));
  for (const auto node : patch.reach)
    for (const auto& field :
         std::ranges::lower_bound(r.greens, node, {}, &organ::GreensFunction::node)->fields)
      basis.push_back(unpacked(field));
  std::vector<double> lower;
  for (std::size_t i = 0; i < basis.size(); ++i)
    for (std::size_t j = 0; j <= i; ++j) lower.push_back(product(basis[i], basis[j]));
  return lower;
}

organ::LocalPatch patch_at(const organ::Organ& organ, NodeIndex node) {
  organ::LocalPatch patch;
  patch.centre = node;
  patch.members = patch.reach = {node};
  for (const auto other : organ.mesh.node_neighbours[node]) {
    if (organ.mesh.is_surface_node[other.value] == 0 || patch.reach.size() == 3) continue;
    patch.reach.push_back(other);
  }
  std::ranges::sort(patch.reach);
  for (std::uint32_t t = 0; t < organ.mesh.tets.size(); ++t) {
    const auto& tet = organ.mesh.tets[t];
    if (std::ranges::find(tet, node) != tet.end())
      patch.inner_tets.push_back(TetIndex(t));
    else if (patch.cubature.size() < 3)
      patch.cubature.push_back({TetIndex(t), 1.5F + static_cast<float>(t)});
  }
  return patch;
}

}  // namespace

organ::Organ block(int nx, int ny, int nz) {
  auto organ = scenario::make_block({nx, ny, nz, 0.01});
  TROCAR_ASSERT(organ.ok());
  material::use_measured(*material::find_measured_material("human_liver_nava2008"),
                         organ->material);
  return std::move(*organ);
}

organ::LocalReduction synthetic_local_reduction(const organ::Organ& organ) {
  organ::LocalReduction r;
  r.source = "synthetic";
  r.mesh_hash = organ::mesh_hash(organ);
  r.elasticity_hash = organ::elasticity_hash(organ);
  r.node_count = static_cast<std::uint32_t>(organ.mesh.node_count());
  r.force_n = 0.4;
  r.free_layers = 1;
  const std::size_t length = 3 * organ.mesh.node_count();
  r.patches = {patch_at(organ, organ.mesh.surface_nodes.front()),
               patch_at(organ, organ.mesh.surface_nodes.back())};
  std::vector<NodeIndex> nodes;
  for (const auto& patch : r.patches)
    nodes.insert(nodes.end(), patch.reach.begin(), patch.reach.end());
  std::ranges::sort(nodes);
  nodes.erase(std::ranges::unique(nodes).begin(), nodes.end());
  constexpr std::size_t kModes = 4;
  // Of one series, so that all modes are orthogonal to them.
  constexpr std::size_t kVibrations = 2;
  const auto fields = orthonormal(length, 1, kVibrations + kModes + r.patches.size());
  for (std::size_t i = 0; i < kVibrations; ++i)
    r.vibrations.push_back(organ::pack_field(fields[i]));
  std::size_t next = fields.size() + 1;
  for (const auto node : nodes) {
    auto& greens = r.greens.emplace_back();
    greens.node = node;
    for (auto& field : greens.fields) {
      auto values = wave(length, next++);
      for (double& value : values) value *= 0.01;
      field = organ::pack_field(values);
    }
  }
  for (std::size_t p = 0; p < r.patches.size(); ++p) {
    auto& patch = r.patches[p];
    for (std::size_t i = 0; i < kModes; ++i)
      patch.modes.push_back(organ::pack_field(fields[kVibrations + p + i]));
    patch.mass = gram(r, patch);
    patch.outer_stiffness = patch.mass;
    for (double& value : patch.outer_stiffness) value *= 100;
  }
  return r;
}

}  // namespace trocar::reduce::testing
