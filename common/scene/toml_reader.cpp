#include "common/scene/toml_reader.h"

#include <cstdio>
#include <fstream>

namespace trocar::scene {

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
    document.fail(error.source(), "",
                  "is not TOML: " + std::string(error.description()) + ", see " + example);
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

}  // namespace trocar::scene
