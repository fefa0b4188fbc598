#include <algorithm>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "server/organs/formats/gmsh_mesh.h"

namespace trocar::formats {
namespace {

// Numbers as text or as bytes of this machine's order.
class Numbers {
 public:
  Numbers(TextReader& in, bool is_binary) : in_(in), is_binary_(is_binary) {}

  bool is_binary() const { return is_binary_; }

  Status whole32(const char* what, std::int64_t& value) {
    return is_binary_ ? take<std::int32_t>(what, value) : in_.read_whole(what, value);
  }
  // A size_t, of which numbers from 2^63 on are refused.
  Status whole64(const char* what, std::int64_t& value) {
    return is_binary_ ? take<std::int64_t>(what, value) : in_.read_whole(what, value);
  }
  Status number(const char* what, double& value) {
    return is_binary_ ? take<double>(what, value) : in_.read_number(what, value);
  }
  template <typename Read>
  Status repeat(std::int64_t count, const Read& read) {
    for (std::int64_t i = 0; i < count; ++i)
      if (auto s = read(); !s) return s;
    return {};
  }

 private:
  template <typename Stored, typename Value>
  Status take(const char* what, Value& value) {
    const auto bytes = in_.bytes(sizeof(Stored));
    if (bytes.empty())
      return in_.error(std::string("the file ends before ") + what + ": it is cut off");
    Stored stored{};
    std::memcpy(&stored, bytes.data(), sizeof stored);
    value = static_cast<Value>(stored);
    return {};
  }

  TextReader& in_;
  bool is_binary_;
};

// Sections by name; those of no interest are skipped.
template <typename Read>
Status read_sections(TextReader& in, GmshMesh& mesh, const Read& read) {
  while (in.next_filled_line()) {
    if (in.line()[0] != '$')
      return in.error(shown(in.line()) + " is outside any section: expected a line such as $Nodes");
    const std::string section(in.line());
    auto status = section == "$PhysicalNames" ? read_physical_names(in, mesh) : read(section);
    if (!status) return status;
  }
  return {};
}

class Version2 {
 public:
  Version2(TextReader& in, GmshMesh& mesh) : in_(in), numbers_(in, true), mesh_(mesh) {}

  Status run() {
    return read_sections(in_, mesh_, [this](const std::string& section) {
      return section == "$Nodes"      ? nodes()
             : section == "$Elements" ? elements()
                                      : skip_gmsh_section(in_, mesh_);
    });
  }

 private:
  Status nodes() {
    if (auto s = mesh_.begin_nodes(); !s) return s;
    std::int64_t count = 0;
    if (auto s = read_gmsh_count(in_, "$Nodes", "nodes", 28, count); !s) return s;
    auto status = numbers_.repeat(count, [&]() -> Status {
      std::int64_t id = 0;
      Vec3d p;
      if (auto s = numbers_.whole32("the number of a node", id); !s) return s;
      for (double* c : {&p.x, &p.y, &p.z})
        if (auto s = numbers_.number("a coordinate", *c); !s) return s;
      return mesh_.add_node(id, p);
    });
    if (!status) return status;
    if (auto s = need_gmsh_end(in_, "$EndNodes"); !s) return s;
    return mesh_.end_nodes();
  }

  Status elements() {
    if (auto s = mesh_.begin_elements(); !s) return s;
    std::int64_t count = 0, found = 0;
    if (auto s = read_gmsh_count(in_, "$Elements", "elements", 8, count); !s) return s;
    while (found < count) {
      std::int64_t type = 0, in_block = 0, tags = 0;
      if (auto s = numbers_.whole32("the type of elements", type); !s) return s;
      if (auto s = numbers_.whole32("the number of elements", in_block); !s) return s;
      if (auto s = numbers_.whole32("the number of tags", tags); !s) return s;
      const auto nodes = mesh_.node_count_of("a block of elements", type);
      if (!nodes) return nodes.error();
      if (in_block < 1 || in_block > count - found)
        return in_.error("a block of " + std::to_string(in_block) + " elements, " +
                         std::to_string(count - found) + " are left of the announced " +
                         std::to_string(count));
      if (tags < 0 || tags > kMaxGmshTags)
        return in_.error("a block of elements: its number of tags must be from 0 to 1000");
      auto status = numbers_.repeat(in_block, [&] { return element(type, tags, *nodes); });
      if (!status) return status;
      found += in_block;
    }
    return need_gmsh_end(in_, "$EndElements");
  }

