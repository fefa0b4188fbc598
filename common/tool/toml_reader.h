#pragma once

// Strict reading of TOML files, for scripts and scenarios: what is not understood is an error with
// file, line and key, never ignored, because a misspelt key would otherwise be a hand or a load
// that silently does something else. For the .cpp files of this folder that read such a file; one
// thread.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/math/vec3.h"

// toml++ 3.3 asserts on some damaged files ("[&", its issue 294) where it should report an error,
// and with NDEBUG the same files are undefined behaviour. Here such an assertion is a parse error.
namespace trocar::tool {
[[noreturn]] inline void refuse_toml() {
  throw std::runtime_error("a [header] is damaged");
}
}  // namespace trocar::tool
#undef NDEBUG
#define TOML_ASSERT(expression) ((expression) ? void() : ::trocar::tool::refuse_toml())
#define TOML_HEADER_ONLY 1
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#include <toml++/toml.h>
#pragma GCC diagnostic pop

namespace trocar::tool {

// The first error wins; later reads return defaults, so that a reader checks once at the end.
// One error gives way: that a key is missing, to an unknown key of the same table, because the one
// is most likely the other misspelt.
class Document {
 public:
  explicit Document(std::string_view source) : source_(source) {}

  void fail(const toml::source_region& at, const std::string& key, const std::string& what) {
    if (!error_) set(at, key, what);
  }
  void fail_missing(const toml::table& table, const std::string& key, const std::string& what) {
    if (error_) return;
    set(table.source(), key, what);
    lacks_a_key_ = &table;
  }
  void fail_unknown(const toml::table& table, const toml::source_region& at, const std::string& key,
                    const std::string& what) {
    if (error_ && lacks_a_key_ != &table) return;
    lacks_a_key_ = nullptr;
    set(at, key, what);
  }
  bool ok() const { return !error_; }
  const Error& error() const { return *error_; }

 private:
  void set(const toml::source_region& at, const std::string& key, const std::string& what) {
    std::string message(source_);
    if (at.begin.line > 0) message += ":" + std::to_string(at.begin.line);
    if (!key.empty()) message += ": key " + key;
    error_ = Error{ErrorCode::BadFile, message + ": " + what};
  }

  std::string source_;
  std::optional<Error> error_;
  const toml::table* lacks_a_key_ = nullptr;  // the table of a missing key, if that is the error
};

// A number as a person would write it.
std::string shown(double value);

// Returns what to say of a key that is `known` with another unit in its name, or with none; nothing
// if it is not.
std::optional<std::string> unit_hint(std::string_view key, const toml::node& value,
                                     std::string_view known);

// Reads the keys of one table and, in finish(), refuses those nobody asked for.
class TableReader {
 public:
  TableReader(Document& document, const toml::table& table, std::string path)
      : document_(document), table_(table), path_(std::move(path)) {}

  // Returns the path of a key, or of the table itself if `key` is empty.
  std::string path_of(std::string_view key) const {
    if (path_.empty() || key.empty()) return path_ + std::string(key);
    return path_ + "." + std::string(key);
  }
  const toml::node* find(std::string_view key) {
    known_.emplace_back(key);
    return table_.get(key);
  }
  void fail(std::string_view key, const std::string& what) {
    const toml::node* node = table_.get(key);
    if (node != nullptr || key.empty())
      document_.fail(node != nullptr ? node->source() : table_.source(), path_of(key), what);
    else
      document_.fail_missing(table_, path_of(key), what);
  }

