#include "tests/validation/lab.h"

#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>

#include "common/base/bytes.h"
#include "common/base/checksum.h"
#include "common/base/timing.h"
#include "server/organs/organ/organ_file.h"

namespace trocar::validation {
namespace {

constexpr std::uint64_t kProgressEvery_ns = 300'000'000, kLogEvery_ns = 10'000'000'000;

}  // namespace

void end_with(const std::string& scenario, const Error& error) {
  std::fprintf(stderr, "\ntrocar-validate: scenario %s: %s\n", scenario.c_str(),
               error.message.c_str());
  std::exit(static_cast<int>(ExitCode::BadFile));
}

void show_progress(const std::string& text) {
  static const bool is_terminal = isatty(STDERR_FILENO) != 0;
  if (is_terminal) {
    std::fprintf(stderr, "\r\033[K  %s", text.c_str());
    return;
  }
  // A log gets a line now and then.
  static std::uint64_t shown = monotonic_ns();
  const auto now = monotonic_ns();
  if (text.empty() || now - shown < kLogEvery_ns) return;
  shown = now;
  std::fprintf(stderr, "  %s\n", text.c_str());
}

Lab::Lab(std::filesystem::path folder, bool is_short)
    : scenarios_(std::move(folder) / "scenarios"), is_short_(is_short) {}

void Lab::keep_organ(const std::string& name, const organ::Organ& organ) const {
  must(organ::write_organ(scenarios_ / (name + ".organ"), organ), name);
}

void Lab::keep_file(const std::string& name, const std::string& text) const {
  must(write_file(scenarios_ / name, text), name);
}

RunPtr Lab::start(Section& section, const std::string& family, const std::string& name,
                  const std::string& text, Solver solver) const {
  auto run = try_start(section, family, name, text, solver);
  if (!run) must(Status(Error{ErrorCode::BadFile, "is not supported"}), name);
  return run;
}

RunPtr Lab::try_start(Section& section, const std::string& family, const std::string& name,
                      const std::string& text, Solver solver) const {
  const auto path = scenarios_ / (name + ".toml");
  must(write_file(path, text), name);
  auto resolved =
      must(scenario::resolve(must(scenario::parse_scenario_text(text, path.string()), name)), name);
  if (const auto supported = scenario::check_supported(resolved); !supported) {
    section.say("Left out: " + name + ": " + supported.error().message);
    return nullptr;
  }
  section.scenes.push_back({family, name, text});
  show_progress(name);
  return std::make_unique<ScenarioRun>(std::move(resolved), solver);
}

void Lab::finish(Section& section, ScenarioRun& run,
                 const std::function<void(const scenario::StepReport&)>& each) const {
  std::uint64_t next = monotonic_ns() + kProgressEvery_ns;
  while (!run.is_finished()) {
    const auto report = run.step();
    ++section.steps;
    section.unconverged_steps += report.is_converged ? 0 : 1;
    if (each) each(report);
    if (const auto now = monotonic_ns(); now >= next) {
      next = now + kProgressEvery_ns;
      show_progress(fmt::format(
          "{}: {:.0f} %", run.scenario().source.stem().string(),
          100.0 * static_cast<double>(run.steps_done()) / static_cast<double>(run.step_count())));
    }
  }
  StateHasher hash;
  hash.update(bytes_of(std::span<const std::uint64_t>(&section.state_hash, 1)));
  hash.update(bytes_of(run.world().displacements));
  section.state_hash = hash.digest();
}

}  // namespace trocar::validation
