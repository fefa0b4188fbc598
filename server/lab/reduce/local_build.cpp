#include "server/lab/reduce/local_build.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <limits>
#include <mutex>
#include <numbers>
#include <thread>

#include "common/base/mix.h"
#include "server/lab/reduce/check_count.h"
#include "server/lab/reduce/cubature.h"
#include "server/lab/reduce/eigen_index.h"
#include "server/lab/reduce/inertia_fields.h"
#include "server/lab/reduce/local_parts.h"
#include "server/lab/reduce/patch_fields.h"
#include "server/lab/reduce/presses.h"
#include "server/lab/reduce/vibrations.h"
#include "server/organs/organ/any_material.h"

namespace trocar::reduce {
namespace {

using organ::LocalPatch;

constexpr double kSlant = 40 * std::numbers::pi / 180;
constexpr std::array kShares{0.5, 1.0};
// Fields of nodes a little beyond a patch count for its modes, too.
constexpr double kFieldMargin_m = 0.008;
// Presses at centres within so many radii count for a patch's modes, and for its cubature.
constexpr double kModeRadii = 3, kCubatureRadii = 1.7;
constexpr std::size_t kMaxCubatureTets = 800;
// The equations of a cubature, one per field and state, are added up with random signs to so many,
// in which residuals are those of all within a few per cent.
constexpr std::size_t kCubatureRows = 2048;

class Builder {
 public:
  Builder(const organ::Organ& organ, const LocalSettings& settings, const LocalProgress& progress,
          std::vector<std::unique_ptr<FullModel>> models, LocalParts parts)
      : organ_(organ),
        settings_(settings),
        progress_(progress),
        normals_(mesh::surface_normals(organ.mesh)),
        models_(std::move(models)),
        accessible_(accessible_nodes(organ, settings.patch_radius_m)),
        parts_(std::move(parts)) {
    std::ranges::sort(accessible_);
  }

  Result<LocalBuilt> build() {
    if (accessible_.empty())
      return Error{ErrorCode::BadFile, organ_.name + ": has no surface that is not held"};
    auto& r = built_.reduction;
    r.source = organ_.name + ", " + std::to_string(settings_.modes) + " + " +
               std::to_string(settings_.inertia_modes) + " modes, patches of " +
               std::to_string(std::lround(settings_.patch_radius_m * 1e3)) + " mm, seed " +
               std::to_string(settings_.seed);
    r.mesh_hash = organ::mesh_hash(organ_);
    r.elasticity_hash = organ::elasticity_hash(organ_);
    r.node_count = static_cast<std::uint32_t>(organ_.mesh.node_count());
    r.force_n = settings_.force_n;
    r.free_layers = settings_.free_layers;
    choose_patches();
    for (const auto& patch : r.patches)
      if (const auto count = settings_.modes + settings_.inertia_modes + settings_.vibrations +
                             3 * patch.reach.size();
          count > organ::kMaxLocalFields)
        return Error{ErrorCode::Usage, "--patch-radius: a patch would have " +
                                           std::to_string(count) + " fields, at most " +
                                           std::to_string(organ::kMaxLocalFields) +
                                           " are possible: make it smaller"};
    find_greens();
    press_centres();
    if (!status_) return status_.error();
    find_vibrations();
    auto& patches = r.patches;
    built_.nonlinear.resize(patches.size());
    built_.residuals.resize(patches.size());
    for_each(LocalStage::Patches, patches.size(),
             [&](FullModel& model, std::size_t i) { return take_or_make(model, i); });
    if (!status_) return status_.error();
    return std::move(built_);
  }

 private:
  const Vec3d& at(NodeIndex node) const { return organ_.mesh.rest_positions[node.value]; }
  double distance(NodeIndex a, NodeIndex b) const { return length(at(a) - at(b)); }
  bool is_accessible(NodeIndex node) const { return std::ranges::binary_search(accessible_, node); }

