// The TOML form of a script. Strict: what is not understood is an error, never ignored, because a
// misspelt key would otherwise be a hand that silently does something else.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "common/scene/script.h"

// toml++ 3.3 asserts on some damaged files ("[&", its issue 294) where it should report an error,
// and with NDEBUG the same files are undefined behaviour. Here such an assertion is a parse error.
namespace trocar::scene {
[[noreturn]] static void refuse_toml() {
  throw std::runtime_error("a [header] is damaged");
}
}  // namespace trocar::scene
#undef NDEBUG
#define TOML_ASSERT(expression) ((expression) ? void() : ::trocar::scene::refuse_toml())
#define TOML_HEADER_ONLY 1
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#include <toml++/toml.h>
#pragma GCC diagnostic pop

namespace trocar::scene {
namespace {

// Tables of a scenario that a script does not have. A scenario reader accepts these and reads its
// hands with read_tools() below.
constexpr std::array<std::string_view, 8> kScenarioTables{
    "scene", "organ", "session", "server", "participant", "decisions", "mark", "expect"};

// The first error wins; later reads return defaults, so that a reader checks once at the end.
class Document {
 public:
  explicit Document(std::string_view source) : source_(source) {}

  void fail(const toml::source_region& at, const std::string& key, const std::string& what) {
    if (error_) return;
    std::string message(source_);
    if (at.begin.line > 0) message += ":" + std::to_string(at.begin.line);
    if (!key.empty()) message += ": key " + key;
    error_ = Error{ErrorCode::BadFile, message + ": " + what};
  }
  bool ok() const { return !error_; }
  const Error& error() const { return *error_; }

