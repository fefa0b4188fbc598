#include "server/organs/mesh/raw_tets.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/base/printable.h"
#include "server/organs/mesh/pieces.h"
#include "server/organs/mesh/places.h"

namespace trocar::mesh {
namespace {

constexpr double kMaxCoordinate_m = 1e9;  // from here on a double cannot hold an organ's shape
// A tet with less volume than this share of its longest edge cubed is flat: a regular one has
// 0.118, one with dihedral angles of one degree about 0.001.
constexpr double kFlat = 1e-6;
constexpr std::size_t kMostListedBytes = 120;  // of a name in a list

class Builder {
 public:
  Builder(RawTets raw, Unit unit, const std::string& name)
      : raw_(std::move(raw)), unit_(unit), name_(name) {}

  Result<ImportedMesh> run() {
    if (raw_.tets.empty())
      return error(
          "has no tetrahedra: mesh the volume (Gmsh: -3), or import the surface as STL, OBJ or "
          "PLY");
    out_.left_out = std::move(raw_.left_out);
    for (auto step : {&Builder::scale, &Builder::drop_unused, &Builder::centre, &Builder::weld,
                      &Builder::check_nodes_of_tets, &Builder::drop_repeated_tets, &Builder::orient,
                      &Builder::check_overlaps, &Builder::count_pieces})
      if (auto status = (this->*step)(); !status) return status.error();
    name_regions();
    out_.mesh.rest_positions = std::move(raw_.positions);
    out_.mesh.tets = std::move(raw_.tets);
    out_.mesh.build_adjacency();
    if (auto status = validate(out_.mesh); !status)
      return error(status.error().message + " (numbered from 0)");
    return std::move(out_);
  }

 private:
  Error error(const std::string& what) const { return {ErrorCode::BadFile, name_ + ": " + what}; }
  void warn(std::string what) { out_.warnings.push_back(std::move(what)); }
  std::string tet_name(std::size_t t) const {
    return "element " + std::to_string(raw_.element_ids[t]);
  }
  std::string node_name(NodeIndex node) const {
    return "node " + std::to_string(raw_.node_ids[node.value]);
  }

  Status scale() {
    const double factor = metres_of(unit_);
    for (std::size_t i = 0; i < raw_.positions.size(); ++i) {
      Vec3d& p = raw_.positions[i];
      p *= factor;
      if (!(std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) <= kMaxCoordinate_m))
        return error(node_name(NodeIndex(i)) +
                     " has a coordinate beyond 1e9 m: correct it in the file");
    }
    return {};
  }

  Status drop_unused() {
    std::vector<std::uint8_t> used(raw_.positions.size(), 0);
    for (const Tet& tet : raw_.tets)
      for (const NodeIndex node : tet) used[node.value] = 1;
    keep_nodes(used);
    const auto dropped = static_cast<std::size_t>(std::ranges::count(used, 0));
    if (dropped > 0) warn("dropped " + std::to_string(dropped) + " nodes that no tet uses");
    return {};
  }

  void keep_nodes(const std::vector<std::uint8_t>& keep) {
    std::vector<std::uint32_t> new_index(keep.size());
    std::uint32_t kept = 0;
    for (std::size_t i = 0; i < keep.size(); ++i) {
      new_index[i] = kept;
      if (!keep[i]) continue;
      raw_.positions[kept] = raw_.positions[i];
      raw_.node_ids[kept++] = raw_.node_ids[i];
    }
    raw_.positions.resize(kept);
    raw_.node_ids.resize(kept);
    for (Tet& tet : raw_.tets)
      for (NodeIndex& node : tet) node = NodeIndex(new_index[node.value]);
    for (NamedNodes& set : raw_.node_sets) {
      std::erase_if(set.nodes, [&](NodeIndex node) { return !keep[node.value]; });
      for (NodeIndex& node : set.nodes) node = NodeIndex(new_index[node.value]);
    }
  }

  Status centre() {
    auto done = mesh::centre(raw_.positions, unit_, "nodes");
    if (!done) return error(done.error().message);
    out_.offset_m = done->offset_m;
    if (!done->warning.empty()) warn(std::move(done->warning));
    return {};
  }

  Status weld() {
    const auto welding = mesh::weld(raw_.positions);
    if (welding.welded == 0) return {};
    for (Tet& tet : raw_.tets)
      for (NodeIndex& node : tet) node = NodeIndex(welding.first[node.value]);
    for (NamedNodes& set : raw_.node_sets)
      for (NodeIndex& node : set.nodes) node = NodeIndex(welding.first[node.value]);
    keep_nodes(welding.keep);
    warn("welded " + std::to_string(welding.welded) +
         " nodes to others at exactly the same position");
    return {};
  }

