// Beyond the papers: what a hand feels of an organ over a network, beside the same organ without
// any delay, and what simple schemes would let it feel.

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "common/base/assert.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "tests/feel/felt_motions.h"
#include "tests/haptics/motions.h"
#include "tests/validation/experiments.h"

namespace trocar::validation {
namespace {

namespace felt = haptics::testing;
using felt::Outcome;

constexpr tool::ToolShape kProbe{.radius_m = 0.006f, .length_m = 0.2f, .reach_m = 0.008f};
constexpr int kFeelShortTets = 6000;    // coarser ones are flat under the probe
constexpr double kStiffness_n_m = 139;  // of tissue that the motions are made for

// Errors that a round trip allows, relative; degrees.
struct Targets {
  double rtt_ms, press, one_hz, three_hz, release, gain, phase_deg;
};
constexpr Targets kTargets[] = {
    {0, 0.05, 0.03, 0.07, 0.04, 0.03, 3},   {10, 0.05, 0.03, 0.07, 0.04, 0.03, 3},
    {25, 0.05, 0.03, 0.07, 0.04, 0.03, 3},  {50, 0.05, 0.03, 0.07, 0.04, 0.03, 3},
    {100, 0.08, 0.04, 0.08, 0.06, 0.05, 5}, {150, 0.14, 0.06, 0.09, 0.08, 0.08, 6}};
constexpr double kSteady = 0.01, kFastGain = 0.15, kFastPhase_deg = 20;
constexpr double kMostStep_n = 0.3, kMostWork_mj = 1;

struct Scheme {
  const char* name;
  felt::MakeOrganClient make;
};
std::vector<Scheme> schemes() {
  return {{"model", [](const auto& laws) { return felt::make_model(kProbe, laws); }},
          {"last force", [](const auto&) { return felt::make_hold(); }},
          {"linearised", [](const auto&) { return felt::make_linear(1); }},
          {"scaled penalty", [](const auto&) { return felt::make_scaled_penalty(); }}};
}

struct Network {
  double rtt_ms = 0, loss = 0.01, jitter_ms = -1;
  bool is_stream = false;

  std::string words() const {
    return fmt::format("{:g} ms, {:g} % lost{}{}", rtt_ms, 100 * loss,
                       jitter_ms > 0 ? fmt::format(", jitter {:g} ms", jitter_ms) : "",
                       is_stream ? ", stream" : "");
  }
};
constexpr Network kDrawn{.rtt_ms = 100};

class FeelStudy {
 public:
  FeelStudy(const Lab& lab, Section& section, const organ::Organ& organ)
      : section_(section),
        is_short_(lab.is_short()),
        simulation_(organ),
        place_(felt::place_on(simulation_, kProbe, {0, 1, 0})) {}

  void run() {
    const auto all = schemes();
    for (const auto& targets : kTargets) {
      if (is_short_ && targets.rtt_ms != 50 && targets.rtt_ms != 100) continue;
      hold_against(targets, {.rtt_ms = targets.rtt_ms}, fmt::format("{:g}-ms", targets.rtt_ms));
      if (is_short_ && targets.rtt_ms != 100) continue;
      for (const auto& scheme : all) compare(scheme, targets.rtt_ms);
    }
    if (!is_short_) {
      hold_against(kTargets[4], {.rtt_ms = 100, .loss = 0}, "100-ms-nothing-lost");
      hold_against(kTargets[4], {.rtt_ms = 100, .loss = 0.05}, "100-ms-5-percent");
      look_at({.rtt_ms = 100, .jitter_ms = 10});
      for (const double rtt_ms : {25.0, 50.0, 100.0})
        look_at({.rtt_ms = rtt_ms, .is_stream = true});
    }
    show();
  }

 private:
  Outcome feel(const Scheme& scheme, const Network& network, const felt::Motion& motion) {
    const auto what = fmt::format("{}, {}, {}", scheme.name, network.words(), motion.name);
    if (const auto known = outcomes_.find(what); known != outcomes_.end()) return known->second;
    show_progress(what);
    felt::FeelSettings settings;
    settings.line = {.rtt_s = 1e-3 * network.rtt_ms,
                     .loss = network.loss,
                     .jitter_s = network.jitter_ms < 0 ? -1 : 1e-3 * network.jitter_ms,
                     .is_stream = network.is_stream};
    const auto plain = felt::plain(motion);
    const auto record = felt::run(simulation_, kProbe, place_, plain, scheme.make, settings);
    if (motion.frequency_hz == 1 && network.words() == kDrawn.words()) draw(scheme, record);
    return outcomes_[what] = felt::measure(felt::measured_of(motion), record);
  }

