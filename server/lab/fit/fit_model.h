#pragma once

// The forces that a scenario predicts for measured displacements, as a function of numbers of its
// material. One thread.

#include <span>
#include <string_view>
#include <vector>

#include "server/lab/fit/fit.h"

namespace trocar::fit {

// A number of a material that can be fitted.
struct Tunable {
  std::string_view key;
  double material::Material::*member;
  double low, high;
  double step;  // of the finite difference: a share of the value, or absolute if it is_bounded
  bool is_bounded;
};
std::span<const Tunable> tunables();

class FitModel {
 public:
  static Result<FitModel> create(const scenario::ResolvedScenario& resolved,
                                 const MeasuredCurve& measured, const FitOptions& options);

  const std::vector<Tunable>& parameters() const { return parameters_; }
  const material::Material& material() const { return material_of(resolved_.organ); }
  // Returns what to say of a parameter on which the curve does not depend.
  Error no_effect(std::size_t parameter) const;
  // The organ with these values.
  organ::Organ organ(std::span<const double> values) const;

  struct Forces {
    std::vector<double> forces_n;  // per measurement; empty if something was not finite
    bool is_converged = true;
  };
  Forces run(std::span<const double> values) const;

 private:
  FitModel() = default;
  Status choose_curve(const FitOptions& options);
  Status choose_parameters(const FitOptions& options);
  Status place_measurements();
  const material::Material& material_of(const organ::Organ& organ) const {
    return region_ ? organ.regions[*region_].material : organ.material;
  }
  double displacement_at(double time_s) const;

  scenario::ResolvedScenario resolved_;
  const MeasuredCurve* measured_ = nullptr;
  scenario::LoadCurve curve_;
  scenario::Solver solver_ = scenario::Solver::Full;
  std::optional<std::size_t> region_;
  std::vector<Tunable> parameters_;
  std::vector<std::size_t> steps_;  // static run: the load step of each measurement
};

}  // namespace trocar::fit
