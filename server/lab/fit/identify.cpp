#include "server/lab/fit/identify.h"

#include <ceres/ceres.h>

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>

#include "server/lab/finite_elements/material_point.h"

namespace trocar::fit {
namespace {

using material::HyperelasticMaterial;

constexpr double kLargestStretchStep = 0.01;
constexpr double kLargestWeightSum = 0.995;
// Central differences take this step, in parameters that are about 1.
constexpr double kDifference = 1e-5;
constexpr double kZ95 = 1.959963985;
// Student's t of 95 % from one degree of freedom on, where the expansion does not hold yet.
constexpr std::array kStudent95{12.7062, 4.3027, 3.1824, 2.7764};
// Beyond it two constants make up for each other.
constexpr double kStrongCorrelation = 0.9;
// Singular values below this share of the largest are rounding errors of the differences.
constexpr double kSmallestSingularValue = 1e-8;

// Parameters: C_i0 over a scale, g_k, log(tau_k / 1 s).
class Model {
 public:
  Model(const std::vector<TestCurve>& curves, const IdentifyOptions& options)
      : curves_(curves), options_(options) {
    for (const auto& curve : curves) row_count_ += curve.times_s.size();
  }

  std::size_t term_count() const {
    return options_.start.empty() ? options_.term_count : options_.start.size();
  }
  std::size_t size() const { return options_.order + 2 * term_count(); }
  std::size_t row_count() const { return row_count_; }
  double scale_pa() const { return scale_pa_; }
  void set_scale(double scale_pa) { scale_pa_ = scale_pa; }
  int evaluations() const { return evaluations_; }

  HyperelasticMaterial material(const double* x) const {
    HyperelasticMaterial m;
    m.name = options_.name;
    m.source = "identified from measured curves";
    m.split = options_.split;
    for (std::size_t i = 0; i < options_.order; ++i) m.coefficients_pa[i] = x[i] * scale_pa_;
    m.bulk_modulus_pa = options_.bulk_ratio * m.coefficients_pa[0];
    const double *g = x + options_.order, *tau = g + term_count();
    for (std::size_t k = 0; k < term_count(); ++k) m.relaxation.push_back({g[k], std::exp(tau[k])});
    return m;
  }

  // Something must carry the load in the end, with room for the differences of the Jacobian.
  bool is_possible(const double* x) const {
    const auto m = material(x);
    return m.coefficients_pa[0] > 0 && m.equilibrium_share() >= 1 - kLargestWeightSum;
  }

  // Differences over each curve's largest stress; false where the material makes no sense.
  bool residuals(const double* x, double* out) const {
    ++evaluations_;
    const auto m = material(x);
    if (!(m.coefficients_pa[0] > 0) || !(m.equilibrium_share() > 0)) return false;
    for (const auto& curve : curves_) {
      const auto stresses = predicted_stresses(m, curve);
      if (stresses.empty()) return false;
      const double largest = curve.largest_stress_pa();
      for (std::size_t i = 0; i < stresses.size(); ++i)
        *out++ = (stresses[i] - curve.stresses_pa[i]) / largest;
    }
    return true;
  }

  // By central differences, row-major.
  bool jacobian(const double* x, double* out) const {
    std::vector<double> shifted(x, x + size()), low(row_count_), high(row_count_);
    for (std::size_t k = 0; k < size(); ++k) {
      shifted[k] = x[k] - kDifference;
      if (!residuals(shifted.data(), low.data())) return false;
      shifted[k] = x[k] + kDifference;
      if (!residuals(shifted.data(), high.data())) return false;
      shifted[k] = x[k];
      for (std::size_t i = 0; i < row_count_; ++i)
        out[i * size() + k] = (high[i] - low[i]) / (2 * kDifference);
    }
    return true;
  }

 private:
  const std::vector<TestCurve>& curves_;
  const IdentifyOptions& options_;
  std::size_t row_count_ = 0;
  double scale_pa_ = 1;
  mutable int evaluations_ = 0;
};

class Cost final : public ceres::CostFunction {
 public:
  explicit Cost(const Model& model) : model_(model) {
    set_num_residuals(static_cast<int>(model.row_count()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(model.size()));
  }
  bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
    if (!model_.is_possible(x[0]) || !model_.residuals(x[0], residuals)) return false;
    return jacobians == nullptr || jacobians[0] == nullptr || model_.jacobian(x[0], jacobians[0]);
  }