 private:
  std::string source_;
  std::optional<Error> error_;
};

std::string shown(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

// Reads the keys of one table and, in finish(), refuses those nobody asked for.
class TableReader {
 public:
  TableReader(Document& document, const toml::table& table, std::string path)
      : document_(document), table_(table), path_(std::move(path)) {}

  std::string path_of(std::string_view key) const {
    return path_.empty() ? std::string(key) : path_ + "." + std::string(key);
  }
  const toml::node* find(std::string_view key) {
    known_.emplace_back(key);
    return table_.get(key);
  }
  void fail(std::string_view key, const std::string& what) {
    const toml::node* node = table_.get(key);
    document_.fail(node != nullptr ? node->source() : table_.source(), path_of(key), what);
  }

  std::optional<double> number(std::string_view key, double least, double most) {
    const toml::node* node = find(key);
    if (node == nullptr) return std::nullopt;
    const auto value = number_of(*node);
    if (!value) {
      fail(key, "is not a number, write one such as 2.5");
    } else if (!std::isfinite(*value)) {
      fail(key, "is not finite, write a plain number");
    } else if (*value < least || *value > most) {
      fail(key, "is " + shown(*value) + ", allowed are " + shown(least) + " to " + shown(most));
    }
    return document_.ok() ? value : std::nullopt;
  }
  std::optional<Vec3d> vector(std::string_view key) {
    const toml::node* node = find(key);
    if (node == nullptr) return std::nullopt;
    const toml::array* array = node->as_array();
    std::array<double, 3> value{};
    bool good = array != nullptr && array->size() == 3;
    for (std::size_t i = 0; good && i < 3; ++i) {
      const auto number = number_of(*array->get(i));
      good = number.has_value();
      if (good) value[i] = *number;
    }
    const Vec3d result{value[0], value[1], value[2]};
    if (!good)
      fail(key, "is not a list of three numbers, write [x, y, z]");
    else if (!is_finite(result))
      fail(key, "is not finite, write three plain numbers");
    return document_.ok() ? std::optional(result) : std::nullopt;
  }
  std::optional<Vec3f> direction(std::string_view key) {
    const auto value = vector(key);
    if (!value) return std::nullopt;
    if (!(length(*value) > 1e-6) || !std::isfinite(length(*value))) {
      fail(key, "has no direction, write a vector that is not zero");
      return std::nullopt;
    }
    return to_float(*value / length(*value));
  }
  std::optional<bool> boolean(std::string_view key) {
    const toml::node* node = find(key);
    if (node == nullptr) return std::nullopt;
    if (!node->is_boolean()) {
      fail(key, "is neither true nor false, write one of them");
      return std::nullopt;
    }
    return node->as_boolean()->get();
  }
  template <typename T, std::size_t N>
  std::optional<T> choice(std::string_view key,
                          const std::array<std::pair<std::string_view, T>, N>& choices) {
    const toml::node* node = find(key);
    if (node == nullptr) return std::nullopt;
    std::string names;
    for (const auto& [name, value] : choices) {
      if (node->is_string() && node->as_string()->get() == name) return value;
      names += (names.empty() ? "\"" : ", \"") + std::string(name) + "\"";
    }
    fail(key, "is not one of the known words, write one of " + names);
    return std::nullopt;
  }
  // Array of tables; empty if absent or wrong.
  std::vector<const toml::table*> tables(std::string_view key) {
    const toml::node* node = find(key);
    if (node == nullptr) return {};
    std::vector<const toml::table*> result;
    const toml::array* array = node->as_array();
    if (array == nullptr || array->empty() || !array->is_homogeneous(toml::node_type::table)) {
      fail(key, "is not a list of tables, write [[" + header_of(key) + "]] above each");
      return {};
    }
    for (const auto& item : *array) result.push_back(item.as_table());
    return result;
  }
  void finish() {
    for (const auto& [key, node] : table_) {
      const std::string_view name = key.str();
      if (std::find(known_.begin(), known_.end(), name) != known_.end()) continue;
      std::string all;
      for (const auto& known : known_) all += (all.empty() ? "" : ", ") + known;
      document_.fail(key.source(), path_of(name), "is unknown, the keys here are " + all);
    }
  }

 private:
  static std::optional<double> number_of(const toml::node& node) {
    if (node.is_integer()) return static_cast<double>(node.as_integer()->get());
    if (node.is_floating_point()) return node.as_floating_point()->get();
    return std::nullopt;
  }
  // "tool[0].key" is written [[tool.key]] in the file.
  std::string header_of(std::string_view key) const {
    std::string header;
    bool inside = false;
    for (const char c : path_of(key)) {
      if (c == '[') inside = true;
      if (!inside) header += c;
      if (c == ']') inside = false;
    }
    return header;
  }

  Document& document_;
  const toml::table& table_;
  std::string path_;
  std::vector<std::string> known_;
};

void read_shape(TableReader& reader, ToolShape& shape) {
  const auto set = [&](std::string_view key, float& value_m, double least_mm, double most_mm) {
    if (const auto mm = reader.number(key, least_mm, most_mm))
      value_m = static_cast<float>(*mm * 1e-3);
  };
  set("radius_mm", shape.radius_m, 0.5, 50);
  set("length_mm", shape.length_m, 10, 1000);
  set("reach_mm", shape.reach_m, 1, 50);
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
  if (const auto verb = reader.choice<Verb, 3>(
          "verb", {{{"none", Verb::None}, {"push", Verb::Push}, {"grasp", Verb::Grasp}}}))
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

std::vector<ScriptTool> read_tools(Document& document, TableReader& root) {
  std::vector<ScriptTool> tools;
  const auto tables = root.tables("tool");
  if (tables.empty()) root.fail("tool", "is missing, add a [[tool]] with its keys");
  if (tables.size() > static_cast<std::size_t>(kToolsPerHand))
    root.fail("tool", "appears " + std::to_string(tables.size()) + " times, a hand has at most " +
                          std::to_string(kToolsPerHand) + " tools");
  for (std::size_t i = 0; i < tables.size() && document.ok(); ++i)
    tools.push_back(read_tool(document, *tables[i], "tool[" + std::to_string(i) + "]"));
  return tools;
}

}  // namespace

Result<Script> parse_script_text(std::string_view text, std::string_view source) {
  Document document(source);
  if (text.size() > kScriptFileLimitBytes) {
    document.fail({}, "",
                  "is larger than " + std::to_string(kScriptFileLimitBytes >> 20) +
                      " MiB, a script is not: is it the right file?");
    return document.error();
  }
  toml::table table;
  try {
    table = toml::parse(text, source);
  } catch (const toml::parse_error& error) {
    document.fail(
        error.source(), "",
        "is not TOML: " + std::string(error.description()) + ", see deploy/scenes/example.toml");
    return document.error();
  } catch (const std::exception& error) {
    document.fail({}, "", "is not TOML: " + std::string(error.what()));
    return document.error();
  }
  for (const auto& [key, node] : table)
    if (std::find(kScenarioTables.begin(), kScenarioTables.end(), key.str()) !=
        kScenarioTables.end())
      document.fail(key.source(), std::string(key.str()),
                    "is not supported in a script, only in a scenario: remove it");
  TableReader root(document, table, "");
  Script script{std::string(source), read_tools(document, root)};
  root.finish();
  if (!document.ok()) return document.error();
  return script;
}

Result<Script> parse_script(const std::filesystem::path& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored))
    return Error{ErrorCode::BadFile, path.string() + ": is a folder, name a script file"};
  std::ifstream file(path, std::ios::binary);
  if (!file)
    return Error{ErrorCode::BadFile, path.string() + ": cannot be opened, check name and rights"};
  std::string text;
  // One byte more than allowed is enough to see that the file is too large.
  text.resize(kScriptFileLimitBytes + 1);
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file.gcount()));
  if (file.bad()) return Error{ErrorCode::BadFile, path.string() + ": cannot be read"};
  return parse_script_text(text, path.string());
}

}  // namespace trocar::scene
