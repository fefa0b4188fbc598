// Compares a local reduction's estimate of its own error with the true error: in presses of many
// kinds, with the limit of force lifted, each beside the converged session. The result says from
// which estimate on a session should give a patch up.

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "tests/validation/live_experiments.h"
#include "tests/validation/live_livers.h"

namespace trocar::validation {
namespace {

// A state is bad with more error of force than this; at most kMissed of the bad may go unseen.
constexpr double kBad = 0.03, kMissed = 0.01;
// A session would have to hold the estimate against this threshold. On the built-in liver it misses
// some 1 % of the bad states, and three of five good ones raise an alarm, as on the coarse one, so
// it is of little use. Sessions hold the estimate against a larger threshold, as a guard
// (reduced_tissue.cpp).
constexpr double kThreshold = 0.035, kMostAlarms = 0.2, kAlarmsOnRecord = 0.95;
constexpr double kReference = kBad / 5;
constexpr Tick kStateTicks = 8;
constexpr float kForceMargin = 1.5f;  // of sessions, see server/tissue/reduction/reduced_tissue.cpp
constexpr std::array kDepths_mm{2.0, 5.0, 8.0, 11.0, 15.0};
constexpr std::array kSlants{0.0, 0.5, 1.0};
constexpr std::array kSpeeds_mm_s{30.0, 90.0};
constexpr std::array kShownThresholds{0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5};

struct State {
  double estimate = 0, force = 0, field = 0, full_force = 0;  // errors; full: of the full solver
  bool is_within = false;                                     // of what sessions trust a patch with
};

struct Rates {
  std::size_t bad = 0, missed = 0, good = 0, alarms = 0;

  double missed_rate() const { return static_cast<double>(missed) / static_cast<double>(bad); }
  double alarm_rate() const { return static_cast<double>(alarms) / static_cast<double>(good); }
};

Rates rates_of(const std::vector<State>& states, double threshold, bool only_within) {
  Rates r;
  for (const auto& state : states) {
    if (only_within && !state.is_within) continue;
    const bool is_raised = !(state.estimate <= threshold);
    if (state.force > kBad)
      ++r.bad, r.missed += is_raised ? 0u : 1u;
    else
      ++r.good, r.alarms += is_raised ? 1u : 0u;
  }
  return r;
}

// The largest with which fewer than kMissed of the bad are missed; NaN: none is bad.
double threshold_of(const std::vector<State>& states, bool only_within) {
  std::vector<double> bad;
  for (const auto& state : states)
    if (state.force > kBad && (state.is_within || !only_within)) bad.push_back(state.estimate);
  if (bad.empty()) return std::nan("");
  std::ranges::sort(bad);
  // At most `may` bad states may have an estimate at or below the threshold.
  const auto may =
      static_cast<std::size_t>(std::ceil(kMissed * static_cast<double>(bad.size())) - 1);
  return std::nextafter(bad[may], 0.0);
}

std::vector<double> ranks_of(const std::vector<double>& values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return values[i]; });
  std::vector<double> ranks(values.size());
  for (std::size_t i = 0; i < order.size(); ++i) ranks[order[i]] = static_cast<double>(i);
  return ranks;
}

// Spearman's: 1 if one grows with the other.
double rank_correlation(const std::vector<double>& a, const std::vector<double>& b) {
  const auto ra = ranks_of(a), rb = ranks_of(b);
  const double middle = (static_cast<double>(a.size()) - 1) / 2;
  double ab = 0, aa = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ab += (ra[i] - middle) * (rb[i] - middle);
    aa += (ra[i] - middle) * (ra[i] - middle);
  }
  return ab / aa;
}

class EstimateStudy {
 public:
  EstimateStudy(const Lab& lab, Section& section, const LiveLiver& liver, std::string& csv)
      : section_(section), liver_(liver), is_short_(lab.is_short()), csv_(csv) {
    // The reduction claims the largest force that there is as its training force, which nothing
    // else reads.
    auto lifted = *liver.reduction.local;
    lifted.force_n = organ::kMaxLocalForce_n;
    lifted_ = std::make_shared<organ::LocalReduction>(std::move(lifted));
  }

  void run() {
    const auto& patches = lifted_->patches;
    const std::size_t per_patch = is_short_ ? 4 : 6;
    std::size_t number = 0;
    for (std::uint32_t p = 0; p < patches.size(); ++p) {
      const auto places = places_of_patch(liver_.organ(), liver_.reduction, p, is_short_ ? 3 : 4);
      for (std::size_t k = 0; k < per_patch; ++k, ++number) {
        show_progress(fmt::format("{}: press {} of {}", liver_.name(), number + 1,
                                  patches.size() * per_patch));
        press(places[k % places.size()], number);
      }
    }
    presses_ = number;
    show();
  }

