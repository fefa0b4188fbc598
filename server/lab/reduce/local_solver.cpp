#include "server/lab/reduce/local_solver.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "server/lab/reduce/eigen_index.h"
#include "server/lab/reduce/karhunen_loeve.h"
#include "server/tissue/reduction/element_set.h"

namespace trocar::reduce {
namespace {

using RowMatrixF = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using VectorF = Eigen::VectorXf;

constexpr int kMaxIterations = 60, kMaxHalvings = 10;
// A step that moves no node near the contact by more than this part of the farthest one's way was
// the last: single precision is not far below.
constexpr float kSettled = 1e-4F;
// Part of the loads that may be left where no step makes it less.
constexpr double kNearlySettled = 1e-3;
// A tangent is made anew when an iteration with it leaves more than this part of the residual.
constexpr double kSlow = 0.35;

double entry(const std::vector<double>& lower, std::size_t i, std::size_t j) {
  return i >= j ? lower[i * (i + 1) / 2 + j] : lower[j * (j + 1) / 2 + i];
}

// On the diagonal where a tangent is not positive definite, the last of which makes any so that is
// without its stress.
constexpr std::array kShifts{1e-9, 1e-6, 1e-3};
// A later patch's mode is kept if it has this share of its own, beside what is there already.
constexpr float kNewInField = 0.05F;

template <typename T>
void sort_once(std::vector<T>& values) {
  std::ranges::sort(values);
  values.erase(std::unique(values.begin(), values.end()), values.end());
}

}  // namespace

// A place says where one patch's nodes are touched.
struct LocalSolver::Place {
  const organ::LocalPatch* patch;
  std::vector<NodeIndex> touched;
};

struct LocalSolver::Contact {
  // A field of the basis and where it stands among its patch's.
  struct Field {
    const organ::PackedField* packed;
    std::size_t at;
  };
  // rest: the tangent at rest of all tets over all nodes, for contacts of several patches.
  Contact(const organ::LocalReduction& reduction, const organ::Organ& organ,
          std::span<const Place> places,
          const std::function<const reduction::BlockMatrix&()>& rest) {
    choose_fields(reduction, places);
    if (places.size() > 1) drop_repeated_fields();
    choose_nodes(organ, places, reduction.free_layers);
    inner = reduction::ElementSet(organ, inner_tets, {}, nodes);
    outer = reduction::ElementSet(organ, outer_tets, outer_weights, nodes);
    std::vector<reduction::BlockMatrix::Pair> pairs;
    inner.add_pairs(pairs);
    for (std::uint32_t n = 0; n < nodes.size(); ++n) pairs.push_back({n, n});
    tangent = reduction::BlockMatrix(nodes.size(), std::move(pairs));
    phi.resize(index(3 * nodes.size()), index(fields.size()));
    for (std::size_t n = 0; n < nodes.size(); ++n)
      for (std::size_t k = 0; k < 3; ++k)
        for (std::size_t c = 0; c < fields.size(); ++c)
          phi(index(3 * n + k), index(c)) =
              static_cast<float>(fields[c].packed->values[3 * nodes[n].value + k]) *
              fields[c].packed->step;
    std::vector<reduction::BlockMatrix::Pair> outer_pairs;
    outer.add_pairs(outer_pairs);
    outer_tangent = reduction::BlockMatrix(nodes.size(), std::move(outer_pairs));
    outer.add_rest_tangent(outer_tangent);
    outer_at_rest = among_fields(outer_tangent);
    stiffness = places.size() == 1 ? stored_stiffness(places[0].patch->outer_stiffness)
                                   : stiffness_of_several(rest());
    q = Vector::Zero(index(fields.size()));
    a = Vector::Zero(index(3 * free.size()));
    u.assign(3 * nodes.size(), 0);
  }

  void choose_fields(const organ::LocalReduction& reduction, std::span<const Place> places) {
    const auto shared = reduction.vibrations.size();
    for (const auto& [patch, touched] : places)
      for (const auto node : touched) {
        const auto at = static_cast<std::size_t>(std::ranges::lower_bound(patch->reach, node) -
                                                 patch->reach.begin());
        const auto greens =
            std::ranges::lower_bound(reduction.greens, node, {}, &organ::GreensFunction::node);
        for (std::size_t axis = 0; axis < 3; ++axis)
          fields.push_back({&greens->fields[axis], shared + patch->modes.size() + 3 * at + axis});
      }
    greens_count = fields.size();
    for (std::size_t i = 0; i < shared; ++i) fields.push_back({&reduction.vibrations[i], i});
    for (const auto& [patch, touched] : places)
      for (std::size_t i = 0; i < patch->modes.size(); ++i)
        fields.push_back({&patch->modes[i], shared + i});
  }