  Status check_nodes_of_tets() {
    for (std::size_t t = 0; t < raw_.tets.size(); ++t) {
      const Tet& tet = raw_.tets[t];
      for (int i = 0; i < 4; ++i)
        for (int j = 0; j < i; ++j)
          if (tet[i] == tet[j])
            return error(tet_name(t) + " uses " + node_name(tet[i]) +
                         " twice: remove or correct that tet");
    }
    return {};
  }

  Status drop_repeated_tets() {
    struct Key {
      Tet nodes;
      std::size_t tet;
    };
    std::vector<Key> keys;
    keys.reserve(raw_.tets.size());
    for (std::size_t t = 0; t < raw_.tets.size(); ++t) {
      keys.push_back({raw_.tets[t], t});
      std::sort(keys.back().nodes.begin(), keys.back().nodes.end());
    }
    std::sort(keys.begin(), keys.end(), [](const Key& a, const Key& b) {
      return a.nodes != b.nodes ? a.nodes < b.nodes : a.tet < b.tet;
    });
    std::vector<std::uint8_t> repeated(raw_.tets.size(), 0);
    std::size_t others = 0;  // in another region than that which is kept
    for (std::size_t i = 1, first = 0; i < keys.size(); ++i) {
      if (keys[i].nodes != keys[i - 1].nodes) {
        first = i;
        continue;
      }
      repeated[keys[i].tet] = 1;
      others += !raw_.tet_regions.empty() &&
                raw_.tet_regions[keys[i].tet] != raw_.tet_regions[keys[first].tet];
    }
    std::size_t kept = 0;
    for (std::size_t t = 0; t < raw_.tets.size(); ++t) {
      if (repeated[t]) continue;
      raw_.tets[kept] = raw_.tets[t];
      if (!raw_.tet_regions.empty()) raw_.tet_regions[kept] = raw_.tet_regions[t];
      raw_.element_ids[kept++] = raw_.element_ids[t];
    }
    if (kept < raw_.tets.size())
      warn("dropped " + std::to_string(raw_.tets.size() - kept) + " tets that were listed twice" +
           (others == 0 ? "" : ", " + std::to_string(others) + " of them in another region"));
    raw_.tets.resize(kept);
    raw_.element_ids.resize(kept);
    if (!raw_.tet_regions.empty()) raw_.tet_regions.resize(kept);
    return {};
  }

  Status orient() {
    std::size_t turned = 0;
    for (std::size_t t = 0; t < raw_.tets.size(); ++t) {
      Tet& tet = raw_.tets[t];
      Vec3d p[4];
      for (int i = 0; i < 4; ++i) p[i] = raw_.positions[tet[i].value];
      double longest_squared = 0;
      for (int i = 0; i < 4; ++i)
        for (int j = 0; j < i; ++j)
          longest_squared = std::max(longest_squared, length_squared(p[i] - p[j]));
      const double volume = dot(cross(p[1] - p[0], p[2] - p[0]), p[3] - p[0]) / 6;
      if (!(std::abs(volume) > kFlat * longest_squared * std::sqrt(longest_squared)))
        return error(tet_name(t) + " is flat, its four nodes lie in a plane (" + node_name(tet[0]) +
                     ", " + std::to_string(raw_.node_ids[tet[1].value]) + ", " +
                     std::to_string(raw_.node_ids[tet[2].value]) + ", " +
                     std::to_string(raw_.node_ids[tet[3].value]) + "): remesh there");
      if (volume < 0) {
        std::swap(tet[2], tet[3]);
        ++turned;
      }
    }
    if (turned > 0)
      warn("turned " + std::to_string(turned) + " of " + std::to_string(raw_.tets.size()) +
           " tets whose nodes were in mirrored order");
    return {};
  }

  // With all tets positive, two that share a face must lie on different sides of it.
  Status check_overlaps() {
    struct Face {
      Triangle key;
      std::size_t tet;
      bool even;  // parity of the sort: which side of the sorted face the tet is on
    };
    std::vector<Face> faces;
    faces.reserve(raw_.tets.size() * 4);
    for (std::size_t t = 0; t < raw_.tets.size(); ++t) {
      const auto& [a, b, c, d] = raw_.tets[t];
      for (Triangle f :
           {Triangle{a, c, b}, Triangle{a, b, d}, Triangle{a, d, c}, Triangle{b, c, d}}) {
        const bool even = ((f[0] < f[1]) + (f[1] < f[2]) + (f[0] < f[2])) % 2 == 1;
        std::sort(f.begin(), f.end());
        faces.push_back({f, t, even});
      }
    }
    std::sort(faces.begin(), faces.end(), [](const Face& x, const Face& y) {
      return x.key != y.key ? x.key < y.key : x.tet < y.tet;
    });
    const auto face_name = [&](const Face& f) {
      return "(" + node_name(f.key[0]) + ", " + std::to_string(raw_.node_ids[f.key[1].value]) +
             ", " + std::to_string(raw_.node_ids[f.key[2].value]) + ")";
    };
    for (std::size_t i = 1; i < faces.size(); ++i) {
      if (faces[i].key != faces[i - 1].key) continue;
      if (i > 1 && faces[i].key == faces[i - 2].key)
        return error("face " + face_name(faces[i]) + " belongs to three tets (" +
                     tet_name(faces[i - 2].tet) + ", " +
                     std::to_string(raw_.element_ids[faces[i - 1].tet]) + ", " +
                     std::to_string(raw_.element_ids[faces[i].tet]) +
                     "): remove the one that overlaps");
    }
    for (std::size_t i = 1; i < faces.size(); ++i)
      if (faces[i].key == faces[i - 1].key && faces[i].even == faces[i - 1].even)
        return error("is tangled: " + tet_name(faces[i - 1].tet) + " and " +
                     std::to_string(raw_.element_ids[faces[i].tet]) +
                     " lie on the same side of their common face " + face_name(faces[i]) +
                     ": remesh there");
    return {};
  }

