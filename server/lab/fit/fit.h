#pragma once

// Fits numbers of a material to a measured force-displacement curve: the scenario that makes the
// same test runs again and again, and least squares (Ceres, Levenberg-Marquardt) change the numbers
// until its forces are nearest to the measured ones (Choi 2002 asks for such a calibration).
//
// In a static run each measured displacement is a load step, and the order of measurements does not
// matter. In a dynamic run forces are compared at the measured times; without times, at the
// measured displacements on the way to the largest one. Forces between samples are interpolated.
// One thread; as long as so many runs of the scenario.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/lab/fit/measurements.h"
#include "server/lab/scenario/load_curve.h"

namespace trocar::fit {

struct FitOptions {
  // Keys of [material]; empty: young_modulus_pa or spring_stiffness_n_m, whichever counts.
  std::vector<std::string> parameters;
  std::string region;  // whose material; empty: the organ's own
  std::string curve;   // of load_curves(), by name; empty: the only one
  scenario::Solver solver = scenario::Solver::Full;
};

struct FittedParameter {
  std::string key;
  double start = 0, value = 0;
  std::optional<double> standard_error;  // nothing if the data do not tell it from the others
  enum class Limit { None, Lower, Upper };
  Limit at = Limit::None;  // where the fit was stopped, because values end there

  // Returns, as identify() does, whether 95 % of the chance lie within less than twice the value.
  bool is_determined() const;
};

struct Fit {
  std::vector<FittedParameter> parameters;
  std::vector<double> forces_n;       // of the fitted material, per measurement
  double rms_n = 0, rms_percent = 0;  // percent of the largest measured force
  int runs = 0;
  bool is_converged = false;
  bool has_unconverged_steps = false;  // in the last run
  organ::Organ organ;                  // with the fitted material

  // Returns what makes the result doubtful, a line each.
  std::vector<std::string> remarks() const;
};

// The function hears after each run what was tried so far.
using Progress =
    std::function<void(int run, const std::vector<FittedParameter>& tried, double rms_n)>;

// Error: the scenario has no such curve, does not reach a measured displacement, an unknown key, or
// one on which the curve does not depend.
Result<Fit> fit(const scenario::ResolvedScenario& resolved, const MeasuredCurve& measured,
                const FitOptions& options, const Progress& progress = {});

// The keys that can be fitted, for messages and help.
std::string fit_keys();
// "[material]" and what was fitted, as a part of a scenario, after the remarks as comments.
std::string to_toml(const Fit& fit, const FitOptions& options);

}  // namespace trocar::fit
