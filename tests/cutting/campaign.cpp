#include "tests/cutting/campaign.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/base/timing.h"
#include "server/tissue/cutting/event_codec.h"
#include "tests/cutting/swept_surface.h"

namespace trocar::cutting::testing {
namespace {

constexpr const char* kNames[kCutKinds] = {"knife",   "crossing", "two blades",
                                           "aligned", "straight", "curved",
                                           "sawing",  "tiny",     "through"};
// The shares are counts in a hundred cuts.
constexpr std::uint32_t kShares[kCutKinds] = {30, 15, 10, 10, 10, 10, 5, 5, 5};
constexpr StrokeKind kStrokes[kCutKinds] = {
    StrokeKind::Knife,   StrokeKind::Crossing, StrokeKind::Knife,
    StrokeKind::Aligned, StrokeKind::Straight, StrokeKind::Curved,
    StrokeKind::Sawing,  StrokeKind::Short,    StrokeKind::Through};
constexpr std::uint32_t kCrumb = 8;          // tets
constexpr std::uint32_t kHalfASecond = 500;  // ticks
constexpr double kDrift = 1e-6;

double degrees(double sine) {
  return std::asin(sine) * 180 / M_PI;
}

// Every crossed edge is split where it is crossed.
Settings generic() {
  Settings settings;
  settings.snap = 1e-4;
  settings.floor_sine = 0;
  settings.length_floor_h = 0;
  settings.debris_tets = 0;
  settings.debris_volume_h3 = 0;
  settings.whole_volume_h3 = 0;
  return settings;
}

double longest_edge(const mesh::TetMesh& mesh) {
  double longest = 0;
  for (const auto& tet : mesh.tets)
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t k = 0; k < i; ++k)
        longest = std::max(
            longest, length(mesh.rest_positions[tet[i].value] - mesh.rest_positions[tet[k].value]));
  return longest;
}

double drift(double now, double before) {
  return std::abs(now - before) / before;
}

// Sides of faces know each other, and nothing is left across a face that was opened.
std::string broken_adjacency(const topology::Topology& topology) {
  for (std::uint32_t t = 0; t < topology.tet_count(); ++t) {
    if (!topology.has_tet(TetIndex(t))) continue;
    for (std::uint8_t corner = 0; corner < 4; ++corner) {
      const TetFace face{TetIndex(t), corner};
      const auto other = across(topology, face);
      if (!other) continue;
      if ((topology.wound_faces(TetIndex(t)) >> corner & 1) != 0)
        return "tets hang together across a wound";
      if (across(topology, *other) != face) return "adjacency is not symmetric";
    }
  }
  return {};
}

std::uint64_t bytes_of(const CutOrgan& organ) {
  const auto& topology = organ.topology();
  std::uint64_t bytes = topology.tet_count() * (sizeof(mesh::Tet) + 4);
  for (std::uint32_t n = 0; n < topology.node_count(); ++n)
    bytes += 2 * sizeof(Vec3d) + 4 * topology.tets_of(NodeIndex(n)).size() + 8;
  Bytes events;
  encode(organ.history(), events);
  return bytes + events.size();
}

}  // namespace

const char* name_of(CutKind kind) {
  return kNames[static_cast<std::size_t>(kind)];
}

std::optional<CutKind> cut_kind_of(const std::string& name) {
  const auto at = std::ranges::find(kNames, name) - std::begin(kNames);
  if (at == kCutKinds) return std::nullopt;
  return static_cast<CutKind>(at);
}

std::uint32_t series_length(std::uint64_t number, const CampaignOptions& options) {
  trocar::testing::Random random(number);
  for (int i = 0; i < 8; ++i) random.unit();  // neighbouring seeds start alike
  return options.shortest + random.below(options.longest - options.shortest + 1);
}

Series::Series(const organ::Organ& organ, std::string name, std::uint64_t number,
               const CampaignOptions& options)
    : name_(std::move(name)),
      number_(number),
      options_(options),
      organ_(organ, options.settings),
      inside_(organ_.organ().mesh),
      strokes_(organ_.organ(), organ_.cutter().mean_h(), number),
      h_(organ_.cutter().mean_h()),
      longest_edge_(longest_edge(organ_.organ().mesh)),
      volume_(total_volume(organ_.topology())),
      mass_(total_mass(organ_.topology())),
      length_(series_length(number, options)) {
  for (int i = 0; i < 8; ++i) strokes_.random().unit();
}

CutKind Series::choose() {
  auto at = strokes_.random().below(100);
  if (options_.only) return *options_.only;
  std::size_t kind = 0;
  while (at >= kShares[kind]) at -= kShares[kind++];
  return static_cast<CutKind>(kind);
}

std::vector<Path> Series::paths_of(CutKind kind) {
  std::vector<Path> paths;
  swept_.clear();
  const auto add = [&](StrokeKind stroke) {
    paths.push_back(strokes_.next(stroke));
    swept_.push_back(strokes_.swept_once());
  };
  add(kStrokes[static_cast<std::size_t>(kind)]);
  if (kind == CutKind::TwoBlades) add(StrokeKind::Crossing);
  return paths;
}

void Series::tick(CutRecord& record) {
  organ_.tick();
  const double ms = double(organ_.last_ns()) / 1e6;
  record.cpu_ms += ms;
  record.worst_ms = std::max(record.worst_ms, ms);
}