 private:
  void press(const LivePlace& place, std::size_t number) {
    Stroke stroke{.place = place};
    // Every depth with every slant and speed, sooner or later: their counts share no factor.
    const double depth_mm = kDepths_mm[number % kDepths_mm.size()],
                 speed_mm_s = kSpeeds_mm_s[number / 2 % kSpeeds_mm_s.size()];
    const double slant = kSlants[number % kSlants.size()];
    const double azimuth = 2 * std::numbers::pi * static_cast<double>(number) * 0.381966;
    stroke.depth_m = static_cast<float>(1e-3 * depth_mm);
    stroke.speed_m_s = static_cast<float>(1e-3 * speed_mm_s);
    stroke.slant = static_cast<float>(slant);
    stroke.hold_ticks = 64;
    stroke.aside =
        rotate(rotation_from_z(place.outward),
               {static_cast<float>(std::cos(azimuth)), static_cast<float>(std::sin(azimuth)), 0});
    const auto script = script_of(stroke);
    const auto reduced = run_session(liver_.organ(), lifted_, script, kStateTicks);
    const auto full = run_session(liver_.organ(), nullptr, script, kStateTicks);
    const auto reference = references_.run(liver_.organ(), script, kStateTicks);
    const auto& centre = lifted_->patches[place.patch].centre;
    const double off =
        1e3 * length(to_double(place.position) - liver_.organ().mesh.rest_positions[centre.value]);
    const double limit = static_cast<double>(kForceMargin) * liver_.reduction.local->force_n;
    if (reduced.lost != 0) note_lost(reduced, fmt::format("{} mm, slant {}", depth_mm, slant));
    for (std::size_t f = 0; f < reference.fields.size(); ++f) {
      const auto i = (f + 1) * kStateTicks - 1;
      const auto& tick = reduced.ticks[i];
      if (reduced.lost != 0 && i + 1 >= reduced.lost) break;
      if (!tick.is_reduced || length(reference.ticks[i].force_n) < kLeastForce_n) continue;
      const State state{
          .estimate = static_cast<double>(tick.estimate),
          .force = force_error(reduced, reference, i),
          .field = field_error(reduced, reference, f),
          .full_force = force_error(full, reference, i),
          .is_within = static_cast<double>(tick.figures.largest_node_force_n) <= limit};
      states_.push_back(state);
      csv_ += fmt::format(
          "{},{},{},{},{:.2f},{},{},{:.1f},{},{},{:.6g},{:.6g},{:.6g},{},{:.6g},"
          "{:.6g},{:.6g},{:.6g}\n",
          liver_.name(), number, tick.figures.patches.patches[0], place.node.value, off, depth_mm,
          slant, std::fmod(azimuth * 180 / std::numbers::pi, 360.0), speed_mm_s, i + 1,
          length(reference.ticks[i].force_n), length(tick.force_n),
          tick.figures.largest_node_force_n, state.is_within ? 1 : 0, state.estimate, state.force,
          state.field, state.full_force);
    }
  }

  void note_lost(const Course& course, const std::string& what) {
    ++lost_;
    double before = 0;
    for (std::size_t i = 0; i + 1 < course.lost; ++i)
      before = std::max(before, static_cast<double>(course.ticks[i].estimate));
    lost_texts_ += fmt::format("{}{} (largest estimate before: {})",
                               lost_texts_.empty() ? "" : "; ", what, shown(before));
  }

  std::vector<double> all(double State::*member) const {
    std::vector<double> values;
    for (const auto& state : states_) values.push_back(state.*member);
    return values;
  }

  void show() {
    scatter("Estimate and error of force", "error of force, %", &State::force);
    scatter("Estimate and L2 error", "L2 error of all nodes, %", &State::field);
    trade_off();
    const double found = threshold_of(states_, false), within = threshold_of(states_, true);
    Table table{fmt::format("Thresholds on the estimate: {}", liver_.title()),
                {"threshold", "of", "force more than 3 % off", "of these missed", "force less off",
                 "of these alarmed"},
                {}};
    const auto add = [&](double threshold, const char* what) {
      if (!std::isfinite(threshold)) return;
      for (const bool only_within : {false, true}) {
        const auto r = rates_of(states_, threshold, only_within);
        table.rows.push_back(
            {shown(threshold) + what,
             only_within ? "states within the limit of force" : "all states", std::to_string(r.bad),
             r.bad > 0 ? shown_percent(r.missed_rate()) : "", std::to_string(r.good),
             r.good > 0 ? shown_percent(r.alarm_rate()) : ""});
      }
    };
    add(found, ", chosen, all states");
    add(within, ", chosen, states within the limit of force");
    add(kThreshold, ", kept");
    for (const double threshold : kShownThresholds) add(threshold, "");
    section_.add(std::move(table));
    const auto estimates = all(&State::estimate), forces = all(&State::force),
               fields = all(&State::field);
    section_.say(fmt::format(
        "{}: {} presses, {} states in which a patch acted with at least {} N. Error of force "
        "{}, L2 {}; the full solver's force as it runs {}. Rank correlation of the estimate with "
        "the error of force {}, with L2 {}. Presses in which nodes had to be put back: {}{}.",
        liver_.title(), presses_, states_.size(), kLeastForce_n, shown_errors(forces),
        shown_errors(fields), shown_errors(all(&State::full_force)),
        shown(rank_correlation(estimates, forces)), shown(rank_correlation(estimates, fields)),
        lost_, lost_texts_.empty() ? "" : ": " + lost_texts_));
    check();
  }

