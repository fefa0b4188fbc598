#include <string>

#include "server/organs/formats/gmsh_mesh.h"

namespace trocar::formats {
namespace {

// Versions 1 and 2.2 differ in the names of their sections and in the numbers before the nodes of
// an element.
class LineReader {
 public:
  LineReader(TextReader& in, int version, GmshMesh& mesh)
      : in_(in), version_(version), mesh_(mesh) {}

  Status run() {
    // In version 1 the first section's line has been read already.
    bool has_line = version_ == 1;
    while (has_line || in_.next_line()) {
      has_line = false;
      if (in_.line().empty()) continue;
      if (in_.line()[0] != '$')
        return in_.error(shown(in_.line()) +
                         " is outside any section: expected a line such as $Nodes");
      Status status;
      if (in_.line() == (version_ == 1 ? "$NOD" : "$Nodes"))
        status = nodes();
      else if (in_.line() == (version_ == 1 ? "$ELM" : "$Elements"))
        status = elements();
      else if (in_.line() == "$PhysicalNames")
        status = read_physical_names(in_, mesh_);
      else
        status = skip_gmsh_section(in_, mesh_);
      if (!status) return status;
    }
    return {};
  }

 private:
  // Reads `what` line by line up to the section's end, which must come after as many as announced.
  template <typename Read>
  Status read_list(const std::string& section, const char* what, std::int64_t least_bytes,
                   const Read& read) {
    std::int64_t count = 0, found = 0;
    if (auto s = read_gmsh_count(in_, section, what, least_bytes, count); !s) return s;
    while (true) {
      if (auto s = in_.need_line(section); !s) return s;
      if (in_.line()[0] == '$') break;
      if (found == count)
        return in_.error(std::string("more ") + what + " than the announced " +
                         std::to_string(count));
      if (auto s = read(); !s) return s;
      ++found;
    }
    if (found != count)
      return in_.error("announced " + std::to_string(count) + " " + what + ", found " +
                       std::to_string(found) + " before " + shown(in_.line()));
    return need_gmsh_end(in_, (version_ == 1 ? "$END" : "$End") + section.substr(1), false);
  }

  Status nodes() {
    if (auto s = mesh_.begin_nodes(); !s) return s;
    if (auto s = read_list(version_ == 1 ? "$NOD" : "$Nodes", "nodes", 8, [&] { return node(); });
        !s)
      return s;
    return mesh_.end_nodes();
  }

  Status node() {
    const auto id_text = in_.word();
    std::int64_t id = 0;
    if (!parse_whole(id_text, id) || id < 1)
      return in_.error("node number " + shown(id_text) + " must be a whole number from 1 on");
    Vec3d p;
    for (double* c : {&p.x, &p.y, &p.z}) {
      const auto text = in_.word();
      if (!parse_finite(text, *c))
        return in_.error("node " + std::to_string(id) + ": coordinate " + shown(text) +
                         " is not a finite number" +
                         (text.find(',') != text.npos ? ": write decimals with a point" : ""));
    }
    if (!in_.word().empty())
      return in_.error("node " + std::to_string(id) + ": more than three coordinates");
    return mesh_.add_node(id, p);
  }

  Status elements() {
    if (auto s = mesh_.begin_elements(); !s) return s;
    return read_list(version_ == 1 ? "$ELM" : "$Elements", "elements", 6,
                     [&] { return element(); });
  }

  Status element() {
    const auto id_text = in_.word();
    std::int64_t id = 0, type = 0, physical = 0, entity = 0;
    if (!parse_whole(id_text, id) || id < 1)
      return in_.error("element number " + shown(id_text) + " must be a whole number from 1 on");
    const std::string name = "element " + std::to_string(id);
    if (!parse_whole(in_.word(), type)) return in_.error(name + ": its type is not a whole number");
    const auto node_count = mesh_.node_count_of(name, type);
    if (!node_count) return node_count.error();
    if (auto s = version_ == 1 ? numbers_of_version1(name, *node_count, physical, entity)
                               : tags(name, physical, entity);
        !s)
      return s;
    std::int64_t nodes[4] = {};
    for (int i = 0; i < *node_count; ++i) {
      const auto text = in_.word();
      if (!parse_whole(text, nodes[i]))
        return in_.error(mesh_.element_name(id, type) + " refers to node " + shown(text) +
                         ", which is not in $Nodes");
    }
    if (!in_.word().empty())
      return in_.error(name + ": more than " + std::to_string(*node_count) + " nodes");
    return mesh_.add_element(id, type, entity, {&physical, 1},
                             {nodes, static_cast<std::size_t>(*node_count)});
  }

  Status tags(const std::string& name, std::int64_t& physical, std::int64_t& entity) {
    std::int64_t count = 0;
    if (!parse_whole(in_.word(), count) || count < 0 || count > kMaxGmshTags)
      return in_.error(name + ": its number of tags must be from 0 to 1000");
    for (std::int64_t i = 0; i < count; ++i) {
      std::int64_t tag = 0;
      if (!parse_whole(in_.word(), tag))
        return in_.error(name + ": a tag is missing or not a whole number");
      if (i == 0) physical = tag;
      if (i == 1) entity = tag;
    }
    return {};
  }

  Status numbers_of_version1(const std::string& name, int node_count, std::int64_t& physical,
                             std::int64_t& entity) {
    std::int64_t count = 0;
    if (!parse_whole(in_.word(), physical) || !parse_whole(in_.word(), entity) ||
        !parse_whole(in_.word(), count))
      return in_.error(name + ": a number of its region or of its nodes is missing");
    if (count != node_count)
      return in_.error(name + " announces " + std::to_string(count) + " nodes, its type has " +
                       std::to_string(node_count));
    return {};
  }

  TextReader& in_;
  int version_;
  GmshMesh& mesh_;
};

}  // namespace

Status read_gmsh_lines(TextReader& reader, int version, GmshMesh& mesh) {
  return LineReader(reader, version, mesh).run();
}

}  // namespace trocar::formats
