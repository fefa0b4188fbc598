// Many hands at once, without a network: each presses, slides, grasps or presses deep, all over an
// organ, through the simulation and the rate controller as the server runs them. Per tick: nodes,
// sweeps, CPU time of each stage. Once a second, the session's forces are compared with
// those of another that the same hands have moved from the start on, on its own, with every tick
// solved to a tolerance. How many ticks reached it is printed, and what a looser one changes. From
// the first that missed it on, no error is told, and the program fails.
//
// A tick is kept if it took at most a millisecond of CPU time of its thread and the forces at the
// end of its second are within 3 % (sum of differences over sum of forces) and 5 % (largest
// difference over largest force).

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <optional>

#include "common/base/program.h"
#include "common/base/timing.h"
#include "server/lab/calibration/press.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/session/control/depth_chooser.h"
#include "server/session/control/rate_controller.h"
#include "server/tissue/hands/sampling.h"

namespace trocar {
namespace {

constexpr const char* kProgram = "bench_hands";
constexpr int kBuiltInTets = 88'000;
constexpr double kToolRadius_m = 0.008;
// One press, before all others, finds the force and the rounding that the tolerance follows from.
constexpr double kPilotDepth_m = 0.012;
constexpr double kMeanLimit = 0.03, kPeakLimit = 0.05, kTickLimitUs = 1000;
// Forces below this, of all hands together, are not compared: nobody touches anything.
constexpr double kLeastForce_n = 0.05;

struct Options {
  std::string organ, law, out;
  int hands = 8;
  double seconds = 60, budget_ms = 0.8;
  unsigned workers = 1;
  std::uint32_t far_interval = 1;
  bool is_frozen = false, is_fixed = false, is_exact = false, has_no_errors = false;
  bool is_averaged = false;
  std::uint32_t nodes = 1200, depth = 0;
};

struct Hand {
  calibration::Place place;
  Vec3f aside;
};

// 0 .. 1 .. 0, smooth, period 1.
float swing(float phase) {
  const float x = 1.0f - std::abs(2.0f * (phase - std::floor(phase)) - 1.0f);
  return x * x * (3 - 2 * x);
}

hands::ToolInput sample_of(const Hand& hand, std::uint8_t number, Tick tick) {
  const float t = static_cast<float>(tick) * 1e-3f + 0.37f * static_cast<float>(number);
  float out = 0.004f, aside = 0;
  tool::Verb verb = tool::Verb::Push;
  switch (number % 4) {
    case 0:  // presses, every 2 s
      out -= 0.012f * swing(t / 2);
      break;
    case 1:  // slides to and fro under pressure, and lifts every 8 s
      out -= 0.010f * std::min(1.0f, 3 * swing(t / 8));
      aside = 0.02f * (swing(t / 2) - 0.5f);
      break;
    case 2: {  // grasps, lifts, lets go, every 4 s
      const float phase = t / 4 - std::floor(t / 4);
      verb = phase < 0.8f ? tool::Verb::Grasp : tool::Verb::None;
      out = 0.015f * swing(std::min(1.0f, phase / 0.8f));
      break;
    }
    default:  // presses deep and slowly, every 5 s
      out -= 0.018f * swing(t / 5);
  }
  const auto& place = hand.place;
  return {
      tool_slot({number}, 0),
      {{place.position + place.outward * out + hand.aside * aside, rotation_from_z(place.outward)},
       verb}};
}

struct Sample {
  double second = 0;
  double mean = 0, peak = 0, force_n = 0;  // errors; sum of the full solution's forces
  bool is_compared = false;
  double median_us = 0;
  std::size_t fast_ticks = 0, ticks = 0;
  wire::RateLevel level = wire::RateLevel::Fixed;
  step::LayerCounts sweeps{};
  std::uint32_t node_limit = 0, depth_limit = 0, queue_nodes = 0;
  bool is_good() const { return is_compared && mean <= kMeanLimit && peak <= kPeakLimit; }
};

double percentile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

std::array<Vec3d, kMaxTools> forces_of(const step::Simulation& simulation) {
  std::array<Vec3d, kMaxTools> forces{};
  const auto& contacts = simulation.context().contact.found;
  for (const auto& tool : contacts.tools)
    forces[tool.tool.value] =
        to_double(contact::reaction_on(contacts, tool, simulation.state().world).force_n);
  return forces;
}

class Session {
 public:
  Session(const organ::Organ& organ, const Options& options)
      : options_(options), simulation_(organ, options.workers) {
    const auto places =
        calibration::spread_places(organ, static_cast<std::size_t>(options.hands), 1);
    if (!options.has_no_errors) {
      pilot_ = calibration::PressBench(organ, options.workers)
                   .pilot(places.front(), {.radius_m = kToolRadius_m, .depth_m = kPilotDepth_m});
      for (auto* solved : {&reference_, &checker_})
        solved->emplace(organ, options.workers,
                        step::SceneRules{.strain_scheme = dynamics::StrainScheme::Implicit});
    }
    for (const auto& place : places) {
      const auto number = static_cast<std::uint8_t>(hands_.size());
      hands_.push_back({place, rotate(rotation_from_z(place.outward), {1, 0, 0})});
      hands::HandJoin join{.slot = {number}};
      join.shapes[0] = {
          .radius_m = static_cast<float>(kToolRadius_m), .length_m = 0.3f, .reach_m = 0.012f};
      inputs_.joins.push_back(join);
    }
    decisions_ = {.depth_limit = options.depth,
                  .node_limit = options.nodes,
                  .is_far_exact = options.is_exact,
                  .far_interval = options.far_interval};
    if (options.is_frozen) decisions_.boundary = world::Boundary::Frozen;
    if (options.depth == 0)
      decisions_.depth_limit =
          options.is_frozen ? step::kFrozenDepthLimit : step::TickDecisions{}.depth_limit;
    control::RateLimits limits{.highest = decisions_, .budget_us = options.budget_ms * 1e3};
    if (!options.is_frozen) {
      limits.layer_sweeps = simulation_.context().solve.far_plan.sweeps;
      limits.far_interval = control::kLongestFarInterval;
    }
    if (!options.is_fixed) controller_.emplace(limits);
    chooser_.emplace(organ.depth_table, limits.nodes);
  }