  // For a key that has to be there: if it is there in another unit, that is what is wrong.
  void fail_missing(std::string_view key, const std::string& advice) {
    for (const auto& [name, node] : table_)
      if (const auto hint = unit_hint(name.str(), node, key)) {
        document_.fail(name.source(), path_of(name.str()), *hint);
        return;
      }
    fail(key, "is missing, " + advice);
  }
  bool has(std::string_view key) const { return table_.contains(key); }
  // The keys that are there.
  std::vector<std::string> keys() const {
    std::vector<std::string> names;
    for (const auto& [name, node] : table_) names.emplace_back(name.str());
    return names;
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
  std::optional<std::int64_t> integer(std::string_view key, std::int64_t least, std::int64_t most) {
    const toml::node* node = find(key);
    if (node == nullptr) return std::nullopt;
    const auto value = node->is_integer() ? std::optional(node->as_integer()->get()) : std::nullopt;
    if (!value)
      fail(key, "is not a whole number, write one such as 4");
    else if (*value < least || *value > most)
      fail(key, "is " + std::to_string(*value) + ", allowed are " + std::to_string(least) + " to " +
                    std::to_string(most));
    return document_.ok() ? value : std::nullopt;
  }
  std::optional<std::string> string(std::string_view key) {
    const toml::node* node = find(key);
    if (node == nullptr) return std::nullopt;
    if (!node->is_string() || node->as_string()->get().empty()) {
      fail(key, "is not a text, write it in quotes");
      return std::nullopt;
    }
    return node->as_string()->get();
  }
  // Lists of one kind; absent: nothing.
  std::optional<std::vector<double>> numbers(std::string_view key) {
    return list<double>(key, "is not a list of numbers, write [1, 2.5]", [](const toml::node& n) {
      const auto value = number_of(n);
      return value && std::isfinite(*value) ? value : std::nullopt;
    });
  }
  std::optional<std::vector<std::int64_t>> integers(std::string_view key) {
    return list<std::int64_t>(
        key, "is not a list of whole numbers, write [1, 2]", [](const toml::node& n) {
          return n.is_integer() ? std::optional(n.as_integer()->get()) : std::nullopt;
        });
  }
  std::optional<std::vector<std::string>> strings(std::string_view key) {
    return list<std::string>(
        key, "is not a list of texts, write [\"one\", \"two\"]", [](const toml::node& n) {
          return n.is_string() ? std::optional(n.as_string()->get()) : std::nullopt;
        });
  }
  // Returns a [key] table, or null if it is absent or wrong.
  const toml::table* table(std::string_view key) {
    const toml::node* node = find(key);
    if (node == nullptr) return nullptr;
    if (!node->is_table()) fail(key, "is not a table, write [" + header_of(key) + "] above it");
    return node->as_table();
  }
  // Returns the line of the key, or of the table if it has no such key; 0 if unknown.
  int line(std::string_view key) const {
    const toml::node* node = table_.get(key);
    return static_cast<int>((node != nullptr ? node->source() : table_.source()).begin.line);
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
      for (const auto& known : known_)
        if (const auto hint = unit_hint(name, node, known))
          document_.fail_unknown(table_, key.source(), path_of(name), *hint);
      std::string all;
      for (const auto& known : known_) all += (all.empty() ? "" : ", ") + known;
      document_.fail_unknown(table_, key.source(), path_of(name),
                             "is unknown, the keys here are " + all);
    }
  }

 private:
  template <typename T, typename Read>
  std::optional<std::vector<T>> list(std::string_view key, const char* complaint, Read read) {
    const toml::node* node = find(key);
    if (node == nullptr) return std::nullopt;
    std::vector<T> values;
    const toml::array* array = node->as_array();
    if (array == nullptr) {
      fail(key, complaint);
      return std::nullopt;
    }
    for (const auto& item : *array) {
      const auto value = read(item);
      if (!value) {
        document_.fail(item.source(), path_of(key), complaint);
        return std::nullopt;
      }
      values.push_back(*value);
    }
    return values;
  }
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

// The document's root table, or nothing and an error. At most `limit_bytes`; `kind` ("script") and
// `example` (a file to look at) are for messages.
std::optional<toml::table> parse_toml(Document& document, std::string_view text,
                                      std::string_view source, std::size_t limit_bytes,
                                      const std::string& kind, const std::string& example);

// Up to limit_bytes + 1 bytes: one more than allowed is enough to see that a file is too large.
Result<std::string> read_text_file(const std::filesystem::path& path, std::size_t limit_bytes,
                                   const std::string& kind);

}  // namespace trocar::tool