  // Patches beside each other have modes that are nearly the same: only what is new in one stays.
  void drop_repeated_fields() {
    const Eigen::MatrixXf all = all_fields();
    Eigen::MatrixXf kept(all.rows(), all.cols());
    Eigen::Index count = 0;
    std::vector<Field> left;
    for (std::size_t i = 0; i < fields.size(); ++i) {
      VectorF field = all.col(index(i)).normalized();
      for (int twice = 0; twice < 2; ++twice)
        field -= kept.leftCols(count) * (kept.leftCols(count).transpose() * field);
      if (i >= greens_count && field.norm() < kNewInField) continue;
      kept.col(count++) = field.normalized();
      left.push_back(fields[i]);
    }
    fields = std::move(left);
  }
  RowMatrixF all_fields() const {
    RowMatrixF all(index(fields.front().packed->values.size()), index(fields.size()));
    for (std::size_t c = 0; c < fields.size(); ++c)
      for (std::size_t i = 0; i < fields[c].packed->values.size(); ++i)
        all(index(i), index(c)) =
            static_cast<float>(fields[c].packed->values[i]) * fields[c].packed->step;
    return all;
  }

  void choose_nodes(const organ::Organ& organ, std::span<const Place> places,
                    std::uint32_t layers) {
    const auto add = [&](TetIndex tet) {
      for (const auto node : organ.mesh.tets[tet.value]) nodes.push_back(node);
    };
    std::vector<NodeIndex> near;
    for (const auto& [patch, touched] : places) {
      near.insert(near.end(), touched.begin(), touched.end());
      inner_tets.insert(inner_tets.end(), patch->inner_tets.begin(), patch->inner_tets.end());
    }
    sort_once(inner_tets);
    // From each patch's weighted tets those that are nearest to it are taken, so that all are of
    // one energy.
    const auto distance = [&](TetIndex tet, const organ::LocalPatch* patch) {
      const auto& x = organ.mesh.rest_positions;
      return length_squared(x[organ.mesh.tets[tet.value][0].value] - x[patch->centre.value]);
    };
    for (const auto& place : places)
      for (const auto& [tet, weight] : place.patch->cubature) {
        const double own = distance(tet, place.patch);
        if (std::ranges::binary_search(inner_tets, tet) ||
            std::ranges::any_of(places, [&, tet = tet](const Place& other) {
              const double theirs = distance(tet, other.patch);
              return theirs < own || (theirs == own && &other < &place);
            }))
          continue;
        outer_tets.push_back(tet);
        outer_weights.push_back(weight);
      }
    for (const auto tet : inner_tets) add(tet);
    for (const auto tet : outer_tets) add(tet);
    sort_once(nodes);
    for (std::uint32_t layer = 0; layer < layers; ++layer) {
      const std::size_t count = near.size();
      for (std::size_t i = 0; i < count; ++i)
        for (const auto other : organ.mesh.node_neighbours[near[i]]) near.push_back(other);
      sort_once(near);
    }
    // A free node's tets are all there as they are.
    const auto is_inner = [&](TetIndex tet) { return std::ranges::binary_search(inner_tets, tet); };
    for (const auto node : near)
      if (!std::ranges::binary_search(organ.fixed_nodes, node) &&
          std::ranges::all_of(organ.mesh.node_tets[node], is_inner))
        free.push_back(local(node));
  }

  Matrix stored_stiffness(const std::vector<double>& lower) const {
    Matrix k(index(fields.size()), index(fields.size()));
    for (std::size_t i = 0; i < fields.size(); ++i)
      for (std::size_t j = 0; j < fields.size(); ++j)
        k(index(i), index(j)) = entry(lower, fields[i].at, fields[j].at);
    return k;
  }

