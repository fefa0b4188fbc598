// Nakao 2003 sec. 5.1, figures 10 to 12: one straight cut in a plate under tension.
//
// The paper prints neither where the cut is nor how long, and figure 12 without numbers. The cut
// here is through the middle, oblique to the mesh; its length is the one that adds about as many
// tets as the paper's. The comparison there is with Bielser and Gross (2000).

#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/papers/nakao/adaptive_splitter.h"
#include "tests/validation/cut_plate.h"
#include "tests/validation/experiments.h"

namespace trocar::validation {
namespace {

// The same order of the areas comes out at 0.05, 0.6 and 1.2 rad, but that at 0.05, along the lines
// of the mesh, faces of existing tets are as straight as any cut.
constexpr double kLength_m = 0.080, kAcross_m = 0.150, kDirection_rad = 0.31,
                 kReach_m = 0.004;  // of the cut
constexpr float kStep_s = 1e-3f;
constexpr int kSettle = 400, kOpen = 400, kShortSettle = 40, kShortOpen = 60;  // steps
constexpr int kEvery = 5;
constexpr ElementCounts kPaperBefore{1274, 6160, 2500, 3647}, kPaperAfter{1505, 7376, 3039, 4301};
constexpr double kTensions[] = {0.02, 0.04, 0.06};
// Numbers of elements before: the mesh is another one.
constexpr double kCountBound = 0.03;
constexpr double kEnergyBound = 1e-9;  // of all that is stored; rounding

struct Way {
  const char* name;
  const char* title;
  cutting::Settings settings;
};

// The blade cuts the whole plate in one motion.
cutting::Settings in_one_motion(cutting::Settings settings) {
  settings.most_pieces_of_motion = 64;
  return settings;
}

std::vector<Way> ways() {
  cutting::Settings faces;
  faces.snap = 0.51;  // always the nearer end: nothing is split
  return {
      {"adaptive", "adaptive (Nakao)", in_one_motion(nakao::settings_of(nakao::Variant::Adaptive))},
      {"plain", "split, neither moved nor chosen",
       in_one_motion(nakao::settings_of(nakao::Variant::Plain))},
      {"faces", "faces of existing tets only", in_one_motion(faces)},
      {"robust", "ours, of sessions", in_one_motion({})}};
}

struct Wound {
  double tension = 0;
  double before_m = 0;  // drift of a node before the cut
  ElementCounts before, after;
  cutting::CutOutput output;
  double area_at_rest_m2 = 0;
  std::vector<double> dihedrals_rad;  // ascending
  double energy_gain = 0;             // share of all that is stored, at the instant of the cut
  double added_mass = 0;              // share, see RemodelledSprings::added_mass()
  std::vector<double> times_s, openings_mm, areas_cm2;
  std::vector<std::array<Vec3d, 2>> skin, lips;

