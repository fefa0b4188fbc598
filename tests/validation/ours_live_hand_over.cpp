// Hand-overs between the full solver and a local reduction, switched at no regular times and
// brought about by cuts: does the force on the tool jump?

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "common/base/mix.h"
#include "tests/validation/live_experiments.h"
#include "tests/validation/live_livers.h"

namespace trocar::validation {
namespace {

constexpr double kHandOverTarget = 0.02;
// Ticks from one switch to the next.
constexpr Tick kShortest = 4, kSpread = 25;
constexpr int kMostRounds = 12;
constexpr float kBladeSpeed_m_s = 0.1f, kBladeDeep_m = 0.012f, kBladeWay_m = 0.02f;
constexpr Tick kPressTicks = 250;  // until the blade comes
// Hand-overs come as often as in sessions at most. They begin once the press is at rest, because
// the tissue creeps until then.
constexpr Tick kRestTicks = 600, kShakenTicks = 8000, kShakenInterval = 16;
constexpr double kShakenDepth_m = 0.004, kMostShaken = 0.15;
constexpr std::size_t kLeastShakes = kShakenTicks / kShakenInterval * 4 / 5;
constexpr std::array<float, 2> kBladeAway_m{0.018f, 0.045f};

enum class Kind { Off, On, Patch, Cut, Other };
const char* hand_over_name_of(Kind kind) {
  switch (kind) {
    case Kind::Off:
      return "switched off";
    case Kind::On:
      return "a patch takes over";
    case Kind::Patch:
      return "from patch to patch";
    case Kind::Cut:
      return "tissue was cut";
    case Kind::Other:
      return "given up for another reason";
  }
  return "?";
}

// Returns the jump of the force at tick number i, from 0, relative to the force. The first jump is
// at tick 2; NaN means hardly any contact.
double jump_at(const Course& course, std::size_t i, double least_n) {
  const auto force = [&](std::size_t tick) { return course.ticks[tick].force_n; };
  if (i < 2 || length(force(i)) < least_n || length(force(i - 2)) < least_n) return std::nan("");
  return length(force(i) - force(i - 1) * 2.0 + force(i - 2)) / length(force(i));
}

struct Jumps {
  std::vector<double> at, without;  // where it is handed over; there, without a hand-over
};

class HandOverStudy {
 public:
  HandOverStudy(const Lab& lab, Section& section, const LiveLiver& liver)
      : section_(section),
        liver_(liver),
        is_short_(lab.is_short()),
        wanted_(lab.is_short() ? 100 : 1000),
        places_(live_places(liver.organ(), liver.reduction, is_short_ ? 2 : 6, is_short_ ? 2 : 6)) {
  }

  void run() {
    for (int round = 0; round < kMostRounds && count() < wanted_; ++round)
      for (std::size_t i = 0; i < places_.size() && count() < wanted_; ++i) {
        show_progress(fmt::format("{}: {} of {} hand-overs", liver_.name(), count(), wanted_));
        switch_in_stroke(places_[i], static_cast<std::uint64_t>(round) * 100 + i);
      }
    for (const auto& place : places_)
      for (const float away : kBladeAway_m) cut_beside(place, away);
    // Not every place is one that the tip can come to from above.
    for (const auto& place : places_)
      if (switch_all_the_time(place)) break;
    show();
  }

 private:
  std::size_t count() const {
    std::size_t sum = 0;
    for (const auto& [kind, jumps] : jumps_) sum += jumps.at.size();
    return sum;
  }