  void scatter(const char* title, const char* label, double State::*member) {
    plot::Plot plot;
    plot.title = fmt::format("{}: {}", title, liver_.title());
    plot.x = {"estimate", true, {}, {}};
    plot.y = {label, true, {}, {}};
    plot::Series within{"force on nodes within the limit", {}, {}, plot::Style::Points, 0},
        beyond{"beyond it", {}, {}, plot::Style::Points, 1};
    for (const auto& state : states_) {
      auto& series = state.is_within ? within : beyond;
      series.x.push_back(state.estimate);
      series.y.push_back(100 * std::max(state.*member, 1e-4));
    }
    for (auto* series : {&within, &beyond})
      if (!series->x.empty()) plot.series.push_back(std::move(*series));
    section_.add(std::move(plot));
  }

  void trade_off() {
    plot::Plot plot;
    plot.title = fmt::format("What a threshold misses and alarms about: {}", liver_.title());
    plot.x = {"threshold on the estimate", true, {}, {}};
    plot.y = {"% of states", false, 0.0, 100.0};
    for (const bool only_within : {false, true}) {
      const int colour = only_within ? 1 : 0;
      const char* of = only_within ? ", within the limit of force" : "";
      plot::Series missed{fmt::format("bad, missed{}", of), {}, {}, plot::Style::Line, colour},
          alarms{fmt::format("good, alarmed{}", of), {}, {}, plot::Style::Dashed, colour};
      for (double threshold = 0.005; threshold < 2; threshold *= 1.1) {
        const auto r = rates_of(states_, threshold, only_within);
        if (r.bad > 0) missed.x.push_back(threshold), missed.y.push_back(100 * r.missed_rate());
        if (r.good > 0) alarms.x.push_back(threshold), alarms.y.push_back(100 * r.alarm_rate());
      }
      for (auto* series : {&missed, &alarms})
        if (!series->x.empty()) plot.series.push_back(std::move(*series));
    }
    section_.add(std::move(plot));
  }

  void check() {
    const auto name = [&](const char* what) { return fmt::format("{}-{}", liver_.name(), what); };
    const auto r = rates_of(states_, kThreshold, false);
    references_.check(section_, name("reference"),
                      target(kReference, "a fifth of what the reference judges"));
    section_.at_most(name("missed"), shown_percent(kMissed), r.missed_rate(),
                     target(kMissed, "nearly every bad state is seen"),
                     "Of states with more than 3 % error of force, those with an estimate below "
                     "the threshold that is kept.");
    section_.at_most(name("alarms"), "few", r.alarm_rate(),
                     target(kMostAlarms, "an alarm is worth heeding").missed(kAlarmsOnRecord),
                     "Of states with less error, those with an estimate above it.");
  }

  Section& section_;
  const LiveLiver& liver_;
  const bool is_short_;
  std::string& csv_;
  std::shared_ptr<const organ::LocalReduction> lifted_;
  References references_;
  std::vector<State> states_;
  std::size_t presses_ = 0, lost_ = 0;
  std::string lost_texts_;
};

}  // namespace

void run_live_reduction_estimate(const Lab& lab, Section& section) {
  section.say(fmt::format(
      "A tip of 8 mm presses centres of patches and other places of them, {} to {} mm deep, "
      "straight "
      "and aslant (up to as far aside as down), at {} and {} mm/s, and stays. {} The limit of "
      "force, "
      "{} times that on a node, is lifted here; where it would have acted is told apart. A state "
      "is "
      "every "
      "{}th tick in which a patch acted and the converged force is at least {} N. Bad ones have "
      "more than "
      "{} error of force. The threshold that is looked for misses fewer than {} of these. All "
      "states are "
      "in scenarios/live-estimate.csv.",
      kDepths_mm.front(), kDepths_mm.back(), kSpeeds_mm_s.front(), kSpeeds_mm_s.back(),
      live_training_text(lab), kForceMargin, kStateTicks, kLeastForce_n, shown_percent(kBad),
      shown_percent(kMissed)));
  std::string csv =
      "liver,press,patch,node,off_centre_mm,depth_mm,slant,azimuth_deg,speed_mm_s,tick,"
      "converged_force_n,force_n,largest_node_force_n,is_within_force_limit,estimate,force_error,"
      "l2_error,full_force_error\n";
  for (const auto& liver : live_livers(lab)) EstimateStudy(lab, section, *liver, csv).run();
  lab.keep_file("live-estimate.csv", csv);
}

}  // namespace trocar::validation