  void run() {
    const auto ticks = static_cast<Tick>(options_.seconds * 1e3);
    for (Tick tick = 1; tick <= ticks; ++tick) {
      if (hands::takes_samples(tick))
        for (std::uint8_t hand = 0; hand < hands_.size(); ++hand)
          inputs_.samples.push_back(sample_of(hands_[hand], hand, tick));
      one_tick();
      if (reference_) follow_reference(tick);
      inputs_.clear();
      if (tick % kTicksPerSecond == 0) end_second(tick);
    }
  }

  void print() const;
  void write_csv(const std::string& path) const;
  bool is_reference_converged() const { return !reference_ || convergence_.is_reached(); }

 private:
  void one_tick();
  void follow_reference(Tick tick);
  void end_second(Tick tick);
  void note_change(const step::TickDecisions& decisions);

  const Options& options_;
  step::Simulation simulation_;
  // The same hands from the start on, on tissue of their own, with every tick solved to the
  // tolerance; and once more with a looser one, which tells the reference's own error.
  std::optional<step::Simulation> reference_, checker_;
  calibration::Pilot pilot_;
  calibration::Convergence convergence_;
  double own_mean_ = 0, own_peak_ = 0;  // the largest of all seconds that are compared
  std::vector<Hand> hands_;
  hands::TickInputs inputs_;
  step::TickDecisions decisions_;
  std::optional<control::RateController> controller_;
  std::optional<control::DepthChooser> chooser_;
  std::vector<double> forces_;

