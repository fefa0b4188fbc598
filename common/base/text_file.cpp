#include "common/base/text_file.h"

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace trocar {

Status write_text_file(const std::filesystem::path& path, std::string_view text) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  // A device, or a link such as /dev/stdout, stays what it is.
  const auto kind = fs::symlink_status(path, ignored).type();
  const bool is_direct = kind != fs::file_type::not_found && kind != fs::file_type::regular;
  const std::string part = is_direct ? path.string() : path.string() + ".part";
  std::FILE* file = std::fopen(part.c_str(), "wb");
  bool is_good = file != nullptr;
  if (is_good) {
    is_good = std::fwrite(text.data(), 1, text.size(), file) == text.size();
    is_good = std::fclose(file) == 0 && is_good;
    is_good = is_good && (is_direct || std::rename(part.c_str(), path.c_str()) == 0);
  }
  if (is_good) return {};
  const std::string why = std::strerror(errno);
  if (!is_direct) fs::remove(part, ignored);
  return Error{ErrorCode::ResourceMissing, path.string() + ": cannot be written (" + why +
                                               "): check that its folder is there and has room"};
}

}  // namespace trocar
