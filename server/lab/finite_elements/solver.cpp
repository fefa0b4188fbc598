#include "server/lab/finite_elements/solver.h"

#include <algorithm>
#include <cmath>

#include "common/base/checksum.h"

namespace trocar::finite_elements {
namespace {

// A line search ends where the slope along the way has fallen to this share, or after so many
// tries.
constexpr double kSlopeShare = 0.7;
constexpr int kMaxTries = 8;
constexpr double kShortestWay = 0.02;
// Diagonal that is added, in mean diagonals, where the tangent is not positive definite.
constexpr double kFirstShift = 1e-4, kShiftGrowth = 10;
constexpr int kMaxShifts = 7;
// Forces of rounding errors, in bulk moduli times the area of the volume's face.
constexpr double kRounding = 1e-13;

Loads between(const Loads& a, const Loads& b, double share) {
  Loads loads = b;
  loads.forces = a.forces + share * (b.forces - a.forces);
  for (std::size_t i = 0; i < loads.held_moves.size(); ++i)
    loads.held_moves[i] = a.held_moves[i] + share * (b.held_moves[i] - a.held_moves[i]);
  return loads;
}

Vector zeros(const Problem& problem) {
  return Vector::Zero(static_cast<Eigen::Index>(problem.dof_count()));
}

double least_force(const Problem& problem) {
  double volume = 0, bulk = 0;
  for (const double v : problem.mesh.volumes) volume += v;
  for (const auto& material : problem.materials) bulk = std::max(bulk, material.bulk_modulus_pa);
  return kRounding * bulk * std::cbrt(volume * volume);
}

}  // namespace

Loads no_loads(const Problem& problem) {
  return {zeros(problem), std::vector<double>(problem.held_dofs.size(), 0.0)};
}

std::uint64_t path_after(std::uint64_t path, const Loads& loads, const StepSettings& settings) {
  StateHasher hasher;
  hasher.update(bytes_of(std::span(&std::as_const(path), 1)));
  hasher.update(
      bytes_of(std::span(loads.forces.data(), static_cast<std::size_t>(loads.forces.size()))));
  hasher.update(bytes_of(loads.held_moves));
  hasher.update(bytes_of(std::span(&settings.dt_s, 1)));
  const std::uint8_t has_inertia = settings.has_inertia ? 1 : 0;
  hasher.update(bytes_of(std::span(&has_inertia, 1)));
  return hasher.digest();
}

Solver::Solver(Problem problem, const SolverSettings& settings)
    : problem_(std::move(problem)),
      settings_(settings),
      assembler_(problem_, settings.threads),
      tangent_(assembler_.pattern().zeros()),
      least_force_n_(least_force(problem_)),
      u_(zeros(problem_)),
      velocity_(u_),
      acceleration_(u_),
      internal_(u_),
      loads_(no_loads(problem_)) {
  factors_.analyze(tangent_);
}

Vector Solver::free_part(const Vector& all) const {
  Vector free(static_cast<Eigen::Index>(assembler_.pattern().free_count()));
  const auto& numbers = assembler_.pattern().free_of_dof();
  for (std::size_t dof = 0; dof < numbers.size(); ++dof)
    if (numbers[dof] >= 0) free[numbers[dof]] = all[static_cast<Eigen::Index>(dof)];
  return free;
}

void Solver::add_free(const Vector& free, Vector& all) const {
  const auto& numbers = assembler_.pattern().free_of_dof();
  for (std::size_t dof = 0; dof < numbers.size(); ++dof)
    if (numbers[dof] >= 0) all[static_cast<Eigen::Index>(dof)] += free[numbers[dof]];
}

double Solver::norm_of_free(const Vector& all) const {
  return free_part(all).norm();
}

void Solver::set_alphas(const Part& part) {
  alpha_f_ = alpha_m_ = 0;
  dt_s_ = part.settings.dt_s;
  if (!part.settings.has_inertia) return;
  const double radius = settings_.high_frequency_radius;
  alpha_m_ = (2 * radius - 1) / (radius + 1);
  alpha_f_ = radius / (radius + 1);
  gamma_ = 0.5 - alpha_m_ + alpha_f_;
  beta_ = (1 - alpha_m_ + alpha_f_) * (1 - alpha_m_ + alpha_f_) / 4;
}

Vector Solver::acceleration_at(const Vector& u) const {
  return (u - u_ - dt_s_ * velocity_) / (beta_ * dt_s_ * dt_s_) -
         (1 / (2 * beta_) - 1) * acceleration_;
}

Vector Solver::velocity_at(const Vector& acceleration) const {
  return velocity_ + dt_s_ * ((1 - gamma_) * acceleration_ + gamma_ * acceleration);
}

Solver::Residual Solver::residual_of(const Vector& u, const Part& part,
                                     const Vector& internal) const {
  Residual result;
  result.is_admissible = true;
  result.values = (1 - alpha_f_) * (internal - part.loads.forces);
  result.scale = internal.norm() + part.loads.forces.norm();
  if (!part.settings.has_inertia) return result;
  result.values += alpha_f_ * (internal_ - loads_.forces);
  const Vector a = acceleration_at(u), v = velocity_at(a);
  const Vector inertia =
      assembler_.mass_times((1 - alpha_m_) * a + alpha_m_ * acceleration_ +
                            problem_.damping_per_s * ((1 - alpha_f_) * v + alpha_f_ * velocity_));
  result.values += inertia;
  result.scale += inertia.norm();
  return result;
}

Solver::Residual Solver::residual_at(const Vector& u, const Part& part) {
  Vector internal = zeros(problem_);
  if (!assembler_.add_forces(u, part.settings.dt_s, internal)) return {};
  return residual_of(u, part, internal);
}

// Factors of the tangent, with a growing diagonal until it is positive definite.
bool Solver::factor(StepReport& report) {
  if (factors_.factor(tangent_)) return true;
  ++report.shifted_factors;
  double shift = kFirstShift * tangent_.diagonal().cwiseAbs().mean();
  for (int i = 0; i < kMaxShifts; ++i, shift *= kShiftGrowth)
    if (factors_.factor(tangent_, shift)) return true;
  return false;
}

// How much of the change to take: where the forces have no more than a share of their first slope
// along it (Matthies & Strang 1979). 0: nowhere admissible.
double Solver::line_search(const Vector& u, const Vector& change, const Part& part,
                           const Residual& before) {
  const double slope_before = before.values.dot(change);
  double low = 0, slope_low = slope_before, high = 1, way = 1;
  bool is_bracketed = false;
  for (int i = 0; i < kMaxTries; ++i) {
    const auto after = residual_at(u + way * change, part);
    const double slope = after.is_admissible ? after.values.dot(change) : 0;
    if (after.is_admissible && std::abs(slope) <= kSlopeShare * std::abs(slope_before)) return way;
    if (!after.is_admissible) {
      high = way, way = low + (way - low) / 4;
      is_bracketed = false;
      continue;
    }
    // It still falls where the whole way ends: no reason to stop short of it.
    if (slope * slope_before > 0 && way == 1) return 1;
    if (slope * slope_before > 0)
      low = way, slope_low = slope;
    else
      high = way, is_bracketed = true;
    const double secant =
        is_bracketed && high == way ? low + (high - low) * slope_low / (slope_low - slope) : 0;
    way = is_bracketed && secant > low + 0.1 * (high - low) && secant < high ? secant
                                                                             : (low + high) / 2;
  }
  if (way < kShortestWay) way = kShortestWay;
  return residual_at(u + way * change, part).is_admissible ? way : 0;
}

bool Solver::solve_part(const Part& part, double part_done, StepReport& report) {
  set_alphas(part);
  const double stiffness = 1 - alpha_f_;
  const double mass = part.settings.has_inertia
                          ? ((1 - alpha_m_) / (beta_ * dt_s_) +
                             problem_.damping_per_s * (1 - alpha_f_) * gamma_ / beta_) /
                                dt_s_
                          : 0;
  Vector u = u_, held = zeros(problem_);
  for (std::size_t i = 0; i < problem_.held_dofs.size(); ++i) {
    const auto dof = static_cast<Eigen::Index>(problem_.held_dofs[i]);
    held[dof] = part.loads.held_moves[i] - u_[dof];
  }
  for (int i = 0; i < settings_.max_iterations; ++i) {
    Vector internal = zeros(problem_), product = zeros(problem_);
    std::fill_n(tangent_.valuePtr(), tangent_.nonZeros(), 0.0);
    if (!assembler_.add_forces_and_tangent(u, part.settings.dt_s, {stiffness, mass}, held, internal,
                                           product, tangent_))
      return false;
    const auto residual = residual_of(u, part, internal);
    report.residual_n = norm_of_free(residual.values);
    const double tolerance = settings_.tolerance * residual.scale + least_force_n_;
    if (on_progress) on_progress({part_done, i, report.residual_n, tolerance});
    if (!std::isfinite(report.residual_n)) return false;
    if (held.isZero(0) && report.residual_n <= tolerance) {
      accept(u, part);
      internal_ = internal;
      return true;
    }
    ++report.iterations;
    if (!factor(report)) return false;
    const Vector right = free_part(residual.values + product);
    Vector change = held;
    add_free(-factors_.solve(right), change);
    // Held degrees of freedom move all the way at once.
    const double way = held.isZero(0) ? line_search(u, change, part, residual) : 1;
    if (way == 0) return false;
    u += way * change;
    held.setZero();
  }
  return false;
}

void Solver::accept(const Vector& u, const Part& part) {
  if (part.settings.has_inertia) {
    const Vector a = acceleration_at(u);
    velocity_ = velocity_at(a);
    acceleration_ = a;
  } else {
    velocity_.setZero();
    acceleration_.setZero();
    is_moving_ = false;
  }
  assembler_.advance(u, part.settings.dt_s);
  u_ = u;
  loads_ = part.loads;
  if (std::isfinite(part.settings.dt_s)) time_s_ += part.settings.dt_s;
}

// The acceleration with which motion starts: M a = loads - forces.
void Solver::start_motion() {
  Vector internal = zeros(problem_), product = zeros(problem_);
  std::fill_n(tangent_.valuePtr(), tangent_.nonZeros(), 0.0);
  const bool is_admissible = assembler_.add_forces_and_tangent(u_, 0, {0, 1}, zeros(problem_),
                                                               internal, product, tangent_);
  TROCAR_ASSERT(is_admissible);
  StepReport ignored;
  acceleration_.setZero();
  if (factor(ignored))
    add_free(factors_.solve(free_part(loads_.forces - internal_)), acceleration_);
  is_moving_ = true;
}

StepReport Solver::step(const Loads& loads, const StepSettings& settings) {
  TROCAR_ASSERT(loads.forces.size() == u_.size());
  TROCAR_ASSERT(loads.held_moves.size() == problem_.held_dofs.size());
  TROCAR_ASSERT(settings.dt_s >= 0 && (!settings.has_inertia || std::isfinite(settings.dt_s)));
  StepReport report;
  const Loads first = loads_;
  if (settings.has_inertia && !is_moving_) start_motion();
  double done = 0, size = 1;
  const double smallest = std::ldexp(1.0, -settings_.max_halvings);
  while (done < 1) {
    const Loads target = done + size >= 1 ? loads : between(first, loads, done + size);
    StepSettings part_settings = settings;
    part_settings.dt_s *= std::isfinite(settings.dt_s) ? size : 1;
    if (solve_part({target, part_settings}, done, report)) {
      done += size;
      size = std::min(2 * size, 1 - done);
      ++report.parts;
      continue;
    }
    size /= 2;
    if (size < smallest) {
      report.is_converged = false;
      return report;
    }
  }
  ++steps_;
  path_ = path_after(path_, loads, settings);
  return report;
}

void Solver::set_forces(const Vector& forces) {
  TROCAR_ASSERT(forces.size() == u_.size());
  loads_.forces = forces;
  is_moving_ = false;
  path_ = path_after(path_, loads_, {});
}

Vector Solver::reactions() const {
  if (!is_moving_) return internal_;
  return internal_ + assembler_.mass_times(acceleration_ + problem_.damping_per_s * velocity_);
}

Vector Solver::weights(const Vec3d& gravity_m_s2) const {
  Vector everywhere = zeros(problem_);
  for (Eigen::Index dof = 0; dof < everywhere.size(); dof += 3)
    everywhere.segment<3>(dof) << gravity_m_s2.x, gravity_m_s2.y, gravity_m_s2.z;
  return assembler_.mass_times(everywhere);
}

State Solver::state() const {
  return {time_s_,   steps_,        path_,     is_moving_, u_,
          velocity_, acceleration_, internal_, loads_,     assembler_.history()};
}

void Solver::restore(const State& state) {
  TROCAR_ASSERT(state.u.size() == u_.size());
  TROCAR_ASSERT(state.history.size() == assembler_.history().size());
  time_s_ = state.time_s, steps_ = state.steps, path_ = state.path;
  is_moving_ = state.is_moving;
  u_ = state.u, velocity_ = state.velocity, acceleration_ = state.acceleration;
  internal_ = state.internal;
  loads_ = state.loads;
  assembler_.set_history(state.history);
}

}  // namespace trocar::finite_elements
