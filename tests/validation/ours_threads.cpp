// Surgical thread beside closed forms: stretch, jerk, friction on a peg, a knot without friction.

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/thread/laid_thread.h"
#include "tests/validation/experiments.h"

namespace trocar::validation {
namespace {

using thread::LaidThread;

constexpr double kPi = std::numbers::pi;

void check_stretch(Section& section) {
  auto rules = thread::rules_of(thread::silk_along({{0, 0, 0}, {0.3, 0, 0}}));
  rules.threads[0].start.is_held = true;
  rules.threads[0].end = {.load_n = {5, 0, 0}, .until_s = 0.1};
  LaidThread laid(rules);
  laid.run(400);
  section.compare("stretch", 5 / rules.threads[0].suture().stretch_n, laid.length_m() / 0.3 - 1,
                  law(0.01, "F / (E A)"), "",
                  "Strain of 300 mm of silk 3-0 under 5 N, after 0.4 s.");
}

void check_jerk(Section& section) {
  section.at_most("jerk", "0", thread::strain_at_a_jerk(),
                  target(1e-3, "a slack thread does not stretch"),
                  "Largest strain of a slack thread whose one end goes off at 1 m/s and stops.");
}

void check_capstan(const Lab& lab, Section& section) {
  constexpr double kLoadN = 0.5, kPegM = 5e-3, kSpeed = 0.02;
  Table table{"Pull over load, drawn over a peg of 5 mm radius at 20 mm/s",
              {"degrees", "friction", "exp(mu theta)", "measured", "off (%)"},
              {}};
  double largest = 0;
  for (const double degrees : {57.3, 90.0, 229.2, 360.0, 540.0})
    for (const double friction : {0.05, 0.15, 0.3}) {
      if (lab.is_short() && (degrees == 90.0 || friction == 0.15)) continue;
      const double angle = degrees * kPi / 180, exact = std::exp(friction * angle);
      LaidThread laid(thread::around_peg(angle, friction, kPegM, kLoadN, kSpeed));
      laid.run(600);
      double sum = 0;
      for (int k = 0; k < 300; ++k) {
        laid.tick();
        sum += length(laid.step.end_forces()[0].end_n);
      }
      const double ours = sum / 300 / kLoadN, off = ours / exact - 1;
      largest = std::max(largest, std::abs(off));
      table.rows.push_back({fmt::format("{:.0f}", degrees), fmt::format("{:.2f}", friction),
                            fmt::format("{:.4f}", exact), fmt::format("{:.4f}", ours),
                            fmt::format("{:+.2f}", 100 * off)});
    }
  section.add(std::move(table));
  section.at_most("capstan", "exp(mu theta)", largest, law(0.03, "Euler-Eytelwein"),
                  "The largest error of the pull at the end, of all cases.");
}

// Without friction the tension is the same all along, so the loop pulls with twice that of an end.
void check_half_knot(Section& section) {
  thread::KnotInHands knot({{3, 1}}, 0);
  double sum = 0;
  for (int k = 0; k < 900; ++k) {
    knot.pull(0.05 * std::clamp(1.2 - knot.force_n() / 2, 0.0, 1.0));
    if (k >= 700) sum += knot.loop_n() / (2 * knot.force_n());
  }
  section.compare("half-knot", 1, sum / 200,
                  target(0.03, "segments of 1 mm slide over each other").missed(0.08), "",
                  "The loop's pull over twice that of an end, of a tight half knot without "
                  "friction. Corners of the chain catch on each other.");
}

}  // namespace

void run_threads(const Lab& lab, Section& section) {
  section.say("Thread moves as a chain of nodes 1 mm apart, solved directly in each tick.");
  check_stretch(section);
  check_jerk(section);
  check_capstan(lab, section);
  check_half_knot(section);
}

}  // namespace trocar::validation