 private:
  const Model& model_;
};

class Reporter final : public ceres::IterationCallback {
 public:
  Reporter(const IdentifyProgress& progress, std::size_t rows) : progress_(progress), rows_(rows) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    if (progress_)
      progress_(summary.iteration, 100 * std::sqrt(2 * summary.cost / static_cast<double>(rows_)));
    return ceres::SOLVER_CONTINUE;
  }

 private:
  const IdentifyProgress& progress_;
  std::size_t rows_;
};

Status check(const IdentifyOptions& options) {
  const auto wrong = [](const char* what) { return Error{ErrorCode::Usage, what}; };
  if (options.name.empty()) return wrong("the material needs a name");
  if (options.order < 1 || options.order > material::kMaxPolynomialOrder)
    return wrong("the order must be from 1 to 5");
  if (options.start.size() > material::kMaxPronyTerms ||
      options.term_count > material::kMaxPronyTerms)
    return wrong("there are at most 4 terms of relaxation");
  if (!(options.bulk_ratio >= 2 && options.bulk_ratio <= 1e6))
    return wrong("the bulk modulus must be from 2 to 1e6 times C10");
  // The start as a material: weights and times are refused with the words of any other.
  HyperelasticMaterial m;
  m.name = "to start from";
  m.coefficients_pa[0] = 1000;
  m.bulk_modulus_pa = 1000 * options.bulk_ratio;
  m.relaxation = options.start;
  if (auto s = material::validate(m); !s) return Error{ErrorCode::Usage, s.error().message};
  if (m.equilibrium_share() < 1 - kLargestWeightSum)
    return wrong("the weights to start from add up to more than 0.995, start from smaller ones");
  return {};
}

double duration(const std::vector<TestCurve>& curves) {
  double longest = 0;
  for (const auto& curve : curves)
    longest = std::max(longest, curve.times_s.back() - curve.times_s.front());
  return longest;
}

// Places to start from: relaxation times spread over the measured time in two ways, and a law that
// stiffens or does not.
std::vector<std::vector<double>> starts(const Model& model, const IdentifyOptions& options,
                                        double duration_s) {
  std::vector<std::vector<double>> all;
  const std::size_t terms = model.term_count();
  for (const double stiffening : {1.0, 0.1})
    for (const double shortest : {1.0 / 30, 1.0 / 300}) {
      std::vector<double> x{1};
      x.resize(options.order, stiffening);
      x.resize(options.order + terms, 0.6 / static_cast<double>(terms));
      for (std::size_t k = 0; k < terms; ++k) {
        const double share = terms == 1 ? 0.5 : double(k) / double(terms - 1);
        x.push_back(std::log(duration_s * shortest * std::pow(1 / (3 * shortest), share)));
      }
      for (std::size_t k = 0; k < options.start.size(); ++k) {
        x[options.order + k] = options.start[k].weight;
        x[options.order + terms + k] = std::log(options.start[k].relaxation_time_s);
      }
      all.push_back(x);
    }
  return all;
}

// Forces are proportional to all moduli together: the best scale of a start follows from one run.
struct Start {
  std::vector<double> x;
  double scale_pa = 0, cost = 0;
};
std::optional<Start> scaled(Model& model, const std::vector<TestCurve>& curves,
                            std::vector<double> x) {
  model.set_scale(1000);
  const auto m = model.material(x.data());
  double both = 0, own = 0, measured = 0;
  for (const auto& curve : curves) {
    const auto stresses = predicted_stresses(m, curve);
    if (stresses.empty()) return std::nullopt;
    const double weight = 1 / (curve.largest_stress_pa() * curve.largest_stress_pa());
    for (std::size_t i = 0; i < stresses.size(); ++i) {
      both += weight * stresses[i] * curve.stresses_pa[i];
      own += weight * stresses[i] * stresses[i];
      measured += weight * curve.stresses_pa[i] * curve.stresses_pa[i];
    }
  }
  if (!(both > 0)) return std::nullopt;
  return Start{std::move(x), 1000 * both / own, measured - both * both / own};
}

// Returns Student's t of 95 % for a whole number of degrees of freedom; it is right to 1 %.
double student_95(double freedom) {
  if (freedom <= static_cast<double>(kStudent95.size()))
    return kStudent95[static_cast<std::size_t>(freedom) - 1];
  const double z = kZ95, z3 = z * z * z, z5 = z3 * z * z;
  return z + (z3 + z) / (4 * freedom) + (5 * z5 + 16 * z3 + 3 * z) / (96 * freedom * freedom);
}

// Covariance of the parameters over the residuals' variance: very large for what no data touch, and
// infinite on the diagonal where there are no derivatives.
Eigen::MatrixXd covariance_of(const Model& model, const std::vector<double>& x) {
  const auto rows = static_cast<Eigen::Index>(model.row_count());
  const auto columns = static_cast<Eigen::Index>(model.size());
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> j(rows, columns);
  if (!model.jacobian(x.data(), j.data()))
    return Eigen::VectorXd::Constant(columns, INFINITY).asDiagonal();
  Eigen::VectorXd lengths = j.colwise().norm().transpose();
  for (auto& l : lengths) l = l > 0 ? l : 1;
  const Eigen::MatrixXd scaled = j * lengths.cwiseInverse().asDiagonal();
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(scaled, Eigen::ComputeThinV);
  const auto& s = svd.singularValues();
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(columns, columns);
  for (Eigen::Index i = 0; i < columns; ++i) {
    const double value = std::max(s[i], kSmallestSingularValue * s[0]);
    covariance += svd.matrixV().col(i) * svd.matrixV().col(i).transpose() / (value * value);
  }
  const auto inverse = lengths.cwiseInverse().asDiagonal();
  return inverse * covariance * inverse;
}

// Notes which other constant each is most strongly correlated with.
void add_couplings(const Eigen::MatrixXd& covariance, std::vector<IdentifiedConstant>& constants) {
  for (std::size_t k = 0; k < constants.size(); ++k)
    for (std::size_t other = 0; other < constants.size(); ++other) {
      const auto i = static_cast<Eigen::Index>(k), o = static_cast<Eigen::Index>(other);
      const double r = covariance(i, o) / std::sqrt(covariance(i, i) * covariance(o, o));
      const double strongest = std::max(kStrongCorrelation, std::abs(constants[k].correlation));
      if (other == k || !(std::abs(r) > strongest)) continue;
      constants[k].correlation = r;
      constants[k].coupled_with = constants[other].name;
    }
}

void add_constants(Identification& result, const Model& model, const IdentifyOptions& options,
                   const std::vector<double>& x, double cost) {
  const double freedom = static_cast<double>(model.row_count() - model.size());
  const Eigen::MatrixXd covariance = covariance_of(model, x);
  const double width = student_95(freedom) * std::sqrt(2 * cost / freedom);
  const std::size_t terms = model.term_count();
  for (std::size_t k = 0; k < x.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    const double half = width * std::sqrt(covariance(i, i));
    IdentifiedConstant constant;
    if (k < options.order) {
      const double scale = model.scale_pa();
      constant = {"C" + std::to_string(k + 1) + "0", "Pa", x[k] * scale, (x[k] - half) * scale,
                  (x[k] + half) * scale};
    } else if (k < options.order + terms) {
      constant = {"g" + std::to_string(k - options.order + 1), "", x[k], x[k] - half, x[k] + half};
    } else {
      constant = {"tau" + std::to_string(k - options.order - terms + 1), "s", std::exp(x[k]),
                  std::exp(x[k] - half), std::exp(x[k] + half)};
    }
    constant.is_determined =
        std::isfinite(constant.high) && constant.high - constant.low < 2 * std::abs(constant.value);
    result.constants.push_back(constant);
  }
  add_couplings(covariance, result.constants);
}

// Terms in order of their relaxation times.
void sort_terms(std::vector<double>& x, std::size_t order, std::size_t terms) {
  std::vector<std::pair<double, double>> pairs;
  for (std::size_t k = 0; k < terms; ++k) pairs.emplace_back(x[order + terms + k], x[order + k]);
  std::sort(pairs.begin(), pairs.end());
  for (std::size_t k = 0; k < terms; ++k)
    x[order + terms + k] = pairs[k].first, x[order + k] = pairs[k].second;
}

struct Minimum {
  double cost = 0;
  bool is_usable = false, is_converged = false;
};
Minimum minimise(const Model& model, const IdentifyProgress& progress, double longest_s,
                 std::vector<double>& x) {
  Cost function(model);
  ceres::Problem::Options ownership;
  ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(ownership);
  problem.AddResidualBlock(&function, nullptr, x.data());
  const std::size_t terms = model.term_count(), order = x.size() - 2 * terms;
  problem.SetParameterLowerBound(x.data(), 0, 1e-4);
  for (std::size_t k = 0; k < terms; ++k) {
    problem.SetParameterLowerBound(x.data(), static_cast<int>(order + k), 0);
    problem.SetParameterUpperBound(x.data(), static_cast<int>(order + k), kLargestWeightSum);
    const int tau = static_cast<int>(order + terms + k);
    problem.SetParameterLowerBound(x.data(), tau, std::log(1e-5 * longest_s));
    problem.SetParameterUpperBound(x.data(), tau, std::log(100 * longest_s));
  }
  ceres::Solver::Options how;
  how.linear_solver_type = ceres::DENSE_QR;
  how.logging_type = ceres::SILENT;
  how.max_num_iterations = 200;
  how.function_tolerance = 1e-12;
  how.parameter_tolerance = 1e-9;
  how.gradient_tolerance = 1e-14;
  Reporter reporter(progress, model.row_count());
  how.callbacks.push_back(&reporter);
  ceres::Solver::Summary summary;
  ceres::Solve(how, &problem, &summary);
  return {summary.final_cost, summary.IsSolutionUsable() && std::isfinite(summary.final_cost),
          summary.termination_type == ceres::CONVERGENCE};
}

}  // namespace

