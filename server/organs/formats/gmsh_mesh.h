#pragma once

// A mesh as the versions of the Gmsh format give it, while it is read: elements are checked against
// the nodes, physical groups are collected by dimension and number.

#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "server/organs/formats/text_reader.h"
#include "server/organs/mesh/raw_tets.h"

namespace trocar::formats {

inline constexpr std::int64_t kMaxGmshTags = 1000;  // of an element

class GmshMesh {
 public:
  explicit GmshMesh(TextReader& reader) : in_(reader) {}

  Status begin_nodes();
  Status add_node(std::int64_t id, const Vec3d& position);
  Status end_nodes();  // needed before the first element

  Status begin_elements();
  // Nodes of an element of that type. Error: unknown or of no use here.
  Result<int> node_count_of(const std::string& element, std::int64_t type) const;
  // entity: of the geometry, on which it lies. physical: the numbers of its groups, 0 is none.
  // Nodes by the file's numbers.
  Status add_element(std::int64_t id, std::int64_t type, std::int64_t entity,
                     std::span<const std::int64_t> physical, std::span<const std::int64_t> nodes);
  // "tet 11 (element 705)", or "element 705" of another type; of the element that comes next.
  std::string element_name(std::int64_t id, std::int64_t type) const;

  // Dimension, number and "name" in quotation marks, as a line of $PhysicalNames.
  Status add_physical_name(std::int64_t dimension, std::int64_t number, std::string_view quoted);

  void leave_out(std::string_view section) { left_out_.emplace_back(section); }

  Result<mesh::RawTets> finish();

 private:
  // Versions 1 and 2.2 list an element once for each of its groups: those become one element.
  void join_repeated();

  TextReader& in_;
  bool has_nodes_ = false, has_elements_ = false;
  mesh::RawTets raw_;
  NodeNumbers numbers_;
  std::map<std::pair<std::int64_t, std::int64_t>, std::string> names_;  // by dimension and number
  std::map<std::pair<std::int64_t, std::int64_t>, std::vector<NodeIndex>> groups_;
  std::map<std::int64_t, std::vector<std::size_t>> volumes_;  // tets of each group
  std::set<std::int64_t> ungrouped_;   // volumes of which a tet is in no group
  std::size_t grown_ = 0;              // numbers in groups beyond the first one of each element
  std::size_t skipped_ = 0;            // points, lines and triangles of no group
  std::vector<std::string> left_out_;  // sections
};

// Versions 1 and 2.2 as text, from the line behind the format line on.
Status read_gmsh_lines(TextReader& reader, int version, GmshMesh& mesh);
// Version 2.2 as binary.
Status read_gmsh_binary2(TextReader& reader, GmshMesh& mesh);
// Version 4.1, either way.
Status read_gmsh4(TextReader& reader, bool is_binary, GmshMesh& mesh);
// A line with the number of `what`, which take `least_bytes` each at least.
Status read_gmsh_count(TextReader& reader, std::string_view section, std::string_view what,
                       std::int64_t least_bytes, std::int64_t& count);
// The line that closes a section; `end`: "$EndNodes". Behind: it is the next line, not this one.
Status need_gmsh_end(TextReader& reader, std::string_view end, bool is_behind = true);
// Reads a section that is about nothing of interest, up to its $End line.
Status skip_gmsh_section(TextReader& reader, GmshMesh& mesh);
// The lines of $PhysicalNames.
Status read_physical_names(TextReader& reader, GmshMesh& mesh);

}  // namespace trocar::formats
