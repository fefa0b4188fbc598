#pragma once

// Series of random cuts of one organ, measured and checked cut by cut. A series is named by its
// organ and number, which gives its length and every stroke: it can be run again alone.

#include <optional>

#include "tests/cutting/random_strokes.h"

namespace trocar::cutting::testing {

enum class CutKind : std::uint8_t {
  Knife,      // straight or on an arc, through the surface
  Crossing,   // across the knife stroke before it
  TwoBlades,  // a knife and one that crosses it, at the same time
  Aligned,    // through nodes and along edges
  Straight,   // somewhere inside
  Curved,     // likewise
  Sawing,     // likewise, to and fro
  Tiny,       // likewise, one edge long
  Through,    // a plane across everything
};
inline constexpr std::size_t kCutKinds = 9;
const char* name_of(CutKind kind);
std::optional<CutKind> cut_kind_of(const std::string& name);

// A record describes one cut; sizes of the organ are those after it.
struct CutRecord {
  std::string organ;
  std::uint64_t series = 0;
  std::uint32_t length = 0, cut = 0;       // of the series; in it, from 0
  std::uint32_t kind = 0;                  // CutKind
  double h = 0, swept = 0, perimeter = 0;  // m, m^2, m: what paths sweep inside the organ
  double wound = 0, waiting = 0;           // m^2, opened; never opened
  std::uint32_t ticks_to_rest = 0;         // after the last blade has left
  bool crosses_ten = false, leaves_bridge = false;
  std::uint64_t tets = 0, nodes = 0, bytes = 0;  // bytes: of topology and edits
  std::uint32_t pieces = 0, crumbs = 0;          // pieces; with fewer than eight tets
  std::uint32_t splits = 0, labels = 0, refused = 0, pinches = 0;
  double angle = 0, floor = 0;              // degrees; the smallest dihedral angle of all
  double volume_drift = 0, mass_drift = 0;  // since the start, relative
  double cpu_ms = 0, worst_ms = 0;          // of all calls of the cut, of the worst one
  // First cut of a series: tets that the path touches, and what the mesh gained; the same with
  // every crossed edge split. Of tets parted one corner to three, two to two: how many, and parts.
  std::uint32_t touched = 0, gained = 0, generic_gained = 0;
  std::uint32_t ones = 0, parts_of_ones = 0, twos = 0, parts_of_twos = 0;
  std::string broken;  // the law, or nothing
};

struct CampaignOptions {
  std::uint32_t shortest = 1, longest = 100;  // cuts per series
  std::optional<CutKind> only;
  std::uint32_t check_every = 1;  // the laws; and at the end
  bool compares = true;           // with the generic split
  Settings settings;
};

class Series {
 public:
  Series(const organ::Organ& organ, std::string name, std::uint64_t number,
         const CampaignOptions& options);

  std::uint32_t length() const { return length_; }
  bool is_over() const { return cut_ == length_; }
  CutRecord next();
  const CutOrgan& organ() const { return organ_; }

 private:
  CutKind choose();
  std::vector<Path> paths_of(CutKind kind);
  void stroke(const std::vector<Path>& paths, CutRecord& record);
  void tick(CutRecord& record);
  void compare(const std::vector<Path>& paths, CutRecord& record) const;
  void measure(const CutOutput& before, CutRecord& record);
  void count_split_tets(const std::vector<std::uint8_t>& crossed, CutRecord& record) const;
  std::string broken_law(const CutRecord& record) const;
  bool has_bridge(const Pieces& pieces) const;

  const std::string name_;
  const std::uint64_t number_;
  const CampaignOptions options_;
  CutOrgan organ_;
  const InsideTest inside_;
  RandomStrokes strokes_;
  const double h_, longest_edge_, volume_, mass_;
  std::vector<Path> swept_;  // what the paths of this cut sweep, once
  std::uint32_t length_ = 0, cut_ = 0;
};

// How long a series is, from its number.
std::uint32_t series_length(std::uint64_t number, const CampaignOptions& options);

}  // namespace trocar::cutting::testing
