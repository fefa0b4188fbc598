#include "server/organs/formats/medit_reader.h"

#include <algorithm>
#include <map>
#include <utility>

#include "server/organs/formats/numbered_tets.h"
#include "server/organs/formats/text_reader.h"

namespace trocar::formats {
namespace {

// Lists that are read over, by how many numbers an entry has; reals count alike.
struct Skipped {
  std::string_view keyword;
  int numbers;
};
constexpr Skipped kSkipped[] = {{"Corners", 1},           {"Ridges", 1},
                                {"RequiredVertices", 1},  {"RequiredEdges", 1},
                                {"RequiredTriangles", 1}, {"Normals", 3},
                                {"Tangents", 3},          {"NormalAtVertices", 2},
                                {"TangentAtEdges", 3},    {"NormalAtTriangleVertices", 3}};

class MeditReader {
 public:
  MeditReader(std::string_view text, const std::string& name) : in_(text, name, '#') {}

  Result<mesh::RawTets> run() {
    std::int64_t version = 0;
    if (in_.token() != "MeshVersionFormatted")
      return in_.error("does not begin with MeshVersionFormatted");
    if (auto s = in_.read_whole("the version", version); !s) return s.error();
    if (version < 1 || version > 3)
      return in_.error("is version " + std::to_string(version) + ", must be 1 to 3");
    while (true) {
      const std::string keyword(in_.token());
      if (keyword.empty() || keyword == "End") break;
      if (auto s = list(keyword); !s) return s.error();
    }
    if (!has_vertices_) return in_.error("the file ends without Vertices");
    if (!has_tets_ && has_other_)
      return in_.error("has no Tetrahedra: mesh the volume with tetrahedra of four nodes");
    if (!has_tets_) return in_.error("the file ends without Tetrahedra");
    const auto& regions = tets_.raw.tet_regions;
    if (std::ranges::all_of(regions, [](auto r) { return r == 0; })) tets_.raw.tet_regions.clear();
    for (auto& [reference, nodes] : sets_)
      tets_.raw.node_sets.push_back({std::to_string(reference), std::move(nodes)});
    return std::move(tets_.raw);
  }

 private:
  Status list(const std::string& keyword) {
    if (keyword == "Dimension") {
      std::int64_t dimension = 0;
      if (auto s = in_.read_whole("the dimension", dimension); !s) return s;
      return dimension == 3
                 ? Status{}
                 : in_.error("has dimension " + std::to_string(dimension) + ", must be 3");
    }
    if (keyword == "Vertices") return vertices();
    const int corners = keyword == "Tetrahedra"       ? 4
                        : keyword == "Triangles"      ? 3
                        : keyword == "Edges"          ? 2
                        : keyword == "Quadrilaterals" ? 4
                                                      : 0;
    if (keyword == "Hexahedra" || keyword == "Prisms" || keyword == "Pyramids")
      return in_.error("has " + keyword + ": mesh with tetrahedra of four nodes");
    if (corners > 0) return elements(keyword, corners);
    const auto skipped = std::ranges::find(kSkipped, keyword, &Skipped::keyword);
    if (skipped == std::end(kSkipped))
      return in_.error("keyword " + shown(keyword) + " is not known");
    std::int64_t count = 0;
    if (auto s = begin(keyword, skipped->numbers * 2, count); !s) return s;
    if (count > 0)
      tets_.raw.left_out.push_back("left out " + std::to_string(count) + " " + keyword);
    double ignored = 0;
    for (std::int64_t i = 0; i < count * skipped->numbers; ++i)
      if (auto s = in_.read_number("a number of " + keyword, ignored); !s) return s;
    return {};
  }

  Status begin(const std::string& keyword, std::int64_t least_bytes, std::int64_t& count) {
    if (auto s = in_.read_whole("the number of " + keyword, count); !s) return s;
    return in_.check_count(count, least_bytes, keyword);
  }

  Status vertices() {
    if (std::exchange(has_vertices_, true))
      return in_.error("a second list of Vertices: a file must have one");
    std::int64_t count = 0;
    if (auto s = begin("Vertices", 8, count); !s) return s;
    for (std::int64_t i = 1; i <= count; ++i) {
      Vec3d p;
      std::int64_t reference = 0;
      const std::string what = "node " + std::to_string(i) + ": coordinate";
      for (double* c : {&p.x, &p.y, &p.z})
        if (auto s = in_.read_number(what, *c); !s) return s;
      if (auto s = in_.read_whole("the reference of a vertex", reference); !s) return s;
      if (reference != 0) sets_[reference].push_back(NodeIndex(static_cast<std::uint32_t>(i - 1)));
      tets_.add_node(i, p);
    }
    return tets_.end_nodes(in_);
  }

  Status elements(const std::string& keyword, int corners) {
    if (!has_vertices_) return in_.error(keyword + " come before Vertices");
    const bool is_tets = keyword == "Tetrahedra";
    has_tets_ = has_tets_ || is_tets;
    has_other_ = has_other_ || !is_tets;
    std::int64_t count = 0;
    if (auto s = begin(keyword, 2 * corners + 2, count); !s) return s;
    for (std::int64_t i = 1; i <= count; ++i) {
      std::array<std::int64_t, 4> nodes{};
      std::int64_t reference = 0;
      const std::string who = keyword + " " + std::to_string(i);
      for (int c = 0; c < corners; ++c)
        if (auto s = in_.read_whole(who + ": a node", nodes[static_cast<std::size_t>(c)]); !s)
          return s;
      if (auto s = in_.read_whole(who + ": the reference", reference); !s) return s;
      if (is_tets) {
        // Some programs write a list for each block of them.
        const auto number = static_cast<std::int64_t>(tets_.raw.tets.size()) + 1;
        if (auto s = tets_.add_tet(number, nodes, in_); !s) return s;
        tets_.raw.tet_regions.push_back(reference);
        continue;
      }
      for (int c = 0; c < corners; ++c) {
        const auto node = tets_.node(nodes[static_cast<std::size_t>(c)], who, in_);
        if (!node) return node.error();
        if (reference != 0) sets_[reference].push_back(*node);
      }
    }
    return {};
  }

  TextReader in_;
  NumberedTets tets_;
  std::map<std::int64_t, std::vector<NodeIndex>> sets_;
  bool has_vertices_ = false, has_tets_ = false, has_other_ = false;
};

}  // namespace

Result<mesh::RawTets> parse_medit(std::string_view text, const std::string& name) {
  return MeditReader(text, name).run();
}

}  // namespace trocar::formats
