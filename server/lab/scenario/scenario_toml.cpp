// This file reads the TOML form of a scenario.

#include "common/tool/script_toml.h"
#include "server/lab/scenario/scenario_tables.h"
#include "server/tissue/thread/rules_toml.h"

namespace trocar::scenario {
namespace {

constexpr std::int64_t kMaxLatticeNodes = 2'000'000;

ScenarioOrgan read_organ(tool::TableReader& reader) {
  ScenarioOrgan organ;
  organ.place = place_of(reader, "source");
  if (const auto source = reader.string("source"))
    organ.source = *source;
  else
    reader.fail("source", "is missing, write \"liver\", \"block\" or a file");
  const bool is_grid = organ.source == "lattice" || organ.source == "block";
  if (const auto nodes = reader.integers("nodes")) {
    if (!is_grid)
      reader.fail("nodes", "is for source = \"lattice\" or \"block\" only, remove it");
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
    if (!is_grid)
      reader.fail("spacing_mm", "is for source = \"lattice\" or \"block\" only, remove it");
    organ.lattice_spacing_m = *spacing_mm * 1e-3;
  }
  reader.finish();
  return organ;
}

// A probe of a quantity is of a set, of a tool or of a thread, and of nothing else.
void check_owner(tool::TableReader& reader, const ProbeRule& probe) {
  const bool is_of_tool = probe.quantity == ProbeQuantity::ToolForce;
  const bool is_of_thread =
      probe.quantity == ProbeQuantity::StartForce || probe.quantity == ProbeQuantity::EndForce;
  if (is_of_thread) {
    if (!probe.thread || probe.set || probe.tool)
      reader.fail("quantity", "is of a thread: write thread = \"name\", no set and no tool");
    return;
  }
  if (probe.thread)
    reader.fail("quantity", "is not of a thread, write \"start_force\" or \"end_force\"");
  if (is_of_tool && (!probe.tool || probe.set))
    reader.fail("quantity",
                "\"force\" is of a tool: write tool = 0 and no set (the force that "
                "holds a set is \"reaction\")");
  else if (!is_of_tool && (probe.tool || !probe.set))
    reader.fail("quantity", "is of nodes: write set = \"name\" and no tool");
}

std::string name_of(const ProbeRule& probe, const Scenario& scenario) {
  constexpr std::array<const char*, 6> kNames{"displacement", "velocity",    "reaction",
                                              "force",        "start_force", "end_force"};
  const auto owner = probe.set      ? probe.set->name
                     : probe.thread ? scenario.threads->threads[*probe.thread].name
                                    : "tool" + std::to_string(probe.tool.value_or(0));
  return owner + "_" + kNames[static_cast<std::size_t>(probe.quantity)];
}

std::optional<std::uint32_t> read_thread_name(tool::TableReader& reader, const Scenario& scenario) {
  const auto name = reader.string("thread");
  if (!name) return std::nullopt;
  const auto& threads =
      scenario.threads ? scenario.threads->threads : std::vector<thread::ThreadRule>{};
  for (std::uint32_t i = 0; i < threads.size(); ++i)
    if (threads[i].name == *name) return i;
  reader.fail("thread", "\"" + *name + "\" is no [[thread]]'s name");
  return std::nullopt;
}

void read_rate(tool::TableReader& reader, ProbeRule& probe) {
  const auto rate = reader.integer("rate_hz", 1, kScenarioRateLimit);
  if (!rate) return;
  probe.every_ticks = static_cast<std::uint32_t>(kScenarioRateLimit / *rate);
  if (kScenarioRateLimit % *rate != 0)
    reader.fail("rate_hz", "is " + std::to_string(*rate) +
                               ", which does not divide 1000, write 100 or 125 for example");
}

ProbeRule read_probe(tool::TableReader& reader, const Scenario& scenario) {
  const bool is_static = scenario.run.mode == RunMode::Static;
  ProbeRule probe;
  probe.set = read_set(reader);
  const auto tool = reader.integer("tool", 0, kMaxTools - 1);
  probe.thread = read_thread_name(reader, scenario);
  probe.place = place_of(reader, probe.set ? "set" : probe.thread ? "thread" : "tool");
  const auto quantity =
      reader.choice<ProbeQuantity, 6>("quantity", {{{"displacement", ProbeQuantity::Displacement},
                                                    {"velocity", ProbeQuantity::Velocity},
                                                    {"reaction", ProbeQuantity::Reaction},
                                                    {"force", ProbeQuantity::ToolForce},
                                                    {"start_force", ProbeQuantity::StartForce},
                                                    {"end_force", ProbeQuantity::EndForce}}});
  if (!quantity)
    reader.fail("quantity",
                "is missing, write \"displacement\", \"velocity\", \"reaction\" or \"force\"");
  probe.quantity = quantity.value_or(ProbeQuantity::Displacement);
  if (tool) probe.tool = static_cast<std::uint32_t>(*tool);
  check_owner(reader, probe);
  if (tool && static_cast<std::size_t>(*tool) >= scenario.tools.size())
    reader.fail("tool", "is " + std::to_string(*tool) + ", there are " +
                            std::to_string(scenario.tools.size()) + " [[tool]]s, counted from 0");
  read_rate(reader, probe);
  if (is_static && reader.has("rate_hz"))
    reader.fail("rate_hz", "is for mode = \"dynamic\", a static run has a row per load step");
  if (is_static && probe.quantity == ProbeQuantity::Velocity)
    reader.fail("quantity", "is zero in a static run, take another");
  probe.name = name_of(probe, scenario);
  return probe;
}

std::vector<ProbeRule> read_probes(tool::Document& document, tool::TableReader& root,
                                   const Scenario& scenario) {
  std::vector<ProbeRule> probes;
  const auto tables = limited_tables(root, "probe");
  for (std::size_t i = 0; i < tables.size() && document.ok(); ++i) {
    tool::TableReader reader(document, *tables[i], table_entry("probe", i));
    auto probe = read_probe(reader, scenario);
    for (const auto& other : probes)
      if (other.name == probe.name)
        reader.fail("quantity", "is probed twice for the same set or tool, remove one");
    reader.finish();
    probes.push_back(std::move(probe));
  }
  return probes;
}

void read_output(tool::TableReader& reader, Scenario& scenario) {
  scenario.output_folder = reader.string("dir");
  const auto times = reader.numbers("fields_s");
  for (std::size_t i = 0; times && i < times->size(); ++i) {
    const double time = (*times)[i];
    if (time < 0 || time > scenario.run.seconds)
      reader.fail("fields_s", "has " + tool::shown(time) + ", the run is from 0 to " +
                                  tool::shown(scenario.run.seconds) + " s");
    if (i > 0 && time <= (*times)[i - 1])
      reader.fail("fields_s", "is not in order of time, sort it");
    scenario.field_times_s.push_back(time);
  }
  reader.finish();
}

void read_scenario(tool::Document& document, tool::TableReader& root, Scenario& scenario) {
  const auto with = [&](const char* name, auto&& read) {
    const auto* table = root.table(name);
    if (table == nullptr || !document.ok()) return false;
    tool::TableReader reader(document, *table, name);
    read(reader);
    return true;
  };
  if (!with("organ", [&](tool::TableReader& r) { scenario.organ = read_organ(r); }))
    root.fail("organ", root.tables("tool").empty()
                           ? "is missing, add [organ] with its source"
                           : "is missing: if this is a script of hands and no scenario, give it to "
                             "trocar-client --script; else add [organ] with its source");
  with("material", [&](tool::TableReader& r) { scenario.material = read_material(r); });
  scenario.node_rules = read_node_rules(document, root);
  scenario.regions = read_regions(document, root);
  with("fix", [&](tool::TableReader& r) {
    scenario.keeps_organ_fixed = r.boolean("organ").value_or(true);
    for (const auto& name : r.strings("sets").value_or(std::vector<std::string>{}))
      scenario.fixes.push_back({place_of(r, "sets"), name});
    r.finish();
  });
  scenario.displacements = read_displacements(document, root);
  scenario.forces = read_forces(document, root);
  scenario.tractions = read_tractions(document, root);
  with("gravity", [&](tool::TableReader& r) {
    scenario.gravity_place = place_of(r, "m_s2");
    const auto gravity = r.vector("m_s2");
    if (!gravity)
      r.fail_missing("m_s2", "write [0, -9.81, 0]");
    else if (!(length(*gravity) <= 1000))
      r.fail("m_s2", "is more than 1000 m/s^2, is the unit right?");
    scenario.gravity_m_s2 = gravity;
    r.finish();
  });
  scenario.tools = tool::read_tools(document, root, kMaxTools);
  if (!with("run", [&](tool::TableReader& r) { scenario.run = read_run(r); }))
    root.fail("run", "is missing, add [run] with seconds");
  scenario.run_place = place_of(root, "run");
  scenario.threads = thread::read_rules(document, root, scenario.gravity_m_s2);
  const bool has_ticks = scenario.run.mode == RunMode::Dynamic &&
                         scenario.run.integrator == Integrator::Implicit &&
                         !scenario.run.starts_in_equilibrium;
  if (scenario.threads && !has_ticks)
    root.fail("thread",
              "moves in ticks: write mode = \"dynamic\" in [run], without start or integrator");
  scenario.probes = read_probes(document, root, scenario);
  with("output", [&](tool::TableReader& r) { read_output(r, scenario); });
  root.finish();
}

}  // namespace

std::string table_entry(const char* table, std::size_t i) {
  return std::string(table) + "[" + std::to_string(i) + "]";
}

Place place_of(const tool::TableReader& reader, std::string_view key) {
  return {reader.line(key), reader.path_of(key)};
}

std::vector<Place> places_of_keys(const tool::TableReader& reader) {
  std::vector<Place> places;
  for (const auto& key : reader.keys()) places.push_back(place_of(reader, key));
  return places;
}

std::vector<const toml::table*> limited_tables(tool::TableReader& root, const char* name) {
  auto tables = root.tables(name);
  if (tables.size() > kMaxScenarioTables)
    root.fail(name, "appears " + std::to_string(tables.size()) + " times, allowed are " +
                        std::to_string(kMaxScenarioTables));
  return tables;
}

std::optional<SetUse> read_set(tool::TableReader& reader) {
  const auto name = reader.string("set");
  if (!name) return std::nullopt;
  return SetUse{place_of(reader, "set"), *name};
}

Result<Scenario> parse_scenario_text(std::string_view text, std::string_view source) {
  tool::Document document(source);
  const auto table = tool::parse_toml(document, text, source, kScenarioFileLimitBytes, "scenario",
                                      "deploy/scenes/pull.toml");
  if (!table) return document.error();
  Scenario scenario;
  scenario.source = std::filesystem::path(source);
  tool::TableReader root(document, *table, "");
  read_scenario(document, root, scenario);
  if (!document.ok()) return document.error();
  return scenario;
}

Result<Scenario> parse_scenario(const std::filesystem::path& path) {
  const auto text = tool::read_text_file(path, kScenarioFileLimitBytes, "scenario");
  if (!text) return text.error();
  return parse_scenario_text(*text, path.string());
}

}  // namespace trocar::scenario
