#include "tests/bench/reference_fem.h"

#include <algorithm>

#include "common/base/assert.h"

namespace trocar::bench {
namespace {

constexpr double kTolerance = 1e-9;
constexpr int kMaxIterations = 20'000;

double dot_all(const std::vector<Vec3d>& a, const std::vector<Vec3d>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += dot(a[i], b[i]);
  return sum;
}

double at(const Vec3d& v, std::size_t axis) {
  return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

}  // namespace

ReferenceFem::ReferenceFem(const PulledBox& box)
    : box_(box), is_fixed_(box.organ.mesh.node_count()) {
  for (const auto node : box.organ.fixed_nodes) is_fixed_[node.value] = 1;
  assemble();
}

void ReferenceFem::assemble() {
  const auto& mesh = box_.organ.mesh;
  std::vector<std::vector<std::uint32_t>> rows(mesh.node_count());
  for (std::uint32_t n = 0; n < rows.size(); ++n) rows[n].push_back(n);
  for (const auto& [a, b] : mesh.edges) {
    rows[a.value].push_back(b.value);
    rows[b.value].push_back(a.value);
  }
  offsets_.push_back(0);
  for (const auto& row : rows) {
    columns_.insert(columns_.end(), row.begin(), row.end());
    offsets_.push_back(static_cast<std::uint32_t>(columns_.size()));
  }
  blocks_.resize(columns_.size());

  const double mu = box_.material.lame_mu_pa(), lambda = box_.material.lame_lambda_pa();
  for (const auto& tet : mesh.tets) {
    const auto& p = mesh.rest_positions;
    const Vec3d origin = p[tet[0].value];
    const Vec3d e1 = p[tet[1].value] - origin, e2 = p[tet[2].value] - origin,
                e3 = p[tet[3].value] - origin;
    const double six_volumes = dot(cross(e1, e2), e3);
    // Gradients of the shape functions.
    std::array<Vec3d, 4> g{Vec3d{}, cross(e2, e3) / six_volumes, cross(e3, e1) / six_volumes,
                           cross(e1, e2) / six_volumes};
    g[0] = -(g[1] + g[2] + g[3]);
    const double volume = six_volumes / 6;
    for (std::size_t a = 0; a < 4; ++a)
      for (std::size_t b = 0; b < 4; ++b) {
        const auto row = tet[a].value, column = tet[b].value;
        auto entry = offsets_[row];
        while (columns_[entry] != column) ++entry;
        const double w = dot(g[a], g[b]);
        for (std::size_t i = 0; i < 3; ++i)
          for (std::size_t j = 0; j < 3; ++j)
            blocks_[entry][3 * i + j] +=
                volume * (lambda * at(g[a], i) * at(g[b], j) + mu * at(g[b], i) * at(g[a], j) +
                          (i == j ? mu * w : 0));
      }
  }
}

void ReferenceFem::multiply(double mass_factor, double stiffness_factor, const Vector& x,
                            Vector& y) const {
  for (std::uint32_t n = 0; n < x.size(); ++n) {
    if (is_fixed_[n]) {
      y[n] = {};
      continue;
    }
    Vec3d sum;
    for (auto e = offsets_[n]; e < offsets_[n + 1]; ++e) {
      const Block& k = blocks_[e];
      const Vec3d& v = x[columns_[e]];
      sum += {k[0] * v.x + k[1] * v.y + k[2] * v.z, k[3] * v.x + k[4] * v.y + k[5] * v.z,
              k[6] * v.x + k[7] * v.y + k[8] * v.z};
    }
    y[n] = sum * stiffness_factor + x[n] * (mass_factor * box_.organ.node_masses_kg[n]);
  }
}

void ReferenceFem::solve(double mass_factor, double stiffness_factor, const Vector& b,
                         Vector& x) const {
  const auto precondition = [&](const Vector& r, Vector& z) {
    for (std::uint32_t n = 0; n < r.size(); ++n) {
      const Block& k = blocks_[offsets_[n]];
      const double mass = mass_factor * box_.organ.node_masses_kg[n];
      z[n] = {r[n].x / (stiffness_factor * k[0] + mass), r[n].y / (stiffness_factor * k[4] + mass),
              r[n].z / (stiffness_factor * k[8] + mass)};
    }
  };
  Vector r(b.size()), z(b.size()), q(b.size());
  multiply(mass_factor, stiffness_factor, x, r);
  double b_squared = 0;
  for (std::size_t n = 0; n < b.size(); ++n) {
    r[n] = is_fixed_[n] ? Vec3d{} : b[n] - r[n];
    if (!is_fixed_[n]) b_squared += length_squared(b[n]);
  }
  precondition(r, z);
  Vector p = z;
  double rz = dot_all(r, z);
  for (int i = 0; i < kMaxIterations; ++i) {
    if (dot_all(r, r) <= kTolerance * kTolerance * b_squared) return;
    multiply(mass_factor, stiffness_factor, p, q);
    const double step = rz / dot_all(p, q);
    for (std::size_t n = 0; n < b.size(); ++n) {
      x[n] += p[n] * step;
      r[n] -= q[n] * step;
    }
    precondition(r, z);
    const double rz_next = dot_all(r, z);
    for (std::size_t n = 0; n < b.size(); ++n) p[n] = z[n] + p[n] * (rz_next / rz);
    rz = rz_next;
  }
  TROCAR_ASSERT(false);
}

double ReferenceFem::face_displacement(const Vector& u) const {
  return box_.face_displacement([&](NodeIndex node) { return u[node.value].x; });
}

double ReferenceFem::static_displacement() {
  Vector load(is_fixed_.size()), u(is_fixed_.size());
  for (std::size_t n = 0; n < load.size(); ++n) load[n] = to_double(box_.forces_n[n]);
  solve(0, 1, load, u);
  return face_displacement(u);
}

// (M (1 + rate dt) + dt^2 K) v' = M v + dt (f - K u),  u' = u + dt v'
double ReferenceFem::displacement_after(int steps, double dt_s) {
  const auto count = is_fixed_.size();
  Vector u(count), v(count), b(count), ku(count);
  for (int s = 0; s < steps; ++s) {
    multiply(0, 1, u, ku);
    for (std::size_t n = 0; n < count; ++n)
      b[n] = v[n] * box_.organ.node_masses_kg[n] + (to_double(box_.forces_n[n]) - ku[n]) * dt_s;
    solve(1 + box_.material.node_damping_per_s * dt_s, dt_s * dt_s, b, v);
    for (std::size_t n = 0; n < count; ++n) u[n] += v[n] * dt_s;
  }
  return face_displacement(u);
}

}  // namespace trocar::bench