  // Runs the model through all motions and adds them to the table.
  std::map<std::string, Outcome> feel_all(const Network& network) {
    const auto model = schemes().front();
    std::vector<felt::Motion> motions{
        felt::press(kStiffness_n_m), felt::palpation(kStiffness_n_m, 0.5),
        felt::palpation(kStiffness_n_m, 1), felt::palpation(kStiffness_n_m, 3),
        felt::release(kStiffness_n_m)};
    if (!is_short_)
      for (const auto& make : {felt::taps, felt::slide, felt::grasp})
        motions.push_back(make(kStiffness_n_m));
    std::map<std::string, Outcome> outcomes;
    for (const auto& motion : motions) {
      const auto outcome = outcomes[motion.name] = feel(model, network, motion);
      const bool is_cyclic = motion.frequency_hz > 0;
      const auto if_cyclic = [&](double value, const char* format) {
        return is_cyclic ? fmt::format(fmt::runtime(format), value) : std::string();
      };
      table_.rows.push_back(
          {network.words(), motion.name, fmt::format("{:.1f}", 100 * outcome.rms),
           motion.steady_from_s >= 0 ? fmt::format("{:.2f}", 100 * outcome.steady) : "",
           if_cyclic(outcome.gain, "{:.3f}"), if_cyclic(outcome.phase_deg, "{:.1f}"),
           if_cyclic(outcome.cycle_mj, "{:.3f}"), if_cyclic(outcome.true_cycle_mj, "{:.3f}"),
           fmt::format("{:.2f}", outcome.work_mj), fmt::format("{:.3f}", outcome.step_n),
           fmt::format("{:.3f}", outcome.true_step_n), fmt::format("{:.3f}", outcome.free_n)});
    }
    return outcomes;
  }

  void look_at(const Network& network) { feel_all(network); }

  void bound(const std::string& what, const std::string& expected, const std::string& ours,
             double error, double most, bool is_relative, const std::string& note) {
    section_.checks.push_back({section_.name + "/" + what, expected, ours, error,
                               target(most, "it is felt as without delay"), is_relative, note});
  }

  void hold_against(const Targets& targets, const Network& network, const std::string& prefix) {
    const auto outcomes = feel_all(network);
    const auto error = [&](const char* motion, const char* what, double most) {
      const double rms = outcomes.at(motion).rms;
      bound(fmt::format("{}-{}", prefix, what), "0 %", shown_percent(rms), rms, most, true,
            fmt::format("Root mean square error of the force, of its peak: {}, {}.", motion,
                        network.words()));
    };
    error("press", "press", targets.press);
    error("1 Hz", "1-hz", targets.one_hz);
    error("3 Hz", "3-hz", targets.three_hz);
    error("release", "release", targets.release);
    const double steady = outcomes.at("press").steady;
    bound(prefix + "-steady", "0 %", shown_percent(steady), std::abs(steady), kSteady, true,
          "Force of a tool that rests, beside the truth.");
    for (const bool is_fast : {false, true}) {
      const char* motion = is_fast ? "3 Hz" : "1 Hz";
      const auto& outcome = outcomes.at(motion);
      const auto name = fmt::format("{}-{}", prefix, is_fast ? "3-hz" : "1-hz");
      bound(name + "-gain", "1", shown(outcome.gain), std::abs(outcome.gain - 1),
            is_fast ? kFastGain : targets.gain, true,
            fmt::format("Felt force over the true one at the palpation's frequency, {}.", motion));
      bound(name + "-phase", "0 degrees", shown(outcome.phase_deg), std::abs(outcome.phase_deg),
            is_fast ? kFastPhase_deg : targets.phase_deg, false,
            fmt::format("Phase of the felt force before the true one, degrees, {}.", motion));
    }
    for (const auto& [motion, what] :
         {std::pair{"0.5 Hz", "0.5-hz"}, std::pair{"1 Hz", "1-hz"}, std::pair{"3 Hz", "3-hz"}}) {
      const double cycle_mj = outcomes.at(motion).cycle_mj;
      bound(fmt::format("{}-{}-work", prefix, what), "below 0", shown(cycle_mj),
            std::max(0.0, cycle_mj), 0, false,
            fmt::format("Work on the hand in a cycle, mJ, {}.", motion));
    }
    double step_n = 0, work_mj = 0, free_n = 0;
    for (const auto& [name, outcome] : outcomes) {
      step_n = std::max(step_n, outcome.step_n);
      work_mj = std::max(work_mj, outcome.work_mj);
      free_n = std::max(free_n, outcome.free_n);
    }
    bound(prefix + "-step", fmt::format("at most {}", kMostStep_n), shown(step_n), step_n,
          kMostStep_n, false, "The largest change of the force within 1 ms, N, all motions.");
    bound(prefix + "-energy", fmt::format("at most {}", kMostWork_mj), shown(work_mj), work_mj,
          kMostWork_mj, false, "The most work done on the hand since the beginning, mJ.");
    bound(prefix + "-free", "0", shown(free_n), free_n, 0, false,
          "Force where the tool is 2 mm and more above the tissue, N.");
  }

