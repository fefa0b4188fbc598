#include "server/organs/formats/abaqus_reader.h"

#include <algorithm>
#include <cctype>
#include <deque>
#include <map>
#include <set>
#include <span>
#include <utility>

#include "common/base/printable.h"
#include "server/organs/formats/numbered_tets.h"
#include "server/organs/formats/text_reader.h"

namespace trocar::formats {
namespace {

constexpr const char* kFieldBlanks = " \t\r";
constexpr std::int64_t kMaxRange = 100'000'000;
constexpr int kMaxRanges = 10'000;  // each may name all elements

// Elements beside tets, by how their types begin, with the number of nodes.
constexpr std::pair<std::string_view, std::size_t> kFlatTypes[] = {
    {"S3", 3},   {"R3D3", 3},   {"STRI3", 3}, {"M3D3", 3}, {"CPS3", 3},
    {"CPE3", 3}, {"SFM3D3", 3}, {"T3D2", 2},  {"B31", 2}};
// Keywords that make what is not listed, and such that say nothing of the mesh.
constexpr std::string_view kMakers[] = {"NGEN",  "NFILL",  "NCOPY", "NMAP",
                                        "ELGEN", "ELCOPY", "SYSTEM"};
constexpr std::string_view kFrames[] = {"HEADING",  "PREPRINT",     "PART",        "END PART",
                                        "ASSEMBLY", "END ASSEMBLY", "END INSTANCE"};

std::string upper(std::string_view text) {
  std::string out(text);
  for (char& c : out) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return out;
}

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(kFieldBlanks);
  if (first == std::string_view::npos) return {};
  text = text.substr(first);
  return text.substr(0, text.find_last_not_of(kFieldBlanks) + 1);
}

// Takes the part up to the next comma.
std::string_view take_field(std::string_view& line) {
  const auto comma = line.find(',');
  const auto field = trimmed(line.substr(0, comma));
  line = comma == std::string_view::npos ? std::string_view{} : line.substr(comma + 1);
  return field;
}

class AbaqusReader {
 public:
  AbaqusReader(std::string_view text, const std::string& name) : in_(text, name) {}

  Result<mesh::RawTets> run() {
    while (in_.next_line()) {
      auto line = in_.line();
      if (line.empty() || line.starts_with("**")) continue;
      if (auto s = line[0] == '*' ? keyword(std::string(line)) : data(line); !s) return s.error();
    }
    if (tets_.raw.positions.empty()) return in_.error("the file ends without nodes (*NODE)");
    if (auto s = add_elements(); !s) return s.error();
    add_sets();
    return std::move(tets_.raw);
  }

 private:
  enum class Section { None, Node, Element, NodeSet, ElementSet, Instance };
  struct Element {
    std::int64_t number;
    std::array<std::int64_t, 4> nodes;
    std::size_t corners;
    int line;
  };
  // Numbers of members; a range is kept as it is written.
  struct Range {
    std::int64_t first, last, step;
  };
  using Set = std::vector<Range>;
  // In the file's order; case does not tell names apart, and the first spelling stays.
  struct Sets {
    std::map<std::string, std::size_t> by_name;
    std::deque<std::pair<std::string, Set>> in_order;

    Set& at(std::string_view name) {
      const auto [found, is_new] = by_name.try_emplace(upper(name), in_order.size());
      if (is_new) in_order.emplace_back(name, Set{});
      return in_order[found->second].second;
    }
  };

  // A line that ends with a comma goes on in the next one.
  Status keyword(std::string text) {
    while (text.ends_with(',') && in_.next_line()) text += in_.line();
    std::string_view line(text);
    line.remove_prefix(1);
    const std::string name = upper(take_field(line));
    section_ = Section::None;
    std::string type;
    std::string_view set_name;
    generates_ = false;
    while (!line.empty()) {
      auto field = take_field(line);
      const auto equals = field.find('=');
      const std::string key = upper(trimmed(field.substr(0, equals)));
      const auto value =
          equals == std::string_view::npos ? std::string_view{} : trimmed(field.substr(equals + 1));
      if (key == "TYPE") type = upper(value);
      if (key == (name == "ELEMENT" || name == "ELSET" ? "ELSET" : "NSET")) set_name = value;
      if (key == "ELSET" && name == "NSET")
        return in_.error("*NSET of the nodes of a set of elements: list its nodes instead");
      if (key == "SYSTEM" && name == "NODE" && upper(value) != "R")
        return in_.error("*NODE, SYSTEM=" + printable(value, 20) +
                         ": save the nodes in rectangular coordinates (SYSTEM=R)");
      if (key == "GENERATE") generates_ = true;
      if (key == "INPUT" && (name == "NODE" || name == "ELEMENT" || name == "INCLUDE"))
        return in_.error("reads another file: put the mesh into one file");
    }
    if (name == "INCLUDE") return in_.error("reads another file: put the mesh into one file");
    for (const auto* once : {"PART", "INSTANCE"})
      if (name == once && !seen_.insert(name).second)
        return in_.error("a second *" + name + ": save the organ as one part, there once");
    if (std::ranges::find(kMakers, name) != std::end(kMakers))
      return in_.error("*" + name + " makes nodes or elements that the file does not list: save " +
                       "the mesh with all of them");
    if (name == "NODE") {
      section_ = Section::Node;
      set_ = set_name.empty() ? nullptr : &node_sets_.at(set_name);
    } else if (name == "ELEMENT") {
      return element_keyword(type, set_name);
    } else if (name == "NSET" || name == "ELSET") {
      if (set_name.empty()) return in_.error("*" + name + " needs a name");
      section_ = name == "NSET" ? Section::NodeSet : Section::ElementSet;
      set_ = &(name == "NSET" ? node_sets_ : element_sets_).at(set_name);
    } else if (name == "INSTANCE") {
      section_ = Section::Instance;
    } else if (std::ranges::find(kFrames, name) == std::end(kFrames) && seen_.insert(name).second) {
      left_out_.push_back("*" + name);
    }
    return {};
  }

