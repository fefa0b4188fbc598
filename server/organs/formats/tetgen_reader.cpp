#include "server/organs/formats/tetgen_reader.h"

#include <cmath>

#include "server/organs/formats/numbered_tets.h"
#include "server/organs/formats/text_reader.h"

namespace trocar::formats {
namespace {

constexpr std::int64_t kMaxAttributes = 100;

Status read_rest(TextReader& in, std::int64_t count, double& first) {
  for (std::int64_t i = 0; i < count; ++i) {
    const auto text = in.word();
    double value = 0;
    if (!parse_finite(text, value))
      return in.error("attribute " + shown(text) + " is not a number");
    if (i == 0) first = value;
  }
  if (!in.word().empty()) return in.error("the line has more numbers than the first line says");
  return {};
}

// A list's first line holds its length, a number that must be `expected`, and how many attributes
// and markers follow on each line.
struct ListHead {
  std::int64_t count = 0, attributes = 0;
};
Result<ListHead> read_head(TextReader& in, const char* what, std::int64_t expected) {
  ListHead head;
  if (!in.next_filled_line()) return in.error("is empty");
  std::int64_t second = 0, markers = 0;
  if (!parse_whole(in.word(), head.count) || !parse_whole(in.word(), second))
    return in.error(std::string("the first line must begin with the number of ") + what);
  if (second != expected)
    return in.error("has " + std::to_string(second) +
                    (expected == 3 ? " coordinates a point, must have 3"
                                   : " nodes an element: mesh with tetrahedra of four nodes"));
  if (const auto text = in.word(); !text.empty() && !parse_whole(text, head.attributes))
    return in.error("the number of attributes is " + shown(text));
  if (const auto text = in.word(); !text.empty() && !parse_whole(text, markers))
    return in.error("the number of markers is " + shown(text));
  if (head.attributes < 0 || head.attributes > kMaxAttributes || markers < 0 || markers > 1)
    return in.error("the numbers of attributes must be 0 to 100, that of markers 0 or 1");
  if (auto s = in.check_count(head.count, 8, what); !s) return s.error();
  head.attributes += markers;
  return head;
}

}  // namespace

Result<mesh::RawTets> parse_tetgen(std::string_view nodes, const std::string& nodes_name,
                                   std::string_view elements, const std::string& elements_name) {
  NumberedTets tets;
  double ignored = 0;
  TextReader points(nodes, nodes_name, '#');
  const auto point_head = read_head(points, "points", 3);
  if (!point_head) return point_head.error();
  for (std::int64_t i = 0; i < point_head->count; ++i) {
    if (auto s = points.need_line("the list of points"); !s) return s.error();
    const auto number_text = points.word();
    std::int64_t number = 0;
    if (!parse_whole(number_text, number))
      return points.error("the number of a point is " + shown(number_text));
    Vec3d p;
    for (double* c : {&p.x, &p.y, &p.z}) {
      const auto text = points.word();
      if (!parse_finite(text, *c))
        return points.error("node " + std::to_string(number) + ": coordinate " + shown(text) +
                            " is not a finite number");
    }
    if (auto s = read_rest(points, point_head->attributes, ignored); !s) return s.error();
    tets.add_node(number, p);
  }
  if (points.next_filled_line()) return points.error("more points than the first line announces");
  if (auto s = tets.end_nodes(points); !s) return s.error();

  TextReader in(elements, elements_name, '#');
  const auto head = read_head(in, "elements", 4);
  if (!head) return head.error();
  for (std::int64_t i = 0; i < head->count; ++i) {
    if (auto s = in.need_line("the list of elements"); !s) return s.error();
    std::int64_t number = 0;
    std::array<std::int64_t, 4> corners{};
    if (!parse_whole(in.word(), number)) return in.error("the number of an element is missing");
    for (auto& corner : corners)
      if (const auto text = in.word(); !parse_whole(text, corner))
        return in.error("element " + std::to_string(number) + " refers to node " + shown(text) +
                        ", which the file does not have");
    if (auto s = tets.add_tet(number, corners, in); !s) return s.error();
    double region = 0;
    if (auto s = read_rest(in, head->attributes, region); !s) return s.error();
    if (head->attributes == 0) continue;
    if (!(region > -1e15 && region < 1e15 && region == std::floor(region)))
      return in.error("element " + std::to_string(number) +
                      ": its region must be a whole number of at most 1e15");
    tets.raw.tet_regions.push_back(static_cast<std::int64_t>(region));
  }
  if (in.next_filled_line()) return in.error("more elements than the first line announces");
  if (point_head->attributes > 0)
    tets.raw.left_out.push_back("left out the attributes and markers of points");
  if (head->attributes > 1)
    tets.raw.left_out.push_back("left out the attributes of elements behind the first one");
  return std::move(tets.raw);
}

}  // namespace trocar::formats