  std::array<std::vector<double>, step::kStageCount> stages_;
  std::vector<double> totals_, wall_, queue_, active_, sweeps_, second_totals_;
  std::vector<Sample> samples_;
  Sample now_;
  step::TickDecisions least_;
  std::vector<std::pair<Tick, std::string>> changes_;
  std::array<std::size_t, 4> levels_{};
  std::uint32_t faults_ = 0;
};

void Session::note_change(const step::TickDecisions& decisions) {
  const auto before = step::sweeps_of_layers(least_), after = step::sweeps_of_layers(decisions);
  const Tick tick = simulation_.current_tick();
  for (std::size_t layer = 0; layer < step::kSweepLayers; ++layer)
    if (after[layer] < before[layer])
      changes_.emplace_back(tick, "layer " + std::to_string(layer) + " to " +
                                      std::to_string(after[layer]) + " sweeps");
  if (decisions.far_interval > least_.far_interval)
    changes_.emplace_back(tick,
                          "far nodes every " + std::to_string(decisions.far_interval) + " ticks");
  least_.far_interval = std::max(least_.far_interval, decisions.far_interval);
  if (decisions.node_limit < least_.node_limit)
    changes_.emplace_back(tick, "queue to " + std::to_string(decisions.node_limit) + " nodes");
  auto least = before;
  for (std::size_t layer = 0; layer < step::kSweepLayers; ++layer)
    least[layer] = std::min(before[layer], after[layer]);
  least_.sweeps = least[0];
  for (std::size_t layer = 1; layer < step::kSweepLayers; ++layer)
    least_.layer_sweeps[layer - 1] = least[layer];
  least_.node_limit = std::min(least_.node_limit, decisions.node_limit);
}

void Session::one_tick() {
  control::read_forces(simulation_, forces_);
  const auto decisions =
      chooser_->choose(controller_ ? controller_->decisions() : decisions_, forces_);
  if (simulation_.current_tick() == 0) least_ = decisions;
  note_change(decisions);
  const auto wall = monotonic_ns();
  const auto cpu = thread_cpu_ns();
  const auto report = simulation_.tick(inputs_, decisions);
  const auto cpu_ns = thread_cpu_ns() - cpu;
  wall_.push_back(static_cast<double>(monotonic_ns() - wall) * 1e-3);
  simulation_.pop_frame();
  // The controller hears the CPU time, which the tick itself needs: a shared machine's other work
  // is not what is measured.
  if (controller_) controller_->observe(report, {cpu_ns, 0});
  for (std::size_t s = 0; s < stages_.size(); ++s)
    if (report.stage_cpu_ns[s] > 0) stages_[s].push_back(1e-3 * report.stage_cpu_ns[s]);
  totals_.push_back(static_cast<double>(cpu_ns) * 1e-3);
  second_totals_.push_back(totals_.back());
  queue_.push_back(report.near.queue_nodes);
  active_.push_back(report.near.active_nodes);
  sweeps_.push_back(static_cast<double>(report.solve.node_sweeps));
  faults_ |= report.faults;
  now_.sweeps = step::sweeps_of_layers(decisions);
  now_.node_limit = decisions.node_limit;
  now_.depth_limit = decisions.depth_limit;
  now_.queue_nodes = report.near.queue_nodes;
  now_.level = controller_ ? controller_->figures().level : wire::RateLevel::Fixed;
  ++levels_[static_cast<std::size_t>(now_.level)];
}

struct Difference {
  double mean = 0, peak = 0;  // sum over sum, largest over largest
  double force_n = 0;         // of the second, all tools together
};

Difference difference_of(const std::array<Vec3d, kMaxTools>& ours,
                         const std::array<Vec3d, kMaxTools>& expected) {
  double sum = 0, force = 0, largest = 0, largest_force = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const double difference = length(ours[i] - expected[i]);
    sum += difference;
    force += length(expected[i]);
    largest = std::max(largest, difference);
    largest_force = std::max(largest_force, length(expected[i]));
  }
  return {sum / force, largest / largest_force, force};
}

void Session::follow_reference(Tick tick) {
  const auto nodes = simulation_.organ().mesh.node_count();
  const auto tight = calibration::converged_decisions(pilot_.tolerance_n(nodes)),
             loose =
                 calibration::converged_decisions(pilot_.tolerance_n(nodes, calibration::kLooser));
  convergence_.note(reference_->tick(inputs_, tight), tight);
  reference_->pop_frame();
  checker_->tick(inputs_, loose);
  checker_->pop_frame();
  if (tick % kTicksPerSecond != 0) return;
  const auto expected = forces_of(*reference_);
  const auto off = difference_of(forces_of(simulation_), expected),
             own = difference_of(forces_of(*checker_), expected);
  now_.force_n = off.force_n;
  now_.is_compared = off.force_n >= kLeastForce_n && convergence_.is_reached();
  if (!now_.is_compared) return;
  now_.mean = off.mean;
  now_.peak = off.peak;
  own_mean_ = std::max(own_mean_, own.mean);
  own_peak_ = std::max(own_peak_, own.peak);
}

void Session::end_second(Tick tick) {
  now_.second = static_cast<double>(tick) * 1e-3;
  now_.ticks = second_totals_.size();
  now_.fast_ticks = static_cast<std::size_t>(
      std::ranges::count_if(second_totals_, [](double us) { return us <= kTickLimitUs; }));
  now_.median_us = percentile(second_totals_, 0.5);
  std::fprintf(stderr, "%s: %.0f s, tick %.2f ms, error %.2f %%, largest %.2f %%\n", kProgram,
               now_.second, now_.median_us * 1e-3, 100 * now_.mean, 100 * now_.peak);
  samples_.push_back(now_);
  now_ = {};
  second_totals_.clear();
}

void Session::print() const {
  const auto& organ = simulation_.organ();
  std::printf("%s, %zu nodes, %s, %d hands, %s, %u %s, %.0f s\n", organ.name.c_str(),
              organ.mesh.node_count(),
              organ.material.elastic_law == material::ElasticLaw::NeoHookean ? "neo-Hookean"
              : organ.material.elastic_law == material::ElasticLaw::Measured ? "measured"
                                                                             : "springs or linear",
              options_.hands, options_.is_frozen ? "frozen" : "graded", options_.workers,
              options_.workers == 1 ? "thread" : "threads", options_.seconds);
  std::printf("%-40s %12s %10s\n", "per tick", "median", "p99");
  const auto line = [](const char* name, const std::vector<double>& values, const char* format) {
    std::printf("  %-38s ", name);
    std::printf(format, percentile(values, 0.5), percentile(values, 0.99));
    std::printf("\n");
  };
  line("nodes in the queue", queue_, "%12.0f %10.0f");
  line("active nodes", active_, "%12.0f %10.0f");
  line("node sweeps", sweeps_, "%12.0f %10.0f");
  for (std::size_t s = 0; s < stages_.size(); ++s)
    line((std::string(wire::name_of(static_cast<step::Stage>(s))) + ", us").c_str(), stages_[s],
         "%12.1f %10.1f");
  line("whole tick, CPU of its thread, us", totals_, "%12.1f %10.1f");
  line("whole tick, wall, us", wall_, "%12.1f %10.1f");

  std::vector<double> means, peaks;
  std::size_t good = 0, kept = 0, ticks = 0, fast = 0;
  for (const auto& sample : samples_) {
    ticks += sample.ticks;
    fast += sample.fast_ticks;
    if (!sample.is_compared) continue;
    means.push_back(100 * sample.mean);
    peaks.push_back(100 * sample.peak);
    good += sample.is_good();
    if (sample.is_good()) kept += sample.fast_ticks;
  }
  if (reference_) {
    std::printf("  the reference, from the start on: %s\n", convergence_.words().c_str());
    if (!convergence_.is_reached())
      std::printf("  LEFT OUT: errors from where the reference missed its tolerance\n");
  }
  if (!means.empty()) {
    line("force error, sum over sum, %", means, "%12.2f %10.2f");
    line("force error, largest over largest, %", peaks, "%12.2f %10.2f");
    std::printf(
        "  the reference's own error, largest: %.3f %% (%.3f %%), by a tolerance %g times "
        "larger\n",
        100 * own_mean_, 100 * own_peak_, calibration::kLooser);
    std::printf("  seconds within %.0f %% (%.0f %%): %zu of %zu\n", 100 * kMeanLimit,
                100 * kPeakLimit, good, means.size());
  }
  std::printf("  ticks within 1 ms: %zu of %zu; kept: %zu\n", fast, ticks, kept);
  std::printf(
      "  controller, share of ticks: fixed %.2f, full %.2f, reduced %.2f, overloaded %.2f\n",
      static_cast<double>(levels_[0]) / static_cast<double>(totals_.size()),
      static_cast<double>(levels_[1]) / static_cast<double>(totals_.size()),
      static_cast<double>(levels_[2]) / static_cast<double>(totals_.size()),
      static_cast<double>(levels_[3]) / static_cast<double>(totals_.size()));
  std::printf("  given up, in this order:\n");
  for (const auto& [tick, what] : changes_)
    std::printf("    tick %6" PRIu64 ": %s\n", tick, what.c_str());
  std::printf(
      "  faults %08x, state hash %016" PRIx64 "%s\n", faults_, simulation_.state_hash(),
      controller_ ? " (with the controller it depends on times; the option fixed repeats)" : "");
}

void Session::write_csv(const std::string& path) const {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  if (!file) return;
  std::fprintf(file,
               "second,tick_median_us,ticks_within_1ms,error_mean_percent,error_peak_percent,"
               "force_n,sweeps_0,sweeps_1,sweeps_2,sweeps_3,depth_limit,node_limit,queue_nodes,"
               "level\n");
  for (const auto& s : samples_)
    std::fprintf(file, "%g,%.1f,%zu,%.4f,%.4f,%.4f,%u,%u,%u,%u,%u,%u,%u,%s\n", s.second,
                 s.median_us, s.fast_ticks, 100 * s.mean, 100 * s.peak, s.force_n, s.sweeps[0],
                 s.sweeps[1], s.sweeps[2], s.sweeps[3], s.depth_limit, s.node_limit, s.queue_nodes,
                 wire::name_of(s.level));
  std::fclose(file);
}

Status run(const Options& options) {
  auto organ = options.organ.empty() ? catalogue::make_liver(kBuiltInTets)
                                     : catalogue::load_organ(options.organ);
  if (!organ) return organ.error();
  if (options.law == "springs") organ->material.elastic_law = material::ElasticLaw::Springs;
  if (options.law == "neo-hookean") organ->material.elastic_law = material::ElasticLaw::NeoHookean;
  if (options.is_averaged) organ->material.has_averaged_strain = true;
  Session session(*organ, options);
  session.run();
  session.print();
  if (!options.out.empty()) session.write_csv(options.out);
  if (!session.is_reference_converged())
    return Error{ErrorCode::Mismatch, "the reference missed its tolerance"};
  return {};
}

}  // namespace
}  // namespace trocar

