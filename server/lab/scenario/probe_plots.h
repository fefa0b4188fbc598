#pragma once

// These plots show the probes: probe_<name>.svg has components and magnitude over time, and
// force_<name>.svg has force against displacement for each curve of load_curve.h. A long run is
// drawn with fewer points: always evenly spaced ones, at most kMaxPlotPoints. One thread.

#include <filesystem>
#include <vector>

#include "common/base/result.h"
#include "server/lab/scenario/load_curve.h"

namespace trocar::scenario {

inline constexpr std::size_t kMaxPlotPoints = 4000;

class ProbePlots {
 public:
  explicit ProbePlots(const ScenarioRun& run);

  // After a step.
  void add(const ScenarioRun& run);
  // Error: gnuplot is missing or a file cannot be written. Probes without a value have no picture.
  Status write(const std::filesystem::path& folder, const ScenarioRun& run) const;

 private:
  struct Sample {
    double time_s = 0;
    Vec3d value;
  };
  // Keeps every stride-th of what it is given.
  template <typename T>
  class Thinned {
   public:
    void add(const T& value) {
      if (given_++ % stride_ != 0) return;
      kept_.push_back(value);
      if (kept_.size() <= kMaxPlotPoints) return;
      for (std::size_t i = 0; 2 * i < kept_.size(); ++i) kept_[i] = kept_[2 * i];
      kept_.resize((kept_.size() + 1) / 2);
      stride_ *= 2;
    }
    const std::vector<T>& kept() const { return kept_; }

   private:
    std::vector<T> kept_;
    std::size_t given_ = 0, stride_ = 1;
  };

  std::vector<LoadCurve> curves_;
  std::vector<Thinned<Sample>> samples_;    // per probe
  std::vector<Thinned<LoadPoint>> points_;  // per curve
};

}  // namespace trocar::scenario
