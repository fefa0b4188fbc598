#include "server/organs/organ/depth_table.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace trocar::organ {
namespace {

constexpr std::uint32_t kMaxNodes = 10'000'000, kMaxDepth = 1000;

const DepthRow* row_of(const DepthTable& table, double force_n) {
  const auto row = std::ranges::lower_bound(table.rows, force_n, {}, &DepthRow::force_n);
  return row == table.rows.end() ? nullptr : &*row;
}

bool is_share(double value) {
  return std::isfinite(value) && value >= 0;
}

}  // namespace

std::optional<std::uint32_t> frozen_nodes_for(const DepthTable& table,
                                              std::span<const double> forces_n) {
  if (forces_n.empty()) return std::nullopt;
  std::uint64_t sum = 0;
  for (const double force : forces_n) {
    const auto* row = row_of(table, force);
    if (!row || !row->frozen_nodes) return std::nullopt;
    sum += *row->frozen_nodes;
  }
  return static_cast<std::uint32_t>(std::min<std::uint64_t>(sum, kMaxNodes));
}

std::optional<std::uint32_t> graded_depth_for(const DepthTable& table,
                                              std::span<const double> forces_n) {
  if (forces_n.empty()) return std::nullopt;
  std::uint32_t deepest = 0;
  for (const double force : forces_n) {
    const auto* row = row_of(table, force);
    if (!row || !row->graded_depth) return std::nullopt;
    deepest = std::max(deepest, *row->graded_depth);
  }
  return deepest;
}

Status validate(const DepthTable& table) {
  const auto bad = [](const std::string& what) {
    return Error{ErrorCode::BadFile, "depth table: " + what + ", calibrate the organ again"};
  };
  if (table.empty()) return {};
  if (table.rows.size() > kMaxDepthRows) return bad("has more than 1000 rows");
  if (!(table.error > 0 && table.error <= 1)) return bad("its error must be above 0, at most 1");
  if (!(table.tool_radius_m > 0 && table.tool_radius_m <= 0.05))
    return bad("its tool radius must be above 0, at most 0.05 m");
  double before = 0;
  for (const auto& row : table.rows) {
    if (!(row.force_n > before && std::isfinite(row.force_n)))
      return bad("its forces must ascend from above 0 N");
    before = row.force_n;
    if (row.frozen_nodes && (*row.frozen_nodes < 1 || *row.frozen_nodes > kMaxNodes))
      return bad("a limit must be 1 to 10000000 nodes");
    if (row.graded_depth && *row.graded_depth > kMaxDepth)
      return bad("a depth must be at most 1000 layers");
    if (!is_share(row.frozen_error) || !is_share(row.graded_error))
      return bad("an error must be finite and not negative");
  }
  return {};
}

}  // namespace trocar::organ
