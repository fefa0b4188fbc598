#include "server/organs/formats/abaqus_reader.h"

#include <algorithm>
#include <cctype>
#include <map>
#include <utility>

#include "server/organs/formats/numbered_tets.h"
#include "server/organs/formats/text_reader.h"

namespace trocar::formats {
namespace {

constexpr const char* kFieldBlanks = " \t\r";
constexpr std::int64_t kMaxRange = 100'000'000;
constexpr int kMaxRanges = 10'000;  // each may name all elements

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
      if (auto s = line[0] == '*' ? keyword(line) : data(line); !s) return s.error();
    }
    if (tets_.raw.positions.empty()) return in_.error("the file ends without nodes (*NODE)");
    if (auto s = add_tets(); !s) return s.error();
    if (auto s = add_sets(); !s) return s.error();
    return std::move(tets_.raw);
  }

 private:
  enum class Section { None, Node, Element, OtherElement, NodeSet, ElementSet };
  struct Element {
    std::int64_t number;
    std::array<std::int64_t, 4> nodes;
    int line;
  };
  // Numbers of members; a range is kept as it is written.
  struct Range {
    std::int64_t first, last, step;
  };
  using Set = std::vector<Range>;

  Status keyword(std::string_view line) {
    line.remove_prefix(1);
    const std::string name = upper(take_field(line));
    section_ = Section::None;
    std::string type, set_name;
    generates_ = false;
    while (!line.empty()) {
      auto field = take_field(line);
      const auto equals = field.find('=');
      const std::string key = upper(trimmed(field.substr(0, equals)));
      const auto value =
          equals == std::string_view::npos ? std::string_view{} : trimmed(field.substr(equals + 1));
      if (key == "TYPE") type = upper(value);
      if (key == "ELSET" || key == "NSET") set_name = upper(value);
      if (key == "GENERATE") generates_ = true;
      if (key == "INPUT" && (name == "NODE" || name == "ELEMENT" || name == "INCLUDE"))
        return in_.error("reads another file: put the mesh into one file");
    }
    if (name == "INCLUDE") return in_.error("reads another file: put the mesh into one file");
    if (name == "PART" && std::exchange(has_part_, true))
      return in_.error("a second *PART: save the organ as one part");
    if (name == "NODE") {
      section_ = Section::Node;
      set_ = set_name.empty() ? nullptr : &node_sets_[set_name];
    } else if (name == "ELEMENT") {
      return element_keyword(type, set_name);
    } else if (name == "NSET" || name == "ELSET") {
      if (set_name.empty()) return in_.error("*" + name + " needs a name");
      section_ = name == "NSET" ? Section::NodeSet : Section::ElementSet;
      set_ = &(name == "NSET" ? node_sets_ : element_sets_)[set_name];
    }
    return {};
  }

  Status element_keyword(const std::string& type, const std::string& set_name) {
    const bool is_flat = type.starts_with("S3") || type.starts_with("STRI3") ||
                         type.starts_with("T3D2") || type.starts_with("M3D3") ||
                         type.starts_with("CPS3") || type.starts_with("CPE3") ||
                         type.starts_with("SFM3D3") || type.starts_with("B31");
    if (type != "C3D4" && type != "C3D4H" && !is_flat)
      return in_.error("elements of type " + shown(type) +
                       ", which is not supported: mesh with tetrahedra of four nodes (C3D4)");
    section_ = is_flat ? Section::OtherElement : Section::Element;
    set_ = set_name.empty() || is_flat ? nullptr : &element_sets_[set_name];
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
    Element element{0, {}, in_.line_number()};
    if (!parse_whole(number_text, element.number) || element.number < 1)
      return in_.error("element number " + shown(number_text) +
                       " must be a whole number from 1 on");
    const std::string who = "element " + std::to_string(element.number);
    for (auto& node : element.nodes)
      if (const auto text = take_field(line); !parse_whole(text, node))
        return in_.error(who + " refers to node " + shown(text) + ", which the file does not have");
    if (!trimmed(line).empty()) return in_.error(who + ": more than 4 nodes");
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
      const auto other = sets.find(upper(field));
      if (other == sets.end())
        return in_.error("set member " + shown(field) + " is no number and no set's name");
      if (&other->second != set_) {
        taken_over_ += other->second.size();
        if (taken_over_ > in_.text().size())
          return in_.error("sets of sets grow larger than the file");
        set_->insert(set_->end(), other->second.begin(), other->second.end());
      }
    }
    return {};
  }

  Status add_tets() {
    if (auto s = tets_.end_nodes(in_); !s) return s;
    for (const Element& element : elements_) {
      in_.speak_of_line(element.line);
      if (auto s = tets_.add_tet(element.number, element.nodes, in_); !s) return s;
    }
    auto ids = tets_.raw.element_ids;
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

  // In the order of their names a later set of elements goes before an earlier one. Sets that hold
  // all tets are names of the whole, as decks have them.
  Status add_sets() {
    auto& raw = tets_.raw;
    const auto tets = by_number(raw.element_ids), nodes = by_number(raw.node_ids);
    std::vector<std::uint8_t> tet_is_taken(tets.size()), node_is_taken(nodes.size());
    std::vector<std::int64_t> regions(raw.tets.size(), 0);
    std::int64_t region = 0;
    for (const auto& [name, set] : element_sets_) {
      const auto members = members_of(set, tets, tet_is_taken);
      if (members.empty() || members.size() == raw.tets.size()) continue;
      raw.region_names[++region] = plain_name(name);
      for (const auto t : members) regions[t] = region;
    }
    if (region > 0) {
      raw.region_names[0] = "rest";
      raw.tet_regions = std::move(regions);
    }
    for (const auto& [name, set] : node_sets_) {
      mesh::NamedNodes named{plain_name(name), {}};
      for (const auto i : members_of(set, nodes, node_is_taken)) named.nodes.emplace_back(i);
      if (!named.nodes.empty()) raw.node_sets.push_back(std::move(named));
    }
    return {};
  }

  TextReader in_;
  NumberedTets tets_;
  Section section_ = Section::None;
  bool generates_ = false, has_part_ = false;
  std::vector<Element> elements_;
  std::map<std::string, Set> node_sets_, element_sets_;
  Set* set_ = nullptr;
  int ranges_ = 0;
  std::size_t taken_over_ = 0;  // members of sets that are in others, too
};

}  // namespace

Result<mesh::RawTets> parse_abaqus(std::string_view text, const std::string& name) {
  return AbaqusReader(text, name).run();
}

}  // namespace trocar::formats
