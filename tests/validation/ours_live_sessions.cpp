// Sessions that a local reduction moves, beside the same sessions of the full solver and converged
// ones: errors over whole strokes, what a tick takes, and which solver acted why.

#include <spdlog/fmt/fmt.h>

#include <array>
#include <cmath>
#include <map>

#include "tests/validation/live_experiments.h"
#include "tests/validation/live_livers.h"

namespace trocar::validation {
namespace {

constexpr double kTargetForce = 0.03;
constexpr Tick kFieldTicks = 8;

struct SessionsErrors {
  std::vector<double> force, field, after;  // in contact; once nothing touches any more
  std::vector<double> us;
};

class SessionsStudy {
 public:
  SessionsStudy(const Lab& lab, Section& section, const LiveLiver& liver)
      : section_(section), liver_(liver), is_short_(lab.is_short()) {}

  void run() {
    const auto places =
        live_places(liver_.organ(), liver_.reduction, is_short_ ? 1 : 4, is_short_ ? 1 : 6);
    for (std::size_t i = 0; i < places.size(); ++i) {
      show_progress(fmt::format("{}: session {} of {}", liver_.name(), i + 1, places.size()));
      measure(places[i]);
    }
    show();
  }

 private:
  enum Way { Reduced, Full, kWays };

  void measure(const LivePlace& place) {
    Stroke stroke{.place = place, .aside = place.inward};
    stroke.slide_m = 0.006f;
    stroke.hold_ticks = stroke.slide_ticks = is_short_ ? 120 : 250;
    stroke.free_ticks = is_short_ ? 150 : 400;
    const auto script = script_of(stroke);
    const std::array courses{
        run_session(liver_.organ(), liver_.reduction.local, script, kFieldTicks),
        run_session(liver_.organ(), nullptr, script, kFieldTicks)};
    const auto reference = references_.run(liver_.organ(), script, kFieldTicks);
    if (reference.largest_force_n() < kLeastForce_n) {
      ++missed_;
      return;
    }
    std::array<std::size_t, kWays> used{};
    for (std::size_t way = 0; way < kWays; ++way) {
      auto& errors = errors_[way][place.is_trained ? 1 : 0];
      used[way] = errors.force.size();
      add_errors(courses[way], reference, errors);
    }
    const auto& reduced = courses[Reduced];
    for (std::size_t way = 0; way < kWays; ++way) lost_[way] += courses[way].lost != 0 ? 1u : 0u;
    ++measured_;
    std::size_t acted = 0;
    for (const auto& tick : reduced.ticks) {
      ++reasons_[{tick.is_reduced, tick.figures.reason}];
      acted += tick.is_reduced ? 1u : 0u;
    }
    const auto part = [&](Way way) {
      const auto& force = errors_[way][place.is_trained ? 1 : 0].force;
      return shown_errors({force.begin() + static_cast<std::ptrdiff_t>(used[way]), force.end()});
    };
    sessions_.rows.push_back(
        {fmt::format("patch {}, {}", place.patch,
                     place.is_trained ? "trained" : "8 mm or more off"),
         fmt::format("{} N", shown(reference.largest_force_n())), part(Reduced), part(Full),
         shown_percent(static_cast<double>(acted) / static_cast<double>(reduced.ticks.size())),
         lost_text(reduced), lost_text(courses[Full])});
    if (!has_plotted_trained_ || (!place.is_trained && !has_plotted_unseen_)) {
      has_plotted_trained_ = true;
      if (!place.is_trained) has_plotted_unseen_ = true;
      plot(place, courses[Reduced], courses[Full], reference);
    }
  }

  static std::string lost_text(const Course& course) {
    return course.lost == 0 ? "" : fmt::format("tick {}", course.lost);
  }

  // Until it was lost.
  void add_errors(const Course& course, const Course& reference, SessionsErrors& errors) {
    const double least = kLeastShare * reference.largest_force_n();
    double largest = 0;
    std::size_t end = 0;
    for (std::size_t i = 0; i < reference.ticks.size(); ++i) {
      if (length(reference.ticks[i].force_n) > 0) end = i + 1;
      if (course.lost != 0 && i + 1 >= course.lost) continue;
      if (length(reference.ticks[i].force_n) < least) continue;
      errors.force.push_back(force_error(course, reference, i));
      errors.us.push_back(course.ticks[i].us);
    }
    for (std::size_t f = 0; f < reference.fields.size(); ++f)
      largest = std::max(largest, norm_of(reference.fields[f]));
    for (std::size_t f = 0; f < reference.fields.size(); ++f) {
      const auto tick = (f + 1) * reference.field_ticks - 1;
      if (course.lost != 0 && tick + 1 >= course.lost) break;
      const double error = field_error(course, reference, f);
      if (length(reference.ticks[tick].force_n) >= least) errors.field.push_back(error);
      if (tick >= end) errors.after.push_back(error * norm_of(reference.fields[f]) / largest);
    }
  }

