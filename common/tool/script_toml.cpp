// This reads the TOML form of a script.

#include "common/tool/script_toml.h"

#include "common/tool/instrument.h"

namespace trocar::tool {
namespace {

// The tables of a scenario besides its tools. A whole scenario, which has [run], is a script, too:
// its tools are played, and the rest is left to trocar-sim, which checks it. In another file such a
// table is a mistake.
constexpr std::array<std::string_view, 12> kScenarioTables{
    "organ", "material", "nodes",   "region", "fix",   "displace",
    "force", "traction", "gravity", "run",    "probe", "output"};

// The shape of an instrument, which other keys then change.
void read_instrument(TableReader& reader, ToolShape& shape) {
  const auto name = reader.string("instrument");
  if (!name) return;
  if (const auto* instrument = find_instrument(*name)) {
    shape = instrument->shape;
    return;
  }
  std::string known;
  for (const auto& instrument : instruments())
    known += (known.empty() ? "" : ", ") + instrument.name;
  reader.fail("instrument", "is none of the known ones, write one of " + known);
}

void read_shape(TableReader& reader, ToolShape& shape) {
  read_instrument(reader, shape);
  const auto set = [&](std::string_view key, float& value_m, double least_mm, double most_mm) {
    if (const auto mm = reader.number(key, least_mm, most_mm))
      value_m = static_cast<float>(*mm * 1e-3);
  };
  set("radius_mm", shape.radius_m, 0.5, 50);
  set("length_mm", shape.length_m, 10, 1000);
  set("reach_mm", shape.reach_m, 1, 50);
  if (const auto width = reader.number("width_mm", 0, 100))
    shape.half_width_m = static_cast<float>(*width * 0.5e-3);
  if (const auto friction = reader.number("friction", 0, 2))
    shape.friction = static_cast<float>(*friction);
  set("edge_mm", shape.edge_m, 1, 200);
  if (const auto grip = reader.number("grip_n", 0.1, 100)) shape.grip_n = static_cast<float>(*grip);
}

std::optional<ScriptAnchor> read_anchor(TableReader& reader) {
  const auto direction = reader.direction("anchor");
  const auto on = reader.choice<AnchorOn, 2>(
      "anchor_on", {{{"ray", AnchorOn::Ray}, {"extreme", AnchorOn::Extreme}}});
  const auto frame = reader.choice<AnchorFrame, 2>(
      "anchor_frame", {{{"world", AnchorFrame::World}, {"normal", AnchorFrame::Normal}}});
  if (!direction) {
    if (on) reader.fail("anchor_on", "needs an anchor, add anchor = [dx, dy, dz]");
    if (frame) reader.fail("anchor_frame", "needs an anchor, add anchor = [dx, dy, dz]");
    return std::nullopt;
  }
  return ScriptAnchor{*direction, on.value_or(AnchorOn::Ray), frame.value_or(AnchorFrame::World)};
}

// Shaft and verb may be left out: then they are as in the key before.
ScriptKey read_key(TableReader& reader, const ScriptKey* before) {
  ScriptKey key;
  if (before != nullptr) key = *before;
  if (const auto time = reader.number("time_s", 0, kScriptTimeLimit)) {
    if (before != nullptr && *time <= before->time_s)
      reader.fail("time_s", "is " + shown(*time) + ", not after the key before (" +
                                shown(before->time_s) + "), put keys in order of time");
    key.time_s = *time;
  } else {
    reader.fail("time_s", "is missing, write the seconds since the script began");
  }
  if (const auto position_mm = reader.vector("position_mm")) {
    const Vec3d position = *position_mm * 1e-3;
    if (!(length(position) <= kScriptReachLimit))
      reader.fail("position_mm", "is " + shown(length(*position_mm)) +
                                     " mm away, allowed are 2000 mm: is it in millimetres?");
    key.position_m = to_float(position);
  } else {
    reader.fail("position_mm", "is missing, write [x, y, z]");
  }
  if (const auto shaft = reader.direction("shaft")) key.shaft = *shaft;
  if (const auto verb = reader.choice<Verb, 4>("verb", {{{"none", Verb::None},
                                                         {"push", Verb::Push},
                                                         {"grasp", Verb::Grasp},
                                                         {"cut", Verb::Cut}}}))
    key.verb = *verb;
  reader.finish();
  return key;
}

void check_loop(TableReader& reader, const ScriptTool& tool) {
  if (!tool.loops) return;
  const auto& first = tool.keys.front();
  const auto& last = tool.keys.back();
  if (tool.keys.size() < 2)
    reader.fail("loop", "needs at least two keys, add keys or remove it");
  else if (first.position_m != last.position_m || first.shaft != last.shaft)
    reader.fail("loop",
                "would make the tool jump, end with the position_mm and shaft of the first key");
}

ScriptTool read_tool(Document& document, const toml::table& table, const std::string& path) {
  TableReader reader(document, table, path);
  ScriptTool tool;
  read_shape(reader, tool.shape);
  tool.anchor = read_anchor(reader);
  tool.loops = reader.boolean("loop").value_or(false);
  tool.ease = reader.choice<Ease, 2>("ease", {{{"smooth", Ease::Smooth}, {"linear", Ease::Linear}}})
                  .value_or(Ease::Smooth);
  const auto key_tables = reader.tables("key");
  if (key_tables.empty())
    reader.fail("key", "is missing, add a [[tool.key]] with time_s and position_mm");
  if (key_tables.size() > kScriptKeyLimit)
    reader.fail("key", "has " + std::to_string(key_tables.size()) + " entries, allowed are " +
                           std::to_string(kScriptKeyLimit));
  for (std::size_t i = 0; i < key_tables.size() && document.ok(); ++i) {
    TableReader key_reader(document, *key_tables[i],
                           reader.path_of("key[" + std::to_string(i) + "]"));
    tool.keys.push_back(read_key(key_reader, tool.keys.empty() ? nullptr : &tool.keys.back()));
  }
  reader.finish();
  if (document.ok()) check_loop(reader, tool);
  return tool;
}

}  // namespace

std::vector<ScriptTool> read_tools(Document& document, TableReader& root, std::size_t most) {
  std::vector<ScriptTool> tools;
  const auto tables = root.tables("tool");
  if (tables.size() > most)
    root.fail("tool", "appears " + std::to_string(tables.size()) + " times, a " +
                          (most == kToolsPerHand ? "hand" : "scenario") + " has at most " +
                          std::to_string(most) + " tools");
  for (std::size_t i = 0; i < tables.size() && document.ok(); ++i)
    tools.push_back(read_tool(document, *tables[i], "tool[" + std::to_string(i) + "]"));
  return tools;
}

Result<Script> parse_script_text(std::string_view text, std::string_view source) {
  Document document(source);
  const auto table = parse_toml(document, text, source, kScriptFileLimitBytes, "script",
                                "deploy/scenes/example.toml");
  if (!table) return document.error();
  TableReader root(document, *table, "");
  const bool is_scenario = root.has("run");
  for (const auto key : kScenarioTables)
    if (root.find(key) != nullptr && !is_scenario)
      root.fail(key, "is not supported in a script, only in a scenario: remove it");
  Script script{std::string(source), read_tools(document, root, kToolsPerHand)};
  if (script.tools.empty()) root.fail("tool", "is missing, add a [[tool]] with its keys");
  root.finish();
  if (!document.ok()) return document.error();
  return script;
}

Result<Script> parse_script(const std::filesystem::path& path) {
  const auto text = read_text_file(path, kScriptFileLimitBytes, "script");
  if (!text) return text.error();
  return parse_script_text(*text, path.string());
}

}  // namespace trocar::tool