  // Items in any order, each by one thread with its model.
  template <typename Work>
  void for_each(LocalStage stage, std::size_t count, Work&& work) {
    std::atomic<std::size_t> next{0};
    std::size_t done = 0;
    std::mutex mutex;
    const auto run = [&](FullModel& model) {
      for (std::size_t i = next++; i < count; i = next++) {
        const Status done_well = work(model, i);
        const std::scoped_lock lock(mutex);
        if (!done_well && status_.ok()) status_ = done_well;
        if (!status_) return;
        ++done;
        if (progress_) progress_(stage, done, count);
      }
    };
    std::vector<std::jthread> others;
    for (std::size_t i = 1; i < models_.size(); ++i)
      others.emplace_back([&, i] { run(*models_[i]); });
    run(*models_[0]);
  }

  void choose_patches() {
    // Farthest first, until every node is within the radius of a centre.
    std::vector<double> far(accessible_.size(), std::numeric_limits<double>::infinity());
    std::vector<NodeIndex> centres, owner(accessible_.size());
    std::size_t next = settings_.seed % accessible_.size();
    do {
      const auto centre = accessible_[next];
      centres.push_back(centre);
      for (std::size_t i = 0; i < accessible_.size(); ++i)
        if (const double d = distance(accessible_[i], centre); d < far[i])
          far[i] = d, owner[i] = centre;
      next = static_cast<std::size_t>(std::ranges::max_element(far) - far.begin());
    } while (far[next] > settings_.patch_radius_m);
    const auto first = centres.front();
    std::ranges::stable_sort(centres, {}, [&](NodeIndex c) { return distance(c, first); });
    if (settings_.patches > 0 && settings_.patches < centres.size())
      centres.resize(settings_.patches);
    for (const auto centre : centres) {
      auto& patch = built_.reduction.patches.emplace_back();
      patch.centre = centre;
      for (std::size_t i = 0; i < accessible_.size(); ++i)
        if (owner[i] == centre) patch.members.push_back(accessible_[i]);
      patch.reach = patch.members;
      for (const auto node : patch.members)
        for (const auto other : organ_.mesh.node_neighbours[node])
          if (is_accessible(other)) patch.reach.push_back(other);
      std::ranges::sort(patch.reach);
      patch.reach.erase(std::unique(patch.reach.begin(), patch.reach.end()), patch.reach.end());
    }
  }

  // The centre, and nodes spread around it.
  std::vector<NodeIndex> field_nodes(const LocalPatch& patch) const {
    std::vector<NodeIndex> near;
    for (const auto node : accessible_)
      if (node != patch.centre &&
          distance(node, patch.centre) <= settings_.patch_radius_m + kFieldMargin_m)
        near.push_back(node);
    const std::array taken{patch.centre};
    auto nodes = spread_nodes(organ_, near, settings_.field_nodes - 1, 0, taken);
    nodes.push_back(patch.centre);
    return nodes;
  }

  void find_greens() {
    std::vector<NodeIndex> nodes;
    for (const auto& patch : built_.reduction.patches) {
      nodes.insert(nodes.end(), patch.reach.begin(), patch.reach.end());
      const auto fields = field_nodes(patch);
      nodes.insert(nodes.end(), fields.begin(), fields.end());
    }
    std::ranges::sort(nodes);
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    auto& greens = built_.reduction.greens;
    greens.resize(nodes.size());
    for_each(LocalStage::Greens, nodes.size(), [&](FullModel& model, std::size_t i) -> Status {
      const auto length = model.dof_count();
      Matrix unit = Matrix::Zero(index(length), 3);
      unit.middleRows<3>(3 * static_cast<Eigen::Index>(nodes[i].value)).setIdentity();
      const Matrix found = model.linear_displacements(unit);
      greens[i].node = nodes[i];
      for (std::size_t axis = 0; axis < 3; ++axis)
        greens[i].fields[axis] = organ::pack_field({found.data() + axis * length, length});
      return Status{};
    });
  }

