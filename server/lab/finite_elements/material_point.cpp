#include "server/lab/finite_elements/material_point.h"

#include <algorithm>
#include <cmath>

namespace trocar::finite_elements {
namespace {

constexpr int kMaxIterations = 60;
constexpr double kTolerance = 1e-13;  // of the free sides' stress, in bulk moduli
constexpr double kLargestChange = 0.2;

}  // namespace

std::optional<MaterialPoint::Response> MaterialPoint::respond(const Matrix3& f, double dt_s) const {
  const auto stress = stress_of(material_, f);
  if (!stress) return std::nullopt;
  const RelaxationStep step(material_, dt_s);
  return Response{
      relaxed_stress(step, history_.data(), stress->relaxing.stress) + stress->volumetric.stress,
      step.tangent_share * stress->relaxing.tangent + stress->volumetric.tangent};
}

void MaterialPoint::advance(const Matrix3& f, double dt_s) {
  const auto stress = stress_of(material_, f);
  TROCAR_ASSERT(stress.has_value());
  advance_history(RelaxationStep(material_, dt_s), history_.data(), stress->relaxing.stress);
}

Matrix3 Specimen::deformation(double stretch, double free_stretch) const {
  Matrix3 f = Matrix3::Identity();
  switch (mode_) {
    case material::TestMode::Uniaxial:
      f.diagonal() << stretch, free_stretch, free_stretch;
      break;
    case material::TestMode::Equibiaxial:
      f.diagonal() << stretch, stretch, free_stretch;
      break;
    case material::TestMode::SimpleShear:
      f(0, 1) = stretch;
      break;
  }
  return f;
}

std::optional<double> Specimen::stretch_to(double stretch, double dt_s) {
  const double bulk = point_.material().bulk_modulus_pa;
  const bool has_free_sides = mode_ != material::TestMode::SimpleShear;
  double free = free_stretch_;
  for (int i = 0; i < kMaxIterations; ++i) {
    const Matrix3 f = deformation(stretch, free);
    const auto response = point_.respond(f, dt_s);
    if (!response) return std::nullopt;
    const double residual = response->stress(2);
    // Both free sides move in a uniaxial test.
    const double coupled = response->tangent(2, 2) +
                           (mode_ == material::TestMode::Uniaxial ? response->tangent(2, 1) : 0);
    if (!has_free_sides || std::abs(residual) <= kTolerance * bulk) {
      free_stretch_ = free;
      point_.advance(f, dt_s);
      const Matrix3 nominal = f * to_matrix(response->stress);
      return mode_ == material::TestMode::SimpleShear ? nominal(0, 1) : nominal(0, 0);
    }
    const double change = -residual / (coupled * free);
    if (!std::isfinite(change)) return std::nullopt;
    free += std::clamp(change, -kLargestChange * free, kLargestChange * free);
  }
  return std::nullopt;
}

}  // namespace trocar::finite_elements
