// Beyond the papers: what it takes to part two bodies that ties hold, beside the energy that these
// are said to take.

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <fstream>
#include <iterator>

#include "common/base/assert.h"
#include "server/organs/catalogue/join_parts.h"
#include "tests/support/tied_strip.h"
#include "tests/validation/experiments.h"

namespace trocar::validation {
namespace {

constexpr double kToughness_j_m2 = 20;
constexpr double kWorkTarget = 0.15, kSpread = 0.05;
constexpr double kSpreadOnRecord = 0.12;  // of all nine strips

std::string read_text(const std::filesystem::path& path) {
  std::ifstream in(path);
  return {std::istreambuf_iterator<char>(in), {}};
}

void peel_strips(const Lab& lab, Section& section) {
  section.say(
      "A strip of wall, 2 mm thick, 10 mm wide and of 100 kPa, lies on a bed that stands. Its free "
      "end is held and drawn off at right angles, until the last tie has broken. What a strip of "
      "60 mm takes more than one of 30 mm is the work of the steady peel: the toughness of what "
      "comes off, whatever the mesh and the sweeps.");
  double least = 1e9, most = 0;
  for (const double spacing_mm : {2.0, 3.0, 5.0})
    for (const std::uint32_t sweeps : {2u, 4u, 30u}) {
      if (lab.is_short() && (spacing_mm == 3 || sweeps != 4)) continue;
      const double work =
          testing::peel_work({.spacing_mm = spacing_mm, .toughness_j_m2 = kToughness_j_m2}, sweeps);
      least = std::min(least, work), most = std::max(most, work);
      section.compare(fmt::format("strip-{:g}-mm-{}-sweeps", spacing_mm, sweeps), kToughness_j_m2,
                      work, target(kWorkTarget, "what a hand does not tell apart"), "J/m^2",
                      "what 30 mm of strip more take, over their area");
    }
  const auto aim = target(kSpread, "the work is no matter of the mesh");
  section.at_most("strip-spread", "the same for all", (most - least) / kToughness_j_m2,
                  lab.is_short() ? aim : aim.missed(kSpreadOnRecord),
                  "the largest difference between two of these");
}

// The scenario of deploy/scenes, on the organ of its part file.
void peel_bed(const Lab& lab, Section& section) {
  const std::filesystem::path scenes = TROCAR_SOURCE_DIR "/deploy/scenes";
  const auto file = must(catalogue::read_part_file(scenes / "bed.toml"), "bed");
  lab.keep_organ("bed", must(catalogue::join_parts(file), "bed").organ);
  auto text = read_text(scenes / "peel.toml");
  const std::string source = "source = \"bed.toml\"";
  const auto at = text.find(source);
  TROCAR_ASSERT(at != std::string::npos);
  text.replace(at, source.size(), "source = \"bed.organ\"");
  const auto run = lab.start(section, "peel", "peel", text);
  double greatest_n = 0, step_n = 0, work_j = 0;
  Vec3d before_n, tip = run->tool_tip(0);
  lab.finish(section, *run, [&](const scenario::StepReport&) {
    const Vec3d force_n = run->probe(0);
    greatest_n = std::max(greatest_n, length(force_n));
    step_n = std::max(step_n, length(force_n - before_n));
    work_j -= dot(force_n, run->tool_tip(0) - tip);
    before_n = force_n, tip = run->tool_tip(0);
  });
  const auto& cuts = run->simulation().state().cuts;
  const auto& ties = cuts.topology().ties();
  std::size_t broken = 0;
  for (std::size_t i = 0; i < ties.count(); ++i) broken += ties[i].is_broken ? 1 : 0;
  section.exactly("bed-ties", fmt::format("{} broken", ties.count()),
                  fmt::format("{} broken", broken), law(0, "it has been drawn out of its bed"),
                  "ties of the bed at the end");
  section.exactly("bed-nodes", "none", cuts.history().empty() ? "none" : "some",
                  target(0, "the liver is not torn"), "nodes and wounds that the peel has made");
  section.at_most("bed-force-step", "smooth", step_n, target(0.2, "what a hand feels as a jerk, N"),
                  "the largest change of the grasper's force in a tick, N");
  section.measured("bed-force", fmt::format("{:.2f} N", greatest_n),
                   "the grasper's greatest force");
  section.measured("bed-work", fmt::format("{:.1f} mJ", 1e3 * work_j), "the grasper's work");
}

}  // namespace

void run_ties(const Lab& lab, Section& section) {
  peel_strips(lab, section);
  peel_bed(lab, section);
}

}  // namespace trocar::validation