  Matrix greens_of(NodeIndex node) const {
    const auto& greens = built_.reduction.greens;
    const auto found = std::ranges::lower_bound(greens, node, {}, &organ::GreensFunction::node);
    TROCAR_ASSERT(found != greens.end() && found->node == node);
    Matrix fields(3 * index(organ_.mesh.node_count()), 3);
    for (std::size_t axis = 0; axis < 3; ++axis)
      unpack(found->fields[axis], fields.col(index(axis)));
    return fields;
  }

  void press_centres() {
    const auto& patches = built_.reduction.patches;
    pressed_.resize(patches.size());
    if (settings_.directions == 0) return;
    for_each(LocalStage::Presses, patches.size(), [&](FullModel& model, std::size_t i) -> Status {
      if (auto known = parts_.read_pressed(i, model.dof_count())) {
        pressed_[i] = std::move(*known);
        return {};
      }
      const auto node = patches[i].centre;
      for (const Vec3d& direction : press_directions(normals_[node.value], i * settings_.directions,
                                                     settings_.directions, kSlant)) {
        auto found =
            model.displacements(model.forces_of({node, direction * settings_.force_n}), kShares);
        pressed_[i].failed += kShares.size() - found.size();
        std::ranges::move(found, std::back_inserter(pressed_[i].fields));
      }
      return parts_.write(i, pressed_[i]);
    });
    for (std::size_t i = 0; i < patches.size(); ++i) {
      built_.pressed.push_back(patches[i].centre);
      built_.failed += pressed_[i].failed;
    }
  }

  // Fields of presses at centres within a distance.
  std::vector<Vector> presses_near(const LocalPatch& patch, double radius_m) const {
    std::vector<Vector> near;
    const auto& patches = built_.reduction.patches;
    for (std::size_t i = 0; i < patches.size(); ++i)
      if (distance(patches[i].centre, patch.centre) <= radius_m)
        near.insert(near.end(), pressed_[i].fields.begin(), pressed_[i].fields.end());
    return near;
  }

  // The slowest ones, orthonormal and as they will be read.
  void find_vibrations() {
    const auto found = slowest_vibrations(*models_[0], settings_.vibrations);
    vibrations_.resize(found.modes.rows(), found.modes.cols());
    for (Eigen::Index i = 0; i < found.modes.cols(); ++i) {
      vibrations_.col(i) = orthogonal_to(vibrations_.leftCols(i), found.modes.col(i).normalized())
                               .col(0)
                               .normalized();
    }
    add_packed(vibrations_, built_.reduction.vibrations);
  }

  Status take_or_make(FullModel& model, std::size_t number) {
    auto& patch = built_.reduction.patches[number];
    find_inner_tets(patch);
    if (auto known = parts_.read_patch(number)) {
      patch.modes = std::move(known->modes);
      patch.cubature = std::move(known->cubature);
      patch.outer_stiffness = std::move(known->outer_stiffness);
      patch.mass = std::move(known->mass);
      built_.nonlinear[number] = known->nonlinear;
      built_.residuals[number] = known->residual;
      return {};
    }
    make(model, number);
    return parts_.write(number, {patch.modes, patch.cubature, patch.outer_stiffness, patch.mass,
                                 built_.nonlinear[number], built_.residuals[number]});
  }