int main(int argc, char** argv) {
  using namespace trocar;
  begin_program(kProgram);
  Options options;
  CLI::App app("Many scripted hands on one organ: what a tick takes, and how true its forces are.",
               kProgram);
  app.footer("Example:\n  bench_hands --hands 16 --law springs --seconds 20 --out hands.csv\n");
  app.add_option("--organ", options.organ, "as trocar-server's [a liver of 88,000 tets]");
  app.add_option("--law", options.law, "instead of the organ's own")
      ->check(CLI::IsMember({"springs", "neo-hookean"}));
  app.add_flag("--averaged", options.is_averaged, "strain averaged over nodes, against locking");
  app.add_option("--hands", options.hands)->check(CLI::Range(1, 16))->capture_default_str();
  app.add_option("--seconds", options.seconds, "simulated")->capture_default_str();
  app.add_option("--workers", options.workers)
      ->check(CLI::Range(1u, kMaxWorkers))
      ->capture_default_str();
  app.add_option("--budget", options.budget_ms, "of a tick, ms")->capture_default_str();
  app.add_option("--nodes", options.nodes, "most in the queue")->capture_default_str();
  app.add_option("--depth", options.depth, "layers [3, frozen: 6]");
  app.add_flag("--frozen", options.is_frozen, "tissue beyond the limits stands still");
  app.add_flag("--exact-far", options.is_exact, "the far field is not linearised");
  app.add_option("--far-interval", options.far_interval,
                 "ticks from one sweep of a far node to the next")
      ->check(CLI::Range(1u, step::kMaxFarInterval))
      ->capture_default_str();
  app.add_flag("--fixed", options.is_fixed, "without the rate controller");
  app.add_flag("--no-errors", options.has_no_errors, "only times");
  app.add_option("--out", options.out, "CSV with a line per second");
  CLI11_PARSE(app, argc, argv);
  const auto done = run(options);
  return done ? 0 : report(kProgram, done.error());
}
