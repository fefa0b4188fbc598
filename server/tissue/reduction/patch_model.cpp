#include "server/tissue/reduction/patch_model.h"

#include <immintrin.h>

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"
#include "server/tissue/reduction/block_matrix.h"

namespace trocar::reduction {
namespace {

template <typename T>
void sort_once(std::vector<T>& values) {
  std::ranges::sort(values);
  values.erase(std::unique(values.begin(), values.end()), values.end());
}

double entry(const std::vector<double>& lower, std::size_t i, std::size_t j) {
  return i >= j ? lower[i * (i + 1) / 2 + j] : lower[j * (j + 1) / 2 + i];
}

// y += s x, of n floats, a multiple of eight.
void add_scaled(float s, const float* x, float* y, std::size_t n) {
  const __m256 factor = _mm256_set1_ps(s);
  for (std::size_t i = 0; i < n; i += 8)
    _mm256_storeu_ps(y + i,
                     _mm256_fmadd_ps(factor, _mm256_loadu_ps(x + i), _mm256_loadu_ps(y + i)));
}

// A field is kept if at least this part of its stiffness is independent of the fields before it:
// kNewInField for fields of later patches, kLeastPivot for those of the first.
constexpr double kNewInField = 0.01, kLeastPivot = 1e-6;

BlockMatrix pattern_of(std::size_t node_count, std::initializer_list<const ElementSet*> sets) {
  std::vector<BlockMatrix::Pair> pairs;
  for (const auto* set : sets) set->add_pairs(pairs);
  for (std::uint32_t n = 0; n < node_count; ++n) pairs.push_back({n, n});
  return {node_count, std::move(pairs)};
}

}  // namespace

PatchModel::PatchModel(const organ::LocalReduction& reduction, const organ::LocalPatch& patch,
                       const organ::Organ& organ)
    : centre_(patch.centre) {
  for (const auto* modes : {&reduction.vibrations, &patch.modes})
    for (const auto& mode : *modes) fields_.push_back({mode.values.data(), mode.step});
  for (const auto node : patch.reach) {
    const auto greens =
        std::ranges::lower_bound(reduction.greens, node, {}, &organ::GreensFunction::node);
    for (const auto& field : greens->fields) fields_.push_back({field.values.data(), field.step});
  }
  blocks_ = {0, fields_.size()};
  select_tets(organ, patch.inner_tets);
  make_matrices(patch);
  make_near_fit();
}

PatchModel::PatchModel(const LocalModels& models, const PatchSet& patches)
    : centre_(models[patches.patches[0]].centre()) {
  std::vector<TetIndex> inner;
  for (const auto p : patches.all()) {
    blocks_.push_back(fields_.size());
    fields_.insert(fields_.end(), models[p].fields_.begin(), models[p].fields_.end());
    const auto& tets = models.patch(p).inner_tets;
    inner.insert(inner.end(), tets.begin(), tets.end());
  }
  blocks_.push_back(fields_.size());
  sort_once(inner);
  select_tets(models.organ(), inner);
  sum_over_nodes(models, inner);
  fill_basis();
  fill_inner_stiffness();
  drop_repeated_fields();
  fill_basis();
  make_near_fit();
}

// Tet by tet, not as a difference: the result is positive semidefinite.
void PatchModel::sum_over_nodes(const LocalModels& models, std::span<const TetIndex> inner) {
  const auto count = field_count(), width = stride(), nodes = models.node_count();
  std::vector<NodeIndex> all_nodes;
  for (std::uint32_t n = 0; n < nodes; ++n) all_nodes.push_back(NodeIndex(n));
  auto tangent = models.rest_tangent();
  ElementSet(models.organ(), inner, std::vector<float>(inner.size(), -1.0f), all_nodes)
      .add_rest_tangent(tangent);
  std::vector<float> all(3 * nodes * width);
  for (std::size_t c = 0; c < count; ++c)
    for (std::size_t dof = 0; dof < 3 * nodes; ++dof)
      all[dof * width + c] = static_cast<float>(fields_[c].values[dof]) * fields_[c].step;
  outer_stiffness_.assign(count * width, 0);
  mass_ = outer_stiffness_;
  constexpr std::size_t kRun = 64;  // nodes that are summed in single precision
  std::vector<float> forces(3 * width), stiffness(count * width), mass(count * width);
  for (std::size_t first = 0; first < nodes; first += kRun) {
    std::ranges::fill(stiffness, 0.0f);
    std::ranges::fill(mass, 0.0f);
    for (std::size_t n = first; n < std::min(first + kRun, nodes); ++n) {
      std::ranges::fill(forces, 0.0f);
      const auto neighbours = tangent.columns(n);
      const auto blocks = tangent.blocks(n);
      for (std::size_t b = 0; b < neighbours.size(); ++b)
        for (std::size_t e = 0; e < 9; ++e)
          add_scaled(blocks[b][e], &all[(3 * neighbours[b] + e % 3) * width],
                     &forces[e / 3 * width], width);
      const auto m = static_cast<float>(models.organ().node_masses_kg[n]);
      for (std::size_t k = 0; k < 3; ++k) {
        const float* const row = &all[(3 * n + k) * width];
        for (std::size_t i = 0; i < count; ++i) {
          const auto from = i / 8 * 8;
          add_scaled(row[i], &forces[k * width] + from, &stiffness[i * width + from], width - from);
          add_scaled(m * row[i], row + from, &mass[i * width + from], width - from);
        }
      }
    }
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t j = i; j < count; ++j) {
        outer_stiffness_[i * width + j] += static_cast<double>(stiffness[i * width + j]);
        mass_[i * width + j] += static_cast<double>(mass[i * width + j]);
      }
  }
  for (auto* matrix : {&outer_stiffness_, &mass_})
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t j = 0; j < i; ++j) (*matrix)[i * width + j] = (*matrix)[j * width + i];
}

