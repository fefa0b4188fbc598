#include "common/tool/toml_reader.h"

#include <cstdio>
#include <fstream>

namespace trocar::tool {
namespace {

struct UnitSuffix {
  std::string_view text;
  char quantity;  // equal ones can be converted
  double in_si;
};

// Longer ones before those they end with.
constexpr std::array kUnitSuffixes{UnitSuffix{"_gpa", 'p', 1e9},    UnitSuffix{"_mpa", 'p', 1e6},
                                   UnitSuffix{"_kpa", 'p', 1e3},    UnitSuffix{"_pa", 'p', 1},
                                   UnitSuffix{"_kg_m3", 'd', 1},    UnitSuffix{"_g_cm3", 'd', 1e3},
                                   UnitSuffix{"_g_ml", 'd', 1e3},   UnitSuffix{"_kg_l", 'd', 1e3},
                                   UnitSuffix{"_n_mm", 'k', 1e3},   UnitSuffix{"_n_m", 'k', 1},
                                   UnitSuffix{"_mm_s2", 'a', 1e-3}, UnitSuffix{"_m_s2", 'a', 1},
                                   UnitSuffix{"_per_ms", 'r', 1e3}, UnitSuffix{"_per_s", 'r', 1},
                                   UnitSuffix{"_khz", 'r', 1e3},    UnitSuffix{"_hz", 'r', 1},
                                   UnitSuffix{"_um", 'l', 1e-6},    UnitSuffix{"_mm", 'l', 1e-3},
                                   UnitSuffix{"_cm", 'l', 1e-2},    UnitSuffix{"_m", 'l', 1},
                                   UnitSuffix{"_us", 't', 1e-6},    UnitSuffix{"_ms", 't', 1e-3},
                                   UnitSuffix{"_s", 't', 1},        UnitSuffix{"_mn", 'f', 1e-3},
                                   UnitSuffix{"_kn", 'f', 1e3},     UnitSuffix{"_n", 'f', 1}};

const UnitSuffix* unit_of(std::string_view key) {
  const auto found =
      std::ranges::find_if(kUnitSuffixes, [&](const auto& u) { return key.ends_with(u.text); });
  return found == kUnitSuffixes.end() ? nullptr : &*found;
}

std::string_view without_unit(std::string_view key) {
  const auto* unit = unit_of(key);
  return unit == nullptr ? key : key.substr(0, key.size() - unit->text.size());
}

}  // namespace

std::optional<std::string> unit_hint(std::string_view key, const toml::node& value,
                                     std::string_view known) {
  const auto *has = unit_of(key), *wants = unit_of(known);
  if (key == known || wants == nullptr || without_unit(key) != without_unit(known))
    return std::nullopt;
  std::string hint = "is unknown, the unit is part of a key's name: write " + std::string(known);
  const auto number = value.value<double>();
  if (has != nullptr && has->quantity == wants->quantity && number)
    hint += " = " + shown(*number * has->in_si / wants->in_si);
  return hint;
}

std::string shown(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

std::optional<toml::table> parse_toml(Document& document, std::string_view text,
                                      std::string_view source, std::size_t limit_bytes,
                                      const std::string& kind, const std::string& example) {
  if (text.size() > limit_bytes) {
    document.fail({}, "",
                  "is larger than " + std::to_string(limit_bytes >> 20) + " MiB, a " + kind +
                      " is not: is it the right file?");
    return std::nullopt;
  }
  try {
    return toml::parse(text, source);
  } catch (const toml::parse_error& error) {
    // The description quotes what it has read, line breaks included.
    std::string description(error.description());
    for (char& c : description)
      if (static_cast<unsigned char>(c) < 0x20) c = ' ';
    document.fail(error.source(), "", "is not TOML: " + description + ", see " + example);
  } catch (const std::exception& error) {
    document.fail({}, "", "is not TOML: " + std::string(error.what()));
  }
  return std::nullopt;
}

Result<std::string> read_text_file(const std::filesystem::path& path, std::size_t limit_bytes,
                                   const std::string& kind) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored))
    return Error{ErrorCode::BadFile, path.string() + ": is a folder, name a " + kind + " file"};
  std::ifstream file(path, std::ios::binary);
  if (!file)
    return Error{ErrorCode::BadFile, path.string() + ": cannot be opened, check name and rights"};
  std::string text;
  text.resize(limit_bytes + 1);
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file.gcount()));
  if (file.bad()) return Error{ErrorCode::BadFile, path.string() + ": cannot be read"};
  return text;
}

}  // namespace trocar::tool
