#pragma once

// probes.csv: one row per time at which a probe is due, one column per probe and axis with the unit
// in its name; a probe that is not due leaves its cells empty. Numbers have nine digits, which name
// a float exactly; times that are ticks are in milliseconds.

#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "common/base/result.h"
#include "server/lab/scenario/scenario_run.h"

namespace trocar::scenario {

class ProbeFile {
 public:
  // Writes the header.
  static Result<ProbeFile> create(const std::filesystem::path& path,
                                  const scenario::Scenario& scenario);

  // After a step: a row if a probe is due.
  void add(const ScenarioRun& run);
  // A row of one value per probe, SI, at any time; nothing for one that is not due.
  void add(double time_s, std::span<const std::optional<Vec3d>> values);
  // Hands all rows to the operating system, so that they survive a crash of the program.
  void flush() { std::fflush(file_.get()); }
  // Error: a row could not be written.
  Status close();

 private:
  struct Closer {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  using Values = std::span<const std::optional<Vec3d>>;
  void add_row(const char* time, Values values);

  std::filesystem::path path_;
  bool is_static_ = false;
  std::vector<double> per_si_;  // per probe
  std::unique_ptr<std::FILE, Closer> file_;
};

}  // namespace trocar::scenario