  Status element_keyword(const std::string& type, std::string_view set_name) {
    const auto flat = std::ranges::find_if(
        kFlatTypes, [&](const auto& kind) { return type.starts_with(kind.first); });
    const bool is_flat = flat != std::end(kFlatTypes);
    if (type != "C3D4" && type != "C3D4H" && !is_flat)
      return in_.error("elements of type " + shown(type) +
                       ", which is not supported: mesh with tetrahedra of four nodes (C3D4)");
    section_ = Section::Element;
    corners_ = is_flat ? flat->second : 4;
    set_ = set_name.empty() ? nullptr : &element_sets_.at(set_name);
    return {};
  }

  Status data(std::string_view line) {
    switch (section_) {
      case Section::Node:
        return node(line);
      case Section::Element:
        return element(line);
      case Section::NodeSet:
      case Section::ElementSet:
        return members(line);
      case Section::Instance:
        left_out_.push_back("the position of *INSTANCE");
        section_ = Section::None;
        return {};
      default:
        return {};
    }
  }

  Status node(std::string_view line) {
    const auto number_text = take_field(line);
    std::int64_t number = 0;
    if (!parse_whole(number_text, number) || number < 1)
      return in_.error("node number " + shown(number_text) + " must be a whole number from 1 on");
    Vec3d p;
    for (double* c : {&p.x, &p.y, &p.z}) {
      const auto text = take_field(line);
      if (!parse_finite(text, *c))
        return in_.error("node " + std::to_string(number) + ": coordinate " + shown(text) +
                         " is not a finite number");
    }
    if (!trimmed(line).empty())
      return in_.error("node " + std::to_string(number) + ": more than three coordinates");
    tets_.add_node(number, p);
    if (set_) set_->push_back({number, number, 1});
    return {};
  }

  Status element(std::string_view line) {
    const auto number_text = take_field(line);
    Element element{0, {}, corners_, in_.line_number()};
    if (!parse_whole(number_text, element.number) || element.number < 1)
      return in_.error("element number " + shown(number_text) +
                       " must be a whole number from 1 on");
    const std::string who = "element " + std::to_string(element.number);
    for (auto& node : std::span(element.nodes).first(corners_)) {
      // A line that ends with a comma goes on in the next one.
      if (trimmed(line).empty() && in_.line().ends_with(',') && in_.next_line()) line = in_.line();
      if (const auto text = take_field(line); !parse_whole(text, node))
        return in_.error(who + " refers to node " + shown(text) + ", which the file does not have");
    }
    if (!trimmed(line).empty())
      return in_.error(who + ": more than " + std::to_string(corners_) + " nodes");
    elements_.push_back(element);
    if (set_) set_->push_back({element.number, element.number, 1});
    return {};
  }

  Status members(std::string_view line) {
    if (generates_) {
      Range range{0, 0, 1};
      if (!parse_whole(take_field(line), range.first) || !parse_whole(take_field(line), range.last))
        return in_.error("a range needs a first and a last number");
      if (const auto text = take_field(line); !text.empty() && !parse_whole(text, range.step))
        return in_.error("the step of a range is " + shown(text));
      if (range.first < 1 || range.step < 1 || range.last < range.first || range.last > kMaxRange)
        return in_.error("a range must ascend from 1 or more to at most 100,000,000");
      if (++ranges_ > kMaxRanges) return in_.error("has more than 10,000 ranges (GENERATE)");
      set_->push_back(range);
      return {};
    }
    while (!line.empty()) {
      const auto field = take_field(line);
      if (field.empty()) continue;
      std::int64_t number = 0;
      if (parse_whole(field, number)) {
        set_->push_back({number, number, 1});
        continue;
      }
      // The name of another set, whose members are taken over.
      auto& sets = section_ == Section::NodeSet ? node_sets_ : element_sets_;
      const auto found = sets.by_name.find(upper(field));
      if (found == sets.by_name.end())
        return in_.error("set member " + shown(field) + " is no number and no set's name");
      const Set& other = sets.in_order[found->second].second;
      if (&other == set_) continue;
      taken_over_ += other.size();
      if (taken_over_ > in_.text().size())
        return in_.error("sets of sets grow larger than the file");
      set_->insert(set_->end(), other.begin(), other.end());
    }
    return {};
  }