  void plot(const LivePlace& place, const Course& reduced, const Course& full,
            const Course& reference) {
    plot::Plot plot;
    plot.title = fmt::format("{}: force, patch {}, {}", liver_.title(), place.patch,
                             place.is_trained ? "trained" : "8 mm or more off");
    plot.x = {"time, s", false, {}, {}};
    plot.y = {"force, N", false, {}, {}};
    const auto add = [&](const char* name, const Course& course, plot::Style style) {
      plot::Series series{name, {}, {}, style, {}};
      for (std::size_t i = 0; i < course.ticks.size(); i += 4) {
        series.x.push_back(static_cast<double>(i + 1) * 1e-3);
        series.y.push_back(length(course.ticks[i].force_n));
      }
      plot.series.push_back(std::move(series));
    };
    add("converged", reference, plot::Style::Line);
    add("full, as it runs", full, plot::Style::Dashed);
    add("reduced", reduced, plot::Style::Dashed);
    section_.add(std::move(plot));
  }

  void show() {
    Table errors{fmt::format("Mean (95th percentile, worst) error over ticks in contact, and CPU "
                             "time of a tick: {}",
                             liver_.title()),
                 {"solver", "places", "force", "L2 of all nodes",
                  "L2 after it has lifted, of the largest", "tick: median", "99th percentile"},
                 {}};
    for (std::size_t way = 0; way < kWays; ++way)
      for (const bool is_trained : {true, false}) {
        const auto& e = errors_[way][is_trained ? 1 : 0];
        errors.rows.push_back({way == Reduced ? "reduced" : "full, as it runs",
                               is_trained ? "of the training" : "8 mm or more off",
                               shown_errors(e.force), shown_errors(e.field), shown_errors(e.after),
                               fmt::format("{} us", shown(quantile(e.us, 0.5))),
                               fmt::format("{} us", shown(quantile(e.us, 0.99)))});
      }
    section_.add(std::move(errors));
    sessions_.title = fmt::format("Each session, force error: {}", liver_.title());
    sessions_.head = {"place",         "largest force", "reduced", "full, as it runs",
                      "ticks reduced", "lost"};
    section_.add(std::move(sessions_));
    Table reasons{fmt::format("Solver of ticks, all sessions: {}", liver_.title()),
                  {"solver", "because", "ticks"},
                  {}};
    std::size_t all = 0;
    for (const auto& [key, ticks] : reasons_) all += ticks;
    for (const auto& [key, ticks] : reasons_)
      reasons.rows.push_back(
          {key.first ? "reduced" : "full", wire::name_of(key.second),
           shown_percent(static_cast<double>(ticks) / static_cast<double>(all))});
    section_.add(std::move(reasons));
    section_.say(fmt::format(
        "{}: {} sessions; lost, for nodes had to be put back: {} of the reduced solver, {} of the "
        "full one; errors are of the ticks before. Places left out because the tip is inside "
        "tissue "
        "from the start: {}.",
        liver_.title(), measured_, lost_[Reduced], lost_[Full], missed_));
    check();
  }

  void check();

  Section& section_;
  const LiveLiver& liver_;
  const bool is_short_;
  std::array<std::array<SessionsErrors, 2>, kWays> errors_;  // [way][is trained]
  std::map<std::pair<bool, wire::SolverReason>, std::size_t> reasons_;
  std::array<std::size_t, kWays> lost_{};
  std::size_t measured_ = 0, missed_ = 0;
  References references_;
  bool has_plotted_trained_ = false, has_plotted_unseen_ = false;
  Table sessions_;
};

void SessionsStudy::check() {
  const auto name = [&](const char* what) { return fmt::format("{}-{}", liver_.name(), what); };
  references_.check(section_, name("reference"),
                    target(kTargetForce / 5, "a fifth of what the reference judges"));
  section_.exactly(name("lost"), "0", std::to_string(lost_[Reduced]), target(0, "none is lost"),
                   "Sessions of the reduced solver in which nodes had to be put back.");
  for (const bool is_trained : {true, false}) {
    const auto& e = errors_[Reduced][is_trained ? 1 : 0];
    const char* of = is_trained ? "trained" : "unseen";
    section_.at_most(name(of) + "-force", shown_percent(kTargetForce), mean(e.force),
                     target(kTargetForce, "3 % of the converged force"),
                     "Contact force, mean over ticks in contact.");
  }
}

}  // namespace

void run_live_reduction_sessions(const Lab& lab, Section& section) {
  section.say(fmt::format(
      "A tip of 8 mm comes down at 40 mm/s, 8 mm deep, stays, slides 6 mm along the surface, lifts "
      "at "
      "the same speed, and the session goes on: with a local reduction, as it runs without one, "
      "and with every tick solved to a tolerance, the reference. Patches lie side by side, and it "
      "slides to their middle. {} Errors are over ticks with at least {:.0f} % of the session's "
      "largest "
      "force; forces as vectors. Each session ran alone, thread CPU time. Target: {} of the force.",
      live_training_text(lab), 100 * kLeastShare, shown_percent(kTargetForce)));
  for (const auto& liver : live_livers(lab)) SessionsStudy(lab, section, *liver).run();
}

}  // namespace trocar::validation
