#include "server/lab/fit/fit.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "common/base/quote.h"
#include "server/lab/fit/fit_model.h"

namespace trocar::fit {
namespace {

// A parameter that is changed by 1 (a bounded one) or doubled and changes the forces by less than
// this share has no effect: it is less than solving leaves.
constexpr double kNoEffect = 1e-5;
constexpr double kLargeResidualPercent = 10;

// Residuals and, by differences, their derivatives. A parameter is its value divided by where it
// started, so that all are about 1, or the value itself if it is bounded.
class Residuals final : public ceres::CostFunction {
 public:
  Residuals(const FitModel& model, const MeasuredCurve& measured, const Progress& progress)
      : model_(model), measured_(measured), progress_(progress) {
    set_num_residuals(static_cast<int>(measured.points.size()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(model.parameters().size()));
    for (const auto& p : model.parameters()) {
      scales_.push_back(p.is_bounded ? 1.0 : model.material().*p.member);
      starts_.push_back(model.material().*p.member / scales_.back());
    }
    for (const auto& point : measured.points)
      largest_n_ = std::max(largest_n_, std::abs(point.force_n));
  }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const std::size_t n = starts_.size(), m = measured_.points.size();
    std::vector<double> x(parameters[0], parameters[0] + n);
    const auto forces = run(x);
    if (forces.empty()) return false;
    for (std::size_t i = 0; i < m; ++i)
      residuals[i] = (forces[i] - measured_.points[i].force_n) / largest_n_;
    if (jacobians == nullptr || jacobians[0] == nullptr) return true;
    for (std::size_t k = 0; k < n; ++k) {
      const auto shifted = shift(x, k);
      const auto other = run(shifted);
      if (other.empty()) return false;
      for (std::size_t i = 0; i < m; ++i)
        jacobians[0][i * n + k] = (other[i] - forces[i]) / largest_n_ / (shifted[k] - x[k]);
    }
    return true;
  }

  // The first parameter on which the forces do not depend where the fit starts. Costs no run, for
  // the optimiser needs the same ones.
  std::optional<std::size_t> without_effect() const {
    const auto forces = run(starts_);
    double largest = 0;
    for (const double force : forces) largest = std::max(largest, std::abs(force));
    for (std::size_t k = 0; k < starts_.size() && !forces.empty(); ++k) {
      const auto shifted = shift(starts_, k);
      const auto other = run(shifted);
      double change = 0;
      for (std::size_t i = 0; i < other.size(); ++i)
        change = std::max(change, std::abs(other[i] - forces[i]));
      if (!other.empty() && change <= kNoEffect * largest * std::abs(shifted[k] - starts_[k]))
        return k;
    }
    return std::nullopt;
  }

  const std::vector<double>& starts() const { return starts_; }
  const std::vector<double>& scales() const { return scales_; }
  double largest_n() const { return largest_n_; }
  int runs() const { return runs_; }
  std::vector<double> values(const std::vector<double>& x) const {
    std::vector<double> result = x;
    for (std::size_t k = 0; k < x.size(); ++k) result[k] *= scales_[k];
    return result;
  }

 private:
  // Returns x with one parameter changed, for a difference in its direction.
  std::vector<double> shift(std::vector<double> x, std::size_t k) const {
    const auto& p = model_.parameters()[k];
    // Away from the upper bound, where materials are most sensitive.
    const double step = p.is_bounded && x[k] + p.step > p.high ? -p.step : p.step;
    x[k] += p.is_bounded ? step : step * x[k];
    return x;
  }
  std::vector<double> run(const std::vector<double>& x) const {
    // The optimiser comes back to values that it has tried.
    for (const auto& [tried, its_forces] : done_)
      if (tried == x) return its_forces;
    const auto forces = model_.run(values(x)).forces_n;
    done_.emplace_back(x, forces);
    ++runs_;
    if (!progress_ || forces.empty()) return forces;
    std::vector<FittedParameter> tried;
    for (std::size_t k = 0; k < x.size(); ++k)
      tried.push_back({std::string(model_.parameters()[k].key), starts_[k] * scales_[k],
                       x[k] * scales_[k], std::nullopt, FittedParameter::Limit::None});
    double sum = 0;
    for (std::size_t i = 0; i < forces.size(); ++i)
      sum += (forces[i] - measured_.points[i].force_n) * (forces[i] - measured_.points[i].force_n);
    progress_(runs_, tried, std::sqrt(sum / static_cast<double>(forces.size())));
    return forces;
  }