  void make(FullModel& model, std::size_t number) {
    auto& patch = built_.reduction.patches[number];
    const auto nodes = field_nodes(patch);
    const auto presses = presses_near(patch, kModeRadii * settings_.patch_radius_m);
    auto states = presses_near(patch, kCubatureRadii * settings_.patch_radius_m);
    Matrix fields(index(model.dof_count()), index(9 * nodes.size() + presses.size()));
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const Matrix series = series_of(model, greens_of(nodes[i]), settings_.force_n);
      fields.middleCols(index(9 * i), 9) = series;
      const Vec3d& n = normals_[nodes[i].value];
      if (auto state = state_of(model, series, {-n.x, -n.y, -n.z}))
        states.push_back(std::move(*state));
    }
    for (std::size_t i = 0; i < presses.size(); ++i)
      fields.col(index(9 * nodes.size() + i)) = presses[i];
    add_packed(karhunen_loeve(orthogonal_to(vibrations_, std::move(fields)), settings_.modes).modes,
               patch.modes);
    add_packed(inertia_of(model, patch, nodes), patch.modes);
    // The fields are unpacked, as they will be read.
    Matrix basis(index(model.dof_count()), index(built_.reduction.field_count(patch)));
    Eigen::Index count = 0;
    for (const auto* shared : {&built_.reduction.vibrations, &patch.modes})
      for (const auto& mode : *shared) unpack(mode, basis.col(count++));
    for (const auto node : patch.reach) {
      basis.middleCols(count, 3) = greens_of(node);
      count += 3;
    }
    patch.outer_stiffness = lower(outer_stiffness(model, patch, basis));
    Matrix weighted = basis;
    for (Eigen::Index i = 0; i < basis.rows(); ++i)
      weighted.row(i) *= organ_.node_masses_kg[static_cast<std::size_t>(i / 3)];
    patch.mass = lower(basis.transpose() * weighted);
    find_patch_cubature(model, number, basis, states);
  }

  static void add_packed(const Matrix& fields, std::vector<organ::PackedField>& packed) {
    for (Eigen::Index i = 0; i < fields.cols(); ++i)
      packed.push_back(
          organ::pack_field({fields.col(i).data(), static_cast<std::size_t>(fields.rows())}));
  }

  // Returns what inertia adds to fields of forces at these nodes, beyond what the patch has.
  Matrix inertia_of(FullModel& model, const LocalPatch& patch,
                    std::span<const NodeIndex> nodes) const {
    const auto modes = index(patch.modes.size());
    Matrix fields(index(model.dof_count()), index(3 * nodes.size())),
        known(index(model.dof_count()), modes + index(3 * patch.reach.size()));
    for (std::size_t i = 0; i < nodes.size(); ++i)
      fields.middleCols(index(3 * i), 3) = greens_of(nodes[i]);
    for (std::size_t i = 0; i < patch.modes.size(); ++i)
      unpack(patch.modes[i], known.col(index(i)));
    // In units of the modes.
    for (std::size_t i = 0; i < patch.reach.size(); ++i)
      known.middleCols(modes + index(3 * i), 3) = greens_of(patch.reach[i]).colwise().normalized();
    return inertia_modes(model, fields, vibrations_, known, settings_.inertia_modes);
  }

  // All tets of nodes that can be free.
  void find_inner_tets(LocalPatch& patch) const {
    const auto& mesh = organ_.mesh;
    std::vector<std::uint8_t> is_near(mesh.node_count(), 0);
    for (const auto node : patch.members) is_near[node.value] = 1;
    for (std::uint32_t layer = 0; layer < settings_.free_layers; ++layer) {
      const auto before = is_near;
      for (std::uint32_t n = 0; n < before.size(); ++n)
        if (before[n] != 0)
          for (const auto other : mesh.node_neighbours[NodeIndex(n)]) is_near[other.value] = 1;
    }
    for (std::uint32_t t = 0; t < mesh.tets.size(); ++t)
      if (std::ranges::any_of(mesh.tets[t], [&](NodeIndex n) { return is_near[n.value] != 0; }))
        patch.inner_tets.push_back(TetIndex(t));
  }

  static std::vector<double> lower(const Matrix& m) {
    std::vector<double> rows;
    for (Eigen::Index i = 0; i < m.rows(); ++i)
      for (Eigen::Index j = 0; j <= i; ++j) rows.push_back((m(i, j) + m(j, i)) / 2);
    return rows;
  }

