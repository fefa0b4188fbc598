#pragma once

// Constants of a measured material from force curves of specimens (Dogan 2011 fits Nava's the same
// way): C_i0, g_k and tau_k by nonlinear least squares (Ceres, Levenberg-Marquardt) over the whole
// history of each curve, loading and relaxation together, so that a ramp need not be sudden. The
// bulk modulus is a given multiple of C10: such tests hardly tell it.
//
// Each curve counts by its difference over its own largest stress. Intervals are of 95 %, from the
// linearised model and the scatter of the residuals (Student's t), for errors that are equal and
// independent; those of tau_k are symmetric in its logarithm. One thread; a few seconds.

#include <functional>
#include <string>
#include <vector>

#include "server/lab/fit/test_curves.h"

namespace trocar::fit {

struct IdentifyOptions {
  std::string name = "identified";
  std::size_t order = 5;                   // number of C_i0
  std::size_t term_count = 2;              // of the Prony series
  std::vector<material::PronyTerm> start;  // instead of term_count terms of our choice
  double bulk_ratio = 40;                  // K over C10
  material::VolumeSplit split = material::VolumeSplit::Unsplit;
};

struct IdentifiedConstant {
  std::string name;           // "C10", "g1", "tau1"
  std::string unit;           // "Pa", "", "s"
  double value = 0;           // SI
  double low = 0, high = 0;   // of the interval, if it is determined
  bool is_determined = true;  // half the interval is narrower than the value
  std::string coupled_with;   // another constant that can make up for it; empty: none
  double correlation = 0;     // with that one
};

struct Identification {
  material::HyperelasticMaterial material;
  std::vector<IdentifiedConstant> constants;
  std::vector<std::vector<double>> stresses_pa;  // of the material, per curve and row
  double rms_percent = 0;                        // of each curve's largest stress
  int evaluations = 0;
  bool is_converged = false;
  Status stability;  // of the identified law: where it fails

  // One line per constant, or pair of them, that the data do not tell.
  std::vector<std::string> remarks() const;
};

// After each iteration: its number and the rms difference in percent.
using IdentifyProgress = std::function<void(int iteration, double rms_percent)>;

// Error: options out of range, fewer rows than constants, or no start from which forces follow.
Result<Identification> identify(const std::vector<TestCurve>& curves,
                                const IdentifyOptions& options,
                                const IdentifyProgress& progress = {});

// Returns what a material would show at the curve's times and stretches, Pa; empty if no
// equilibrium of its free sides was found. Steps of stretch are at most 1 %.
std::vector<double> predicted_stresses(const material::HyperelasticMaterial& material,
                                       const TestCurve& curve);

}  // namespace trocar::fit