std::vector<double> predicted_stresses(const HyperelasticMaterial& material,
                                       const TestCurve& curve) {
  finite_elements::Specimen specimen(material, curve.mode);
  std::vector<double> stresses;
  double before = curve.mode == material::TestMode::SimpleShear ? 0 : 1;
  for (std::size_t i = 0; i < curve.times_s.size(); ++i) {
    const double stretch = curve.stretches[i];
    const double dt = i == 0 ? 0 : curve.times_s[i] - curve.times_s[i - 1];
    const int parts = 1 + static_cast<int>(std::abs(stretch - before) / kLargestStretchStep);
    std::optional<double> stress;
    for (int part = 1; part <= parts; ++part) {
      stress = specimen.stretch_to(before + (stretch - before) * part / parts, dt / parts);
      if (!stress || !std::isfinite(*stress)) return {};
    }
    stresses.push_back(*stress);
    before = stretch;
  }
  return stresses;
}

std::vector<std::string> Identification::remarks() const {
  std::vector<std::string> lines;
  for (const auto& constant : constants) {
    if (constant.is_determined) continue;
    std::string line = "the data do not tell " + constant.name;
    if (!constant.coupled_with.empty()) line += " from " + constant.coupled_with;
    line += constant.name[0] == 'C'
                ? ": measure further stretch, or ask for a lower order"
                : ": measure longer or faster relaxation, or ask for fewer terms";
    lines.push_back(line);
  }
  return lines;
}

