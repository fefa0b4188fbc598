#pragma once

// A lab runs experiments: it turns scenario texts into running scenarios, keeps the texts and the
// organs that they need beside the report (so that trocar-sim runs the very same), and shows how
// far a run is. A scenario that cannot run is an error of this program: it says so and ends.

#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "common/base/result.h"
#include "server/lab/scenario/scenario_run.h"
#include "tests/validation/report.h"

namespace trocar::validation {

using scenario::ScenarioRun;
using scenario::Solver;
using RunPtr = std::unique_ptr<ScenarioRun>;

class Lab {
 public:
  Lab(std::filesystem::path folder, bool is_short);

  // Seconds instead of minutes: coarser meshes, fewer points.
  bool is_short() const { return is_short_; }

  // The folder of scenarios and of what other programs are given.
  const std::filesystem::path& scenarios() const { return scenarios_; }

  // Makes scenarios/<name>.organ, to which scenarios refer as "<name>.organ".
  void keep_organ(const std::string& name, const organ::Organ& organ) const;

  // Makes scenarios/<name>, a file to which scenarios refer.
  void keep_file(const std::string& name, const std::string& text) const;

  // Keeps the text as scenarios/<name>.toml and in the section, and gets it ready to run.
  RunPtr start(Section& section, const std::string& family, const std::string& name,
               const std::string& text, Solver solver = Solver::Live) const;
  // Does the same as start(), but returns null if the solver cannot do it yet; the section says so.
  RunPtr try_start(Section& section, const std::string& family, const std::string& name,
                   const std::string& text, Solver solver = Solver::Live) const;
  // To the end, `each` after every step. The section counts steps that missed their tolerance.
  void finish(Section& section, ScenarioRun& run,
              const std::function<void(const scenario::StepReport&)>& each = {}) const;

 private:
  std::filesystem::path scenarios_;
  bool is_short_;
};

// Says why the scenario cannot run, and ends the program.
[[noreturn]] void end_with(const std::string& scenario, const Error& error);

// Returns what a scenario needs, or ends the program.
template <typename T>
T must(Result<T> result, const std::string& scenario) {
  if (!result) end_with(scenario, result.error());
  if constexpr (!std::is_void_v<T>) return std::move(*result);
}

// One line on a terminal that is rewritten; nothing elsewhere.
void show_progress(const std::string& text);

}  // namespace trocar::validation
