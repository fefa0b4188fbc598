#include "server/papers/dogan/build.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

#include "server/papers/dogan/check_count.h"
#include "server/papers/dogan/reduced_model.h"

namespace trocar::dogan {

namespace {

constexpr double kSlant = 40 * std::numbers::pi / 180;
// These times are of 20 s. They are steps of the full model, so that the fast term of table 1 (0.58
// s) is followed.
constexpr std::array kCreepTimes{0.0, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0,  1.5, 2.0,
                                 3.0, 4.0, 5.5, 7.5,  10., 13.,  16.5, 20.0};
// A neighbour that moves less than this part of the loaded node has no growth of its own.
constexpr double kLeastMove = 0.05;

double error_in_modes(const Vector& projected, double norm_squared, const Vector& xi) {
  // Modes are orthonormal: what they cannot show, and what the solution has wrong among them.
  const double outside = std::max(0.0, norm_squared - projected.squaredNorm());
  return std::sqrt((outside + (projected - xi).squaredNorm()) / norm_squared);
}

// All that the scan of tangents needs of the training.
struct ReducedTraining {
  Matrix forces, projected;  // modes x snapshots
  Vector norms_squared;

  ReducedTraining(const FullModel& model, const Training& training, const Matrix& modes)
      : forces(modes.cols(), static_cast<Eigen::Index>(training.snapshots.size())),
        projected(forces.rows(), forces.cols()),
        norms_squared(forces.cols()) {
    for (Eigen::Index i = 0; i < forces.cols(); ++i) {
      const auto& snapshot = training.snapshots[static_cast<std::size_t>(i)];
      forces.col(i) = modes.transpose() * model.forces_of(snapshot.press);
      projected.col(i) = modes.transpose() * snapshot.displacements;
      norms_squared[i] = snapshot.displacements.squaredNorm();
      TROCAR_ASSERT(norms_squared[i] > 0);
    }
  }
  // Infinity where the tangent is not positive definite.
  double error_of(const Matrix& tangent) const {
    const Eigen::LLT<Matrix> factors(tangent);
    if (factors.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
    double sum = 0;
    for (Eigen::Index i = 0; i < forces.cols(); ++i)
      sum += error_in_modes(projected.col(i), norms_squared[i], factors.solve(forces.col(i)));
    return sum / static_cast<double>(forces.cols());
  }
};

std::string source_of(const organ::Organ& organ, const Training& training,
                      const Settings& settings) {
  char text[120];
  std::snprintf(text, sizeof text,
                ", %zu snapshots at %zu sites, up to %g N on patches of %g mm, seed %llu",
                training.snapshots.size(), training.places.size(), settings.force_n,
                1e3 * settings.radius_m, static_cast<unsigned long long>(settings.seed));
  return organ.name + text;
}

std::vector<double> numbers_of(const Matrix& matrix) {
  return {matrix.data(), matrix.data() + matrix.size()};
}

Vector at_node(const Vector& all, NodeIndex node) {
  return all.segment<3>(3 * static_cast<Eigen::Index>(node.value));
}

// Returns the displacement at each time along that at once, over it.
std::vector<double> growth_of(const std::vector<Vector>& displacements) {
  std::vector<double> growth{1};
  for (std::size_t i = 1; i < displacements.size(); ++i)
    growth.push_back(displacements[i].dot(displacements[0]) / displacements[0].squaredNorm());
  return growth;
}

CreepCurve curve_of(const organ::Organ& organ, NodeIndex loaded, const std::vector<Vector>& fields,
                    double influence_m) {
  CreepCurve curve{loaded, growth_of(fields), {}};
  const double least = kLeastMove * at_node(fields[0], loaded).norm();
  const auto& rest = organ.mesh.rest_positions;
  for (std::uint32_t n = 0; n < rest.size(); ++n) {
    const NodeIndex node(n);
    if (length(rest[n] - rest[loaded.value]) > influence_m ||
        at_node(fields[0], node).norm() < least || at_node(fields[0], node).isZero(0))
      continue;
    std::vector<Vector> moves;
    for (const auto& field : fields) moves.push_back(at_node(field, node));
    curve.neighbours.push_back({node, growth_of(moves)});
  }
  return curve;
}

}  // namespace

Status validate(const Settings& s) {
  const auto wrong = [](const std::string& what) { return Error{ErrorCode::Usage, what}; };
  if (auto c = check_count("--modes", s.modes, 1, reduction::kMaxReducedModes); !c) return c;
  if (auto c = check_count("--places", s.places, 1, 1000); !c) return c;
  if (auto c = check_count("--directions", s.directions, 1, 20); !c) return c;
  if (auto c = check_count("--magnitudes", s.magnitudes, 1, 20); !c) return c;
  if (auto c = check_count("--tangents", s.tangents, 0, 10'000); !c) return c;
  if (auto c = check_count("--creep-nodes", s.creep_nodes, 0, 1000); !c) return c;
  if (auto c = check_count("--threads", s.threads, 1, kMaxWorkers); !c) return c;
  if (!(s.force_n > 0 && s.force_n <= 100)) return wrong("--force: must be above 0, at most 100 N");
  if (!(s.radius_m >= 0 && s.radius_m <= 0.2)) return wrong("--radius: must be from 0 to 200 mm");
  if (!(s.influence_m >= 0 && s.influence_m <= 2))
    return wrong("--influence: must be from 0 to 2000 mm");
  if (!(s.creep_s > 0 && s.creep_s <= 10'000))
    return wrong("--creep-seconds: must be above 0, at most 10000 s");
  return {};
}

std::vector<double> creep_times(double seconds) {
  std::vector<double> times;
  for (const double t : kCreepTimes) times.push_back(t * seconds / kCreepTimes.back());
  return times;
}

Training train(FullModel& model, const Settings& settings, const Progress& progress) {
  const auto& organ = model.organ();
  const auto normals = mesh::surface_normals(organ.mesh);
  Training training;
  training.places = spread_nodes(organ, accessible_nodes(organ, settings.radius_m), settings.places,
                                 settings.seed);
  std::vector<double> shares;
  for (std::size_t i = 1; i <= settings.magnitudes; ++i)
    shares.push_back(static_cast<double>(i) / static_cast<double>(settings.magnitudes));
  const std::size_t all = training.places.size() * settings.directions;
  std::size_t done = 0;
  for (const auto node : training.places)
    for (const Vec3d& direction :
         press_directions(normals[node.value], done, settings.directions, kSlant)) {
      const Press press{node, direction * settings.force_n, settings.radius_m};
      auto found = model.displacements(model.forces_of(press), shares);
      training.failed += shares.size() - found.size();
      for (std::size_t i = 0; i < found.size(); ++i)
        training.snapshots.push_back(
            {{node, press.force_n * shares[i], press.radius_m}, std::move(found[i])});
      ++done;
      if (progress) progress(Stage::Snapshots, done, all);
    }
  return training;
}

Result<Built> reduce(FullModel& model, const Training& training, const Settings& settings,
                     const Progress& progress) {
  const auto& snapshots = training.snapshots;
  Matrix q(static_cast<Eigen::Index>(model.dof_count()),
           static_cast<Eigen::Index>(snapshots.size()));
  for (std::size_t i = 0; i < snapshots.size(); ++i)
    q.col(static_cast<Eigen::Index>(i)) = snapshots[i].displacements;
  if (snapshots.empty() || q.isZero(0))
    return Error{ErrorCode::BadFile, model.organ().name +
                                         ": no press of the training has an equilibrium in which "
                                         "it moves, try another --force or --radius"};
  Built built;
  built.karhunen_loeve = karhunen_loeve(q, settings.modes);
  const Matrix& modes = built.karhunen_loeve.modes;
  const ReducedTraining reduced(model, training, modes);
  const auto initial = model.reduced_tangent(Vector::Zero(q.rows()), modes);
  TROCAR_ASSERT(initial.has_value());
  Matrix best = *initial;
  built.initial_error = built.best_error = reduced.error_of(best);
  const std::size_t count = std::min(settings.tangents, snapshots.size());
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t at = i * snapshots.size() / count;
    const auto tangent = model.reduced_tangent(snapshots[at].displacements, modes);
    const double error =
        tangent ? reduced.error_of(*tangent) : std::numeric_limits<double>::infinity();
    if (std::isfinite(error))
      built.tried.push_back({at, error});
    else
      ++built.indefinite;
    if (error < built.best_error) {
      best = *tangent;
      built.best_error = error;
      built.best_at = snapshots[at].press;
    }
    if (progress) progress(Stage::Tangents, i + 1, count);
  }
  auto& r = built.reduction;
  r.source = source_of(model.organ(), training, settings);
  r.mesh_hash = reduction::mesh_hash(model.organ());
  r.elasticity_hash = reduction::elasticity_hash(model.organ());
  r.node_count = static_cast<std::uint32_t>(model.organ().mesh.node_count());
  r.snapshot_count = static_cast<std::uint32_t>(snapshots.size());
  r.force_n = settings.force_n;
  r.radius_m = settings.radius_m;
  r.influence_m = settings.influence_m;
  const Vector& all = built.karhunen_loeve.eigenvalues;
  r.eigenvalues_m2.assign(all.data(), all.data() + modes.cols());
  r.eigenvalue_sum_m2 = all.sum();
  r.modes = numbers_of(modes);
  r.initial_tangent_n_m = numbers_of(*initial);
  r.best_tangent_n_m = numbers_of(best);
  return built;
}

void add_creep(FullModel& model, const Settings& settings, Reduction& reduction,
               const Progress& progress) {
  const auto& organ = model.organ();
  const auto normals = mesh::surface_normals(organ.mesh);
  const auto nodes = spread_nodes(organ, accessible_nodes(organ, settings.radius_m),
                                  settings.creep_nodes, settings.seed);
  const auto times = creep_times(settings.creep_s);
  reduction.creep.clear();
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Press press{nodes[i], normals[nodes[i].value] * -settings.force_n, settings.radius_m};
    const auto fields = model.creep(model.forces_of(press), times);
    if (fields.size() == times.size())
      reduction.creep.push_back(curve_of(organ, nodes[i], fields, settings.influence_m));
    if (progress) progress(Stage::Creep, i + 1, nodes.size());
  }
  reduction.creep_times_s = reduction.creep.empty() ? std::vector<double>{} : times;
}

}  // namespace trocar::dogan
