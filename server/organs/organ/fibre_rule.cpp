#include "server/organs/organ/fibre_rule.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>

namespace trocar::organ {
namespace {

constexpr std::uintmax_t kLimitBytes = 256u << 20;
constexpr std::string_view kHeader = "id,x,y,z";
// Nearer to the axis than that there is no direction around it, m.
constexpr double kOnAxis_m = 1e-9;

std::optional<Vec3d> axis_named(std::string_view name) {
  if (name == "x") return Vec3d{1, 0, 0};
  if (name == "y") return Vec3d{0, 1, 0};
  if (name == "z") return Vec3d{0, 0, 1};
  return std::nullopt;
}

Vec3d unit(const Vec3d& v) {
  // In two steps: the square of a long or a short one may be no number.
  const double largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  const Vec3d scaled = v / largest;
  return scaled / length(scaled);
}

std::string_view without_return(std::string_view row) {
  return row.ends_with('\r') ? row.substr(0, row.size() - 1) : row;
}

// A node and its direction; nothing if these are not exactly four numbers.
struct Row {
  std::uint64_t node = 0;
  Vec3d direction;
};
std::optional<Row> read_row(std::string_view text) {
  Row row;
  const char *at = text.data(), *const end = at + text.size();
  const auto take = [&](auto& value, bool is_last) {
    while (at < end && *at == ' ') ++at;
    const auto [rest, failed] = std::from_chars(at, end, value);
    at = rest;
    while (at < end && *at == ' ') ++at;
    if (failed != std::errc{} || (is_last ? at != end : at == end || *at != ',')) return false;
    ++at;
    return true;
  };
  if (!take(row.node, false) || !take(row.direction.x, false) || !take(row.direction.y, false) ||
      !take(row.direction.z, true))
    return std::nullopt;
  return row;
}

class Table {
 public:
  Table(const std::filesystem::path& path, std::size_t nodes) : path_(path), directions_(nodes) {}

  Result<std::vector<Vec3d>> read() {
    std::error_code missing;
    const auto bytes = std::filesystem::file_size(path_, missing);
    std::ifstream file(path_);
    if (missing || !file) return wrong("cannot be opened, check name and rights");
    if (bytes > kLimitBytes) return wrong("is larger than 256 MiB, no organ needs that");
    std::string row;
    while (std::getline(file, row)) {
      ++line_;
      if (auto taken = take(without_return(row)); !taken) return taken.error();
    }
    if (line_ == 0) return wrong("is empty");
    if (rows_ != directions_.size()) {
      line_ = 0;
      return wrong("has directions for " + std::to_string(rows_) + " nodes, the organ has " +
                   std::to_string(directions_.size()) + ": write a row for each");
    }
    return std::move(directions_);
  }

 private:
  Error wrong(const std::string& what) const {
    return {ErrorCode::BadFile,
            path_.string() + (line_ > 0 ? ":" + std::to_string(line_) : "") + ": " + what};
  }

  Status take(std::string_view text) {
    if (line_ == 1)
      return text == kHeader ? Status() : wrong("must be \"" + std::string(kHeader) + "\"");
    const auto row = read_row(text);
    if (!row) return wrong("must be four numbers: node, x, y, z");
    if (row->node >= directions_.size())
      return wrong("there is no node " + std::to_string(row->node) + ", the organ has " +
                   std::to_string(directions_.size()));
    if (!is_finite(row->direction)) return wrong("the direction is not finite");
    if (row->direction == Vec3d{}) return wrong("the direction has no length");
    auto& direction = directions_[row->node];
    if (direction != Vec3d{})
      return wrong("node " + std::to_string(row->node) + " has a direction already");
    direction = unit(row->direction);
    ++rows_;
    return {};
  }

  const std::filesystem::path& path_;
  std::vector<Vec3d> directions_;
  std::size_t rows_ = 0;
  int line_ = 0;
};

}  // namespace

Result<FibreRule> parse_fibre_rule(std::string_view text) {
  constexpr std::string_view kAround = "around:";
  if (const auto axis = axis_named(text)) return FibreRule{FibreRule::Kind::Along, *axis, {}};
  if (text.starts_with(kAround))
    if (const auto axis = axis_named(text.substr(kAround.size())))
      return FibreRule{FibreRule::Kind::Around, *axis, {}};
  if (text.ends_with(".csv")) return FibreRule{FibreRule::Kind::Table, {}, text};
  return Error{ErrorCode::Usage, "--fibres: '" + std::string(text.substr(0, 60)) +
                                     "' is not x, y, z, around:x, around:y, around:z or the name "
                                     "of a .csv file"};
}

Result<std::vector<Vec3d>> fibre_directions_by(const FibreRule& rule, const mesh::TetMesh& mesh) {
  if (rule.kind == FibreRule::Kind::Table) return Table(rule.table, mesh.node_count()).read();
  std::vector<Vec3d> directions(mesh.node_count(), rule.axis);
  if (rule.kind == FibreRule::Kind::Along) return directions;
  for (std::size_t n = 0; n < directions.size(); ++n) {
    const Vec3d around = cross(rule.axis, mesh.rest_positions[n]);
    directions[n] = length(around) > kOnAxis_m ? unit(around) : Vec3d{};
  }
  return directions;
}

}  // namespace trocar::organ
