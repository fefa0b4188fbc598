#pragma once

// Tetrahedra as a file gives them, and what makes a valid mesh of them.
//
// make_mesh() repairs what can only have been meant one way, and says so in `warnings`: it drops
// unused nodes, welds nodes at exactly the same place, drops tets listed twice, and turns tets
// whose nodes are listed in the mirrored order. It rejects, naming the first culprit by the file's
// own numbers: tets that use a node twice or have no volume, tets that overlap a neighbour (a
// tangled mesh, or a face of three tets), surfaces that are not manifold, and meshes larger than 2
// m. All of it in double precision; the result is centred on the origin before anything is
// measured, so a mesh far from the origin loses nothing more than its file has lost.

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "server/organs/mesh/tet_mesh.h"

namespace trocar::mesh {

enum class Unit : std::uint8_t { Metre, Centimetre, Millimetre };
// The unit is "m", "cm" or "mm".
Result<Unit> parse_unit(std::string_view text);
double metres_of(Unit unit);

struct NamedNodes {
  std::string name;              // as the file has it, whatever bytes these are
  std::vector<NodeIndex> nodes;  // ascending, distinct
  std::vector<TetIndex> tets;    // likewise, of a region
};

struct RawTets {
  std::vector<Vec3d> positions;           // in the file's unit
  std::vector<std::int64_t> node_ids;     // the file's number of each node
  std::vector<Tet> tets;                  // valid indices into `positions`
  std::vector<std::int64_t> element_ids;  // the file's number of each tet
  // The file's number of each tet's region; empty: the file has none.
  std::vector<std::int64_t> tet_regions;
  std::map<std::int64_t, std::string> region_names;  // of some of them
  std::vector<NamedNodes> node_sets;                 // in any order and number
  std::vector<std::string> left_out;                 // one line each: what of the file is not here
};

// Regions from sets of tets in the file's order, of which a tet may be in several: it belongs to
// the last. A set of all tets is a name of the whole, and no region. What differs from the file is
// left_out.
class RegionSets {
 public:
  explicit RegionSets(std::size_t tets) : region_of_(tets, 0) {}

  // tets: distinct.
  void add(const std::string& name, const std::vector<std::size_t>& tets);
  // Gives `raw` its regions; tets of no set are the region "rest".
  void finish(RawTets& raw) &&;

 private:
  struct Set {
    std::string name;
    std::size_t tets, kept;
  };
  std::vector<std::int64_t> region_of_;  // 1 for the first set
  std::vector<Set> sets_;
};

struct ImportedMesh {
  TetMesh mesh;    // adjacency built, valid, rest bounding box centred on the origin
  Vec3d offset_m;  // add to a rest position to get the file's place
  std::vector<std::string> warnings;  // one line each: what was repaired, and how often
  // Each region by name with its tets and their nodes, if the file has two regions or more; those
  // at an interface belong to both.
  std::vector<NamedNodes> regions;
  std::vector<NamedNodes> node_sets;  // that have nodes left
  std::vector<std::string> left_out;  // one line each: what of the file is not here
};

// The names in quotation marks with commas between them, as as_name() has them; from some 200 bytes
// on dots follow.
std::string list_of(const std::vector<std::string>& names);

// `name` starts each error, usually the file's path.
Result<ImportedMesh> make_mesh(RawTets raw, Unit unit, const std::string& name);

}  // namespace trocar::mesh