  void switch_in_stroke(const LivePlace& place, std::uint64_t seed) {
    Stroke stroke{.place = place, .aside = place.inward};
    stroke.depth_m = 0.003f + 0.001f * static_cast<float>(seed % 4);
    stroke.slide_m = 0.008f;
    stroke.hold_ticks = 300;
    stroke.slide_ticks = 400;
    auto script = script_of(stroke);
    std::vector<bool> is_off(script.ticks + 1);
    for (Tick tick = 0, number = 0; tick < script.ticks; ++number) {
      const Tick next = tick + kShortest + splitmix64(1000 * seed + number) % kSpread;
      for (; tick < std::min(next, script.ticks); ++tick) is_off[tick + 1] = number % 2 == 0;
    }
    script.decisions = [&](Tick tick) {
      return step::TickDecisions{.is_reduction_off = is_off[tick]};
    };
    add(script, false);
  }

  // Does what is lost and gained at each hand-over add up? False: there was hardly one.
  bool switch_all_the_time(const LivePlace& place) {
    show_progress(fmt::format("{}: a hand-over every 16 ticks", liver_.name()));
    Stroke stroke{
        .place = place, .aside = place.inward, .depth_m = static_cast<float>(kShakenDepth_m)};
    stroke.hold_ticks = kRestTicks + kShakenTicks - stroke.down_ticks();
    auto script = script_of(stroke);
    script.decisions = [](Tick tick) {
      return step::TickDecisions{.is_reduction_off =
                                     tick <= kRestTicks || tick / kShakenInterval % 2 == 0};
    };
    const auto course = run_session(liver_.organ(), liver_.reduction.local, script, kRestTicks);
    shaken_count_ = 0;
    for (std::size_t i = kRestTicks; i < course.ticks.size(); ++i)
      shaken_count_ += course.ticks[i].is_reduced != course.ticks[i - 1].is_reduced ? 1u : 0u;
    if (shaken_count_ < kLeastShakes) return false;
    const auto &before = course.fields.front(), &after = course.fields.back();
    shaken_m_ = course.lost != 0 ? std::nan("") : 0;
    for (std::size_t n = 0; n < before.size(); ++n)
      shaken_m_ = std::max(shaken_m_, static_cast<double>(length(after[n] - before[n])));
    section_.say(fmt::format(
        "{}: after {} ticks of a press of {} mm, {} hand-overs, one every {} ticks, moved no node "
        "by more than {} mm.",
        liver_.title(), kRestTicks, 1e3 * kShakenDepth_m, shaken_count_, kShakenInterval,
        shown(1e3 * shaken_m_)));
    return true;
  }

  void cut_beside(const LivePlace& place, float away_m) {
    const Vec3f way = place.inward * -1.0f, across = cross(place.outward, way);
    // The blade enters at the node of the surface that is nearest to the wanted place.
    const auto& x = liver_.organ().mesh.rest_positions;
    const auto normals = mesh::surface_normals(liver_.organ().mesh);
    const Vec3f wanted = place.position + way * away_m;
    NodeIndex spot = place.node;
    for (const auto node : liver_.organ().mesh.surface_nodes)
      if (length(to_float(x[node.value]) - wanted) < length(to_float(x[spot.value]) - wanted))
        spot = node;
    const Vec3f at = to_float(x[spot.value]), out = to_float(normals[spot.value]);
    Stroke stroke{.place = place, .aside = place.inward, .depth_m = 0.005f};
    stroke.hold_ticks = 600;
    auto script = script_of(stroke);
    script.inputs = [=](Tick tick) {
      auto inputs = stroke.at(tick);
      if (tick == 1) {
        hands::HandJoin join{.slot = {1}};
        join.shapes[0] = {.radius_m = 0.002f, .length_m = 0.3f, .edge_m = 0.04f};
        inputs.joins.push_back(join);
      }
      const float went = kBladeSpeed_m_s * kTickSeconds *
                         static_cast<float>(tick > kPressTicks ? tick - kPressTicks : 0);
      const float down = std::min(0.01f + kBladeDeep_m, went);
      const float along = std::clamp(went - down, 0.0f, kBladeWay_m);
      const Vec3f tip = at + out * (0.01f - down) + across * (along - kBladeWay_m / 2);
      inputs.samples.push_back({tool_slot({1}, 0), {{tip, rotation_from_z(out)}, tool::Verb::Cut}});
      return inputs;
    };
    cuts_ += add(script, true);
    ++cut_sessions_;
  }

