#include "server/organs/mesh/gmsh_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>

namespace trocar::mesh {
namespace {

constexpr std::uintmax_t kMaxFileBytes = std::uintmax_t{1} << 30;
constexpr std::size_t kMaxShownBytes = 40;
constexpr const char* kFormats =
    "only Gmsh 2.2 ASCII is read, convert with: gmsh IN -save -format msh22 -o OUT.msh";

// Makes a part of a foreign file safe to print on one line.
std::string shown(std::string_view text) {
  std::string out = "'";
  for (const char c : text.substr(0, kMaxShownBytes)) out += c >= 32 && c < 127 ? c : '?';
  return out + (text.size() > kMaxShownBytes ? "...'" : "'");
}

template <typename T>
bool parse_number(std::string_view text, T& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size();
}

class Parser {
 public:
  Parser(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  Result<RawTets> run() {
    if (text_.empty()) return Error{ErrorCode::BadFile, name_ + ": is empty"};
    if (auto s = format(); !s) return s.error();
    while (next_line()) {
      if (line_.empty()) continue;
      if (line_[0] != '$')
        return error(shown(line_) + " is outside any section: expected a line such as $Nodes");
      Status status;
      if (line_ == "$Nodes")
        status = nodes();
      else if (line_ == "$Elements")
        status = elements();
      else
        status = skip_section();
      if (!status) return status.error();
    }
    if (!has_nodes_) return error("the file ends without a $Nodes section");
    if (!has_elements_) return error("the file ends without an $Elements section");
    return std::move(raw_);
  }

 private:
  Error error(const std::string& what) const {
    // Past the end: the last line had no line end.
    const char* hint = position_ > text_.size() ? " (the file ends here: it may be cut off)" : "";
    return {ErrorCode::BadFile, name_ + ":" + std::to_string(line_number_) + ": " + what + hint};
  }

  // Advances to the next line, without its end and outer blanks; false at the end of the file.
  bool next_line() {
    if (position_ >= text_.size()) return false;
    const auto end = std::min(text_.find('\n', position_), text_.size());
    line_ = text_.substr(position_, end - position_);
    position_ = end + 1;
    ++line_number_;
    const auto first = line_.find_first_not_of(" \t\r");
    line_ = first == std::string_view::npos ? std::string_view{} : line_.substr(first);
    line_ = line_.substr(0, line_.find_last_not_of(" \t\r") + 1);
    return true;
  }

  // Next word of the current line; empty when there is none.
  std::string_view word() {
    const auto begin = std::min(line_.find_first_not_of(" \t"), line_.size());
    const auto end = std::min(line_.find_first_of(" \t", begin), line_.size());
    const auto found = line_.substr(begin, end - begin);
    line_ = line_.substr(end);
    return found;
  }

  // Advances to the next line that is not blank, which must exist.
  Status need_line(const char* section) {
    while (next_line())
      if (!line_.empty()) return {};
    return error(std::string("the file ends inside ") + section +
                 ": it is cut off, fetch it again");
  }

  Status format() {
    if (!next_line() || line_ != "$MeshFormat") {
      const std::string_view start = text_.substr(0, 64);
      if (start.starts_with("$NOD")) return error(std::string("is Gmsh version 1: ") + kFormats);
      if (start.starts_with("# vtk")) return error(std::string("is a VTK file: ") + kFormats);
      return error(std::string("does not begin with $MeshFormat: ") + kFormats);
    }
    if (auto s = need_line("$MeshFormat"); !s) return s;
    const auto version = word(), type = word(), size = word();
    if (version != "2.2") return error("is Gmsh version " + shown(version) + ": " + kFormats);
    if (type == "1") return error(std::string("is a binary Gmsh file: ") + kFormats);
    if (type != "0" || size != "8" || !word().empty())
      return error("format line must be '2.2 0 8'");
    if (auto s = need_line("$MeshFormat"); !s) return s;
    if (line_ != "$EndMeshFormat") return error("expected $EndMeshFormat, found " + shown(line_));
    return {};
  }

  Status skip_section() {
    const std::string name(line_.substr(1));
    const std::string end = "$End" + name;
    const auto begins_at = line_number_;
    while (next_line())
      if (line_ == end) return {};
    return Error{ErrorCode::BadFile, name_ + ":" + std::to_string(begins_at) + ": section " +
                                         shown("$" + name) + " is never closed by " + shown(end)};
  }

  // The count that opens a section. It only has to be believable; the list itself is what counts.
  Status count_line(const char* section, const char* what, std::int64_t least_bytes,
                    std::int64_t& count) {
    if (auto s = need_line(section); !s) return s;
    const std::string text(line_);
    if (!parse_number(word(), count) || !word().empty())
      return error(std::string("number of ") + what + " is " + shown(text) +
                   ", must be a whole number");
    const auto room = static_cast<std::int64_t>(text_.size() - std::min(position_, text_.size()));
    if (count < 0)
      return error("announces " + text + " " + what + ", must be 0 or more: write the true number");
    if (count > room / least_bytes)
      return error("announces " + text + " " + what +
                   ", the rest of the file has room for at most " +
                   std::to_string(room / least_bytes));
    return {};
  }

  Status close(const char* end, const char* what, std::int64_t announced, std::int64_t found) {
    if (found != announced)
      return error("announced " + std::to_string(announced) + " " + what + ", found " +
                   std::to_string(found) + " before " + shown(line_));
    if (line_ != end) return error(std::string("expected ") + end + ", found " + shown(line_));
    return {};
  }

  Status nodes() {
    if (has_nodes_) return error("a second $Nodes section: a file must have one");
    has_nodes_ = true;
    std::int64_t count = 0;
    if (auto s = count_line("$Nodes", "nodes", 8, count); !s) return s;
    std::int64_t found = 0;
    while (true) {
      if (auto s = need_line("$Nodes"); !s) return s;
      if (line_[0] == '$') break;
      if (found == count) return error("more nodes than the announced " + std::to_string(count));
      if (auto s = node(); !s) return s;
      ++found;
    }
    if (auto s = close("$EndNodes", "nodes", count, found); !s) return s;
    return index_nodes();
  }

  Status node() {
    const auto id_text = word();
    std::int64_t id = 0;
    if (!parse_number(id_text, id) || id < 1)
      return error("node number " + shown(id_text) + " must be a whole number from 1 on");
    Vec3d p;
    for (double* c : {&p.x, &p.y, &p.z}) {
      const auto text = word();
      if (!parse_number(text, *c) || !std::isfinite(*c))
        return error("node " + std::to_string(id) + ": coordinate " + shown(text) +
                     " is not a finite number" +
                     (text.find(',') != text.npos ? ": write decimals with a point" : ""));
    }
    if (!word().empty())
      return error("node " + std::to_string(id) + ": more than three coordinates");
    raw_.positions.push_back(p);
    raw_.node_ids.push_back(id);
    return {};
  }

  Status index_nodes() {
    by_id_.resize(raw_.node_ids.size());
    for (std::size_t i = 0; i < by_id_.size(); ++i) by_id_[i] = {raw_.node_ids[i], NodeIndex(i)};
    std::sort(by_id_.begin(), by_id_.end());
    for (std::size_t i = 1; i < by_id_.size(); ++i)
      if (by_id_[i].first == by_id_[i - 1].first)
        return error("node number " + std::to_string(by_id_[i].first) +
                     " is given twice: number every node differently");
    return {};
  }

  Status elements() {
    if (!has_nodes_) return error("$Elements comes before $Nodes");
    if (has_elements_) return error("a second $Elements section: a file must have one");
    has_elements_ = true;
    std::int64_t count = 0;
    if (auto s = count_line("$Elements", "elements", 6, count); !s) return s;
    std::int64_t found = 0;
    while (true) {
      if (auto s = need_line("$Elements"); !s) return s;
      if (line_[0] == '$') break;
      if (found == count) return error("more elements than the announced " + std::to_string(count));
      if (auto s = element(); !s) return s;
      ++found;
    }
    return close("$EndElements", "elements", count, found);
  }

  Status element() {
    const auto id_text = word();
    std::int64_t id = 0, type = 0, tag_count = 0;
    if (!parse_number(id_text, id) || id < 1)
      return error("element number " + shown(id_text) + " must be a whole number from 1 on");
    const std::string name = "element " + std::to_string(id);
    if (!parse_number(word(), type)) return error(name + ": its type is not a whole number");
    const int node_count = type == 15 ? 1 : type == 1 ? 2 : type == 2 ? 3 : type == 4 ? 4 : 0;
    if (node_count == 0)
      return error(name + " has type " + std::to_string(type) +
                   (type == 5    ? " (hexahedron)"
                    : type == 11 ? " (tetrahedron of second order)"
                                 : "") +
                   ", which is not supported: mesh with tetrahedra of four nodes (type 4)");
    if (!parse_number(word(), tag_count) || tag_count < 0 || tag_count > 1000)
      return error(name + ": its number of tags must be from 0 to 1000");
    for (std::int64_t i = 0; i < tag_count; ++i)
      if (std::int64_t tag = 0; !parse_number(word(), tag))
        return error(name + ": a tag is missing or not a whole number");
    Tet nodes;
    for (int i = 0; i < node_count; ++i) {
      const auto text = word();
      const auto found = find_node(text);
      if (!found)
        return error(element_name(name, type) + " refers to node " + shown(text) +
                     ", which is not in $Nodes");
      nodes[i] = *found;
      for (int j = 0; j < i; ++j)
        if (nodes[j] == nodes[i])
          return error(element_name(name, type) + " uses node " + std::string(text) + " twice");
    }
    if (!word().empty())
      return error(name + ": more than " + std::to_string(node_count) + " nodes");
    if (type == 4) {
      raw_.tets.push_back(nodes);
      raw_.element_ids.push_back(id);
    }
    return {};
  }

  std::string element_name(const std::string& name, std::int64_t type) const {
    return type == 4 ? "tet " + std::to_string(raw_.tets.size() + 1) + " (" + name + ")" : name;
  }

  std::optional<NodeIndex> find_node(std::string_view text) const {
    std::int64_t id = 0;
    if (!parse_number(text, id)) return std::nullopt;
    const auto found = std::lower_bound(by_id_.begin(), by_id_.end(), std::pair(id, NodeIndex(0)));
    if (found == by_id_.end() || found->first != id) return std::nullopt;
    return found->second;
  }

  std::string_view text_;
  const std::string& name_;
  std::size_t position_ = 0;
  int line_number_ = 0;
  std::string_view line_;
  bool has_nodes_ = false, has_elements_ = false;
  RawTets raw_;
  std::vector<std::pair<std::int64_t, NodeIndex>> by_id_;  // ascending
};

}  // namespace

Result<ImportedMesh> parse_gmsh(std::string_view text, Unit unit, const std::string& name) {
  auto raw = Parser(text, name).run();
  if (!raw) return raw.error();
  return make_mesh(std::move(*raw), unit, name);
}

Result<ImportedMesh> read_gmsh(const std::filesystem::path& path, Unit unit) {
  const std::string name = path.string();
  std::error_code failure;
  const auto bytes = std::filesystem::file_size(path, failure);
  if (failure) return Error{ErrorCode::BadFile, name + ": cannot be opened: " + failure.message()};
  if (bytes > kMaxFileBytes)
    return Error{ErrorCode::BadFile, name + ": is larger than 1 GiB: use a coarser mesh"};
  std::ifstream file(path, std::ios::binary);
  std::string text(static_cast<std::size_t>(bytes), '\0');
  if (!file || !file.read(text.data(), static_cast<std::streamsize>(text.size())))
    return Error{ErrorCode::BadFile, name + ": cannot be read"};
  return parse_gmsh(text, unit, name);
}

}  // namespace trocar::mesh
