#include "server/tissue/thread/elasticity.h"

#include <algorithm>

namespace trocar::thread {
namespace {

constexpr double kLeastM = 1e-3 * kSegmentM;  // no segment counts as shorter

// The middle of three nodes that are joined.
bool bends_at(const Threads& threads, std::size_t i) {
  return threads.is_joined[i - 1] != 0 && threads.is_joined[i] != 0;
}

Vec3d bend(const std::vector<Vec3d>& x, std::size_t i) {
  return x[i - 1] - x[i] * 2.0 + x[i + 1];
}

double bending_n_m(const NodeFigures& figures, std::size_t i) {
  return figures.bending_nm2[i] / (kSegmentM * kSegmentM * kSegmentM);
}

}  // namespace

NodeFigures::NodeFigures(const Rules& rules) {
  for (const auto& rule : rules.threads) {
    const auto suture = rule.suture();
    const auto count = nodes_along(rule.path_m).size();
    const auto all = mass_kg.size() + count;
    mass_kg.resize(all, suture.density_kg_m * kSegmentM);
    mass_kg[all - count] *= 0.5;
    mass_kg[all - 1] *= 0.5;
    stretch_n.resize(all, suture.stretch_n);
    bending_nm2.resize(all, suture.bending_nm2);
    breaks_n.resize(all, suture.breaks_n);
    self_friction.resize(all, suture.self_friction);
  }
}

void Elasticity::begin(double dt_s, Threads& threads) {
  dt_s_ = dt_s;
  before_ = threads.places_m;
  solved_n_ = threads.tensions_n;
  aims_.resize(before_.size());
  const double coasting_s = dt_s / (1 + kDrag * dt_s);
  for (std::size_t i = 0; i < before_.size(); ++i) {
    const Vec3d& v = threads.velocities_m_s[i];
    aims_[i] = before_[i] + v * coasting_s + gravity_m_s2_ * (dt_s * coasting_s);
    threads.places_m[i] += v * dt_s;
  }
}

void Elasticity::move(const ChainSolver& solver, double part, Threads& threads) {
  auto& x = threads.places_m;
  for (std::size_t i = 0; i + 1 < x.size(); ++i) {
    const Vec3d e = x[i + 1] - x[i];
    const double now_m = std::max(length(e), kLeastM);
    const double longer_m = dot(e, solver.solution(i + 1) - solver.solution(i)) / now_m;
    solved_n_[i] = figures_.stretch_n[i] / kSegmentM * (now_m - kSegmentM + part * longer_m);
  }
  for (std::size_t i = 0; i < x.size(); ++i) x[i] += solver.solution(i) * part;
}

void Elasticity::add(const Threads& threads, ChainSolver& solver) const {
  const auto& x = threads.places_m;
  const double inertia = (1 + kDrag * dt_s_) / (dt_s_ * dt_s_);
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double m = figures_.mass_kg[i] * inertia;
    solver.add_diagonal(i, m);
    solver.add_right(i, to_column((aims_[i] - x[i]) * m));
  }
  for (std::size_t i = 0; i + 1 < x.size(); ++i)
    if (threads.is_joined[i] != 0) add_segment(i, threads, solver);
  for (std::size_t i = 1; i + 1 < x.size(); ++i)
    if (bends_at(threads, i)) add_bend(i, threads, solver);
}

void Elasticity::add_segment(std::size_t i, const Threads& threads, ChainSolver& solver) const {
  const auto& x = threads.places_m;
  const double k = figures_.stretch_n[i] / kSegmentM;
  const Vec3d e = x[i + 1] - x[i];
  const double now_m = std::max(length(e), kLeastM);
  const Vec3d t = e / now_m;
  const double tension = k * (now_m - kSegmentM);
  const double across = std::max(0.0, solved_n_[i]) / now_m;
  const Block stiffness = uniaxial(t, k, std::min(across, k));
  solver.add_diagonal(i, stiffness);
  solver.add_diagonal(i + 1, stiffness);
  solver.add_next(i, stiffness * -1.0);
  const Column force = to_column(t * tension);
  solver.add_right(i, force);
  solver.add_right(i + 1, -force);
}

void Elasticity::add_bend(std::size_t i, const Threads& threads, ChainSolver& solver) const {
  const double k = bending_n_m(figures_, i), damping = kBendingSeconds / dt_s_;
  const Vec3d now = bend(threads.places_m, i);
  const Column force = to_column((now + (now - bend(before_, i)) * damping) * k);
  const double h = k * (1 + damping);
  solver.add_right(i - 1, -force);
  solver.add_right(i, force + force);
  solver.add_right(i + 1, -force);
  solver.add_diagonal(i - 1, h);
  solver.add_diagonal(i, 4 * h);
  solver.add_diagonal(i + 1, h);
  solver.add_next(i - 1, -2 * h);
  solver.add_next(i, -2 * h);
  solver.add_after_next(i - 1, h);
}

void Elasticity::end(Threads& threads) const {
  const auto& x = threads.places_m;
  for (std::size_t i = 0; i < x.size(); ++i)
    threads.velocities_m_s[i] = (x[i] - before_[i]) / dt_s_;
  for (std::size_t i = 0; i + 1 < x.size(); ++i)
    threads.tensions_n[i] = threads.is_joined[i] != 0
                                ? figures_.stretch_n[i] * (length(x[i + 1] - x[i]) / kSegmentM - 1)
                                : 0;
}

void Elasticity::undo(Threads& threads) const {
  threads.places_m = before_;
  std::ranges::fill(threads.velocities_m_s, Vec3d{});
  std::ranges::fill(threads.tensions_n, 0.0);
}

double Elasticity::elastic_energy_j(const Threads& threads) const {
  const auto& x = threads.places_m;
  double energy_j = 0;
  for (std::size_t i = 0; i + 1 < x.size(); ++i) {
    if (threads.is_joined[i] == 0) continue;
    const double stretch_m = length(x[i + 1] - x[i]) - kSegmentM;
    energy_j += 0.5 * figures_.stretch_n[i] / kSegmentM * stretch_m * stretch_m;
  }
  for (std::size_t i = 1; i + 1 < x.size(); ++i)
    if (bends_at(threads, i))
      energy_j += 0.5 * bending_n_m(figures_, i) * length_squared(bend(x, i));
  return energy_j;
}

double Elasticity::kinetic_energy_j(const Threads& threads) const {
  double energy_j = 0;
  for (std::size_t i = 0; i < threads.node_count(); ++i)
    energy_j += 0.5 * figures_.mass_kg[i] * length_squared(threads.velocities_m_s[i]);
  return energy_j;
}

}  // namespace trocar::thread
