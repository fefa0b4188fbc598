#include "server/organs/edit/box_rule.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>

namespace trocar::edit {
namespace {

constexpr double kMargin_m = 1e-6;
constexpr double kLargest_mm = 2000;  // no organ is larger
constexpr std::size_t kShownLetters = 60;

// Returns the number of a bound, m; `open` where nothing is written; none: it is no number.
std::optional<double> bound_of(std::string_view text, double open) {
  if (text.empty()) return open;
  double value_mm = 0;
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), value_mm);
  if (failed != std::errc{} || end != text.data() + text.size() ||
      !(std::abs(value_mm) <= kLargest_mm))
    return std::nullopt;
  return value_mm * 1e-3;
}

// A term such as "x=-10..20". False: it is none, or the axis has been said before.
bool take_axis(std::string_view term, BoxRule& rule) {
  if (term.size() < 5 || term[1] != '=') return false;
  double Vec3d::*const axis = term[0] == 'x'   ? &Vec3d::x
                              : term[0] == 'y' ? &Vec3d::y
                              : term[0] == 'z' ? &Vec3d::z
                                               : nullptr;
  const auto dots = term.find("..");
  if (axis == nullptr || dots == std::string_view::npos) return false;
  if (rule.low_m.*axis != -BoxRule::kOpen || rule.high_m.*axis != BoxRule::kOpen) return false;
  const auto low = bound_of(term.substr(2, dots - 2), -BoxRule::kOpen);
  const auto high = bound_of(term.substr(dots + 2), BoxRule::kOpen);
  if (!low || !high || *low > *high) return false;
  rule.low_m.*axis = *low;
  rule.high_m.*axis = *high;
  return true;
}

bool is_within(double x, double low, double high) {
  return x >= low - kMargin_m && x <= high + kMargin_m;
}

}  // namespace

Result<BoxRule> parse_box_rule(std::string_view text, std::string_view option) {
  BoxRule rule;
  bool says_something = false;
  while (!text.empty()) {
    const auto comma = std::min(text.find(','), text.size());
    const auto term = text.substr(0, comma);
    text.remove_prefix(std::min(comma + 1, text.size()));
    says_something = true;
    if (term == "all") continue;
    if (term == "surface") {
      rule.is_on_surface = true;
      continue;
    }
    if (!take_axis(term, rule))
      return Error{ErrorCode::Usage,
                   std::string(option) + ": '" + std::string(term.substr(0, kShownLetters)) +
                       "' is no term such as x=-10..20, y=..-40, z=5.., surface or all, in mm, "
                       "each axis once, from -2000 to 2000"};
  }
  if (!says_something)
    return Error{ErrorCode::Usage, std::string(option) + ": says nothing, write y=..-40 or all"};
  return rule;
}

std::vector<NodeIndex> nodes_in(const BoxRule& rule, const mesh::TetMesh& mesh) {
  std::vector<NodeIndex> nodes;
  for (std::size_t i = 0; i < mesh.node_count(); ++i) {
    const Vec3d& p = mesh.rest_positions[i];
    if (rule.is_on_surface && mesh.is_surface_node[i] == 0) continue;
    if (is_within(p.x, rule.low_m.x, rule.high_m.x) &&
        is_within(p.y, rule.low_m.y, rule.high_m.y) && is_within(p.z, rule.low_m.z, rule.high_m.z))
      nodes.push_back(NodeIndex(i));
  }
  return nodes;
}

}  // namespace trocar::edit
