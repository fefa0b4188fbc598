#include "common/base/kept_file.h"

#include <array>
#include <fstream>
#include <string_view>

#include "common/base/writable.h"

namespace trocar {

Status refuse_to_replace_kept(const std::string& option, const std::filesystem::path& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return {};
  std::array<char, 8> bytes{};
  std::ifstream(path, std::ios::binary).read(bytes.data(), bytes.size());
  const std::string_view magic(bytes.data(), bytes.size());
  const bool is_recording = magic == std::string_view("\x89MCAP0\r\n", 8);
  if (!is_recording && magic != "TROCARO1") return {};
  return Error{ErrorCode::Usage, option + ": " + path.string() + " is " +
                                     (is_recording ? "a recording" : "an organ") +
                                     ", which would be lost: choose another name"};
}

Status check_output(const std::string& option, const std::filesystem::path& path) {
  if (auto kept = refuse_to_replace_kept(option, path); !kept) return kept;
  const auto writable = check_writable(path);
  return writable ? writable
                  : Status(Error{writable.error().code, option + ": " + writable.error().message});
}

}  // namespace trocar
