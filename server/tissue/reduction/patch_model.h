#pragma once

// Patches of a local reduction made ready for ticks, one or several that act together: their fields
// at the nodes near them, their tets, and their matrices, all in fields of like stiffness.
// Immutable once made.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/wire/figures.h"
#include "server/organs/organ/local_reduction.h"
#include "server/organs/organ/organ.h"
#include "server/tissue/reduction/block_matrix.h"
#include "server/tissue/reduction/dense.h"
#include "server/tissue/reduction/element_set.h"

namespace trocar::reduction {

using wire::PatchSet;

class LocalModels;

class PatchModel {
 public:
  PatchModel(const organ::LocalReduction& reduction, const organ::LocalPatch& patch,
             const organ::Organ& organ);
  // Joins two patches or more. Their fields come one after another, without fields of later patches
  // that are nearly linear combinations of those before. Tets near any of the patches keep their
  // nonlinear forces. O(organ x fields^2).
  PatchModel(const LocalModels& models, const PatchSet& patches);

  NodeIndex centre() const { return centre_; }
  // Vibrations, modes, then the Green's functions of the patch's reach, x, y, z.
  std::size_t field_count() const { return fields_.size(); }
  std::size_t stride() const { return padded(field_count()); }

  // Returns where each patch's fields begin, and where the last one's end.
  std::span<const std::size_t> blocks() const { return blocks_; }

  // Nodes of its tets, ascending: its local nodes.
  std::span<const NodeIndex> nodes() const { return nodes_; }
  std::span<const float> masses() const { return masses_; }  // kg
  static constexpr std::uint32_t kNone = 0xffffffffu;
  // kNone: it is none of them.
  std::uint32_t local(NodeIndex node) const;
  // Per local node: all its tets are as they are, so that it may move on its own.
  bool may_be_free(std::uint32_t local) const { return is_free_[local] != 0; }
  // At the local nodes, x, y, z.
  BasisRows basis() const { return {basis_, stride()}; }

  const ElementSet& inner() const { return inner_; }
  // Nodes around those that may be free, by their numbers among local nodes, and all their tets
  // that are not inner: where the fields alone have to do.
  std::span<const std::uint32_t> rim() const { return rim_; }
  const ElementSet& beyond_rim() const { return beyond_rim_; }
  // Their stiffness at rest, the mean over axes, N/m.
  std::span<const float> rim_stiffness() const { return rim_stiffness_; }

  // Rows of `stride` doubles. At rest, N/m and kg: of all tets but the inner ones; of the inner
  // ones; of the nodes.
  std::span<const double> outer_stiffness() const { return outer_stiffness_; }
  std::span<const double> inner_stiffness() const { return inner_stiffness_; }
  std::span<const double> mass() const { return mass_; }
  // Returns the factored system of a least-squares fit; null if it is not positive definite, which
  // no reduction that was made of this organ causes. The fit seeks fields that move the nodes that
  // may be free as wanted, and all else hardly. It minimises the squared differences over those
  // nodes, weighted by mass, plus kBeside times the sum of the other nodes' squared moves, weighted
  // by mass, and kBeside_s2 times the energy in the outer stiffness. With a hundredth of the weight
  // kBeside contacts err by up to 8 %; with ten times as much fields go three times as far astray.
  static constexpr double kBeside = 1000, kBeside_s2 = 1e-4;
  const BlockSystem* near_fit() const { return has_near_fit_ ? &near_fit_ : nullptr; }

  // out[3 n + k - 3 begin] += sum_c field c at node n x[c], of nodes begin to end.
  void add_everywhere(std::size_t begin, std::size_t end, std::span<const float> x,
                      std::span<float> out) const;
  // out[c] += sum of field c times f, of nodes begin to end.
  void add_along_everywhere(std::size_t begin, std::size_t end, std::span<const float> f,
                            std::span<float> out) const;

 private:
  struct Field {
    const std::int16_t* values;  // all nodes
    float step;                  // with its scale
  };
  // Ascending.
  void select_tets(const organ::Organ& organ, std::span<const TetIndex> inner);
  // Drops fields that nearly are linear combinations of those before; more so of later patches.
  void drop_repeated_fields();
  void make_matrices(const organ::LocalPatch& patch);
  void fill_basis();
  void fill_inner_stiffness();
  void make_near_fit();
  // Projects onto the fields the masses of all nodes and the stiffness of the outer tets.
  void sum_over_nodes(const LocalModels& models, std::span<const TetIndex> inner);

  NodeIndex centre_;
  std::vector<std::size_t> blocks_;
  std::vector<Field> fields_;
  std::vector<NodeIndex> nodes_;
  std::vector<float> masses_;
  std::vector<std::uint8_t> is_free_;
  std::vector<float> basis_;
  std::vector<std::uint32_t> rim_;
  std::vector<float> rim_stiffness_;
  ElementSet inner_, beyond_rim_;
  std::vector<double> outer_stiffness_, inner_stiffness_, mass_;
  BlockSystem near_fit_;
  bool has_near_fit_ = false;
};

// All patches of a reduction.
class LocalModels {
 public:
  // A valid reduction of this organ; both must outlive it.
  LocalModels(const organ::LocalReduction& reduction, const organ::Organ& organ);

  std::size_t size() const { return models_.size(); }
  const organ::Organ& organ() const { return organ_; }
  const organ::LocalPatch& patch(std::uint32_t number) const { return reduction_.patches[number]; }
  // Returns the tangent of all tets at rest over all nodes; it is empty for a single patch.
  const BlockMatrix& rest_tangent() const { return rest_tangent_; }
  const PatchModel& operator[](std::uint32_t patch) const { return models_[patch]; }
  std::size_t node_count() const { return node_count_; }
  double force_n() const { return force_n_; }  // largest of the training, at a node
  double drag_per_s() const { return drag_per_s_; }

 private:
  const organ::LocalReduction& reduction_;
  const organ::Organ& organ_;
  std::vector<PatchModel> models_;
  BlockMatrix rest_tangent_;
  std::size_t node_count_ = 0;
  double force_n_ = 0, drag_per_s_ = 0;
};

}  // namespace trocar::reduction