  // Returns the stiffness of all tets at rest less that of the inner ones.
  Matrix stiffness_of_several(const reduction::BlockMatrix& rest) {
    const RowMatrixF all = all_fields();
    tangent.clear();
    inner.add_rest_tangent(tangent);
    // The difference is small beside the two.
    const auto quadratic = [](const reduction::BlockMatrix& k, const RowMatrixF& b) {
      return Matrix(b.cast<double>().transpose() * product(k, b).cast<double>());
    };
    return quadratic(rest, all) - quadratic(tangent, phi);
  }

  Matrix among_fields(const reduction::BlockMatrix& k) const {
    const Eigen::MatrixXf among = phi.transpose() * product(k, phi);
    return among.cast<double>();
  }

  static RowMatrixF product(const reduction::BlockMatrix& k, const RowMatrixF& b) {
    RowMatrixF kb = RowMatrixF::Zero(b.rows(), b.cols());
    for (std::size_t row = 0; row < k.node_count(); ++row) {
      const auto columns = k.columns(row);
      const auto blocks = k.blocks(row);
      for (std::size_t i = 0; i < columns.size(); ++i)
        kb.middleRows<3>(index(3 * row)).noalias() +=
            Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(blocks[i].data()) *
            b.middleRows<3>(index(3 * columns[i]));
    }
    return kb;
  }

  std::uint32_t local(NodeIndex node) const {
    const auto found = std::ranges::lower_bound(nodes, node);
    TROCAR_ASSERT(found != nodes.end() && *found == node);
    return static_cast<std::uint32_t>(found - nodes.begin());
  }

  std::size_t unknowns() const { return fields.size() + 3 * free.size(); }

  void place(const Vector& at_q, const Vector& at_a) {
    Eigen::Map<VectorF> all(u.data(), index(u.size()));
    all.noalias() = phi * at_q.cast<float>();
    for (std::size_t i = 0; i < free.size(); ++i)
      for (std::size_t k = 0; k < 3; ++k)
        u[3 * free[i] + k] += static_cast<float>(at_a[index(3 * i + k)]);
  }

  // Returns what is left of the loads, per unknown.
  Vector residual(std::span<const NodeForce> forces, std::span<const NodeSpring> springs) {
    place(q, a);
    f.assign(u.size(), 0);
    inner.add_forces(reduction::ForcePart::Whole, u, f);
    const auto push = [&](NodeIndex node, const Vec3d& force) {
      float* at = f.data() + 3 * local(node);
      at[0] -= static_cast<float>(force.x);
      at[1] -= static_cast<float>(force.y);
      at[2] -= static_cast<float>(force.z);
    };
    for (const auto& [node, force] : forces) push(node, force);
    for (const auto& spring : springs)
      push(spring.node, (spring.target_m - displacement(spring.node)) * spring.stiffness_n_m);
    Vector r(index(unknowns()));
    for (std::size_t i = 0; i < free.size(); ++i)
      for (std::size_t k = 0; k < 3; ++k)
        r[index(fields.size() + 3 * i + k)] = -static_cast<double>(f[3 * free[i] + k]);
    outer.add_forces(reduction::ForcePart::Nonlinear, u, f);
    const VectorF along = phi.transpose() * Eigen::Map<const VectorF>(f.data(), index(f.size()));
    r.head(index(fields.size())) = -(along.cast<double>() + stiffness * q);
    return r;
  }

  // Returns the norm of the loads over the unknowns.
  double norm_of(std::span<const NodeForce> forces, std::span<const NodeSpring> springs) const {
    Vector loads = Vector::Zero(index(unknowns()));
    const auto add = [&](NodeIndex node, const Vec3d& force) {
      const auto at = local(node);
      const Eigen::Vector3d load(force.x, force.y, force.z);
      loads.head(index(fields.size())) +=
          phi.middleRows<3>(index(3 * at)).cast<double>().transpose() * load;
      const auto found = std::ranges::find(free, at);
      if (found != free.end())
        loads.segment<3>(
            index(fields.size() + 3 * static_cast<std::size_t>(found - free.begin()))) += load;
    };
    for (const auto& [node, force] : forces) add(node, force);
    for (const auto& spring : springs)
      add(spring.node, (spring.target_m - displacement(spring.node)) * spring.stiffness_n_m);
    return loads.norm();
  }