  Status count_pieces() {
    TetMesh pieces_of;
    pieces_of.tets = raw_.tets;
    const auto count = find_pieces(pieces_of).count;
    if (count > 1) warn("is " + std::to_string(count) + " separate pieces; all are kept");
    return {};
  }

  void name_regions() {
    const auto tidy = [](NamedNodes& set) {
      std::sort(set.nodes.begin(), set.nodes.end());
      set.nodes.erase(std::unique(set.nodes.begin(), set.nodes.end()), set.nodes.end());
    };
    std::map<std::int64_t, NamedNodes> regions;
    for (std::size_t t = 0; t < raw_.tet_regions.size(); ++t) {
      auto& region = regions[raw_.tet_regions[t]];
      region.nodes.insert(region.nodes.end(), raw_.tets[t].begin(), raw_.tets[t].end());
      region.tets.emplace_back(t);
    }
    if (regions.size() > 1)
      for (auto& [number, region] : regions) {
        const auto named = raw_.region_names.find(number);
        region.name =
            named != raw_.region_names.end() ? named->second : "region " + std::to_string(number);
        tidy(region);
        out_.regions.push_back(std::move(region));
      }
    for (NamedNodes& set : raw_.node_sets) {
      tidy(set);
      if (!set.nodes.empty()) out_.node_sets.push_back(std::move(set));
    }
  }

  RawTets raw_;
  Unit unit_;
  const std::string& name_;
  ImportedMesh out_;
};

}  // namespace

std::string list_of(const std::vector<std::string>& names) {
  std::string text;
  for (const auto& name : names) {
    if (text.size() > 200) return text + ", ...";
    text += (text.empty() ? "'" : ", '") + as_name(name, kMostListedBytes) + "'";
  }
  return text;
}

void RegionSets::add(const std::string& name, const std::vector<std::size_t>& tets) {
  sets_.push_back({name, tets.size(), 0});
  if (tets.size() == region_of_.size()) return;
  for (const auto t : tets) region_of_[t] = static_cast<std::int64_t>(sets_.size());
}

void RegionSets::finish(RawTets& raw) && {
  for (const auto region : region_of_)
    if (region > 0) ++sets_[static_cast<std::size_t>(region - 1)].kept;
  std::vector<std::string> whole, cut;
  for (std::size_t s = 0; s < sets_.size(); ++s) {
    const auto& [name, tets, kept] = sets_[s];
    if (kept > 0) raw.region_names[static_cast<std::int64_t>(s + 1)] = name;
    if (tets == region_of_.size())
      whole.push_back(name);
    else if (kept < tets)
      cut.push_back(as_name(name, kMostListedBytes / 2) + ": " + std::to_string(kept) + " of " +
                    std::to_string(tets));
  }
  if (!whole.empty())
    raw.left_out.push_back("no region, as it holds all elements: " + list_of(whole));
  if (!cut.empty())
    raw.left_out.push_back(
        "an element belongs to the last region that holds it, so these keep fewer: " +
        list_of(cut));
  if (raw.region_names.empty()) return;
  raw.region_names[0] = "rest";
  raw.tet_regions = std::move(region_of_);
}

Result<Unit> parse_unit(std::string_view text) {
  if (text == "m") return Unit::Metre;
  if (text == "cm") return Unit::Centimetre;
  if (text == "mm") return Unit::Millimetre;
  return Error{ErrorCode::Usage, "--unit: '" + std::string(text) + "' is not one of m, cm, mm"};
}

double metres_of(Unit unit) {
  return unit == Unit::Metre ? 1 : unit == Unit::Centimetre ? 0.01 : 0.001;
}

Result<ImportedMesh> make_mesh(RawTets raw, Unit unit, const std::string& name) {
  TROCAR_ASSERT(raw.positions.size() == raw.node_ids.size());
  TROCAR_ASSERT(raw.tets.size() == raw.element_ids.size());
  TROCAR_ASSERT(raw.tet_regions.empty() || raw.tets.size() == raw.tet_regions.size());
  return Builder(std::move(raw), unit, name).run();
}

}  // namespace trocar::mesh
