#include "server/organs/organ/fix_rule.h"

#include <algorithm>
#include <charconv>
#include <cstdio>

namespace trocar::organ {

Result<FixRule> parse_fix_rule(std::string_view text) {
  const Error bad{ErrorCode::Usage, "--fix: '" + std::string(text.substr(0, 60)) +
                                        "' is not none, bottom:F, top:F or back:F with F above 0 "
                                        "and at most 1, such as bottom:0.2"};
  if (text == "none") return FixRule{FixRule::Side::None, 0};
  const auto colon = text.find(':');
  if (colon == std::string_view::npos) return bad;
  const auto side = text.substr(0, colon), number = text.substr(colon + 1);
  FixRule rule;
  if (side == "bottom")
    rule.side = FixRule::Side::Bottom;
  else if (side == "top")
    rule.side = FixRule::Side::Top;
  else if (side == "back")
    rule.side = FixRule::Side::Back;
  else
    return bad;
  const auto parsed = std::from_chars(number.data(), number.data() + number.size(), rule.fraction);
  if (parsed.ec != std::errc{} || parsed.ptr != number.data() + number.size() ||
      !(rule.fraction > 0 && rule.fraction <= 1))
    return bad;
  return rule;
}

std::string to_text(const FixRule& rule) {
  const char* side = rule.side == FixRule::Side::Bottom ? "bottom"
                     : rule.side == FixRule::Side::Top  ? "top"
                                                        : "back";
  if (rule.side == FixRule::Side::None) return "none";
  char text[40];
  std::snprintf(text, sizeof text, "%s:%g", side, rule.fraction);
  return text;
}

std::vector<NodeIndex> nodes_held_by(const FixRule& rule, const mesh::TetMesh& mesh) {
  if (rule.side == FixRule::Side::None) return {};
  // Returns the height above the held side.
  const auto coordinate = [&](const Vec3d& p) {
    return rule.side == FixRule::Side::Bottom ? p.y : rule.side == FixRule::Side::Top ? -p.y : p.z;
  };
  double low = coordinate(mesh.rest_positions.front()), high = low;
  for (const Vec3d& p : mesh.rest_positions) {
    low = std::min(low, coordinate(p));
    high = std::max(high, coordinate(p));
  }
  const double limit = low + rule.fraction * (high - low);
  std::vector<NodeIndex> held;
  for (const NodeIndex node : mesh.surface_nodes)
    if (coordinate(mesh.rest_positions[node.value]) <= limit) held.push_back(node);
  return held;
}

}  // namespace trocar::organ