  Status add_elements() {
    if (auto s = tets_.end_nodes(in_); !s) return s;
    std::vector<std::int64_t> ids;
    for (const Element& element : elements_) {
      in_.speak_of_line(element.line);
      ids.push_back(element.number);
      if (element.corners == 4) {
        if (auto s = tets_.add_tet(element.number, element.nodes, in_); !s) return s;
        continue;
      }
      auto& flat = flats_.emplace_back();
      flat_ids_.push_back(element.number);
      for (const auto node : std::span(element.nodes).first(element.corners)) {
        const auto index = tets_.node(node, "element " + std::to_string(element.number), in_);
        if (!index) return index.error();
        flat.push_back(*index);
      }
    }
    std::sort(ids.begin(), ids.end());
    const auto twice = std::adjacent_find(ids.begin(), ids.end());
    if (twice != ids.end())
      return in_.error("element number " + std::to_string(*twice) +
                       " is given twice: number every element differently");
    return {};
  }

  using Numbered = std::vector<std::pair<std::int64_t, std::size_t>>;
  static Numbered by_number(const std::vector<std::int64_t>& numbers) {
    Numbered sorted;
    for (std::size_t i = 0; i < numbers.size(); ++i) sorted.emplace_back(numbers[i], i);
    std::sort(sorted.begin(), sorted.end());
    return sorted;
  }

  // Indices of a set's members, ascending; numbers that nothing has are left out.
  static std::vector<std::size_t> members_of(const Set& set, const Numbered& numbered,
                                             std::vector<std::uint8_t>& is_taken) {
    std::vector<std::size_t> members;
    for (const Range& range : set) {
      auto at = std::lower_bound(numbered.begin(), numbered.end(),
                                 std::pair(range.first, std::size_t{0}));
      for (; at != numbered.end() && at->first <= range.last; ++at)
        if ((at->first - range.first) % range.step == 0 && !is_taken[at->second]) {
          is_taken[at->second] = 1;
          members.push_back(at->second);
        }
    }
    for (const auto member : members) is_taken[member] = 0;
    std::sort(members.begin(), members.end());
    return members;
  }

  // A set of tets is a region, one of nodes, or of points, lines and triangles, a set of nodes.
  void add_sets() {
    auto& raw = tets_.raw;
    const auto tets = by_number(raw.element_ids), flats = by_number(flat_ids_),
               nodes = by_number(raw.node_ids);
    std::vector<std::uint8_t> is_taken(std::max({tets.size(), flats.size(), nodes.size()}));
    std::vector<std::uint8_t> is_in_set(flats.size());
    mesh::RegionSets regions(raw.tets.size());
    const auto add_nodes = [&raw](const std::string& name, std::vector<NodeIndex> members) {
      if (!members.empty()) raw.node_sets.push_back({name, std::move(members)});
    };
    for (const auto& [name, set] : node_sets_.in_order) {
      std::vector<NodeIndex> members;
      for (const auto i : members_of(set, nodes, is_taken)) members.emplace_back(i);
      add_nodes(name, std::move(members));
    }
    for (const auto& [name, set] : element_sets_.in_order) {
      if (const auto members = members_of(set, tets, is_taken); !members.empty())
        regions.add(name, members);
      std::vector<NodeIndex> members;
      for (const auto i : members_of(set, flats, is_taken)) {
        is_in_set[i] = 1;
        members.insert(members.end(), flats_[i].begin(), flats_[i].end());
      }
      add_nodes(name, std::move(members));
    }
    std::move(regions).finish(raw);
    if (const auto skipped = std::ranges::count(is_in_set, 0); skipped > 0)
      raw.left_out.push_back("left out " + std::to_string(skipped) +
                             " triangles and lines of no set");
    if (!left_out_.empty()) raw.left_out.push_back("left out: " + mesh::list_of(left_out_));
  }

  TextReader in_;
  NumberedTets tets_;
  Section section_ = Section::None;
  bool generates_ = false;
  std::size_t corners_ = 4;  // of the elements of this section
  std::vector<Element> elements_;
  std::vector<std::vector<NodeIndex>> flats_;  // triangles and lines
  std::vector<std::int64_t> flat_ids_;
  Sets node_sets_, element_sets_;
  std::set<std::string> seen_;         // keywords
  std::vector<std::string> left_out_;  // likewise
  Set* set_ = nullptr;
  int ranges_ = 0;
  std::size_t taken_over_ = 0;  // members of sets that are in others, too
};

}  // namespace

Result<mesh::RawTets> parse_abaqus(std::string_view text, const std::string& name) {
  return AbaqusReader(text, name).run();
}

}  // namespace trocar::formats