// By the pivots of a Cholesky factor of the stiffness: of a field that has 1, what is its own.
void PatchModel::drop_repeated_fields() {
  const auto count = field_count(), width = stride();
  std::vector<std::size_t> kept;
  std::vector<double> lower;  // rows of kept.size() + 1 entries
  for (std::size_t i = 0; i < count; ++i) {
    std::vector<double> row;
    const auto between = [&](std::size_t a, std::size_t b) {
      return outer_stiffness_[a * width + b] + inner_stiffness_[a * width + b];
    };
    double own = between(i, i);
    for (std::size_t j = 0; j < kept.size(); ++j) {
      const double* const other = &lower[j * (j + 1) / 2];
      double value = between(i, kept[j]);
      for (std::size_t k = 0; k < j; ++k) value -= row[k] * other[k];
      row.push_back(value / other[j]);
      own -= row.back() * row.back();
    }
    const bool is_later = i >= blocks_[1];
    if (own < (is_later ? kNewInField : kLeastPivot)) continue;
    row.push_back(std::sqrt(own));
    lower.insert(lower.end(), row.begin(), row.end());
    kept.push_back(i);
  }
  std::vector<Field> fields;
  for (const auto i : kept) fields.push_back(fields_[i]);
  for (auto& begin : blocks_)
    begin = static_cast<std::size_t>(std::ranges::lower_bound(kept, begin) - kept.begin());
  fields_ = std::move(fields);
  for (auto* matrix : {&outer_stiffness_, &inner_stiffness_, &mass_}) {
    std::vector<double> of_kept(field_count() * stride(), 0.0);
    for (std::size_t i = 0; i < kept.size(); ++i)
      for (std::size_t j = 0; j < kept.size(); ++j)
        of_kept[i * stride() + j] = (*matrix)[kept[i] * width + kept[j]];
    *matrix = std::move(of_kept);
  }
}