  // Runs it, and without the reduction; whether a cut was handed over.
  std::size_t add(const Script& script, bool is_cut) {
    auto without_reduction = script;
    without_reduction.decisions = {};
    const auto course = run_session(liver_.organ(), liver_.reduction.local, script, 0);
    const auto full = run_session(liver_.organ(), nullptr, without_reduction, 0);
    const double least = kLeastShare * full.largest_force_n();
    std::size_t cuts = 0;
    lost_ += course.lost != 0 ? 1u : 0u;
    for (std::size_t i = 2; i < course.ticks.size(); ++i) {
      const auto &now = course.ticks[i], &before = course.ticks[i - 1];
      if (course.lost != 0 && i + 1 >= course.lost) break;
      const bool is_same = now.is_reduced == before.is_reduced &&
                           (!now.is_reduced || now.figures.patches == before.figures.patches);
      if (is_same) continue;
      const double at = jump_at(course, i, least), without = jump_at(full, i, least);
      if (!std::isfinite(at) || !std::isfinite(without)) continue;
      const auto kind = kind_of(now, before);
      cuts += kind == Kind::Cut ? 1u : 0u;
      auto& jumps = jumps_[{is_cut, kind}];
      jumps.at.push_back(at);
      jumps.without.push_back(without);
    }
    return cuts;
  }

  static Kind kind_of(const LiveTick& now, const LiveTick& before) {
    if (now.is_reduced) return before.is_reduced ? Kind::Patch : Kind::On;
    if (now.figures.reason == wire::SolverReason::Off) return Kind::Off;
    return now.figures.reason == wire::SolverReason::Cut ? Kind::Cut : Kind::Other;
  }

  static double share_above(const std::vector<double>& jumps) {
    return static_cast<double>(
               std::ranges::count_if(jumps, [](double jump) { return jump > kHandOverTarget; })) /
           static_cast<double>(jumps.size());
  }

  void show() {
    Table table{
        fmt::format("Jump of the force: {}", liver_.title()),
        {"in", "hand-over", "count", "median", "95th percentile", "99th", "worst", "above 2 %",
         "without, in the same ticks: median", "95th percentile", "99th", "worst", "above 2 %"},
        {}};
    plot::Plot plot;
    plot.title = fmt::format("Jumps of the force in order: {}", liver_.title());
    plot.x = {"share of hand-overs, %", false, {}, {}};
    plot.y = {"jump, % of the force", true, {}, {}};
    std::array<std::vector<double>, 2> at, without;
    for (const auto& [key, jumps] : jumps_) {
      std::vector<std::string> row{key.first ? "cuts" : "presses and slides",
                                   hand_over_name_of(key.second), std::to_string(jumps.at.size())};
      for (const auto* values : {&jumps.at, &jumps.without}) {
        for (const double share : {0.5, 0.95, 0.99, 1.0})
          row.push_back(shown_percent(quantile(*values, share)));
        row.push_back(shown_percent(share_above(*values)));
      }
      table.rows.push_back(std::move(row));
      auto &a = at[key.first ? 1 : 0], &w = without[key.first ? 1 : 0];
      a.insert(a.end(), jumps.at.begin(), jumps.at.end());
      w.insert(w.end(), jumps.without.begin(), jumps.without.end());
    }
    section_.add(std::move(table));
    const auto curve = [&](const char* name, std::vector<double> values, plot::Style style,
                           int colour) {
      if (values.empty()) return;
      std::ranges::sort(values);
      plot::Series series{name, {}, {}, style, colour};
      for (std::size_t i = 0; i < values.size(); ++i) {
        series.x.push_back(100.0 * static_cast<double>(i + 1) / static_cast<double>(values.size()));
        series.y.push_back(100 * std::max(values[i], 1e-5));
      }
      plot.series.push_back(std::move(series));
    };
    curve("presses and slides", at[0], plot::Style::Line, 0);
    curve("the same ticks, full solver throughout", without[0], plot::Style::Dashed, 0);
    curve("sessions with a cut", at[1], plot::Style::Line, 1);
    curve("the same ticks of cuts, full solver throughout", without[1], plot::Style::Dashed, 1);
    section_.add(std::move(plot));
    section_.say(fmt::format(
        "{}: {} sessions with a blade, {} hand-overs because tissue was cut. Sessions in which "
        "nodes had to be put back: {}.",
        liver_.title(), cut_sessions_, cuts_, lost_));
    check(at);
  }

