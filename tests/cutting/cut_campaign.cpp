// Many random cuts of one organ, or of a fresh one each: what becomes of its tets. A row per
// organ: cuts, tets before and after, nodes, pieces (and how many have fewer than eight tets),
// worst and first percentile of the dihedral angles, share of the wound that waits, wound over
// swept area, through cuts that left a bridge, edits refused, worst and mean CPU time. Everything
// that has to hold is checked after every cut, or after every --check cuts.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include "common/base/timing.h"
#include "common/scene/load_organ.h"
#include "tests/cutting/random_strokes.h"

namespace trocar::cutting::testing {
namespace {

struct Options {
  std::vector<std::string> organs;
  std::string kind = "mixed";
  int cuts = 100, check = 1;
  std::uint64_t seed = 1;
  bool is_fresh = false, is_verbose = false;
  Settings settings;
};

struct Row {
  double swept = 0, wound = 0, waiting = 0;
  int bridges = 0, bad = 0;
  std::uint64_t crossed = 0, refused = 0, splits = 0, labels = 0, pinches = 0;
  std::uint64_t cpu_ns = 0, worst_ns = 0;
  std::vector<double> ratios;
};

scene::Organ load(const std::string& spec) {
  if (spec == "box") return box_organ(12, 12, 12, 0.005);
  if (spec == "regular") return box_organ(12, 12, 12, 0.005, 0);
  auto organ = scene::load_organ(spec);
  if (!organ) {
    std::fprintf(stderr, "cut_campaign: %s\n", organ.error().message.c_str());
    std::exit(3);
  }
  return *organ;
}

// A piece on both sides of a plane, farther than the wound is rough.
bool has_bridge(const CutOrgan& organ, const RandomStrokes& strokes, double h) {
  const auto pieces = find_pieces(organ.topology());
  std::vector<int> sides(pieces.count);
  for (std::uint32_t t = 0; t < organ.topology().tet_count(); ++t) {
    if (!organ.topology().has_tet(TetIndex(t))) continue;
    for (const auto n : organ.topology().tet(TetIndex(t))) {
      const double d =
          dot(strokes.plane_normal(), organ.topology().rest()[n.value] - strokes.plane_point());
      if (std::abs(d) > 1.5 * h) sides[pieces.piece_of_tet[t]] |= d > 0 ? 1 : 2;
    }
  }
  return std::ranges::any_of(sides, [](int side) { return side == 3; });
}

StrokeKind kind_of(const std::string& name, RandomStrokes& strokes) {
  static const std::map<std::string, StrokeKind> kKinds{
      {"straight", StrokeKind::Straight}, {"curved", StrokeKind::Curved},
      {"sawing", StrokeKind::Sawing},     {"short", StrokeKind::Short},
      {"knife", StrokeKind::Knife},       {"through", StrokeKind::Through}};
  const auto found = kKinds.find(name);
  return found != kKinds.end() ? found->second : strokes.any_kind();
}

void print(const std::string& name, const Options& options, const Row& row, std::size_t before,
           const CutOrgan& organ) {
  std::vector<double> sines;
  for (std::uint32_t t = 0; t < organ.topology().tet_count(); ++t)
    if (organ.topology().has_tet(TetIndex(t)))
      sines.push_back(
          least_sine(rest_corners(organ.topology(), organ.topology().tet(TetIndex(t)))));
  std::sort(sines.begin(), sines.end());
  const auto degrees = [](double sine) { return std::asin(sine) * 180 / M_PI; };
  const auto pieces = find_pieces(organ.topology());
  const auto small = std::ranges::count_if(pieces.tets, [](auto n) { return n < 8; });
  std::printf(
      "%s %s: %d cuts, crossed tets %llu, tets %zu -> %zu, nodes %zu, pieces %u (%td small), "
      "dihedral %.2f / %.2f, waiting %.1f %%, area ratio %.3f, bridges %d, bad %d\n",
      name.c_str(), options.kind.c_str(), options.cuts,
      static_cast<unsigned long long>(row.crossed), before, sines.size(),
      organ.topology().node_count(), pieces.count, small, degrees(sines.front()),
      degrees(sines[sines.size() / 100]), 100 * row.waiting / (row.waiting + row.wound),
      row.wound / row.swept, row.bridges, row.bad);
  auto ratios = row.ratios;
  std::sort(ratios.begin(), ratios.end());
  const auto within = [&](double share) {
    return std::ranges::count_if(ratios, [&](double r) { return std::abs(r - 1) <= share; });
  };
  std::printf(
      "  single strokes %.2f .. %.2f .. %.2f, within 5 %% %td, 10 %% %td of %zu; splits %llu, "
      "labels %llu, refused %llu, pinch splits %llu; CPU %.1f us per crossed tet, worst call "
      "%.2f ms\n",
      ratios.empty() ? 0 : ratios.front(), ratios.empty() ? 0 : ratios[ratios.size() / 2],
      ratios.empty() ? 0 : ratios.back(), within(0.05), within(0.1), ratios.size(),
      static_cast<unsigned long long>(row.splits), static_cast<unsigned long long>(row.labels),
      static_cast<unsigned long long>(row.refused), static_cast<unsigned long long>(row.pinches),
      row.crossed ? double(row.cpu_ns) / 1e3 / double(row.crossed) : 0, double(row.worst_ns) / 1e6);
}

void cut_once(const Path& path, CutOrgan& organ, Row& row) {
  for (const auto& edge : path) {
    organ.cutter().move(0, edge);
    organ.tick();
    row.cpu_ns += organ.last_ns();
    row.worst_ns = std::max(row.worst_ns, organ.last_ns());
  }
  organ.cutter().lift(0);
  while (!organ.cutter().is_idle()) {
    organ.tick();
    row.cpu_ns += organ.last_ns();
    row.worst_ns = std::max(row.worst_ns, organ.last_ns());
  }
}

void add(Row& row, const CutOutput& before, const CutOutput& after) {
  row.wound += after.opened_area_m2 - before.opened_area_m2;
  row.waiting += after.waiting_area_m2 - before.waiting_area_m2;
  row.crossed += after.crossed_tets - before.crossed_tets;
  row.splits += after.splits - before.splits;
  row.labels += after.labels - before.labels;
  row.refused += after.refused_splits - before.refused_splits;
  row.pinches += after.pinch_splits - before.pinch_splits;
}

int run(const std::string& name, const Options& options) {
  const auto fresh = load(name);
  auto organ = std::make_unique<CutOrgan>(fresh, options.settings);
  const InsideTest inside(fresh.mesh);
  const double h = organ->cutter().mean_h();
  RandomStrokes strokes(fresh, h, options.seed);
  const auto before = fresh.mesh.tets.size();
  Row row;
  for (int cut = 0; cut < options.cuts; ++cut) {
    if (options.is_fresh && cut > 0) organ = std::make_unique<CutOrgan>(fresh, options.settings);
    const auto path = strokes.next(kind_of(options.kind, strokes));
    const auto had = organ->total();
    cut_once(path, *organ, row);
    add(row, had, organ->total());
    const double swept = inside.swept_area(path, h / 8);
    const double wound = organ->total().opened_area_m2 - had.opened_area_m2;
    row.swept += swept;
    if (swept > 0) row.ratios.push_back(wound / swept);
    const bool bridge = options.kind == "through" && has_bridge(*organ, strokes, h);
    row.bridges += bridge;
    std::string failure;
    if (cut % options.check == 0 || cut + 1 == options.cuts) failure = organ->check();
    row.bad += !failure.empty();
    if (options.is_verbose || !failure.empty())
      std::printf("cut %d: swept %.3f h2, ratio %.3f, waiting %.2f h2, pieces %u%s %s\n", cut,
                  swept / h / h, wound / swept,
                  (organ->total().waiting_area_m2 - had.waiting_area_m2) / h / h,
                  find_pieces(organ->topology()).count, bridge ? ", bridge" : "", failure.c_str());
    if (!failure.empty()) break;
  }
  print(name, options, row, before, *organ);
  return row.bad;
}

int main(int argc, char** argv) {
  Options options;
  CLI::App app("Random cuts and what becomes of the mesh");
  app.add_option("organs", options.organs, "liver, box, regular, or files")->required();
  app.add_option("--kind", options.kind, "mixed, straight, curved, sawing, short, knife, through");
  app.add_option("--cuts", options.cuts);
  app.add_option("--check", options.check, "check after every so many cuts");
  app.add_option("--seed", options.seed);
  app.add_flag("--fresh", options.is_fresh, "a fresh organ for every cut");
  app.add_flag("--verbose", options.is_verbose, "a line per cut");
  app.add_option("--snap", options.settings.snap);
  app.add_option("--extension", options.settings.extension_h);
  app.add_option("--length-floor", options.settings.length_floor_h);
  app.add_option("--debris", options.settings.debris_tets);
  app.add_option("--edits", options.settings.edits_per_call);
  CLI11_PARSE(app, argc, argv);
  int bad = 0;
  for (const auto& name : options.organs) bad += run(name, options);
  return bad > 0 ? 1 : 0;
}

}  // namespace
}  // namespace trocar::cutting::testing

int main(int argc, char** argv) {
  return trocar::cutting::testing::main(argc, argv);
}