  double opening_mm() const { return openings_mm.back(); }
  double area_cm2() const { return areas_cm2.back(); }
};

// Cuts through the plate with an upright blade.
void cut_straight(CutPlate& plate, double length_m) {
  const Vec3d half = Vec3d{std::cos(kDirection_rad), 0, std::sin(kDirection_rad)} * (length_m / 2);
  const Vec3d deep{0, kReach_m, 0};
  plate.cut({deep - half, Vec3d{} - half - deep}, {half + deep, half - deep});
}

Wound cut_plate(const Way& way, double tension, Mechanics mechanics, bool is_short) {
  auto organ = catalogue::make_plate();
  organ.material.tension = tension;
  organ.gravity_m_s2 = {};
  CutPlate plate(std::move(organ), way.settings, mechanics);
  Wound wound{.tension = tension, .before = plate.counts()};
  for (int i = 0; i < (is_short ? kShortSettle : kSettle); ++i) plate.step(kStep_s);
  for (std::uint32_t n = 0; n < plate.topology().node_count(); ++n)
    wound.before_m =
        std::max(wound.before_m, length(plate.position(NodeIndex(n)) - plate.topology().rest()[n]));
  cut_straight(plate, kLength_m);
  wound.output = plate.output();
  wound.after = plate.counts();
  wound.area_at_rest_m2 = plate.wound_area_at_rest();
  wound.dihedrals_rad = plate.dihedrals_rad();
  const auto [before_j, after_j] = plate.energies_j();
  if (const auto* springs = plate.springs()) {
    wound.energy_gain = after_j / before_j - 1;
    wound.added_mass = springs->added_mass();
  }
  for (int i = 0; i <= (is_short ? kShortOpen : kOpen); ++i) {
    if (i > 0) plate.step(kStep_s);
    if (i % kEvery != 0) continue;
    wound.times_s.push_back(i * static_cast<double>(kStep_s));
    wound.openings_mm.push_back(plate.opening() * 1e3);
    wound.areas_cm2.push_back(plate.wound_area() * 1e4);
  }
  wound.skin = plate.upper_edges(false);
  wound.lips = plate.upper_edges(true);
  return wound;
}

// Returns what a cut makes of the mesh, without mechanics.
Wound count_only(const Way& way, double length_m) {
  CutPlate plate(catalogue::make_plate(), way.settings, Mechanics::Live);
  Wound wound{.before = plate.counts()};
  cut_straight(plate, length_m);
  wound.output = plate.output();
  wound.after = plate.counts();
  wound.area_at_rest_m2 = plate.wound_area_at_rest();
  wound.dihedrals_rad = plate.dihedrals_rad();
  return wound;
}

// The adaptive way, with a patch per mean edge instead of one for the whole cut.
Way in_steps(Way way) {
  way.title = "adaptive, a patch per edge length";
  way.settings.piece_h = way.settings.collect_h = 1;
  return way;
}

// Draws the edges around the wound as seen from above.
plot::Plot picture_plate(const std::string& title, const Wound& wound) {
  const double reach_mm = kLength_m * 600;
  plot::Plot plot{.title = title,
                  .x = {"x, mm", false, -reach_mm, reach_mm},
                  .y = {"z, mm", false, -reach_mm / 2, reach_mm / 2},
                  .series = {},
                  .width_px = 900,
                  .height_px = 520};
  const auto draw = [&](const char* name, const auto& edges, int colour) {
    plot::Series series{name, {}, {}, plot::Style::Line, colour};
    for (const auto& edge : edges) {
      for (const auto& p : edge) {
        series.x.push_back(p.x * 1e3);
        series.y.push_back(p.z * 1e3);
      }
      series.x.push_back(std::numeric_limits<double>::quiet_NaN());
      series.y.push_back(std::numeric_limits<double>::quiet_NaN());
    }
    plot.series.push_back(std::move(series));
  };
  draw("upper face", wound.skin, 0);
  draw("lips of the wound", wound.lips, 1);
  return plot;
}

std::vector<std::string> counts_row(const std::string& what, const ElementCounts& counts) {
  return {what, std::to_string(counts.nodes), std::to_string(counts.edges),
          std::to_string(counts.polygons), std::to_string(counts.tets)};
}

ElementCounts growth(const ElementCounts& before, const ElementCounts& after) {
  return {after.nodes - before.nodes, after.edges - before.edges, after.polygons - before.polygons,
          after.tets - before.tets};
}

using Results = std::vector<std::pair<Way, std::vector<Wound>>>;

// Nodes - edges + faces - tets: 0 for a plate with a slit.
std::int64_t euler_number(const ElementCounts& counts) {
  const auto faces = (4 * counts.tets + counts.polygons) / 2;
  return static_cast<std::int64_t>(counts.nodes + faces) -
         static_cast<std::int64_t>(counts.edges + counts.tets);
}

void say_counts(Section& section, const Results& all) {
  Table table{"Elements (figures 10 and 11)", {"", "nodes", "edges", "polygons", "tets"}, {}};
  table.rows.push_back(counts_row("paper, before", kPaperBefore));
  table.rows.push_back(counts_row("ours, before", all.front().second.front().before));
  table.rows.push_back(counts_row("paper, after", kPaperAfter));
  table.rows.push_back(counts_row("paper, added", growth(kPaperBefore, kPaperAfter)));
  for (const auto& [way, wounds] : all) {
    const auto& wound = wounds.front();
    table.rows.push_back(counts_row(std::string(way.title) + ", after", wound.after));
    table.rows.push_back(
        counts_row(std::string(way.title) + ", added", growth(wound.before, wound.after)));
  }
  const auto across = count_only(all.front().first, kAcross_m);
  table.rows.push_back(counts_row(fmt::format("adaptive, {:g} mm, added", kAcross_m * 1e3),
                                  growth(across.before, across.after)));
  section.add(std::move(table));
  const auto& ours = all.front().second.front();
  const auto compare = [&](const char* what, std::size_t printed, std::size_t own) {
    section.compare(std::string("before-") + what, static_cast<double>(printed),
                    static_cast<double>(own),
                    paper(kCountBound, "figure 10, another mesh of the plate"), "",
                    fmt::format("The plate before the cut: {}.", what));
  };
  compare("nodes", kPaperBefore.nodes, ours.before.nodes);
  compare("edges", kPaperBefore.edges, ours.before.edges);
  compare("polygons", kPaperBefore.polygons, ours.before.polygons);
  compare("tets", kPaperBefore.tets, ours.before.tets);
  section.exactly("euler-before", "1", std::to_string(euler_number(ours.before)),
                  law(0, "Euler: nodes - edges + faces - tets"),
                  "Euler number of a solid without holes; the paper's numbers give 11.");
  section.exactly("euler-after", "0", std::to_string(euler_number(ours.after)),
                  law(0, "Euler: nodes - edges + faces - tets"),
                  "Euler number of a plate with a slit; the paper's number of polygons is odd.");
}

// The worst tets, each by its worst angle.
std::string shown_dihedrals(const Wound& wound) {
  const auto degrees = [&](std::size_t place) {
    return wound.dihedrals_rad[place - 1] * 180 / std::numbers::pi;
  };
  return fmt::format("{:.1f} / {:.1f} / {:.1f}", degrees(1), degrees(50), degrees(200));
}

void say_work(Section& section, const Results& all) {
  Table table{"What each way of cutting did",
              {"", "tets crossed", "1+3 / 2+2 / other", "edges split", "nodes moved / not",
               "smoothed", "dihedrals, deg: worst / 50th / 200th", "left closed, mm2",
               "wound at rest, cm2", "energy at the cut", "inertia added for the step"},
              {}};
  const auto add = [&](const Way& way, const Wound& wound, bool has_mechanics) {
    const auto& out = wound.output;
    table.rows.push_back({way.title, std::to_string(out.crossed_tets),
                          fmt::format("{} / {} / {}", out.four_tets, out.six_tets, out.other_tets),
                          std::to_string(out.splits),
                          fmt::format("{} / {}", out.moved_nodes, out.refused_moves),
                          std::to_string(out.smoothed_nodes), shown_dihedrals(wound),
                          shown(out.waiting_area_m2 * 1e6), shown(wound.area_at_rest_m2 * 1e4),
                          has_mechanics ? fmt::format("{:+.2g}", wound.energy_gain) : "",
                          has_mechanics ? fmt::format("{:.2g}", wound.added_mass) : ""});
  };
  for (const auto& [way, wounds] : all) add(way, wounds.front(), true);
  const auto stepped = in_steps(all.front().first);
  add(stepped, count_only(stepped, kLength_m), false);
  section.add(std::move(table));
}

void say_wounds(Section& section, const std::string& mechanics, const Results& all) {
  Table table{"The wound when it has opened (figures 11 and 12), " + mechanics,
              {"", "tension", "opening, mm", "cut area, cm2", "more than at rest",
               "drift before the cut, mm"},
              {}};
  plot::Plot openings{.title = "Opening of the wound, " + mechanics,
                      .x = {"time, s"},
                      .y = {"width, mm"},
                      .series = {}};
  plot::Plot areas{.title = "Area of the cut surfaces when open (figure 12), " + mechanics,
                   .x = {"tension, %"},
                   .y = {"area of both sides, cm2"},
                   .series = {}};
  plot::Plot growing{.title = "Area of the cut surfaces while the wound opens, " + mechanics,
                     .x = {"time, s"},
                     .y = {"area of both sides, cm2"},
                     .series = {}};
  for (const auto& [way, wounds] : all) {
    plot::Series curve{way.title, {}, {}, plot::Style::LineAndPoints, {}};
    for (const auto& wound : wounds) {
      table.rows.push_back({way.title, fmt::format("{:g} %", wound.tension * 100),
                            shown(wound.opening_mm()), shown(wound.area_cm2()),
                            shown_percent(wound.area_cm2() / (wound.area_at_rest_m2 * 1e4) - 1),
                            shown(wound.before_m * 1e3)});
      curve.x.push_back(wound.tension * 100);
      curve.y.push_back(wound.area_cm2());
      const auto name = fmt::format("{}, {:g} %", way.title, wound.tension * 100);
      if (std::string(way.name) == "adaptive" || std::string(way.name) == "faces") {
        openings.series.push_back({name, wound.times_s, wound.openings_mm, plot::Style::Line, {}});
        growing.series.push_back({name, wound.times_s, wound.areas_cm2, plot::Style::Line, {}});
      }
    }
    areas.series.push_back(std::move(curve));
  }
  section.add(std::move(table));
  section.add(std::move(openings));
  section.add(std::move(growing));
  section.add(std::move(areas));
}

bool grows(const std::vector<Wound>& wounds, double (Wound::*value)() const) {
  for (std::size_t i = 1; i < wounds.size(); ++i)
    if (!((wounds[i].*value)() > (wounds[i - 1].*value)())) return false;
  return true;
}

std::string yes(bool is_so) {
  return is_so ? "yes" : "no";
}

void check_openings(Section& section, const std::string& mechanics, const Results& all) {
  for (const auto& [way, wounds] : all)
    section.exactly(fmt::format("opening-{}-{}", mechanics, way.name), "yes",
                    yes(grows(wounds, &Wound::opening_mm)),
                    paper(0, "figure 11: more tension, a wider wound"),
                    fmt::format("{}: the wound opens wider with more tension.", way.title));
}

void check_areas(Section& section, const Results& all) {
  for (const auto& [way, wounds] : all)
    if (std::string(way.name) == "adaptive" || std::string(way.name) == "plain")
      section.exactly(
          fmt::format("area-{}", way.name), "yes", yes(grows(wounds, &Wound::area_cm2)),
          paper(0, "figure 12: more tension, more area"),
          fmt::format("{}: the cut area grows from each tension to the next.", way.title));
  for (std::size_t other = 1; other < 3; ++other)
    for (std::size_t i = 0; i < all[other].second.size(); ++i) {
      const auto &adaptive = all[0].second[i], &wound = all[other].second[i];
      section.exactly(
          fmt::format("adaptive-below-{}-{:g}", all[other].first.name, wound.tension * 100), "yes",
          yes(adaptive.area_cm2() < wound.area_cm2()),
          paper(0, "figure 12: the adaptive wound is smaller"),
          fmt::format("Figure 12 at {:g} %: adaptive {:.3f} cm2, {} {:.3f} cm2.",
                      wound.tension * 100, adaptive.area_cm2(), all[other].first.title,
                      wound.area_cm2()));
    }
}

Results cut_all(const Lab& lab, Mechanics mechanics) {
  Results all;
  for (const auto& way : ways()) {
    auto& wounds = all.emplace_back(way, std::vector<Wound>{}).second;
    for (const double tension : kTensions) {
      if (lab.is_short() && tension == kTensions[1]) continue;
      show_progress(fmt::format("nakao2003/plate: {}, {:g} %", way.title, tension * 100));
      wounds.push_back(cut_plate(way, tension, mechanics, lab.is_short()));
    }
  }
  return all;
}

}  // namespace

void run_plate(const Lab& lab, Section& section) {
  section.say(fmt::format(
      "A plate of 16 x 16 x 0.4 cm, 100 N/m along every edge of its tets, 0.05 N s/m, 0.9 g/cm3; "
      "the rim is fixed and the nodes of both faces stay in their plane. All its springs are "
      "shorter than their places by the tension (eq. 3). It settles, is cut straight through over "
      "{:g} mm, and opens. The paper prints neither the place nor the length of its cut, and "
      "figure "
      "12 without numbers: what can be compared is which area is larger.",
      kLength_m * 1e3));
  section.say(
      "Four ways to cut: the paper's adaptive subdivision, with nodes moved to the end of the cut "
      "and patterns chosen by dihedral angles; the same without either, which stands for the "
      "non-adaptive one (the paper used Bielser and Gross 2000); faces of existing tets alone; and "
      "the method of live sessions. The area counts both sides of the wound.");
  const auto printed = cut_all(lab, Mechanics::AsPrinted);
  say_counts(section, printed);
  say_work(section, printed);
  say_wounds(section, "as printed", printed);
  check_openings(section, "printed", printed);
  check_areas(section, printed);
  for (const auto& [way, wounds] : printed)
    if (way.name != std::string_view("adaptive"))
      section.at_most(fmt::format("energy-{}", way.name), "unchanged (sec. 3.2)",
                      std::abs(wounds.back().energy_gain),
                      law(kEnergyBound, "section 3.2: a cut changes no energy"),
                      fmt::format("{}: elastic energy at the instant of the cut.", way.title));
  section.say(
      "The order of figure 12 comes out: the adaptive wound is smallest at every tension, and it "
      "is "
      "larger at 6 % than at 2 %. Without numbers in the paper no more can be said. Two things "
      "work "
      "against each other: a wound that gapes has longer lips, which grows with the square of the "
      "tension, and lips that are free shorten, which grows with the tension itself; at 2 and 4 % "
      "they about balance. Lips keep their length only because re-modelling gives the edges that a "
      "cut makes no tension, so that the cut changes no energy; where nothing is split, or where "
      "new edges have the tension of the others, as in the live solver below, the area shrinks. "
      "Part of the difference between adaptive and not is there at rest: without moved nodes the "
      "cut ends up to an element beyond the blade, and faces of existing tets go in zigzag (but "
      "for a cut along the lines of the mesh).");
  section.say(
      "Elements: neither the place nor the length of the paper's cut is known, so growth is "
      "compared "
      "by its mix. For a tet ours adds half a node and a polygon, the paper a third of a node and "
      "0.8 polygons; a section of one layer of tets has few inner edges, and each cut edge makes "
      "two "
      "nodes. The paper's own counts are those of no closed solid (see the Euler numbers). Moving "
      "nodes and choosing patterns adds no elements and makes most of the thin ones thicker; the "
      "worst angle is that of an edge crossed "
      "near "
      "its end, which no pattern mends, and which the method of sessions refuses to split. In "
      "steps "
      "of an edge each patch pulls nodes back to its own border, and the wound stays smaller.");
  const auto live = cut_all(lab, Mechanics::Live);
  say_wounds(section, "live solver", live);
  check_openings(section, "live", live);
  for (const auto& [way, wounds] : printed)
    for (const auto& wound : wounds)
      if (&wound == &wounds.back() || std::string(way.name) == "adaptive")
        section.add(picture_plate(
            fmt::format("From above: {}, {:g} %", way.title, wound.tension * 100), wound));
}

}  // namespace trocar::validation