  void check(const std::array<std::vector<double>, 2>& at) {
    const auto name = [&](const char* what) { return fmt::format("{}-{}", liver_.name(), what); };
    section_.at_least(name("count"), std::to_string(wanted_), static_cast<double>(at[0].size()),
                      target(static_cast<double>(wanted_), "enough for a 99th percentile"),
                      "Hand-overs in presses and slides.");
    section_.at_most(name("jump"), shown_percent(kHandOverTarget), quantile(at[0], 0.99),
                     target(kHandOverTarget, "a hand does not feel it"),
                     "Jump of the force, 99th percentile, presses and slides.");
    section_.at_least(
        name("cuts"), "one per session", static_cast<double>(cuts_),
        target(0.5 * static_cast<double>(cut_sessions_), "enough for a 95th percentile"),
        "Hand-overs because tissue was cut.");
    section_.at_most(name("jump-cut"), shown_percent(kHandOverTarget), quantile(at[1], 0.95),
                     target(kHandOverTarget, "a hand does not feel it"),
                     "Jump of the force, 95th percentile, sessions with a cut.");
    section_.at_least(name("shaken-count"), std::to_string(kShakenTicks / kShakenInterval),
                      static_cast<double>(shaken_count_),
                      target(static_cast<double>(kLeastShakes), "as often as in sessions"),
                      "Hand-overs one soon after another, in a press.");
    section_.at_most(name("shaken"), "0 %", shaken_m_ / kShakenDepth_m,
                     target(kMostShaken, "hand-overs do not walk"),
                     "What they and creep move any node by, of the press.");
  }

  Section& section_;
  const LiveLiver& liver_;
  const bool is_short_;
  const std::size_t wanted_;
  const std::vector<LivePlace> places_;
  std::map<std::pair<bool, Kind>, Jumps> jumps_;
  std::size_t cuts_ = 0, cut_sessions_ = 0, lost_ = 0;
  std::size_t shaken_count_ = 0;
  double shaken_m_ = std::nan("");
};

}  // namespace

void run_live_reduction_hand_over(const Lab& lab, Section& section) {
  section.say(fmt::format(
      "A tip of 8 mm presses 3 to 6 mm deep and slides 8 mm, and the reduction is switched off and "
      "on every {} to {} ticks; and it presses 5 mm deep while a blade comes down {:.0f} or {:.0f} "
      "mm "
      "away and slices {:.0f} mm of tissue. {} The jump is |F(t) - 2 F(t-1) + F(t-2)| / |F(t)| in "
      "the "
      "tick in which another solver or patch is the first to act. Contacts that slip and a blade "
      "make "
      "the force jump too: beside it, the same ticks of the same session with the full solver "
      "throughout. "
      "Target: at most {}.",
      kShortest, kShortest + kSpread - 1, 1e3f * kBladeAway_m[0], 1e3f * kBladeAway_m[1],
      1e3f * kBladeWay_m, live_training_text(lab), shown_percent(kHandOverTarget)));
  for (const auto& liver : live_livers(lab)) HandOverStudy(lab, section, *liver).run();
}

}  // namespace trocar::validation
