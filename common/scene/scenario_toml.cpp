// The TOML form of a scenario.

#include "common/scene/scenario.h"
#include "common/scene/script_toml.h"

namespace trocar::scene {
namespace {

constexpr double kMaxCoordinate_mm = 10'000;
constexpr double kMaxForce_n = 1e6;
constexpr std::int64_t kMaxLatticeNodes = 2'000'000;
constexpr std::size_t kMaxTables = 1000;  // [[displace]], [[force]], [[probe]] each

std::string entry(const char* table, std::size_t i) {
  return std::string(table) + "[" + std::to_string(i) + "]";
}

Place place_of(const TableReader& reader, std::string_view key) {
  return {reader.line(key), reader.path_of(key)};
}

std::vector<const toml::table*> limited_tables(TableReader& root, const char* name) {
  auto tables = root.tables(name);
  if (tables.size() > kMaxTables)
    root.fail(name, "appears " + std::to_string(tables.size()) + " times, allowed are " +
                        std::to_string(kMaxTables));
  return tables;
}

ScenarioOrgan read_organ(TableReader& reader) {
  ScenarioOrgan organ;
  organ.place = place_of(reader, "source");
  if (const auto source = reader.string("source"))
    organ.source = *source;
  else
    reader.fail("source", "is missing, write \"lattice\", \"liver\" or a file");
  if (const auto nodes = reader.integers("nodes")) {
    if (organ.source != "lattice")
      reader.fail("nodes", "is for source = \"lattice\" only, remove it");
    else if (nodes->size() != 3 ||
             !std::all_of(nodes->begin(), nodes->end(), [](auto n) { return n >= 2 && n <= 400; }))
      reader.fail("nodes", "is not three numbers from 2 to 400, write [nx, ny, nz]");
    else if ((*nodes)[0] * (*nodes)[1] * (*nodes)[2] > kMaxLatticeNodes)
      reader.fail("nodes", "makes " + std::to_string((*nodes)[0] * (*nodes)[1] * (*nodes)[2]) +
                               " nodes, allowed are " + std::to_string(kMaxLatticeNodes));
    else
      organ.lattice_nodes = {static_cast<int>((*nodes)[0]), static_cast<int>((*nodes)[1]),
                             static_cast<int>((*nodes)[2])};
  }
  if (const auto spacing_mm = reader.number("spacing_mm", 0.5, 1000)) {
    if (organ.source != "lattice")
      reader.fail("spacing_mm", "is for source = \"lattice\" only, remove it");
    organ.lattice_spacing_m = *spacing_mm * 1e-3;
  }
  reader.finish();
  return organ;
}

MaterialChange read_material(TableReader& reader) {
  MaterialChange material;
  material.place = place_of(reader, "");
  material.density_kg_m3 = reader.number("density_kg_m3", 1, 30000);
  material.young_modulus_pa = reader.number("young_modulus_pa", 0, 1e12);
  material.spring_stiffness_n_m = reader.number("spring_stiffness_n_m", 0, 1e9);
  material.node_damping_per_s = reader.number("node_damping_per_s", 0, 1e6);
  material.spring_damping_time_s = reader.number("spring_damping_time_s", 0, 100);
  if (material.young_modulus_pa && material.spring_stiffness_n_m)
    reader.fail("young_modulus_pa", "and spring_stiffness_n_m exclude each other, remove one");
  material.place = place_of(reader, material.young_modulus_pa       ? "young_modulus_pa"
                                    : material.spring_stiffness_n_m ? "spring_stiffness_n_m"
                                                                    : "");
  reader.finish();
  return material;
}

std::optional<Vec3d> read_point(TableReader& reader, std::string_view key) {
  const auto mm = reader.vector(key);
  if (!mm) return std::nullopt;
  if (std::max({std::abs(mm->x), std::abs(mm->y), std::abs(mm->z)}) > kMaxCoordinate_mm)
    reader.fail(key, "is more than 10 m away: is it in millimetres?");
  return *mm * 1e-3;
}

NodeRule read_node_rule(TableReader& reader, const std::vector<NodeRule>& before) {
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
  if (int(rule.ids.has_value()) + int(rule.box.has_value()) + int(rule.near.has_value()) != 1)
    reader.fail("name", "needs exactly one of ids, box_min_mm with box_max_mm, or nearest_mm");
  reader.finish();
  return rule;
}

std::optional<SetUse> read_set(TableReader& reader) {
  const auto name = reader.string("set");
  if (!name) return std::nullopt;
  return SetUse{place_of(reader, "set"), *name};
}

TimedVector read_over_time(Document& document, TableReader& reader, std::string_view value_key,
                           double scale, double most) {
  TimedVector result;
  const auto keys = reader.tables("key");
  if (keys.empty())
    reader.fail("key", "is missing, add keys with time_s and " + std::string(value_key));
  for (std::size_t i = 0; i < keys.size() && document.ok(); ++i) {
    TableReader key(document, *keys[i], reader.path_of(entry("key", i)));
    const auto time = key.number("time_s", 0, kScenarioTimeLimit);
    if (!time)
      key.fail("time_s", "is missing, write the seconds since the start");
    else if (!result.keys.empty() && *time <= result.keys.back().time_s)
      key.fail("time_s", "is " + shown(*time) + ", not after the key before (" +
                             shown(result.keys.back().time_s) + "), put keys in order of time");
    const auto value = key.vector(value_key);
    if (!value)
      key.fail(value_key, "is missing, write [x, y, z]");
    else if (std::max({std::abs(value->x), std::abs(value->y), std::abs(value->z)}) > most)
      key.fail(value_key, "has a part larger than " + shown(most) + ", is the unit right?");
    key.finish();
    if (document.ok()) result.keys.push_back({*time, *value * scale});
  }
  return result;
}

std::vector<LoadRule> read_loads(Document& document, TableReader& root, const char* table,
                                 std::string_view value_key, double scale, double most) {
  std::vector<LoadRule> loads;
  const auto tables = limited_tables(root, table);
  for (std::size_t i = 0; i < tables.size() && document.ok(); ++i) {
    TableReader reader(document, *tables[i], entry(table, i));
    const auto set = read_set(reader);
    if (!set) reader.fail("set", "is missing, name a set of [[nodes]]");
    auto over_time = read_over_time(document, reader, value_key, scale, most);
    reader.finish();
    if (document.ok()) loads.push_back({*set, std::move(over_time)});
  }
  return loads;
}

std::vector<ProbeRule> read_probes(Document& document, TableReader& root, std::size_t tool_count) {
  std::vector<ProbeRule> probes;
  const auto tables = limited_tables(root, "probe");
  for (std::size_t i = 0; i < tables.size() && document.ok(); ++i) {
    TableReader reader(document, *tables[i], entry("probe", i));
    ProbeRule probe;
    probe.set = read_set(reader);
    const auto tool = reader.integer("tool", 0, kMaxTools - 1);
    probe.place = place_of(reader, probe.set ? "set" : "tool");
    const auto quantity =
        reader.choice<ProbeQuantity, 4>("quantity", {{{"displacement", ProbeQuantity::Displacement},
                                                      {"velocity", ProbeQuantity::Velocity},
                                                      {"reaction", ProbeQuantity::Reaction},
                                                      {"force", ProbeQuantity::ToolForce}}});
    if (!quantity)
      reader.fail("quantity",
                  "is missing, write \"displacement\", \"velocity\", \"reaction\" or \"force\"");
    probe.quantity = quantity.value_or(ProbeQuantity::Displacement);
    const bool is_of_tool = probe.quantity == ProbeQuantity::ToolForce;
    if (is_of_tool && (!tool || probe.set))
      reader.fail("quantity",
                  "\"force\" is of a tool: write tool = 0 and no set (the force that "
                  "holds a set is \"reaction\")");
    else if (!is_of_tool && (tool || !probe.set))
      reader.fail("quantity", "is of nodes: write set = \"name\" and no tool");
    if (tool && static_cast<std::size_t>(*tool) >= tool_count)
      reader.fail("tool", "is " + std::to_string(*tool) + ", there are " +
                              std::to_string(tool_count) + " [[tool]]s, counted from 0");
    if (tool) probe.tool = static_cast<std::uint32_t>(*tool);
    if (const auto rate = reader.integer("rate_hz", 1, kScenarioRateLimit)) {
      probe.every_ticks = static_cast<std::uint32_t>(kScenarioRateLimit / *rate);
      if (kScenarioRateLimit % *rate != 0)
        reader.fail("rate_hz", "is " + std::to_string(*rate) +
                                   ", which does not divide 1000, write 100 or 125 for example");
    }
    constexpr std::array<const char*, 4> kNames{"displacement", "velocity", "reaction", "force"};
    probe.name = (probe.set ? probe.set->name : "tool" + std::to_string(tool.value_or(0))) + "_" +
                 kNames[static_cast<std::size_t>(probe.quantity)];
    for (const auto& other : probes)
      if (other.name == probe.name)
        reader.fail("quantity", "is probed twice for the same set or tool, remove one");
    reader.finish();
    probes.push_back(std::move(probe));
  }
  return probes;
}

RunRule read_run(TableReader& reader) {
  RunRule run;
  const auto set = [&](std::string_view key, std::uint32_t& value, std::int64_t most) {
    if (const auto number = reader.integer(key, 1, most))
      value = static_cast<std::uint32_t>(*number);
  };
  if (const auto seconds = reader.number("seconds", 0.001, kScenarioTimeLimit))
    run.seconds = *seconds;
  else
    reader.fail("seconds", "is missing, write how long to simulate");
  set("sweeps", run.sweeps, 64);
  run.over_relaxation = reader.number("over_relaxation", 1, 1.9).value_or(run.over_relaxation);
  std::uint32_t limit = 0;
  set("depth", limit, 1000);
  if (limit > 0) run.depth = limit;
  limit = 0;
  set("nodes", limit, 10'000'000);
  if (limit > 0) run.nodes = limit;
  run.tolerance_n = reader.number("tolerance_n", 1e-9, 1).value_or(run.tolerance_n);
  set("max_sweeps", run.max_sweeps, 1'000'000);
  reader.finish();
  return run;
}

void read_output(TableReader& reader, Scenario& scenario) {
  scenario.output_folder = reader.string("dir");
  const auto times = reader.numbers("fields_s");
  for (std::size_t i = 0; times && i < times->size(); ++i) {
    const double time = (*times)[i];
    if (time < 0 || time > scenario.run.seconds)
      reader.fail("fields_s", "has " + shown(time) + ", the run is from 0 to " +
                                  shown(scenario.run.seconds) + " s");
    if (i > 0 && time <= (*times)[i - 1])
      reader.fail("fields_s", "is not in order of time, sort it");
    scenario.field_times_s.push_back(time);
  }
  reader.finish();
}

void read_scenario(Document& document, TableReader& root, Scenario& scenario) {
  const auto with = [&](const char* name, auto&& read) {
    const auto* table = root.table(name);
    if (table == nullptr || !document.ok()) return false;
    TableReader reader(document, *table, name);
    read(reader);
    return true;
  };
  if (!with("organ", [&](TableReader& r) { scenario.organ = read_organ(r); }))
    root.fail("organ", "is missing, add [organ] with its source");
  with("material", [&](TableReader& r) { scenario.material = read_material(r); });
  const auto node_tables = root.tables("nodes");
  for (std::size_t i = 0; i < node_tables.size() && document.ok(); ++i) {
    TableReader reader(document, *node_tables[i], entry("nodes", i));
    scenario.node_rules.push_back(read_node_rule(reader, scenario.node_rules));
  }
  with("fix", [&](TableReader& r) {
    scenario.keeps_organ_fixed = r.boolean("organ").value_or(true);
    for (const auto& name : r.strings("sets").value_or(std::vector<std::string>{}))
      scenario.fixes.push_back({place_of(r, "sets"), name});
    r.finish();
  });
  scenario.displacements =
      read_loads(document, root, "displace", "displacement_mm", 1e-3, kMaxCoordinate_mm);
  scenario.forces = read_loads(document, root, "force", "force_n", 1, kMaxForce_n);
  with("gravity", [&](TableReader& r) {
    scenario.gravity_place = place_of(r, "m_s2");
    const auto gravity = r.vector("m_s2");
    if (!gravity)
      r.fail("m_s2", "is missing, write [0, -9.81, 0]");
    else if (!(length(*gravity) <= 1000))
      r.fail("m_s2", "is more than 1000 m/s^2, is the unit right?");
    scenario.gravity_m_s2 = gravity.value_or(Vec3d{});
    r.finish();
  });
  scenario.tools = read_tools(document, root, kMaxTools);
  if (!with("run", [&](TableReader& r) { scenario.run = read_run(r); }))
    root.fail("run", "is missing, add [run] with seconds");
  scenario.run_place = place_of(root, "run");
  scenario.probes = read_probes(document, root, scenario.tools.size());
  with("output", [&](TableReader& r) { read_output(r, scenario); });
  root.finish();
}

}  // namespace

Result<Scenario> parse_scenario_text(std::string_view text, std::string_view source) {
  Document document(source);
  const auto table = parse_toml(document, text, source, kScenarioFileLimitBytes, "scenario",
                                "deploy/scenes/pull.toml");
  if (!table) return document.error();
  Scenario scenario;
  scenario.source = std::filesystem::path(source);
  TableReader root(document, *table, "");
  read_scenario(document, root, scenario);
  if (!document.ok()) return document.error();
  return scenario;
}

Result<Scenario> parse_scenario(const std::filesystem::path& path) {
  const auto text = read_text_file(path, kScenarioFileLimitBytes, "scenario");
  if (!text) return text.error();
  return parse_scenario_text(*text, path.string());
}

}  // namespace trocar::scene
