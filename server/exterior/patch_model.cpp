#include "server/exterior/patch_model.h"

#include <immintrin.h>

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"
#include "server/exterior/block_matrix.h"

namespace trocar::exterior {
namespace {

template <typename T>
void sort_once(std::vector<T>& values) {
  std::ranges::sort(values);
  values.erase(std::ranges::unique(values).begin(), values.end());
}

double entry(const std::vector<double>& lower, std::size_t i, std::size_t j) {
  return i >= j ? lower[i * (i + 1) / 2 + j] : lower[j * (j + 1) / 2 + i];
}

}  // namespace

PatchModel::PatchModel(const scene::LocalReduction& reduction, const scene::LocalPatch& patch,
                       const scene::Organ& organ)
    : centre_(patch.centre) {
  for (const auto& mode : patch.modes) fields_.push_back({mode.values.data(), mode.step});
  for (const auto node : patch.reach) {
    const auto greens =
        std::ranges::lower_bound(reduction.greens, node, {}, &scene::GreensFunction::node);
    for (const auto& field : greens->fields) fields_.push_back({field.values.data(), field.step});
  }
  choose_nodes(organ, patch);
  make_matrices(patch);
}

void PatchModel::choose_nodes(const scene::Organ& organ, const scene::LocalPatch& patch) {
  const auto& mesh = organ.mesh;
  const auto is_inner = [&](TetIndex tet) {
    return std::ranges::binary_search(patch.inner_tets, tet);
  };
  const auto may_be_free = [&](NodeIndex node) {
    return !std::ranges::binary_search(organ.fixed_nodes, node) &&
           std::ranges::all_of(mesh.node_tets[node], is_inner);
  };
  std::vector<NodeIndex> rim;
  std::vector<TetIndex> outer, beyond;
  std::vector<float> weights;
  for (const auto& [tet, weight] : patch.cubature) outer.push_back(tet), weights.push_back(weight);
  const auto add_nodes_of = [&](std::span<const TetIndex> tets, std::vector<NodeIndex>& to) {
    for (const auto tet : tets)
      for (const auto node : mesh.tets[tet.value]) to.push_back(node);
  };
  add_nodes_of(patch.inner_tets, nodes_);
  for (const auto node : nodes_)
    if (!may_be_free(node) && !std::ranges::binary_search(organ.fixed_nodes, node))
      rim.push_back(node);
  sort_once(rim);
  for (const auto node : rim)
    for (const auto tet : mesh.node_tets[node])
      if (!is_inner(tet)) beyond.push_back(tet);
  sort_once(beyond);
  add_nodes_of(outer, nodes_);
  add_nodes_of(beyond, nodes_);
  sort_once(nodes_);
  for (const auto node : nodes_) {
    is_free_.push_back(may_be_free(node));
    masses_.push_back(static_cast<float>(organ.node_masses_kg[node.value]));
  }
  for (const auto node : rim) rim_.push_back(local(node));
  inner_ = ElementSet(organ, patch.inner_tets, {}, nodes_);
  outer_ = ElementSet(organ, outer, weights, nodes_);
  beyond_rim_ = ElementSet(organ, beyond, {}, nodes_);
  std::vector<BlockMatrix::Pair> pairs;
  inner_.add_pairs(pairs);
  beyond_rim_.add_pairs(pairs);
  BlockMatrix tangent(nodes_.size(), std::move(pairs));
  inner_.add_rest_tangent(tangent);
  beyond_rim_.add_rest_tangent(tangent);
  for (const auto node : rim_) {
    const auto& block = tangent.at(node, node);
    rim_stiffness_.push_back((block[0] + block[4] + block[8]) / 3);
  }
}

void PatchModel::make_matrices(const scene::LocalPatch& patch) {
  const auto count = field_count(), width = stride();
  basis_.assign(3 * nodes_.size() * width, 0);
  const auto fill = [&] {
    for (std::size_t n = 0; n < nodes_.size(); ++n)
      for (std::size_t k = 0; k < 3; ++k)
        for (std::size_t c = 0; c < count; ++c)
          basis_[(3 * n + k) * width + c] =
              static_cast<float>(fields_[c].values[3 * nodes_[n].value + k]) * fields_[c].step;
  };
  fill();
  // Inner tets at rest among the fields.
  std::vector<BlockMatrix::Pair> pairs;
  inner_.add_pairs(pairs);
  for (std::uint32_t n = 0; n < nodes_.size(); ++n) pairs.push_back({n, n});
  BlockMatrix tangent(nodes_.size(), std::move(pairs));
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
  std::vector<double> scales(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double own = entry(patch.outer_stiffness, i, i) + inner[i * count + i];
    // A field is to move the tissue as a whole does that has 1 N/m.
    scales[i] = own > 0 ? 1 / std::sqrt(own) : 1;
  }
  outer_stiffness_.assign(count * width, 0);
  inner_stiffness_ = mass_ = outer_stiffness_;
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t j = 0; j < count; ++j) {
      const double scale = scales[i] * scales[j];
      outer_stiffness_[i * width + j] = scale * entry(patch.outer_stiffness, i, j);
      inner_stiffness_[i * width + j] = scale * (inner[i * count + j] + inner[j * count + i]) / 2;
      mass_[i * width + j] = scale * entry(patch.mass, i, j);
    }
  for (std::size_t i = 0; i < count; ++i)
    fields_[i].step = static_cast<float>(static_cast<double>(fields_[i].step) * scales[i]);
  fill();
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

LocalModels::LocalModels(const scene::LocalReduction& reduction, const scene::Organ& organ)
    : node_count_(organ.mesh.node_count()),
      force_n_(reduction.force_n),
      drag_per_s_(organ.material.node_damping_per_s) {
  models_.reserve(reduction.patches.size());
  for (const auto& patch : reduction.patches) models_.emplace_back(reduction, patch, organ);
}

}  // namespace trocar::exterior