  Status element(std::int64_t type, std::int64_t tags, int node_count) {
    std::int64_t id = 0, physical = 0, entity = 0, nodes[4] = {};
    if (auto s = numbers_.whole32("the number of an element", id); !s) return s;
    for (std::int64_t i = 0; i < tags; ++i) {
      std::int64_t tag = 0;
      if (auto s = numbers_.whole32("a tag", tag); !s) return s;
      if (i == 0) physical = tag;
      if (i == 1) entity = tag;
    }
    for (int i = 0; i < node_count; ++i)
      if (auto s = numbers_.whole32("a node of an element", nodes[i]); !s) return s;
    return mesh_.add_element(id, type, entity, {&physical, 1},
                             {nodes, static_cast<std::size_t>(node_count)});
  }

  TextReader& in_;
  Numbers numbers_;
  GmshMesh& mesh_;
};

class Version4 {
 public:
  Version4(TextReader& in, bool is_binary, GmshMesh& mesh)
      : in_(in), numbers_(in, is_binary), mesh_(mesh) {}

  Status run() {
    return read_sections(in_, mesh_, [this](const std::string& section) {
      return section == "$Entities"   ? entities()
             : section == "$Nodes"    ? nodes()
             : section == "$Elements" ? elements()
             : section == "$PartitionedEntities"
                 ? Status(in_.error("is partitioned: save the whole mesh"))
                 : skip_gmsh_section(in_, mesh_);
    });
  }

 private:
  // Entities say to which physical group the elements on them belong.
  Status entities() {
    if (auto s = open("$Entities"); !s) return s;
    std::int64_t counts[4] = {};
    for (auto& count : counts) {
      if (auto s = numbers_.whole64("the number of entities", count); !s) return s;
      if (auto s = in_.check_count(count, 8, "entities"); !s) return s;
    }
    for (int dimension = 0; dimension < 4; ++dimension) {
      auto status = numbers_.repeat(counts[dimension], [&] { return entity(dimension); });
      if (!status) return status;
    }
    return need_gmsh_end(in_, "$EndEntities");
  }

  Status entity(int dimension) {
    std::int64_t tag = 0, groups = 0, bounding = 0;
    if (auto s = numbers_.whole32("the number of an entity", tag); !s) return s;
    double ignored = 0;
    for (int i = 0; i < (dimension == 0 ? 3 : 6); ++i)
      if (auto s = numbers_.number("a coordinate of an entity", ignored); !s) return s;
    if (auto s = numbers_.whole64("the number of physical groups", groups); !s) return s;
    if (auto s = in_.check_count(groups, numbers_.is_binary() ? 4 : 2, "physical groups"); !s)
      return s;
    if (groups > kMaxGmshTags) return in_.error("an entity has more than 1000 physical groups");
    auto& physical = physical_[{dimension, tag}];
    for (std::int64_t i = 0; i < groups; ++i) {
      std::int64_t group = 0;
      if (auto s = numbers_.whole32("a physical group", group); !s) return s;
      // The sign is an orientation.
      group = group < 0 ? -group : group;
      if (std::ranges::find(physical, group) == physical.end()) physical.push_back(group);
    }
    if (dimension == 0) return {};
    if (auto s = numbers_.whole64("the number of bounding entities", bounding); !s) return s;
    if (auto s = in_.check_count(bounding, numbers_.is_binary() ? 4 : 2, "bounding entities"); !s)
      return s;
    return numbers_.repeat(bounding, [&] {
      std::int64_t entity_tag = 0;
      return numbers_.whole32("a bounding entity", entity_tag);
    });
  }

  Status open(const char* section) {
    // Numbers follow on lines as text, and at once as bytes.
    return numbers_.is_binary() ? Status{} : in_.need_line(section);
  }

  // Blocks of a section: four numbers open it, how many blocks, how many in all, and the range of
  // numbers. `read` takes how many are announced, and counts those that it finds.
  template <typename Read>
  Status blocks(const std::string& section, const char* what, std::int64_t least_bytes,
                const Read& read) {
    if (auto s = open(section.c_str()); !s) return s;
    std::int64_t count = 0, total = 0, found = 0, ignored = 0;
    if (auto s = numbers_.whole64("the number of blocks", count); !s) return s;
    if (auto s = in_.check_count(count, 8, "blocks"); !s) return s;
    if (auto s = numbers_.whole64(what, total); !s) return s;
    if (auto s = in_.check_count(total, least_bytes, what); !s) return s;
    if (auto s = numbers_.whole64("the least number", ignored); !s) return s;
    if (auto s = numbers_.whole64("the greatest number", ignored); !s) return s;
    for (std::int64_t b = 0; b < count; ++b)
      if (auto s = read(total, found); !s) return s;
    if (found != total)
      return in_.error("announced " + std::to_string(total) + " " + what + ", found " +
                       std::to_string(found));
    return need_gmsh_end(in_, "$End" + section.substr(1));
  }