  void compare(const Scheme& scheme, double rtt_ms) {
    const Network network{.rtt_ms = rtt_ms};
    const auto press = feel(scheme, network, felt::press(kStiffness_n_m));
    const auto slow = feel(scheme, network, felt::palpation(kStiffness_n_m, 1));
    const auto fast = feel(scheme, network, felt::palpation(kStiffness_n_m, 3));
    const auto release = feel(scheme, network, felt::release(kStiffness_n_m));
    const auto percent = [](double share) { return fmt::format("{:.1f}", 100 * share); };
    beside_.rows.push_back(
        {fmt::format("{:g}", rtt_ms), scheme.name, percent(press.rms), percent(slow.rms),
         percent(fast.rms), percent(release.rms), fmt::format("{:.2f}", slow.gain),
         fmt::format("{:.0f}", slow.phase_deg), fmt::format("{:.2f}", fast.gain),
         fmt::format("{:.0f}", fast.phase_deg), fmt::format("{:.2f}", slow.cycle_mj),
         fmt::format("{:.2f}", fast.cycle_mj),
         fmt::format("{:.1f}", std::max({press.work_mj, slow.work_mj, fast.work_mj})),
         fmt::format("{:.3f}",
                     std::max({press.free_n, slow.free_n, fast.free_n, release.free_n}))});
    for (const auto& [name, rms] : {std::pair{"1 Hz", slow.rms}, std::pair{"3 Hz", fast.rms}}) {
      auto& series = name == std::string("1 Hz") ? slow_errors_ : fast_errors_;
      auto found = std::ranges::find(series, scheme.name, &plot::Series::name);
      if (found == series.end())
        found = series.insert(series.end(), {scheme.name, {}, {}, plot::Style::LineAndPoints, {}});
      found->x.push_back(rtt_ms);
      found->y.push_back(100 * rms);
    }
  }

  // Two cycles of what each scheme lets the hand feel, and of the truth beside the model.
  void draw(const Scheme& scheme, const felt::FeelRecord& record) {
    const auto curve = [&](const std::string& name, const std::vector<Vec3d>& forces,
                           plot::Style style) {
      if (std::ranges::find(traces_, name, &plot::Series::name) != traces_.end()) return;
      plot::Series series{name, {}, {}, style, {}};
      for (std::size_t k = 2500; k < std::min<std::size_t>(4500, forces.size()); k += 4) {
        series.x.push_back(1e-3 * static_cast<double>(k));
        series.y.push_back(forces[k].z);
      }
      traces_.push_back(std::move(series));
    };
    curve(scheme.name, record.rendered_n, plot::Style::Line);
    if (scheme.name == std::string("model")) curve("truth", record.true_n, plot::Style::Dashed);
  }

  void show() {
    section_.add(std::move(table_));
    section_.add(std::move(beside_));
    const auto add = [&](const char* title, const char* x, const char* y,
                         std::vector<plot::Series> series, bool is_logarithmic) {
      plot::Plot plot;
      plot.title = title;
      plot.x = {x, false, {}, {}};
      plot.y = {y, is_logarithmic, {}, {}};
      plot.series = std::move(series);
      section_.add(std::move(plot));
    };
    add("Palpation at 1 Hz", "round trip, ms", "error, % of the peak", slow_errors_, true);
    add("Palpation at 3 Hz", "round trip, ms", "error, % of the peak", fast_errors_, true);
    add("Palpation at 1 Hz, round trip of 100 ms", "time, s", "force, N", traces_, false);
  }

  Section& section_;
  const bool is_short_;
  const step::Simulation simulation_;
  const felt::Frame place_;
  Table table_{
      "What a hand feels of the model",
      {"network", "motion", "error, %", "steady, %", "gain", "phase, degrees", "work per cycle, mJ",
       "of the truth", "most work, mJ", "largest step, N/ms", "of the truth", "free, N"},
      {}};
  Table beside_{"Beside other schemes, 1 % lost",
                {"round trip, ms", "scheme", "press, %", "1 Hz, %", "3 Hz, %", "release, %",
                 "gain 1 Hz", "phase 1 Hz", "gain 3 Hz", "phase 3 Hz", "work per cycle 1 Hz, mJ",
                 "3 Hz, mJ", "most work, mJ", "free, N"},
                {}};
  std::map<std::string, Outcome> outcomes_;  // of what was run
  std::vector<plot::Series> slow_errors_, fast_errors_, traces_;
};

}  // namespace

void run_feel(const Lab& lab, Section& section) {
  const auto liver = catalogue::make_measured_liver(lab.is_short() ? kFeelShortTets
                                                                   : catalogue::kDefaultLiverTets);
  TROCAR_ASSERT(liver.ok());
  section.say(fmt::format(
      "A calculated hand (0.15 kg on 400 N/m, with a reflex) presses, palpates by 3 mm to both "
      "sides of some 7 mm, taps, slides and grasps the measured liver ({} nodes) with a probe of "
      "{:.0f} mm radius, "
      "through the network of the first column; patches come at 62.5 Hz. The device's motion also "
      "goes to a second liver without any delay, whose force is the truth. Errors are root mean "
      "squares over the whole motion, first contact included, in % of the greatest true force. "
      "Beside the model of the client: the server's last force; that force and its stiffness "
      "times the way since; and a spring of 1 N/mm to the surface as the server had it, scaled by "
      "delay and speed after Schuwerk et al. 2015.",
      liver->mesh.node_count(), 1e3f * kProbe.radius_m));
  FeelStudy(lab, section, *liver).run();
}

}  // namespace trocar::validation