Result<Identification> identify(const std::vector<TestCurve>& curves,
                                const IdentifyOptions& options, const IdentifyProgress& progress) {
  if (auto s = check(options); !s) return s.error();
  Model model(curves, options);
  if (model.row_count() <= model.size())
    return Error{ErrorCode::BadFile, "there are " + std::to_string(model.row_count()) +
                                         " measurements for " + std::to_string(model.size()) +
                                         " constants: ask for a lower order or fewer terms"};
  std::optional<Start> best;
  for (auto& x : starts(model, options, duration(curves)))
    if (auto start = scaled(model, curves, std::move(x));
        start && (!best || start->cost < best->cost))
      best = std::move(start);
  if (!best)
    return Error{ErrorCode::BadFile,
                 "the curves are not those of a material that resists its "
                 "deformation: check signs, test and units"};
  model.set_scale(best->scale_pa);
  Identification result;
  auto& x = best->x;
  const auto minimum = minimise(model, progress, duration(curves), x);
  if (!minimum.is_usable)
    return Error{ErrorCode::BadFile,
                 "no material was found whose forces are near these: start from other weights and "
                 "times, or ask for a lower order or fewer terms"};
  result.is_converged = minimum.is_converged;
  sort_terms(x, options.order, model.term_count());
  result.material = model.material(x.data());
  for (const auto& curve : curves)
    result.stresses_pa.push_back(predicted_stresses(result.material, curve));
  result.rms_percent = 100 * std::sqrt(2 * minimum.cost / static_cast<double>(model.row_count()));
  add_constants(result, model, options, x, minimum.cost);
  result.evaluations = model.evaluations();
  result.stability = material::validate(result.material);
  return result;
}

}  // namespace trocar::fit