  static Matrix outer_stiffness(FullModel& model, const LocalPatch& patch, const Matrix& basis) {
    const auto& numbers = model.free_of_dof();
    const auto tangent = model.rest_tangent();
    Matrix free(tangent.rows(), basis.cols());
    for (std::size_t dof = 0; dof < numbers.size(); ++dof)
      if (numbers[dof] >= 0) free.row(numbers[dof]) = basis.row(index(dof));
    const Matrix product = tangent.selfadjointView<Eigen::Lower>() * free;
    Matrix k = free.transpose() * product;
    for (const auto tet : patch.inner_tets) {
      const TetForces forces(model, tet);
      const Matrix gradients = forces.gradients(basis);
      Matrix stresses(9, basis.cols());
      for (Eigen::Index c = 0; c < basis.cols(); ++c)
        Eigen::Map<Matrix3>(stresses.col(c).data()) =
            forces.linear_stress(Eigen::Map<const Matrix3>(gradients.col(c).data()));
      k.noalias() -= forces.volume() * gradients.transpose() * stresses;
    }
    return k;
  }

  void find_patch_cubature(FullModel& model, std::size_t number, const Matrix& basis,
                           const std::vector<Vector>& states) {
    auto& patch = built_.reduction.patches[number];
    std::vector<TetIndex> outer;
    for (std::uint32_t t = 0; t < organ_.mesh.tets.size(); ++t)
      if (!std::ranges::binary_search(patch.inner_tets, TetIndex(t))) outer.push_back(TetIndex(t));
    if (settings_.residual == 0) {
      for (const auto tet : outer) patch.cubature.push_back({tet, 1});
      return;
    }
    const auto fields = basis.cols();
    // Every field in units of the forces that it bears in these states.
    Matrix whole(fields, index(states.size()));
    for (std::size_t s = 0; s < states.size(); ++s) {
      const auto forces = model.resistance(states[s]);
      TROCAR_ASSERT(forces.has_value());
      whole.col(index(s)) = basis.transpose() * *forces;
    }
    Vector scale = whole.rowwise().norm();
    const double least = 1e-3 * scale.maxCoeff();
    scale = scale.cwiseMax(least).cwiseInverse();
    const double norm = (scale.asDiagonal() * whole).norm();
    const auto rows = std::min(kCubatureRows, static_cast<std::size_t>(fields) * states.size());
    Eigen::MatrixXf a = Eigen::MatrixXf::Zero(index(rows), index(outer.size()));
    Vector sums = Vector::Zero(index(rows));
    for (std::size_t o = 0; o < outer.size(); ++o) {
      const TetForces forces(model, outer[o]);
      const Matrix gradients = forces.gradients(basis);
      Vector column = Vector::Zero(index(rows));
      for (std::size_t s = 0; s < states.size(); ++s) {
        const auto stress = forces.nonlinear_stress(forces.gradient(states[s]));
        if (!stress) continue;
        const Eigen::Map<const Eigen::Matrix<double, 9, 1>> p(stress->data());
        const Vector part = scale.cwiseProduct(forces.volume() * (gradients.transpose() * p));
        for (Eigen::Index c = 0; c < fields; ++c) {
          const auto hash =
              splitmix64(s * static_cast<std::size_t>(fields) + static_cast<std::size_t>(c));
          const double sign = (hash & 1) != 0 ? 1 : -1;
          column[index((hash >> 1) % rows)] += sign * part[c];
        }
      }
      a.col(index(o)) = column.cast<float>();
      sums += column;
    }
    built_.nonlinear[number] = sums.norm() / norm;
    if (sums.isZero(0)) return;
    const auto found =
        find_cubature(a, sums, settings_.residual * norm / sums.norm(), kMaxCubatureTets);
    for (std::size_t i = 0; i < found.columns.size(); ++i)
      patch.cubature.push_back({outer[found.columns[i]], static_cast<float>(found.weights[i])});
    built_.residuals[number] = found.residual * sums.norm() / norm;
  }