  void make_factors(std::span<const NodeSpring> springs) {
    for (const bool with_stress : {true, false}) {
      tangent.clear();
      inner.add_tangent(u, with_stress, tangent);
      for (const auto& spring : springs) {
        auto& block = tangent.at(local(spring.node), local(spring.node));
        for (const std::size_t i : {0, 4, 8}) block[i] += static_cast<float>(spring.stiffness_n_m);
      }
      const auto m = index(fields.size());
      const RowMatrixF stiff = product(tangent, phi);
      Matrix h = Matrix::Zero(index(unknowns()), index(unknowns()));
      const Eigen::MatrixXf of_fields = phi.transpose() * stiff;
      h.topLeftCorner(m, m) = stiffness + of_fields.cast<double>();
      if (with_stress) {
        outer_tangent.clear();
        outer.add_tangent(u, true, outer_tangent);
        h.topLeftCorner(m, m) += among_fields(outer_tangent) - outer_at_rest;
      }
      for (std::size_t i = 0; i < free.size(); ++i) {
        h.block(m + index(3 * i), 0, 3, m) = stiff.middleRows<3>(index(3 * free[i])).cast<double>();
        for (std::size_t j = 0; j < free.size(); ++j) {
          const auto columns = tangent.columns(free[i]);
          const auto found = std::ranges::lower_bound(columns, free[j]);
          if (found == columns.end() || *found != free[j]) continue;
          const auto& block =
              tangent.blocks(free[i])[static_cast<std::size_t>(found - columns.begin())];
          h.block<3, 3>(m + index(3 * i), m + index(3 * j)) =
              Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(block.data())
                  .cast<double>();
        }
      }
      const Vector diagonal = h.diagonal();
      for (const double shift : kShifts) {
        h.diagonal() = diagonal * (1 + shift);
        factors.compute(h);
        if (factors.info() == Eigen::Success) return;
      }
    }
  }

  float farthest_from(const std::vector<float>& other) const {
    float most = 0;
    for (std::size_t i = 0; i < u.size(); ++i) most = std::max(most, std::abs(u[i] - other[i]));
    return most;
  }
  float farthest() const {
    float most = 0;
    for (const float part : u) most = std::max(most, std::abs(part));
    return most;
  }
  Vec3d displacement(NodeIndex node) const {
    const float* at = u.data() + 3 * local(node);
    return {static_cast<double>(at[0]), static_cast<double>(at[1]), static_cast<double>(at[2])};
  }