void PatchModel::select_tets(const organ::Organ& organ, std::span<const TetIndex> inner) {
  const auto& mesh = organ.mesh;
  const auto is_inner = [&](TetIndex tet) { return std::ranges::binary_search(inner, tet); };
  const auto may_be_free = [&](NodeIndex node) {
    return !std::ranges::binary_search(organ.fixed_nodes, node) &&
           std::ranges::all_of(mesh.node_tets[node], is_inner);
  };
  const auto add_nodes_of = [&](std::span<const TetIndex> tets) {
    for (const auto tet : tets)
      for (const auto node : mesh.tets[tet.value]) nodes_.push_back(node);
  };
  add_nodes_of(inner);
  sort_once(nodes_);
  std::vector<NodeIndex> rim;
  std::vector<TetIndex> beyond;
  for (const auto node : nodes_)
    if (!may_be_free(node) && !std::ranges::binary_search(organ.fixed_nodes, node))
      rim.push_back(node);
  for (const auto node : rim)
    for (const auto tet : mesh.node_tets[node])
      if (!is_inner(tet)) beyond.push_back(tet);
  sort_once(beyond);
  add_nodes_of(beyond);
  sort_once(nodes_);
  for (const auto node : nodes_) {
    is_free_.push_back(may_be_free(node));
    masses_.push_back(static_cast<float>(organ.node_masses_kg[node.value]));
  }
  for (const auto node : rim) rim_.push_back(local(node));
  inner_ = ElementSet(organ, inner, {}, nodes_);
  beyond_rim_ = ElementSet(organ, beyond, {}, nodes_);
  auto tangent = pattern_of(nodes_.size(), {&inner_, &beyond_rim_});
  inner_.add_rest_tangent(tangent);
  beyond_rim_.add_rest_tangent(tangent);
  for (const auto node : rim_) {
    const auto& block = tangent.at(node, node);
    rim_stiffness_.push_back((block[0] + block[4] + block[8]) / 3);
  }
}

void PatchModel::fill_basis() {
  const auto width = stride();
  basis_.assign(3 * nodes_.size() * width, 0);
  for (std::size_t c = 0; c < field_count(); ++c)
    for (std::size_t n = 0; n < nodes_.size(); ++n)
      for (std::size_t k = 0; k < 3; ++k)
        basis_[(3 * n + k) * width + c] =
            static_cast<float>(fields_[c].values[3 * nodes_[n].value + k]) * fields_[c].step;
}

void PatchModel::fill_inner_stiffness() {
  const auto count = field_count(), width = stride();
  auto tangent = pattern_of(nodes_.size(), {&inner_});
  inner_.add_rest_tangent(tangent);
  std::vector<double> inner(count * count, 0.0);
  std::vector<float> product(3 * width);
  for (std::size_t row = 0; row < nodes_.size(); ++row) {
    product.assign(3 * width, 0);
    const auto columns = tangent.columns(row);
    const auto blocks = tangent.blocks(row);
    for (std::size_t i = 0; i < columns.size(); ++i)
      for (std::size_t k = 0; k < 9; ++k) {
        const float* const from = &basis_[(3 * columns[i] + k % 3) * width];
        for (std::size_t c = 0; c < count; ++c)
          product[k / 3 * width + c] += blocks[i][k] * from[c];
      }
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t i = 0; i < count; ++i)
        for (std::size_t j = 0; j < count; ++j)
          inner[i * count + j] += static_cast<double>(basis_[(3 * row + k) * width + i]) *
                                  static_cast<double>(product[k * width + j]);
  }
  inner_stiffness_.assign(count * width, 0);
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t j = 0; j < count; ++j)
      inner_stiffness_[i * width + j] = (inner[i * count + j] + inner[j * count + i]) / 2;
}

void PatchModel::make_near_fit() {
  const auto count = field_count(), width = stride();
  std::vector<double> free_mass(count * width, 0.0);
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    if (is_free_[n] == 0) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      const float* const row = &basis_[(3 * n + k) * width];
      for (std::size_t i = 0; i < count; ++i) {
        const double own = static_cast<double>(masses_[n] * row[i]);
        for (std::size_t j = i; j < count; ++j)
          free_mass[i * width + j] += own * static_cast<double>(row[j]);
      }
    }
  }
  near_fit_.resize(blocks_);
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t j = 0; j < count; ++j) {
      const double own = free_mass[std::min(i, j) * width + std::max(i, j)];
      const auto at = i * width + j;
      const double all = own + kBeside * (mass_[at] - own + kBeside_s2 * outer_stiffness_[at]);
      near_fit_.row(i)[j] = i == j ? all * (1 + kLeastPivot) : all;
    }
  has_near_fit_ = near_fit_.factor();
}