void Series::stroke(const std::vector<Path>& paths, CutRecord& record) {
  auto& cutter = organ_.cutter();
  std::size_t ticks = 0;
  for (const auto& path : paths) ticks = std::max(ticks, path.size());
  for (std::size_t i = 0; i < ticks; ++i) {
    for (std::uint32_t blade = 0; blade < paths.size(); ++blade) {
      if (i < paths[blade].size() && !cutter.move(blade, paths[blade][i]))
        record.broken = "a blade was refused";
      if (i == paths[blade].size()) cutter.lift(blade);
    }
    tick(record);
  }
  for (std::uint32_t blade = 0; blade < paths.size(); ++blade) cutter.lift(blade);
  for (; !cutter.is_idle() && record.ticks_to_rest < 100'000; ++record.ticks_to_rest) tick(record);
}

// A piece with more than a chip on both sides of the last plane, farther away than a wound is
// rough. Chips stay with the other side (Settings::debris_volume_h3).
bool Series::has_bridge(const Pieces& pieces) const {
  std::vector<std::array<double, 2>> volumes(pieces.count);
  const auto& topology = organ_.topology();
  for (std::uint32_t t = 0; t < topology.tet_count(); ++t) {
    if (!topology.has_tet(TetIndex(t))) continue;
    const auto corners = rest_corners(topology, topology.tet(TetIndex(t)));
    const Vec3d centre = (corners[0] + corners[1] + corners[2] + corners[3]) / 4;
    const double d = dot(strokes_.plane_normal(), centre - strokes_.plane_point());
    if (std::abs(d) > longest_edge_ / 2)
      volumes[pieces.piece_of_tet[t]][d > 0] += six_volumes(corners) / 6;
  }
  const double chip = options_.settings.debris_volume_h3 * h_ * h_ * h_;
  return std::ranges::any_of(
      volumes, [&](const auto& sides) { return sides[0] >= chip && sides[1] >= chip; });
}

std::string Series::broken_law(const CutRecord& record) const {
  if (!record.broken.empty()) return record.broken;
  if (record.ticks_to_rest > kHalfASecond) return "not at rest half a second after the blade";
  if (!(record.volume_drift <= kDrift)) return "volume not kept";
  if (!(record.mass_drift <= kDrift)) return "mass not kept";
  if (auto failure = organ_.check(); !failure.empty()) return failure;
  return broken_adjacency(organ_.topology());
}

// Before the cut is done, on the fresh organ.
void Series::compare(const std::vector<Path>& paths, CutRecord& record) const {
  CutOrgan other(organ_.organ(), generic());
  for (std::uint32_t blade = 0; blade < paths.size(); ++blade) other.stroke(paths[blade], blade);
  const auto tets = find_pieces(other.topology()).tets;
  record.generic_gained = std::accumulate(tets.begin(), tets.end(), 0u) -
                          static_cast<std::uint32_t>(organ_.organ().mesh.tets.size());
}

// After the cut; crossed: edges of the organ's tets.
void Series::count_split_tets(const std::vector<std::uint8_t>& crossed, CutRecord& record) const {
  const auto parts = count_parts(organ_.organ(), organ_.history());
  record.gained = static_cast<std::uint32_t>(record.tets - organ_.organ().mesh.tets.size());
  for (std::size_t t = 0; t < parts.size(); ++t) {
    const auto parting = parting_of(crossed[t]);
    record.touched += parting != Parting::None;
    if (parting == Parting::OneAndThree) ++record.ones, record.parts_of_ones += parts[t];
    if (parting == Parting::TwoAndTwo) ++record.twos, record.parts_of_twos += parts[t];
  }
}

void Series::measure(const CutOutput& before, CutRecord& record) {
  const auto& after = organ_.total();
  const auto& topology = organ_.topology();
  record.wound = after.opened_area_m2 - before.opened_area_m2;
  record.waiting = after.waiting_area_m2 - before.waiting_area_m2;
  record.splits = after.splits - before.splits;
  record.labels = after.labels - before.labels;
  record.refused = after.refused_splits - before.refused_splits;
  record.pinches = after.pinch_splits - before.pinch_splits;
  const auto pieces = find_pieces(topology);
  record.pieces = pieces.count;
  for (const auto tets : pieces.tets) record.tets += tets, record.crumbs += tets < kCrumb;
  for (std::uint32_t n = 0; n < topology.node_count(); ++n)
    record.nodes += topology.has_node(NodeIndex(n));
  record.bytes = bytes_of(organ_);
  record.leaves_bridge =
      record.kind == static_cast<std::uint32_t>(CutKind::Through) && has_bridge(pieces);
  record.angle = degrees(least_dihedral_sine(topology));
  record.floor = degrees(organ_.cutter().floor_sine());
  record.volume_drift = drift(total_volume(topology), volume_);
  record.mass_drift = drift(total_mass(topology), mass_);
}

CutRecord Series::next() {
  CutRecord record;
  record.organ = name_, record.series = number_, record.length = length_, record.cut = cut_;
  const auto kind = choose();
  record.kind = static_cast<std::uint32_t>(kind);
  record.h = h_;
  const auto paths = paths_of(kind);
  for (const auto& path : swept_) {
    record.swept += inside_.swept_area(path, h_ / 8);
    record.perimeter += inside_.perimeter(path, h_ / 8);
  }
  const bool is_first = cut_ == 0 && options_.compares;
  const SweptSurface surface(swept_);
  std::vector<std::uint8_t> crossed;
  if (is_first) {
    for (std::uint32_t t = 0; t < organ_.topology().tet_count(); ++t)
      crossed.push_back(surface.crossed_edges(organ_.topology(), TetIndex(t)));
    compare(paths, record);
  }
  record.crosses_ten = surface.touched_tets(organ_.topology(), 10) == 10;
  const auto before = organ_.total();
  stroke(paths, record);
  measure(before, record);
  if (is_first) count_split_tets(crossed, record);
  ++cut_;
  if (cut_ % options_.check_every == 0 || is_over()) record.broken = broken_law(record);
  std::ranges::replace(record.broken, ',', ';');
  return record;
}

}  // namespace trocar::cutting::testing