  std::vector<Field> fields;  // Green's functions, vibrations, then modes
  std::size_t greens_count = 0;
  std::vector<TetIndex> inner_tets, outer_tets;  // of all patches; inner ones ascending
  std::vector<float> outer_weights;
  std::vector<NodeIndex> nodes;     // of the tets; ascending
  std::vector<std::uint32_t> free;  // local
  reduction::ElementSet inner, outer;
  RowMatrixF phi;    // of the fields at the nodes
  Matrix stiffness;  // of the outer tets at rest
  reduction::BlockMatrix tangent, outer_tangent;
  Matrix outer_at_rest;  // of the weighted tets, among the fields
  Eigen::LLT<Matrix> factors;
  bool has_factors = false;
  Vector q, a;
  std::vector<float> u, f;
};

LocalSolver::LocalSolver(const organ::LocalReduction& reduction, const organ::Organ& organ)
    : reduction_(reduction), organ_(organ) {}
LocalSolver::~LocalSolver() = default;

bool LocalSolver::touch(std::span<const NodeIndex> nodes) {
  std::vector<Place> places;
  if (const auto* patch = patch_of(nodes)) {
    places.push_back({patch, {nodes.begin(), nodes.end()}});
  } else {
    for (const auto node : nodes) {
      const auto* home = patch_of(std::span(&node, 1));
      if (home == nullptr) return false;
      auto place = std::ranges::find(places, home, &Place::patch);
      if (place == places.end()) place = places.insert(places.end(), {home, {}});
      place->touched.push_back(node);
    }
    if (places.size() > kMaxPatches) return false;
  }
  contact_ = std::make_unique<Contact>(
      reduction_, organ_, places,
      [this]() -> const reduction::BlockMatrix& { return rest_tangent(); });
  return true;
}

// The patch that the first node belongs to, if it reaches the others; else any that does.
const organ::LocalPatch* LocalSolver::patch_of(std::span<const NodeIndex> nodes) const {
  const organ::LocalPatch* found = nullptr;
  for (const auto& patch : reduction_.patches) {
    if (!std::ranges::all_of(
            nodes, [&](NodeIndex n) { return std::ranges::binary_search(patch.reach, n); }))
      continue;
    if (std::ranges::binary_search(patch.members, nodes.front())) return &patch;
    if (found == nullptr) found = &patch;
  }
  return found;
}

const reduction::BlockMatrix& LocalSolver::rest_tangent() {
  if (rest_tangent_.node_count() > 0) return rest_tangent_;
  std::vector<TetIndex> tets;
  std::vector<NodeIndex> nodes;
  for (std::uint32_t t = 0; t < organ_.mesh.tets.size(); ++t) tets.push_back(TetIndex(t));
  for (std::uint32_t n = 0; n < organ_.mesh.node_count(); ++n) nodes.push_back(NodeIndex(n));
  const reduction::ElementSet all(organ_, tets, {}, nodes);
  std::vector<reduction::BlockMatrix::Pair> pairs;
  all.add_pairs(pairs);
  rest_tangent_ = reduction::BlockMatrix(nodes.size(), std::move(pairs));
  all.add_rest_tangent(rest_tangent_);
  return rest_tangent_;
}

LocalSolver::Sizes LocalSolver::sizes() const {
  if (contact_ == nullptr) return {};
  const auto& c = *contact_;
  return {.modes = c.fields.size() - c.greens_count,
          .greens = c.greens_count,
          .free_nodes = c.free.size(),
          .inner_tets = c.inner.tet_count(),
          .cubature_tets = c.outer.tet_count()};
}

LocalSolver::Report LocalSolver::solve(std::span<const NodeForce> forces,
                                       std::span<const NodeSpring> springs) {
  TROCAR_ASSERT(contact_ != nullptr);
  auto& c = *contact_;
  Report report;
  Vector r = c.residual(forces, springs);
  double before = r.norm();
  std::vector<float> from;
  while (!report.is_converged && before > 0 && report.iterations < kMaxIterations) {
    const bool is_fresh = !c.has_factors;
    if (is_fresh) {
      c.make_factors(springs);
      c.has_factors = true;
      ++report.factors;
    }
    const Vector step = c.factors.solve(r);
    const Vector q = c.q, a = c.a;
    from = c.u;
    double part = 1, after = 0;
    for (int halvings = 0; halvings <= kMaxHalvings; ++halvings) {
      if (halvings > 0) part /= 2;
      c.q = q + part * step.head(q.size());
      c.a = a + part * step.tail(a.size());
      r = c.residual(forces, springs);
      after = r.norm();
      if (after < before) break;
    }
    ++report.iterations;
    const float moved = c.farthest_from(from), far = c.farthest();
    if (moved <= kSettled * far * static_cast<float>(part)) {
      report.is_converged = true;
    } else if (after >= before) {
      c.q = q, c.a = a;
      r = c.residual(forces, springs);
      if (is_fresh) {
        // It gets no nearer in single precision.
        report.is_converged = before <= kNearlySettled * c.norm_of(forces, springs);
        break;
      }
      c.has_factors = false;
      continue;
    }
    if (part < 1 || after > kSlow * before) c.has_factors = false;
    before = after;
  }
  report.is_converged = report.is_converged || before == 0;
  report.residual_n = before;
  return report;
}

Vec3d LocalSolver::displacement(NodeIndex node) const {
  return contact_->displacement(node);
}

std::vector<Vec3d> LocalSolver::displacements() const {
  const auto& c = *contact_;
  std::vector<Vec3d> all(organ_.mesh.node_count());
  for (std::size_t i = 0; i < c.fields.size(); ++i) {
    const auto& field = *c.fields[i].packed;
    const double step = c.q[index(i)] * static_cast<double>(field.step);
    for (std::size_t n = 0; n < all.size(); ++n) {
      all[n].x += step * field.values[3 * n];
      all[n].y += step * field.values[3 * n + 1];
      all[n].z += step * field.values[3 * n + 2];
    }
  }
  for (std::size_t i = 0; i < c.free.size(); ++i)
    all[c.nodes[c.free[i]].value] +=
        Vec3d{c.a[index(3 * i)], c.a[index(3 * i + 1)], c.a[index(3 * i + 2)]};
  return all;
}

}  // namespace trocar::reduce