  Status nodes() {
    if (auto s = mesh_.begin_nodes(); !s) return s;
    auto status = blocks("$Nodes", "nodes", numbers_.is_binary() ? 32 : 8,
                         [this](auto total, auto& found) { return node_block(total, found); });
    return status ? mesh_.end_nodes() : status;
  }

  Status block_header(const char* what, std::int64_t& dimension, std::int64_t& tag,
                      std::int64_t& third, std::int64_t& count, std::int64_t left) {
    if (auto s = numbers_.whole32("a dimension", dimension); !s) return s;
    if (auto s = numbers_.whole32("the number of an entity", tag); !s) return s;
    if (auto s = numbers_.whole32("a type", third); !s) return s;
    if (auto s = numbers_.whole64(what, count); !s) return s;
    if (dimension < 0 || dimension > 3)
      return in_.error("dimension " + std::to_string(dimension) + " must be 0 to 3");
    if (count < 0 || count > left)
      return in_.error("a block of " + std::to_string(count) + " " + what + ", " +
                       std::to_string(left) + " are left of those announced");
    return {};
  }

  Status node_block(std::int64_t total, std::int64_t& found) {
    std::int64_t dimension = 0, tag = 0, parametric = 0, count = 0;
    if (auto s = block_header("nodes", dimension, tag, parametric, count, total - found); !s)
      return s;
    if (parametric != 0 && parametric != 1)
      return in_.error("a block of nodes is parametric " + std::to_string(parametric) +
                       ", must be 0 or 1");
    std::vector<std::int64_t> ids;
    auto status = numbers_.repeat(count, [&] {
      ids.emplace_back();
      return numbers_.whole64("the number of a node", ids.back());
    });
    if (!status) return status;
    for (const std::int64_t id : ids) {
      Vec3d p;
      const std::string what = "node " + std::to_string(id) + ": coordinate";
      for (double* c : {&p.x, &p.y, &p.z})
        if (auto s = numbers_.number(what.c_str(), *c); !s) return s;
      double parameter = 0;
      for (std::int64_t i = 0; parametric == 1 && i < dimension; ++i)
        if (auto s = numbers_.number("a parameter of a node", parameter); !s) return s;
      if (auto s = mesh_.add_node(id, p); !s) return s;
    }
    found += count;
    return {};
  }

  Status elements() {
    if (auto s = mesh_.begin_elements(); !s) return s;
    return blocks("$Elements", "elements", numbers_.is_binary() ? 16 : 4,
                  [this](auto total, auto& found) { return element_block(total, found); });
  }

  Status element_block(std::int64_t total, std::int64_t& found) {
    std::int64_t dimension = 0, tag = 0, type = 0, count = 0;
    if (auto s = block_header("elements", dimension, tag, type, count, total - found); !s) return s;
    const auto node_count = mesh_.node_count_of("a block of elements", type);
    if (!node_count) return node_count.error();
    const auto& physical = physical_[{dimension, tag}];
    auto status = numbers_.repeat(count, [&]() -> Status {
      std::int64_t id = 0, nodes[4] = {};
      if (auto s = numbers_.whole64("the number of an element", id); !s) return s;
      for (int i = 0; i < *node_count; ++i)
        if (auto s = numbers_.whole64("a node of an element", nodes[i]); !s) return s;
      return mesh_.add_element(id, type, tag, physical,
                               {nodes, static_cast<std::size_t>(*node_count)});
    });
    found += count;
    return status;
  }

  TextReader& in_;
  Numbers numbers_;
  GmshMesh& mesh_;
  // Groups of each entity, by dimension and number.
  std::map<std::pair<std::int64_t, std::int64_t>, std::vector<std::int64_t>> physical_;
};

}  // namespace

Status read_gmsh_binary2(TextReader& reader, GmshMesh& mesh) {
  return Version2(reader, mesh).run();
}

Status read_gmsh4(TextReader& reader, bool is_binary, GmshMesh& mesh) {
  return Version4(reader, is_binary, mesh).run();
}

}  // namespace trocar::formats