void PatchModel::make_matrices(const organ::LocalPatch& patch) {
  const auto count = field_count(), width = stride();
  fill_basis();
  fill_inner_stiffness();
  std::vector<double> scales;
  for (std::size_t i = 0; i < count; ++i) {
    const double own = entry(patch.outer_stiffness, i, i) + inner_stiffness_[i * width + i];
    // A field is to move the tissue as a whole does that has 1 N/m.
    scales.push_back(own > 0 ? 1 / std::sqrt(own) : 1);
  }
  outer_stiffness_.assign(count * width, 0);
  mass_ = outer_stiffness_;
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t j = 0; j < count; ++j) {
      const double scale = scales[i] * scales[j];
      outer_stiffness_[i * width + j] = scale * entry(patch.outer_stiffness, i, j);
      inner_stiffness_[i * width + j] *= scale;
      mass_[i * width + j] = scale * entry(patch.mass, i, j);
    }
  for (std::size_t i = 0; i < count; ++i)
    fields_[i].step = static_cast<float>(static_cast<double>(fields_[i].step) * scales[i]);
  fill_basis();
}

std::uint32_t PatchModel::local(NodeIndex node) const {
  const auto found = std::ranges::lower_bound(nodes_, node);
  return found != nodes_.end() && *found == node
             ? static_cast<std::uint32_t>(found - nodes_.begin())
             : kNone;
}

namespace {

__m256 load_packed(const std::int16_t* values) {
  return _mm256_cvtepi32_ps(
      _mm256_cvtepi16_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(values))));
}

}  // namespace

void PatchModel::add_everywhere(std::size_t begin, std::size_t end, std::span<const float> x,
                                std::span<float> out) const {
  const std::size_t first = 3 * begin, count = 3 * (end - begin);
  TROCAR_ASSERT_HOT(out.size() == count);
  constexpr std::size_t kRun = 64;
  for (std::size_t run = 0; run < count; run += kRun) {
    const auto here = std::min(kRun, count - run);
    alignas(32) float sums[kRun];
    std::copy_n(out.data() + run, here, sums);
    for (std::size_t c = 0; c < fields_.size(); ++c) {
      const float factor = x[c] * fields_[c].step;
      const auto* const values = fields_[c].values + first + run;
      std::size_t i = 0;
      const __m256 factors = _mm256_set1_ps(factor);
      for (; i + 8 <= here; i += 8)
        _mm256_store_ps(
            sums + i, _mm256_fmadd_ps(factors, load_packed(values + i), _mm256_load_ps(sums + i)));
      for (; i < here; ++i) sums[i] += factor * static_cast<float>(values[i]);
    }
    std::copy_n(sums, here, out.data() + run);
  }
}

void PatchModel::add_along_everywhere(std::size_t begin, std::size_t end, std::span<const float> f,
                                      std::span<float> out) const {
  const std::size_t first = 3 * begin, count = 3 * (end - begin);
  TROCAR_ASSERT_HOT(f.size() == count);
  for (std::size_t c = 0; c < fields_.size(); ++c) {
    const auto* const values = fields_[c].values + first;
    __m256 sums = _mm256_setzero_ps();
    std::size_t i = 0;
    for (; i + 8 <= count; i += 8)
      sums = _mm256_fmadd_ps(load_packed(values + i), _mm256_loadu_ps(f.data() + i), sums);
    alignas(32) float parts[8];
    _mm256_store_ps(parts, sums);
    float rest = 0;
    for (; i < count; ++i) rest += static_cast<float>(values[i]) * f[i];
    out[c] += fields_[c].step * ((((parts[0] + parts[4]) + (parts[2] + parts[6])) +
                                  ((parts[1] + parts[5]) + (parts[3] + parts[7]))) +
                                 rest);
  }
}

LocalModels::LocalModels(const organ::LocalReduction& reduction, const organ::Organ& organ)
    : reduction_(reduction),
      organ_(organ),
      node_count_(organ.mesh.node_count()),
      force_n_(reduction.force_n),
      drag_per_s_(organ.material.node_damping_per_s) {
  models_.reserve(reduction.patches.size());
  for (const auto& patch : reduction.patches) models_.emplace_back(reduction, patch, organ);
  if (models_.size() < 2) return;
  std::vector<TetIndex> tets;
  std::vector<NodeIndex> nodes;
  for (std::uint32_t t = 0; t < organ.mesh.tets.size(); ++t) tets.push_back(TetIndex(t));
  for (std::uint32_t n = 0; n < node_count_; ++n) nodes.push_back(NodeIndex(n));
  const ElementSet all(organ, tets, {}, nodes);
  rest_tangent_ = pattern_of(node_count_, {&all});
  all.add_rest_tangent(rest_tangent_);
}

}  // namespace trocar::reduction