  const FitModel& model_;
  const MeasuredCurve& measured_;
  const Progress& progress_;
  std::vector<double> starts_, scales_;
  double largest_n_ = 0;
  mutable int runs_ = 0;
  mutable std::vector<std::pair<std::vector<double>, std::vector<double>>> done_;
};

// From the scatter of the residuals, for measurements that are equally exact.
void add_standard_errors(ceres::Problem& problem, const std::vector<double>& x, double cost,
                         const Residuals& residuals, Fit& fit) {
  const auto points = static_cast<double>(fit.forces_n.size());
  const std::size_t n = x.size();
  if (points <= static_cast<double>(n)) return;
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::DENSE_SVD;
  ceres::Covariance covariance(options);
  const std::vector<std::pair<const double*, const double*>> blocks{{x.data(), x.data()}};
  if (!covariance.Compute(blocks, &problem)) return;
  std::vector<double> matrix(n * n);
  covariance.GetCovarianceBlock(x.data(), x.data(), matrix.data());
  const double variance = 2 * cost / (points - static_cast<double>(n));
  for (std::size_t k = 0; k < n; ++k)
    fit.parameters[k].standard_error =
        std::sqrt(variance * matrix[k * n + k]) * residuals.scales()[k];
}

FittedParameter::Limit limit_at(const Tunable& tunable, double value) {
  const auto is_near = [&](double limit) {
    return std::abs(value - limit) <= 1e-3 * (tunable.is_bounded ? tunable.high : limit);
  };
  if (is_near(tunable.low)) return FittedParameter::Limit::Lower;
  return is_near(tunable.high) ? FittedParameter::Limit::Upper : FittedParameter::Limit::None;
}

}  // namespace

bool FittedParameter::is_determined() const {
  return standard_error && 1.96 * *standard_error < std::abs(value);
}

std::vector<std::string> Fit::remarks() const {
  std::vector<std::string> lines;
  char line[200];
  for (const auto& p : parameters) {
    if (p.at != FittedParameter::Limit::None) {
      std::snprintf(line, sizeof line,
                    "%s ends at its %s limit, %.6g: look at the sign and the unit of the forces",
                    p.key.c_str(), p.at == FittedParameter::Limit::Lower ? "lower" : "upper",
                    p.value);
      lines.emplace_back(line);
    } else if (!p.is_determined() && forces_n.size() > parameters.size()) {
      lines.push_back("the data do not tell " + p.key + ": measure more, or fit fewer parameters");
    }
  }
  if (rms_percent > kLargeResidualPercent) {
    std::snprintf(line, sizeof line,
                  "the residual is %.3g %% of the largest measured force: this scenario and this "
                  "material do not follow the curve",
                  rms_percent);
    lines.emplace_back(line);
  }
  return lines;
}

std::string fit_keys() {
  std::string keys;
  for (const auto& tunable : tunables())
    keys += (keys.empty() ? "" : ", ") + std::string(tunable.key);
  return keys;
}

Result<Fit> fit(const scenario::ResolvedScenario& resolved, const MeasuredCurve& measured,
                const FitOptions& options, const Progress& progress) {
  const auto model = FitModel::create(resolved, measured, options);
  if (!model) return model.error();
  Residuals residuals(*model, measured, progress);
  if (residuals.largest_n() == 0)
    return Error{ErrorCode::BadFile, measured.source.string() + ": all forces are 0"};
  if (const auto k = residuals.without_effect()) return model->no_effect(*k);
  std::vector<double> x = residuals.starts();
  ceres::Problem::Options ownership;
  ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(ownership);
  problem.AddResidualBlock(&residuals, nullptr, x.data());
  for (std::size_t k = 0; k < x.size(); ++k) {
    problem.SetParameterLowerBound(x.data(), static_cast<int>(k),
                                   model->parameters()[k].low / residuals.scales()[k]);
    problem.SetParameterUpperBound(x.data(), static_cast<int>(k),
                                   model->parameters()[k].high / residuals.scales()[k]);
  }
  ceres::Solver::Options how;
  how.linear_solver_type = ceres::DENSE_QR;
  how.logging_type = ceres::SILENT;
  how.max_num_iterations = 30;
  // Runs are solved to a tolerance: beyond this the optimiser would chase what is left.
  how.parameter_tolerance = 3e-4;
  how.function_tolerance = 1e-4;
  // The start may be far off, and the forces are nearly linear in a stiffness.
  how.initial_trust_region_radius = 1e8;
  ceres::Solver::Summary summary;
  ceres::Solve(how, &problem, &summary);
  if (!summary.IsSolutionUsable())
    return Error{ErrorCode::BadFile,
                 resolved.scenario.source.string() +
                     ": does not come to an end with these materials, start from other values"};

  Fit fit;
  const auto values = residuals.values(x);
  for (std::size_t k = 0; k < x.size(); ++k)
    fit.parameters.push_back({std::string(model->parameters()[k].key),
                              residuals.starts()[k] * residuals.scales()[k], values[k],
                              std::nullopt, limit_at(model->parameters()[k], values[k])});
  auto last = model->run(values);
  fit.has_unconverged_steps = !last.is_converged;
  fit.forces_n = std::move(last.forces_n);
  fit.rms_n = std::sqrt(2 * summary.final_cost / static_cast<double>(fit.forces_n.size())) *
              residuals.largest_n();
  fit.rms_percent = 100 * fit.rms_n / residuals.largest_n();
  fit.is_converged = summary.termination_type == ceres::CONVERGENCE;
  add_standard_errors(problem, x, summary.final_cost, residuals, fit);
  fit.runs = residuals.runs() + 1;
  fit.organ = model->organ(values);
  return fit;
}

std::string to_toml(const Fit& fit, const FitOptions& options) {
  std::string text;
  for (const auto& remark : fit.remarks()) text += "# Warning: " + remark + ".\n";
  text += options.region.empty() ? "[material]\n" : "[[region]]\n";
  if (!options.region.empty()) text += "name = " + quote(options.region) + "\n";
  for (const auto& p : fit.parameters) {
    char line[120];
    std::snprintf(line, sizeof line, "%s = %.6g", p.key.c_str(), p.value);
    text += line;
    if (p.standard_error && p.is_determined()) {
      std::snprintf(line, sizeof line, "  # +- %.2g", *p.standard_error);
      text += line;
    } else if (p.standard_error) {
      text += "  # not determined";
    }
    text += "\n";
  }
  return text;
}

}  // namespace trocar::fit
