// Loads: node sets, and what moves and loads them, in a scenario's TOML form.

#include "server/lab/scenario/scenario_tables.h"

namespace trocar::scenario {
namespace {

constexpr double kMaxCoordinate_mm = 10'000;
constexpr double kMaxForce_n = 1e6;
constexpr double kMaxTraction_pa = 1e9;

std::optional<Vec3d> read_point(tool::TableReader& reader, std::string_view key) {
  const auto mm = reader.vector(key);
  if (!mm) return std::nullopt;
  if (std::max({std::abs(mm->x), std::abs(mm->y), std::abs(mm->z)}) > kMaxCoordinate_mm)
    reader.fail(key, "is more than 10 m away: is it in millimetres?");
  return *mm * 1e-3;
}

NodeRule read_node_rule(tool::TableReader& reader, const std::vector<NodeRule>& before) {
  NodeRule rule;
  rule.place = place_of(reader, "name");
  rule.name = reader.string("name").value_or("");
  if (rule.name.empty()) reader.fail("name", "is missing, give the set a name");
  const auto is_plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-';
  };
  if (!std::all_of(rule.name.begin(), rule.name.end(), is_plain) || rule.name.size() > 60)
    reader.fail("name", "is not a plain name, use up to 60 letters, digits, _ and -");
  if (rule.name == "fixed" || rule.name == "all")
    reader.fail("name", "is taken: \"fixed\" and \"all\" exist in every scenario");
  for (const auto& other : before)
    if (other.name == rule.name)
      reader.fail("name", "\"" + rule.name + "\" is taken by the set in line " +
                              std::to_string(other.place.line));
  rule.ids = reader.integers("ids");
  rule.csv = reader.string("csv");
  rule.ids_place = place_of(reader, rule.csv ? "csv" : "ids");
  rule.is_on_surface = reader.boolean("surface").value_or(false);
  const auto low = read_point(reader, "box_min_mm"), high = read_point(reader, "box_max_mm");
  if (low.has_value() != high.has_value())
    reader.fail(low ? "box_min_mm" : "box_max_mm", "needs the other corner too");
  if (low && high) {
    rule.box = NodeRule::Box{*low, *high};
    if (low->x > high->x || low->y > high->y || low->z > high->z)
      reader.fail("box_min_mm", "is above box_max_mm, exchange them");
  }
  const auto point = read_point(reader, "nearest_mm");
  const auto radius_mm = reader.number("radius_mm", 0, kMaxCoordinate_mm);
  if (radius_mm && !point) reader.fail("radius_mm", "needs nearest_mm = [x, y, z]");
  if (point) rule.near = NodeRule::Near{*point, std::nullopt};
  if (point && radius_mm) rule.near->radius_m = *radius_mm * 1e-3;
  const int kinds = int(rule.ids.has_value()) + int(rule.csv.has_value()) +
                    int(rule.box.has_value()) + int(rule.near.has_value());
  if (kinds > 1 || (kinds == 0 && !rule.is_on_surface))
    reader.fail("name",
                "needs exactly one of ids, csv, box_min_mm with box_max_mm, or nearest_mm; or "
                "surface = true alone for the whole surface");
  reader.finish();
  return rule;
}

std::optional<Vec3d> first_of(const std::optional<double>& number) {
  return number ? std::optional(Vec3d{*number, 0, 0}) : std::nullopt;
}

TimedVector read_over_time(tool::Document& document, tool::TableReader& reader,
                           std::string_view value_key, double scale, double most,
                           bool is_vector = true) {
  TimedVector result;
  const auto keys = reader.tables("key");
  if (keys.empty())
    reader.fail("key", "is missing, add keys with time_s and " + std::string(value_key));
  for (std::size_t i = 0; i < keys.size() && document.ok(); ++i) {
    tool::TableReader key(document, *keys[i], reader.path_of(table_entry("key", i)));
    const auto time = key.number("time_s", 0, kScenarioTimeLimit);
    if (!time)
      key.fail_missing("time_s", "write the seconds since the start");
    else if (!result.keys.empty() && *time <= result.keys.back().time_s)
      key.fail("time_s", "is " + tool::shown(*time) + ", not after the key before (" +
                             tool::shown(result.keys.back().time_s) +
                             "), put keys in order of time");
    const auto value =
        is_vector ? key.vector(value_key) : first_of(key.number(value_key, -most, most));
    if (!value)
      key.fail_missing(value_key, is_vector ? "write [x, y, z]" : "write a number");
    else if (std::max({std::abs(value->x), std::abs(value->y), std::abs(value->z)}) > most)
      key.fail(value_key, "has a part larger than " + tool::shown(most) + ", is the unit right?");
    key.finish();
    if (document.ok()) result.keys.push_back({*time, *value * scale});
  }
  return result;
}

SetUse read_loaded_set(tool::TableReader& reader) {
  const auto set = read_set(reader);
  if (!set) reader.fail("set", "is missing, name a set of [[nodes]]");
  return set.value_or(SetUse{});
}

// Calls read(reader) for each [[table]].
template <typename Rule, typename Read>
std::vector<Rule> read_each(tool::Document& document, tool::TableReader& root, const char* table,
                            Read read) {
  std::vector<Rule> rules;
  const auto tables = limited_tables(root, table);
  for (std::size_t i = 0; i < tables.size() && document.ok(); ++i) {
    tool::TableReader reader(document, *tables[i], table_entry(table, i));
    rules.push_back(read(reader));
    reader.finish();
  }
  return rules;
}

std::uint8_t read_axes(tool::TableReader& reader) {
  const auto text = reader.string("axes");
  if (!text) return kAllAxes;
  std::uint8_t axes = 0;
  for (const char c : *text) {
    const int bit = c == 'x' ? 1 : c == 'y' ? 2 : c == 'z' ? 4 : 0;
    if (bit == 0 || (axes & bit) != 0) {
      reader.fail("axes", "is no list of axes, write \"y\" or \"xz\" for example");
      break;
    }
    axes = static_cast<std::uint8_t>(axes | bit);
  }
  return axes;
}

DisplacementRule read_displacement(tool::Document& document, tool::TableReader& reader) {
  DisplacementRule rule{read_loaded_set(reader), read_axes(reader), {}};
  if (rule.axes != kAllAxes && reader.find("key") == nullptr) {
    rule.over_time.keys = {{0, {}}};  // a plane of symmetry
    return rule;
  }
  rule.over_time = read_over_time(document, reader, "displacement_mm", 1e-3, kMaxCoordinate_mm);
  for (const auto& [time, value] : rule.over_time.keys)
    if (((rule.axes & 1) == 0 && value.x != 0) || ((rule.axes & 2) == 0 && value.y != 0) ||
        ((rule.axes & 4) == 0 && value.z != 0))
      reader.fail("axes", "leaves an axis free along which a key moves the set, write 0 there");
  return rule;
}

TractionRule read_traction(tool::Document& document, tool::TableReader& reader) {
  TractionRule rule{read_loaded_set(reader), false, {}};
  // The first key tells which kind it is; then all keys are of that kind.
  const auto keys = reader.tables("key");
  rule.is_pressure = !keys.empty() && keys.front()->contains("pressure_pa");
  rule.over_time =
      read_over_time(document, reader, rule.is_pressure ? "pressure_pa" : "traction_pa", 1,
                     kMaxTraction_pa, !rule.is_pressure);
  return rule;
}

}  // namespace

std::vector<NodeRule> read_node_rules(tool::Document& document, tool::TableReader& root) {
  std::vector<NodeRule> rules;
  const auto tables = root.tables("nodes");
  for (std::size_t i = 0; i < tables.size() && document.ok(); ++i) {
    tool::TableReader reader(document, *tables[i], table_entry("nodes", i));
    rules.push_back(read_node_rule(reader, rules));
  }
  return rules;
}

std::vector<DisplacementRule> read_displacements(tool::Document& document,
                                                 tool::TableReader& root) {
  return read_each<DisplacementRule>(document, root, "displace", [&](tool::TableReader& reader) {
    return read_displacement(document, reader);
  });
}

std::vector<ForceRule> read_forces(tool::Document& document, tool::TableReader& root) {
  return read_each<ForceRule>(document, root, "force", [&](tool::TableReader& reader) {
    return ForceRule{read_loaded_set(reader),
                     read_over_time(document, reader, "force_n", 1, kMaxForce_n)};
  });
}

std::vector<TractionRule> read_tractions(tool::Document& document, tool::TableReader& root) {
  return read_each<TractionRule>(document, root, "traction", [&](tool::TableReader& reader) {
    return read_traction(document, reader);
  });
}

}  // namespace trocar::scenario