  const organ::Organ& organ_;
  const LocalSettings& settings_;
  const LocalProgress& progress_;
  const std::vector<Vec3d> normals_;
  const std::vector<std::unique_ptr<FullModel>> models_;  // one per thread
  std::vector<NodeIndex> accessible_;                     // ascending
  std::vector<Pressed> pressed_;                          // per patch
  Matrix vibrations_;                                     // a column each
  const LocalParts parts_;
  Status status_;  // of writing parts
  LocalBuilt built_;
};

// Names what the result depends on, in one line.
std::string key_of(const organ::Organ& organ, const LocalSettings& s) {
  char text[400];
  std::snprintf(
      text, sizeof text,
      "local 3, organ %016" PRIx64 " %016" PRIx64 " %016" PRIx64
      ", modes %zu + %zu, vibrations %zu, radius %a, layers %u, force %a, directions %zu, "
      "field nodes %zu, residual %a, patches %zu, seed %" PRIu64,
      organ::organ_hash(organ), organ::mesh_hash(organ), organ::elasticity_hash(organ), s.modes,
      s.inertia_modes, s.vibrations, s.patch_radius_m, s.free_layers, s.force_n, s.directions,
      s.field_nodes, s.residual, s.patches, s.seed);
  return text;
}

}  // namespace

Status validate(const LocalSettings& s) {
  const auto wrong = [](const std::string& what) { return Error{ErrorCode::Usage, what}; };
  if (auto c = check_count("--modes", s.modes, 1, organ::kMaxReducedModes); !c) return c;
  if (s.inertia_modes > organ::kMaxReducedModes - s.modes)
    return wrong("--modes and --inertia-modes: " + std::to_string(s.modes) + " and " +
                 std::to_string(s.inertia_modes) + ", together at most " +
                 std::to_string(organ::kMaxReducedModes));
  if (auto c = check_count("--vibrations", s.vibrations, 0, organ::kMaxReducedModes); !c) return c;
  if (auto c = check_count("--free-layers", s.free_layers, 0, organ::kMaxFreeLayers); !c) return c;
  if (auto c = check_count("--directions", s.directions, 0, 20); !c) return c;
  if (auto c = check_count("--field-nodes", s.field_nodes, 1, 100); !c) return c;
  if (auto c = check_count("--patches", s.patches, 0, organ::kMaxLocalPatches); !c) return c;
  if (auto c = check_count("--threads", s.threads, 1, kMaxWorkers); !c) return c;
  if (!(s.force_n > 0 && s.force_n <= organ::kMaxLocalForce_n))
    return wrong("--force: must be above 0, at most " +
                 std::to_string(std::lround(organ::kMaxLocalForce_n)) + " N");
  if (!(s.patch_radius_m >= 1e-3 && s.patch_radius_m <= 0.2))
    return wrong("--patch-radius: must be from 1 to 200 mm");
  if (!(s.residual >= 0 && s.residual <= 0.1)) return wrong("--residual: must be from 0 to 0.1");
  return {};
}

Result<LocalBuilt> build_local(const organ::Organ& organ, const LocalSettings& settings,
                               const LocalProgress& progress) {
  if (organ::any_material(organ, [](const material::Material& m) {
        return m.elastic_law == material::ElasticLaw::Measured &&
               m.measured.split != material::VolumeSplit::Unsplit;
      }))
    return Error{ErrorCode::BadFile,
                 organ.name + ": has a measured law that is split, which sessions do not have"};
  std::vector<std::unique_ptr<FullModel>> models;
  for (unsigned i = 0; i < settings.threads; ++i) {
    auto model = FullModel::create(organ);
    if (!model) return model.error();
    models.push_back(std::move(*model));
  }
  LocalParts parts;
  if (!settings.parts.empty()) {
    auto opened = LocalParts::open(settings.parts, key_of(organ, settings));
    if (!opened) return opened.error();
    parts = std::move(*opened);
  }
  return Builder(organ, settings, progress, std::move(models), std::move(parts)).build();
}

}  // namespace trocar::reduce
